"""The method `sh-prt`: indirect light from transfer matrices of vertices."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.image_to_image.device_frames import DeviceFrames
from gibench.baselines.image_to_image.frames import spaced
from gibench.baselines.method import Method, Setting, Site, View, reading
from gibench.baselines.precomputed_radiance_transfer import METHOD, transfer
from gibench.baselines.precomputed_radiance_transfer.environment import (
    coefficients_of,
    count,
    degrees,
    negative_share,
    window,
)
from gibench.baselines.precomputed_radiance_transfer.reflection import (
    cosine_kernel,
    lobe_kernel,
    reflectance,
)
from gibench.baselines.precomputed_radiance_transfer.surfaces import ReflectingFrames
from gibench.baselines.relighting.examples import MEASURED, Light
from gibench.baselines.relighting.frames import Relit
from gibench.baselines.relighting.surfaces import MATERIAL, Box, Pixels, hit
from gibench.baselines.training.encodings.spherical_harmonics import spherical_harmonics
from gibench.baselines.training_set import TrainingSet
from gibench.baselines.vertex_features.remeshing import meshes_of
from gibench.datasets.cameras import camera_of
from gibench.rendering.lighting import EnvironmentMap
from gibench.rendering.scene import Scene

PIXELS = 1 << 13
"""At a time, so that memory does not grow with the resolution."""

ROWS = 1 << 9
"""Matrices that are in memory at a time, in single precision."""

SURVEY = (64, 48)
"""Pixels of the frames that say what is seen of a scene."""


class HarmonicTransfer(Relit):
    """See `gibench.baselines.precomputed_radiance_transfer.METHOD`."""

    method: ClassVar[Method] = METHOD
    stage: ClassVar[str] = "gather"

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not bake."""
        super().adjust(settings)
        self._degree, self._window = int(settings["degree"]), float(settings["window"])
        self._arrived: Arrived | None = None

    def prepare(self, site: Site) -> None:
        """Find the transfer of the scene."""
        super().prepare(site)
        self._surfaces = ReflectingFrames(site.scene)
        self._reflected = int(self.settings["reflected"])
        box = seen_box(site, self._surfaces)
        chosen = {
            "edge": float(self.settings["edge"]),
            "reflected": self._reflected,
            "paths": int(self.settings["paths"]),
            "max_depth": site.max_depth,
        }
        bake = site.bakes.get(
            "transfer", {**chosen, **box.facts()}, partial(_made, site.scene, site.folder, box, chosen)
        )
        with reading("the transfer", bake.folder):
            self.transfer = transfer.read(bake.folder, self._reflected)
        self._closest = self.transfer.closest()
        self._matrices = torch.from_numpy(self.transfer.matrices)

    def light_of(self, environment: EnvironmentMap) -> Light:
        """Its coefficients (81, 3)."""
        return coefficients_of(environment)

    def told(self, light: Light) -> Arrived:
        """What arrives at vertices under that light, as far as it was asked for."""
        windowed = light[: count(self._degree)] * window(self._window, self._degree)[:, None]
        if self._arrived is None or not np.array_equal(windowed, self._arrived.light):
            self._arrived = Arrived(self._matrices, windowed)
        return self._arrived

    def numbers(self, view: View, light: Light, told: Arrived) -> dict[str, float]:
        """How much ringing there is: shares of negative light in the environment, as taken and without a window."""
        return {
            "negative_environment": negative_share(told.light),
            "negative_unwindowed": negative_share(light[: count(self._degree)]),
        }

    def sent(self, pixels: Pixels, told: Arrived) -> Tensor:
        """Both lobes' share of what arrives at the surfaces, interpolated between vertices."""
        found = pixels.places.new_zeros(len(pixels.places), 3)
        for first in range(0, len(found), PIXELS):
            part = slice(first, first + PIXELS)
            found[part] = self._sent(pixels.places[part], pixels.material[part], told)
        return found

    def _sent(self, places: Tensor, material: Tensor, told: Arrived) -> Tensor:
        normal, reflected, alpha, diffuse, specular = material.split(list(MATERIAL.values()), dim=-1)
        alpha, cosine = alpha[:, 0], (normal * reflected).sum(dim=-1)
        corners, weights = self._closest(places.cpu().numpy().astype(np.float64), normal.cpu().numpy())
        arrived = told.at(self.transfer.row[corners], weights).to(places.device)
        band = torch.from_numpy(degrees(self._reflected)).to(places.device)
        cosines = torch.from_numpy(cosine_kernel(self._reflected)).float().to(places.device)
        matt = spherical_harmonics(normal, self._reflected) * cosines[band] / torch.pi
        gloss = spherical_harmonics(reflected, self._reflected) * lobe_kernel(alpha, self._reflected)[:, band]
        shown = torch.einsum("ni,nic->nc", matt, arrived) * diffuse
        return shown + torch.einsum("ni,nic->nc", gloss, arrived) * reflectance(specular, alpha, cosine)


class Arrived:
    """What arrives at vertices under one light, in harmonics, made where it is first asked for."""

    def __init__(self, matrices: Tensor, light: Light) -> None:
        """matrices: (R, I, 3, 81), float16. light: (count, 3), 81 at most."""
        self.light, self._matrices = light, matrices
        self._taken = torch.from_numpy(np.ascontiguousarray(light.T, np.float32))  # (3, count)
        self._known = np.zeros(len(matrices), bool)
        self._found = np.zeros(matrices.shape[:3], np.float32)

    def at(self, rows: NDArray[np.int64], weights: NDArray[np.float32]) -> Tensor:
        """(N, I, 3) of places between three vertices, by their rows and weights, (N, 3) each."""
        asked = np.unique(rows)
        missing = asked[~self._known[asked]]
        for first in range(0, len(missing), ROWS):
            some = missing[first : first + ROWS]
            matrices = self._matrices[torch.from_numpy(some)][..., : self._taken.shape[1]].float()
            self._found[some] = torch.einsum("ricj,cj->ric", matrices, self._taken).numpy()
        self._known[missing] = True
        found = torch.from_numpy(self._found)
        mixed = torch.nn.functional.embedding_bag(
            torch.from_numpy(rows), found.flatten(1), per_sample_weights=torch.from_numpy(weights), mode="sum"
        )
        return mixed.unflatten(1, found.shape[1:])


def seen_box(site: Site, frames: DeviceFrames) -> Box:
    """The box of the places that cameras of training views see; of the whole scene where there are none.

    Poses are enough: no view is read, nor charged for.
    """
    views = site.training
    if not isinstance(views, TrainingSet) or not len(views):
        bounds = site.scene.mi_scene.bbox()
        return Box.around([torch.tensor(np.array([bounds.min, bounds.max], np.float32).reshape(2, 3))])
    rows = [views.frames.iloc[number] for number in spaced(range(len(views)), MEASURED)]
    images = (frames.read(camera_of({str(k): v for k, v in row.items()}), SURVEY) for row in rows)
    return Box.around(one["position"][:, hit(one)].T.cpu() for one in images)


def _made(scene: Scene, folder: Path, box: Box, chosen: Mapping[str, Any], into: Path) -> None:
    transfer.write(into, transfer.made(scene, meshes_of(folder), box, **chosen))
