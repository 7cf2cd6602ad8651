"""The method `vertex-features`: as `nfvr`, with features on vertices."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np

from gibench.baselines.method import Method, MethodError
from gibench.baselines.neural_free_viewpoint_relighting.implementation import NeuralRelighting
from gibench.baselines.neural_free_viewpoint_relighting.network import Size
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.training_set import TrainingSet
from gibench.baselines.vertex_features import METHOD
from gibench.baselines.vertex_features.field import VertexField
from gibench.baselines.vertex_features.remeshing import Mesh, even_mesh, meshes_of

MESH = "mesh.npz"
"""Name of the even mesh in the folder of a training."""


class VertexFeatures(NeuralRelighting):
    """See `gibench.baselines.vertex_features.METHOD`."""

    method: ClassVar[Method] = METHOD

    def survey(self, views: TrainingSet, number: int, box: Box, folder: Path) -> None:
        """Make the even mesh of the scene of a view, and leave it in a folder."""
        room = views[number].path.parents[1]
        mesh = even_mesh(meshes_of(room), box, float(self.settings["edge"]))
        np.savez(folder / MESH, vertices=mesh.vertices, triangles=mesh.triangles)
        self._stands_on(mesh, box)

    def surveyed(self, folder: Path, box: Box) -> None:
        """Read the even mesh."""
        with np.load(folder / MESH, allow_pickle=False) as file:
            mesh = Mesh(file["vertices"].astype(np.float32), file["triangles"].astype(np.int64))
        vertices, triangles = mesh
        if (
            triangles.ndim != 2
            or not len(triangles)
            or not 0 <= triangles.min() <= triangles.max() < len(vertices)
        ):
            raise MethodError(f"{folder / MESH} holds no mesh: remove that folder")
        self._stands_on(mesh, box)

    def _stands_on(self, mesh: Mesh, box: Box) -> None:
        self._mesh, self._box = mesh, box

    def field(self, size: Size) -> VertexField:
        """On the vertices."""
        return VertexField(self._mesh, self._box, size.products)
