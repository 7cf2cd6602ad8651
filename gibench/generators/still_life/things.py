"""Things of a still life: a ring, animals, bodies of geometry, and vessels from the furniture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gibench.generators.furniture import sample_furniture
from gibench.generators.parts import Mesh
from gibench.generators.shapes import (
    fillet,
    merge,
    revolve,
    rotate_x,
    rounded_box,
    sphere,
    torus,
    translate,
)
from gibench.generators.still_life.figures import ANIMALS, sample_animal

RING = "ring"
VESSELS = ("bowl", "bottle", "mug", "vase")


def ring(*, radius: float, height: float, thickness: float) -> Mesh:
    """A ring around the z axis that lies on z = 0: a band of metal with rounded edges.

    radius: of its outer side. height, thickness: of the band; metres. A light from the side makes the bright curve on
    the ground inside of it (a caustic: a nephroid or a cardioid).
    """
    inner = radius - thickness
    corners = np.array([[inner, 0.0], [radius, 0.0], [radius, height], [inner, height]])
    profile = fillet(corners, 0.3 * min(thickness, height), segments=4, closed=True)
    return revolve(profile, segments=128, closed=True)


def sample_ring(rng: np.random.Generator) -> Mesh:
    """A lying ring, or one in ten that stands."""
    drawn = {"radius": rng.uniform(0.08, 0.15), "height": rng.uniform(0.03, 0.06)}
    mesh = ring(**drawn, thickness=float(rng.uniform(0.006, 0.012)))
    return mesh if rng.random() < 0.9 else on_ground(rotate_x(mesh, np.pi / 2))


def _ball(rng: np.random.Generator) -> Mesh:
    return sphere(float(rng.uniform(0.05, 0.1)), segments=96)


def _cube(rng: np.random.Generator) -> Mesh:
    side = float(rng.uniform(0.07, 0.14))
    return rounded_box((-side / 2, side / 2, -side / 2, side / 2, 0.0, side), 0.08 * side, arc=4, flat=4)


def _cone(rng: np.random.Generator) -> Mesh:
    radius, height = float(rng.uniform(0.05, 0.08)), float(rng.uniform(0.14, 0.24))
    profile = fillet(
        np.array([[0, 0], [radius, 0], [0.12 * radius, height], [0, height]]),
        [0, 0.006, 0.006, 0],
        segments=4,
    )
    return revolve(profile, segments=96)


def _doughnut(rng: np.random.Generator) -> Mesh:
    return torus(float(rng.uniform(0.06, 0.09)), float(rng.uniform(0.02, 0.035)), segments=96, sides=48)


def _vessel(family: str) -> Callable[[np.random.Generator], Mesh]:
    return lambda rng: merge([part.mesh for part in sample_furniture(rng, family).parts])


def _animal(species: str) -> Callable[[np.random.Generator], Mesh]:
    return lambda rng: sample_animal(rng, species)


THINGS: dict[str, Callable[[np.random.Generator], Mesh]] = {
    **{species: _animal(species) for species in ANIMALS},
    **{family: _vessel(family) for family in VESSELS},
    "ball": _ball,
    "cube": _cube,
    "cone": _cone,
    "doughnut": _doughnut,
}
"""Name of a thing → its sampler; a new one is a line here."""


def on_ground(mesh: Mesh) -> Mesh:
    """The mesh with its middle over the origin and its lowest point at z = 0."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle = (low + high) / 2
    return translate(mesh, (-middle[0], -middle[1], -low[2]))


def sample_thing(rng: np.random.Generator, name: str) -> Mesh:
    """A thing of `THINGS`, or the RING, that stands on z = 0 over the origin, metres."""
    return on_ground(sample_ring(rng) if name == RING else THINGS[name](rng))
