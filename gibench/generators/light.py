"""Lamps: lumens and kelvin to radiance, once, and how much light a bulb and a room get."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from gibench.errors import GibenchError
from gibench.generators.parts import Light

LUMENS_PER_WATT = 683.0  # luminous efficacy at 555 nm, which defines the lumen
KELVIN_RANGE = (1000.0, 25000.0)

BULB_LUMENS = (450.0, 1600.0)  # what a 40 W to a 100 W incandescent bulb gave
ROOM_LUMENS = (1500.0, 6000.0)

# The white tones that shops sell, and how often a home has them.
_TONES = (2700.0, 3000.0, 3500.0, 4000.0, 5000.0, 6500.0)
_TONE_SHARES = (0.2, 0.2, 0.15, 0.2, 0.15, 0.1)

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

#: What colour-science gives for the tones of rooms: importing it takes as long as making a small room.
_RGB_OF_TONES = {
    2700.0: (1.9347721092605408, 0.8037144172576656, 0.19184069734801593),
    3000.0: (1.7706318085634447, 0.8444031910617682, 0.2721123996126749),
    3500.0: (1.564015730075032, 0.8923486917378849, 0.4055743968852214),
    4000.0: (1.4137520671701618, 0.9241074752316576, 0.5334438259548766),
    5000.0: (1.213294328835293, 0.960585302250749, 0.7623686637102636),
    6500.0: (1.0431769058321592, 0.9836330251488247, 1.0349896154244267),
}


class BadLight(GibenchError):
    """A light whose flux, colour temperature or size no lamp can have."""


def kelvin_to_rgb(kelvin: float) -> tuple[float, float, float]:
    """Linear Rec. 709 colour, of luminance 1, of a black body.

    kelvin: temperature in [1000, 25000]. Below 1900 K the colour lies outside the Rec. 709 gamut: its
    negative blue is set to 0 and the luminance restored. From 2700 to 6500 K nothing is clipped. White is
    D65, so that warm lamps look as orange as they are beside daylight.

    Raises BadLight for a temperature outside the range.
    Source: Planck's law and the CIE 1931 observer, through colour-science.
    """
    if not KELVIN_RANGE[0] <= kelvin <= KELVIN_RANGE[1]:
        raise BadLight(f"a light has a colour temperature of {kelvin} K; give one between 1000 and 25000 K")
    return _RGB_OF_TONES.get(kelvin) or _black_body(kelvin)


@lru_cache(maxsize=256)
def _black_body(kelvin: float) -> tuple[float, float, float]:
    with warnings.catch_warnings():
        # It tells everybody without Matplotlib that it cannot draw plots, which nobody asked of it.
        warnings.filterwarnings("ignore", message='"Matplotlib" related API')
        import colour  # takes two seconds, which only those who need it should pay

    uv = colour.temperature.CCT_to_uv_Planck1900(kelvin)
    xyz = colour.xy_to_XYZ(colour.UCS_uv_to_xy(uv))
    rgb = np.maximum(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB @ xyz, 0.0)
    rgb /= rgb @ _LUMINANCE
    return float(rgb[0]), float(rgb[1]), float(rgb[2])


def emitting_area(light: Light) -> float:
    """Area that emits, m²: one side of a rectangle or disk, the outside of a sphere or shade. Raises BadLight."""
    count = {"rectangle": 2, "disk": 1, "sphere": 1, "shade": 3}.get(light.shape)
    if count is None:
        raise BadLight(
            f"light {light.name!r} has the shape {light.shape!r}; use rectangle, disk, sphere or shade"
        )
    if len(light.size) != count or not all(math.isfinite(s) and s > 0 for s in light.size):
        raise BadLight(
            f"light {light.name!r} has the size {tuple(light.size)}; "
            f"a {light.shape} needs {count} positive length(s) in metres"
        )
    if light.shape == "rectangle":
        return light.size[0] * light.size[1]
    if light.shape == "shade":
        lower, upper, height = light.size
        return math.pi * (lower + upper) * math.hypot(lower - upper, height)
    return (4 if light.shape == "sphere" else 1) * math.pi * light.size[0] ** 2


def radiance_of(light: Light) -> tuple[float, float, float]:
    """Radiance of the whole surface of a light, W·m⁻²·sr⁻¹, linear Rec. 709.

    A Lambertian surface of area A and radiance L emits the flux π·A·L, so L = Φ / (683 lm/W · π · A) in
    luminance; the colour is that of `kelvin_to_rgb`. This is the one place where lumens become radiance.

    Raises BadLight for a flux that is not positive and finite, a size of zero, an unknown shape or a colour
    temperature out of range.
    """
    if not (math.isfinite(light.lumens) and light.lumens > 0):
        raise BadLight(f"light {light.name!r} has {light.lumens} lm; the flux must be positive and finite")
    level = light.lumens / (LUMENS_PER_WATT * math.pi * emitting_area(light))
    red, green, blue = kelvin_to_rgb(light.kelvin)
    return level * red, level * green, level * blue


def fed(lights: Iterable[Light], lumens: float, kelvin: float) -> tuple[Light, ...]:
    """The lights of a lamp, with their shares of what its bulb gives (lm, K)."""
    return tuple(replace(light, lumens=light.share * lumens, kelvin=kelvin) for light in lights)


def sample_kelvin(rng: np.random.Generator) -> float:
    """Colour temperature of a room's lamps, one of the tones that shops sell, K."""
    return float(rng.choice(_TONES, p=_TONE_SHARES))


def sample_bulb(rng: np.random.Generator) -> float:
    """Flux of one bulb, lumens, log-uniform in `BULB_LUMENS`."""
    return _log_uniform(rng, *BULB_LUMENS)


def sample_room_flux(rng: np.random.Generator, floor_area: float) -> float:
    """Flux that all lamps of a room add up to, lumens, within `ROOM_LUMENS`.

    floor_area: m². Around 150 lm/m², from a dim evening to a bright workplace. Raises BadLight for no area.
    """
    if not (math.isfinite(floor_area) and floor_area > 0):
        raise BadLight(f"a room has a floor of {floor_area} m²; its flux needs a positive area")
    return float(np.clip(floor_area * _log_uniform(rng, 80.0, 280.0), *ROOM_LUMENS))


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return round(low * (high / low) ** float(rng.random()), 1)
