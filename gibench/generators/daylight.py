"""Daylight through the windows: nothing, a sun-and-sky model, or an HDR panorama, in W·m⁻²·sr⁻¹."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError
from gibench.generators.light import LUMENS_PER_WATT
from gibench.generators.parts import Environment
from gibench.rendering.lighting import LUMINANCE

KINDS = ("none", "sunsky", "hdr")

# Mitsuba divides the radiance of `sunsky` by the integral of the CIE 1931 ȳ curve over wavelength in nm.
# Multiplied by it, a luminance of 1 stands for 683 lm·m⁻²·sr⁻¹ again: a clear sky gives 15 to 20 klx on open
# ground and a sun at 60° another 80 klx, as measured outdoors.
SUNSKY_TO_RADIANCE = 106.856895

# A lower sun is redder than Rec. 709 can hold, which Mitsuba's RGB sun answers with values of little meaning.
LOWEST_SUN = math.radians(5)

_KIND_SHARES = (0.3, 0.7)  # night or closed blinds outside, or day

# Of what nature gives, to balance daylight against lamps; see `sample_sunsky`.
_SUNNY_LEVEL = (0.02, 0.2)
_OVERCAST_LEVEL = (0.25, 1.0)
_PANORAMA_LUX = (1e3, 1e4)


class BadEnvironment(GibenchError):
    """An environment that does not exist, cannot be read, or has values that no light has."""


def sunsky(
    *, elevation: float, azimuth: float, turbidity: float, albedo: float, sun: float, sky: float, level: float
) -> Environment:
    """A clear or clouded sky with its sun, after Hošek and Wilkie (2012, 2013), as in Mitsuba's `sunsky`.

    elevation: of the sun, radians in [5°, 90°]. azimuth: radians about +Z from +X. turbidity: haze of the air
    in [2, 8]. albedo: reflectance of the ground, in [0, 1]. sun, sky: their shares of the clear-sky value, ≥
    0 and not both 0; a sun of 0 is an overcast day. level: what reaches the windows relative to nature, > 0;
    less than 1 stands for dusk, awnings and tinted panes, and balances daylight against lamps. Raises
    BadEnvironment for a value outside its range.
    """
    ranges = (
        ("elevation", elevation, LOWEST_SUN, math.pi / 2),
        ("turbidity", turbidity, 2.0, 8.0),
        ("albedo", albedo, 0.0, 1.0),
        ("sun", sun, 0.0, math.inf),
        ("sky", sky, 0.0, math.inf),
        ("level", level, 0.0, math.inf),
        ("azimuth", azimuth, -math.inf, math.inf),
    )
    for name, value, low, high in ranges:
        if not (math.isfinite(value) and low <= value <= high):
            raise BadEnvironment(f"sunsky: {name} is {value}; give a finite value in [{low:.4g}, {high:.4g}]")
    if level == 0 or sun + sky == 0:
        raise BadEnvironment("sunsky: it emits nothing; use the environment 'none' for a dark outside")
    direction = [
        math.cos(elevation) * math.cos(azimuth),
        math.cos(elevation) * math.sin(azimuth),
        math.sin(elevation),
    ]
    return Environment(
        "sunsky",
        {
            "sun_direction": direction,
            "turbidity": turbidity,
            "albedo": albedo,
            "sun_scale": sun,
            "sky_scale": sky,
            "scale": SUNSKY_TO_RADIANCE * level,
        },
    )


def sample_sunsky(rng: np.random.Generator, **fixed: Any) -> Environment:
    """Half the days sunny, half overcast, the sun between 10° and 60°.

    The level is drawn so that daylight and lamps have a say in the same room: a full sun through a window brings
    ten times the light of all lamps, and drowns them. `level=1.0` among the fixed parameters gives nature's.
    """
    sunny = bool(rng.random() < 0.5)
    drawn = {
        "elevation": float(rng.uniform(math.radians(10), math.radians(60))),
        "azimuth": float(rng.uniform(0, 2 * math.pi)),
        "turbidity": float(rng.uniform(2.0, 6.0)),
        "albedo": float(rng.uniform(0.1, 0.3)),
        "sun": 1.0 if sunny else 0.0,
        "sky": 1.0 if sunny else float(rng.uniform(0.5, 1.0)),
        "level": _log_uniform(rng, *(_SUNNY_LEVEL if sunny else _OVERCAST_LEVEL)),
    }
    return sunsky(**{**drawn, **fixed})


def hdr(*, path: str, rotation: float, lux: float) -> Environment:
    """An equirectangular HDR panorama, scaled to an illuminance.

    path: of an .hdr or .exr file whose upper edge is the zenith. rotation: about +Z, radians. lux:
    illuminance that its upper half gives to open, level ground; panoramas come in arbitrary units, so it must
    be said. Raises BadEnvironment where the file is missing, unreadable, not finite, negative or black.
    """
    if not (math.isfinite(lux) and lux > 0 and math.isfinite(rotation)):
        raise BadEnvironment(
            f"hdr {path}: rotation {rotation} and {lux} lx; both must be finite, the illuminance positive"
        )
    file = Path(path)
    if not file.is_file():
        raise BadEnvironment(f"hdr {path}: there is no such file; give the path of an .hdr or .exr panorama")
    stat = file.stat()
    irradiance = _irradiance(str(file.resolve()), stat.st_mtime_ns, stat.st_size)
    scale = lux / (LUMENS_PER_WATT * irradiance)
    return Environment("hdr", {"path": str(file.resolve()), "rotation": rotation, "scale": scale})


def sample_hdr(rng: np.random.Generator, **fixed: Any) -> Environment:
    """A panorama (its path is among `fixed`) turned at random, at 1 to 10 klx on open ground."""
    drawn = {"rotation": float(rng.uniform(0, 2 * math.pi)), "lux": _log_uniform(rng, *_PANORAMA_LUX)}
    return hdr(**{**drawn, **fixed})


def sample_daylight(
    rng: np.random.Generator, *, kind: str | None = None, path: str | None = None, **fixed: Any
) -> Environment:
    """The environment outside the windows of a room.

    kind: "none", "sunsky", "hdr", or None to draw: nothing in 3 of 10 rooms, else the panorama at `path` if
    one is given, else sun and sky. fixed: parameters of `sunsky` or `hdr` that are not drawn. Raises
    BadEnvironment for an unknown kind or a bad value.
    """
    drawn = str(rng.choice(["none", "day"], p=_KIND_SHARES))
    if kind is None:
        kind = "none" if drawn == "none" else "hdr" if path else "sunsky"
    if kind not in KINDS:
        raise BadEnvironment(
            f"there is no environment {kind!r}; use {', '.join(KINDS)}, or the path of an HDR file"
        )
    if kind == "hdr":
        if path is None:
            raise BadEnvironment("the environment 'hdr' needs the path of an .hdr or .exr panorama")
        return sample_hdr(rng, path=path, **fixed)
    return sample_sunsky(rng, **fixed) if kind == "sunsky" else Environment()


def environment_xml(environment: Environment) -> Element | None:
    """The `<emitter>` of an environment for Mitsuba's RGB variants, or None for kind "none".

    Raises BadEnvironment for an unknown kind.
    """
    values = environment.parameters
    if environment.kind == "none":
        return None
    if environment.kind == "sunsky":
        emitter = Element("emitter", type="sunsky", id="environment")
        x, y, z = values["sun_direction"]
        SubElement(
            emitter, "vector", name="sun_direction", x=repr(x), y=repr(y), z=repr(z)
        )  # Z is up, as ours
        _floats(emitter, {"turbidity": values["turbidity"]})
        SubElement(emitter, "rgb", name="albedo", value=repr(float(values["albedo"])))
        scale = values["scale"]
        _floats(emitter, {"sun_scale": values["sun_scale"] * scale, "sky_scale": values["sky_scale"] * scale})
        return emitter
    if environment.kind == "hdr":
        emitter = Element("emitter", type="envmap", id="environment")
        SubElement(emitter, "string", name="filename", value=str(values["path"]))
        _floats(emitter, {"scale": values["scale"]})
        to_world = SubElement(emitter, "transform", name="to_world")
        SubElement(to_world, "rotate", x="1", angle="90")  # Mitsuba's panoramas have Y up
        SubElement(to_world, "rotate", z="1", angle=repr(math.degrees(values["rotation"])))
        return emitter
    raise BadEnvironment(f"there is no environment {environment.kind!r}; use {', '.join(KINDS)}")


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(low * (high / low) ** rng.random())


def _floats(emitter: Element, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        SubElement(emitter, "float", name=name, value=repr(float(value)))


@lru_cache(maxsize=8)
def _irradiance(path: str, modified: int, size: int) -> float:
    """Irradiance, as luminance, that a panorama gives to level ground. modified, size: renew it for a new file."""
    image = read_panorama(path)
    rows = len(image) // 2
    # Latitude bands: cosine at the ground times solid angle, integrated exactly over each row.
    edges = np.pi * np.arange(rows + 1) / len(image)
    weight = np.diff(np.sin(edges) ** 2) / 2 * (2 * np.pi)
    luminance = image[:rows].mean(1) @ LUMINANCE
    irradiance = float(weight @ luminance)
    if irradiance <= 0:
        raise BadEnvironment(
            f"hdr {path}: its upper half is black; give a panorama with light above the horizon"
        )
    return irradiance


def read_panorama(path: str) -> NDArray[np.float64]:
    """(H, 2·H, 3) linear RGB of a panorama that holds only finite values ≥ 0. Raises BadEnvironment."""
    try:
        image = _read_exr(path) if path.lower().endswith(".exr") else _read_hdr(path)
    except Exception as error:  # what Mitsuba raises for a file that is no image differs by format
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadEnvironment(f"hdr {path}: not readable as an .hdr or .exr image ({reason})") from error
    if image.ndim != 3 or len(image) < 2 or image.shape[1] != 2 * len(image):
        size = " × ".join(map(str, image.shape[1::-1]))
        raise BadEnvironment(
            f"hdr {path}: it has {size} texels; an equirectangular panorama is twice as wide as high"
        )
    broken = int((~np.isfinite(image)).sum() + (image < 0).sum())
    if broken:
        raise BadEnvironment(
            f"hdr {path}: {broken} values are negative or not finite; mend the file or use another"
        )
    return image.astype(np.float64)


def _read_hdr(path: str) -> NDArray[np.float32]:
    from gibench.rendering.backend import select_variant

    select_variant()  # before Mitsuba is loaded, so that it finds the right LLVM
    import mitsuba as mi

    return np.array(mi.Bitmap(path).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))


def _read_exr(path: str) -> NDArray[np.float32]:
    # Mitsuba's reader of OpenEXR never returns in a process that may use one thread only.
    import OpenEXR

    with OpenEXR.File(path, separate_channels=True) as file:
        channels = file.channels()
        # A panorama without colour has luminance alone.
        names = "YYY" if "Y" in channels and "R" not in channels else "RGB"
        return np.stack([channels[name].pixels for name in names], axis=-1).astype(np.float32)
