"""Features on the vertices of a mesh, between which they are interpolated."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.vertex_features.closest import ClosestTriangles
from gibench.baselines.vertex_features.remeshing import Mesh

INITIAL = 0.1
"""Standard deviation of features before a training."""


class VertexField(nn.Module):
    """Features of places in the unit cube: softplus of what is interpolated between vertices (section 6.4)."""

    def __init__(self, mesh: Mesh, box: Box, products: int) -> None:
        """box: that the unit cube stands for. products: features of a place, M."""
        super().__init__()
        self.box = box
        self.closest = ClosestTriangles(mesh)
        self.features = nn.Parameter(INITIAL * torch.randn(len(mesh.vertices), products))

    def forward(self, points: Tensor) -> Tensor:
        """(…, 3) in [0, 1] to (…, M). The closest triangles are found on the host."""
        flat = points.detach().reshape(-1, 3).cpu().numpy().astype(np.float64)
        found = self.closest(flat * np.array(self.box.size) + np.array(self.box.lowest))
        corners, weights = (torch.from_numpy(part).to(points.device) for part in found)
        mixed = (self.features[corners] * weights[..., None]).sum(dim=1)
        return nn.functional.softplus(mixed).reshape(*points.shape[:-1], mixed.shape[1])
