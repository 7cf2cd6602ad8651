"""Positions and directions as a camera sees them, and as it sees them in a mirror.

Networks for rooms that they have never seen take positions relative to the camera, or they learn rooms by heart. Axes
are right, down and forward: the mirror image of a frame is a frame of the mirrored room, in which only x changes sign.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Images
from gibench.rendering.camera import PinholeCamera

POINTS = ("position", "reflected_position")
"""Channels of places; a miss holds 0, before and after."""

DIRECTIONS = (
    "normal",
    "geometric_normal",
    "reflected_normal",
    "curvature_direction",
    "light_direction",
)
"""Channels of directions."""


def in_camera_space(images: Images, camera: PinholeCamera) -> Images:
    """The images with POINTS (m) and DIRECTIONS of world space in the space of a camera; all others as they are."""
    return {name: _seen(name, image, camera) for name, image in images.items()}


def _seen(name: str, image: Tensor, camera: PinholeCamera) -> Tensor:
    if name not in (*POINTS, *DIRECTIONS):
        return image
    axes = image.new_tensor(camera.frame)
    if name in POINTS:
        hit = (image != 0).any(dim=-3, keepdim=True)
        image = torch.where(hit, image - image.new_tensor(camera.position)[:, None, None], 0)
    return torch.einsum("ij,...jhw->...ihw", axes, image)


def mirrored(images: Images) -> Images:
    """The images of the room in a mirror: left is right. Of images in camera space."""
    result = {}
    for name, image in images.items():
        image = image.flip(-1)
        if name in (*POINTS, *DIRECTIONS):
            image = image * image.new_tensor([-1.0, 1.0, 1.0])[:, None, None]
        result[name] = image
    return result
