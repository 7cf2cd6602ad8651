"""Lighting of a frame: an area light, an environment, or the scene's own light. A shot is a camera under a lighting.

`light_rig.LightRig` lights a loaded scene with them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.panoramas import Panorama

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear Rec. 709."""


class LightingError(GibenchError, ValueError):
    """A light that cannot shine, or a lighting that a scene cannot take."""


@dataclass(frozen=True)
class AreaLight:
    """A rectangle that shines to one side.

    centre: world space, m. direction: in which it shines; made unit. width, height: sides, m, > 0. radiance:
    W·m⁻²·sr⁻¹, linear Rec. 709, ≥ 0. up: along its height, at an angle to the direction; by default the side that is
    as upright as can be. Seen from behind it is black. Raises LightingError for what is no such rectangle.

    >>> light = AreaLight((0, 0, 2.5), direction=(0, 0, -1), width=1, height=0.5, radiance=(2, 2, 2))
    >>> light.area, round(light.luminous_flux)
    (0.5, 2146)
    """

    centre: tuple[float, float, float]
    direction: tuple[float, float, float]
    width: float
    height: float
    radiance: tuple[float, float, float]
    up: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        """Numbers of NumPy become Python's, the direction unit, and `up` unit and square to it."""
        for name in ("centre", "direction", "radiance", "up"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, tuple(float(c) for c in value))
        object.__setattr__(self, "width", float(self.width))
        object.__setattr__(self, "height", float(self.height))
        if self.up is None:
            steep = abs(self.direction[2]) > 0.999 * math.hypot(*self.direction)
            object.__setattr__(self, "up", (0.0, 1.0, 0.0) if steep else (0.0, 0.0, 1.0))
        self._check()
        forward = _unit(self.direction)
        assert self.up is not None
        up = np.subtract(self.up, forward * (forward @ np.array(self.up)))
        object.__setattr__(self, "direction", tuple(forward.tolist()))
        object.__setattr__(self, "up", tuple(_unit(up).tolist()))

    def _check(self) -> None:
        problem = ""
        vectors = (self.centre, self.direction, self.radiance, self.up or ())
        if [len(v) for v in vectors] != [3] * 4:
            problem = "each of centre, direction, radiance and up has three numbers"
        elif not np.isfinite([*np.ravel(vectors), self.width, self.height]).all():
            problem = "all numbers must be finite"
        elif not (self.width > 0 and self.height > 0):
            problem = "the sides must be longer than 0"
        elif min(self.radiance) < 0:
            problem = "no light has negative radiance"
        elif (
            not math.hypot(*self.direction) > 0
            or not math.hypot(*np.cross(self.direction, self.up or ())) > 0
        ):
            problem = "the direction must have a length, and up an angle to it"
        if problem:
            raise LightingError(
                f"area light at {self.centre} towards {self.direction}, {self.width} by {self.height} m, radiance "
                f"{self.radiance}: {problem}"
            )

    @property
    def area(self) -> float:
        """m²."""
        return self.width * self.height

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3): unit directions along width, height and light, by row; right-handed."""
        up, forward = np.array(self.up), np.array(self.direction)
        return np.array([np.cross(up, forward), up, forward])

    @property
    def corners(self) -> NDArray[np.float64]:
        """(4, 3), m, counter-clockwise seen from its bright side."""
        along, up, _ = self.axes * np.array([[self.width / 2], [self.height / 2], [0]])
        return np.array(self.centre) + np.array([-along - up, along - up, along + up, up - along])

    @property
    def to_world(self) -> NDArray[np.float64]:
        """(4, 4) from Mitsuba's `rectangle`, which spans [−1, 1]² and shines along +Z."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes.T * [self.width / 2, self.height / 2, 1]
        matrix[:3, 3] = self.centre
        return matrix

    @property
    def intensity(self) -> NDArray[np.float64]:
        """(3,), W·sr⁻¹: radiant intensity in its direction, radiance times area."""
        return np.array(self.radiance) * self.area

    @property
    def luminous_flux(self) -> float:
        """Lumens: 683 lm/W · π · area · luminance of its radiance."""
        return float(683.0 * math.pi * self.area * (LUMINANCE @ np.array(self.radiance)))


@dataclass(frozen=True)
class EnvironmentMap:
    """Light from far away on all sides. panorama: its radiance; rotation: about Z, radians, left as seen from above."""

    panorama: Panorama
    rotation: float = 0.0

    def __post_init__(self) -> None:
        """Raises LightingError for a rotation that is no number."""
        object.__setattr__(self, "rotation", float(self.rotation))
        if not math.isfinite(self.rotation):
            raise LightingError(f"environment {self.panorama.name}: its rotation is {self.rotation}")

    @property
    def to_world(self) -> NDArray[np.float64]:
        """(4, 4) from Mitsuba's `envmap`, which has Y up."""
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        return np.array([[c, 0, s, 0], [s, 0, -c, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


@dataclass(frozen=True)
class Lighting:
    """All the light of a frame: an area light or an environment; with neither, what the scene brings along."""

    area: AreaLight | None = None
    environment: EnvironmentMap | None = None

    def __post_init__(self) -> None:
        """Raises LightingError for both at once."""
        if self.area is not None and self.environment is not None:
            raise LightingError("a lighting is an area light or an environment, not both: leave one out")

    @property
    def kind(self) -> str:
        """ "own", "area-light" or "environment"."""
        return "area-light" if self.area else "environment" if self.environment else "own"


@dataclass(frozen=True)
class Shot:
    """A camera, and the lighting that it sees the scene under."""

    camera: PinholeCamera
    lighting: Lighting = Lighting()


def _unit(vector: Any) -> NDArray[np.float64]:
    vector = np.asarray(vector, dtype=np.float64)
    return vector / np.linalg.norm(vector)
