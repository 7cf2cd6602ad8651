"""Lights of a room as shapes: where they are, what they look like, how they move with their lamp."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gibench.errors import GibenchError
from gibench.generators.parts import FloatArray, Light, Mesh
from gibench.generators.poses import stand, turn
from gibench.generators.shapes import sphere

SHADE_SEGMENTS = 40
"""Around a lamp shade."""

LAMP_MATERIAL = "lamp"  # of the glass that glows; hardly ever seen to reflect


class TiltedLight(GibenchError):
    """A rectangular light that lies flat and is turned by something else than a multiple of 90°."""


def placed_light(light: Light, owner: str, position: tuple[float, float, float], yaw: float) -> Light:
    """A lamp's light where its lamp stands, named after it."""
    centre = turn(np.array(light.centre), yaw) + np.asarray(position)
    direction = turn(np.array(light.direction), yaw)
    size = light.size
    if light.shape == "rectangle" and abs(light.direction[2]) > 0.999:
        # A flat rectangle has its width along world x, so a quarter turn exchanges its sides.
        quarters = yaw / (math.pi / 2)
        if abs(quarters - round(quarters)) > 1e-6:
            raise TiltedLight(f"{owner} carries a flat rectangular light; place it at a multiple of 90°")
        size = size if round(quarters) % 2 == 0 else (size[1], size[0])
    return replace(
        light,
        name=f"{owner}.{light.name}",
        centre=(float(centre[0]), float(centre[1]), float(centre[2])),
        direction=(float(direction[0]), float(direction[1]), float(direction[2])),
        size=size,
    )


def light_matrix(light: Light) -> FloatArray:
    """(4, 4) from Mitsuba's unit rectangle ([−1, 1]² in z = 0, facing +z) or unit disk to the light's place.

    The width of a rectangle is horizontal; one that faces straight up or down has it along world x.
    """
    normal = np.asarray(light.direction, dtype=np.float64)
    across = np.array([-normal[1], normal[0], 0.0])
    length = float(np.linalg.norm(across))
    across = across / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    scale = 0.5 if light.shape == "rectangle" else 1.0
    matrix = np.eye(4)
    matrix[:3, 0] = scale * light.size[0] * across
    matrix[:3, 1] = scale * light.size[-1] * np.cross(normal, across)
    matrix[:3, 2] = normal
    matrix[:3, 3] = light.centre
    return matrix


def light_mesh(light: Light, segments: int = 24) -> Mesh:
    """The glowing surface as a mesh: open for a rectangle, disk or shade, closed for a sphere."""
    if light.shape == "sphere":
        return stand(sphere(light.size[0]), light.centre, 0.0)
    if light.shape == "shade":
        return stand(frustum(*light.size[:3]), light.centre, 0.0)
    if light.shape == "rectangle":
        flat = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    else:
        angle = np.arange(segments) * (2 * math.pi / segments)
        flat = np.column_stack([np.cos(angle), np.sin(angle)])
    count = len(flat)
    matrix = light_matrix(light)
    vertices = np.column_stack([flat, np.zeros(count), np.ones(count)]) @ matrix.T
    fan = np.column_stack([np.zeros(count - 2), np.arange(1, count - 1), np.arange(2, count)])
    normals = np.tile(np.asarray(light.direction, dtype=np.float64), (count, 1))
    return Mesh(vertices[:, :3], fan.astype(np.int32), normals, flat * light.size[0])


def frustum(lower: float, upper: float, height: float, *, segments: int = SHADE_SEGMENTS) -> Mesh:
    """The wall of an upright frustum around the origin, metres, open below and above; UVs in metres along it."""
    angle = np.arange(segments + 1) * (2 * math.pi / segments)
    slant = math.hypot(lower - upper, height)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    rise, lean = height / slant, (lower - upper) / slant
    rings, normals, uvs = [], [], []
    for radius, z, v in ((lower, -height / 2, 0.0), (upper, height / 2, slant)):
        rings.append(np.column_stack([radius * out, np.full(segments + 1, z)]))
        normals.append(np.column_stack([rise * out, np.full(segments + 1, lean)]))
        uvs.append(np.column_stack([0.5 * (lower + upper) * angle, np.full(segments + 1, v)]))
    first = np.arange(segments)
    below = np.column_stack([first, first + 1, first + segments + 2])
    above = np.column_stack([first, first + segments + 2, first + segments + 1])
    faces = np.concatenate([below, above]).astype(np.int32)
    return Mesh(np.concatenate(rings), faces, np.concatenate(normals), np.concatenate(uvs))
