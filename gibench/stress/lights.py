"""Lights that are tiny, huge, dim, many, hidden, touching, or none at all."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np
from numpy.typing import NDArray

from gibench.datasets import exr
from gibench.generators.light import BadLight, radiance_of
from gibench.generators.panorama import write_panorama
from gibench.generators.parts import Environment, Light
from gibench.metrics import reference_exposure, relmse, tone_map
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import RenderedFrame, render_frame
from gibench.rendering.scene import Scene, SceneError, load_dict
from gibench.stress.answers import (
    mean_check,
    not_finite,
    parallel_rectangle,
    perpendicular_rectangle,
    worst,
)
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import area, constant, diffuse, rectangle
from gibench.stress.views import POINT, seen, spot

REFLECTANCE = 0.5

FORM_FACTOR = "form factor in closed form; noise"

CONES = (
    "Mitsuba takes the solid angle of a sphere from 1 − cos θ in float32, which cancels: 7 % off for a radius of half "
    "a millimetre at 1.5 m, 0.04 % for the 2 cm of a bulb at 3 m"
)

SUN, SUN_ROW, SUN_COLUMN = 64890.0, 64, 300
"""Radiance of the sun of the panorama, and where it stands: 45° high."""

HEIGHT, WIDTH = 256, 512
"""Of the panorama."""


def floor(half: float = 1.0) -> dict[str, Any]:
    """A grey floor around the origin."""
    return rectangle([0, 0, 0], [0, 0, 1], (half, half), bsdf=diffuse(REFLECTANCE))


def lamp(centre: tuple[float, float, float], half: tuple[float, float], radiance: float) -> dict[str, Any]:
    """A black rectangle that shines downwards."""
    return rectangle(centre, [0, 0, -1], half, bsdf=diffuse(0.0), emitter=area(radiance))


@case("lamp of 1 mm, radiance 1e6", quick=True)
def lamp_of_a_millimetre() -> Found:
    """Irradiance at the foot of a lamp's centre."""
    scene = load_dict({"type": "scene", "floor": floor(), "lamp": lamp((0, 0, 1.5), (5e-4, 5e-4), 1e6)})
    answer = REFLECTANCE * 1e6 * parallel_rectangle(5e-4, 5e-4, 1.5)
    yield mean_check(
        "light", "radiance of the floor", seen(scene, spot(45), max_depth=1), answer, FORM_FACTOR
    )


@case("round lamp of radius {radius:g} m", radius=(5e-4, 5e-3, 0.1), quick=(5e-4,))
def round_lamp(radius: float) -> Found:
    """Irradiance below a sphere: pi · L · (r/d)²."""
    bulb = {
        "type": "sphere",
        "center": [0, 0, 1.5],
        "radius": radius,
        "bsdf": diffuse(0.0),
        "emitter": area(1e6),
    }
    scene = load_dict({"type": "scene", "floor": floor(), "bulb": bulb})
    answer = REFLECTANCE * 1e6 * (radius / 1.5) ** 2
    frame = seen(scene, spot(60), max_depth=1)
    known = CONES if radius < 0.01 else ""
    yield mean_check("light", "radiance of the floor", frame, answer, "closed form; noise", known=known)


@case("lamps, {count} of them", count=(1, 64, 1024), quick=(64,))
def many_lamps(count: int) -> Found:
    """Squares of 4 cm in rows, 3 m above a floor."""
    side, height = round(count**0.5), 3.0
    ticks = (np.arange(side) - (side - 1) / 2) * 0.1
    places = [(float(x), float(y)) for x in ticks for y in ticks]
    lamps = {f"lamp{k}": lamp((x, y, height), (0.02, 0.02), 100.0) for k, (x, y) in enumerate(places)}
    scene = load_dict({"type": "scene", "floor": floor(), **lamps})
    answer = REFLECTANCE * 100.0 * sum(parallel_rectangle(0.02, 0.02, height, x, y) for x, y in places)
    frame = seen(scene, spot(60), max_depth=1, spp=256)
    yield mean_check("light", "radiance of the floor", frame, answer, FORM_FACTOR)


def behind_a_gap(**light: Any) -> Any:
    """A floor under a ceiling that is black and closed but for a gap of 1 m by 1 cm, 1 m above the origin."""
    black, reach = diffuse(0.0), 4.0
    sides = ((1, 0), (-1, 0), (0, 1), (0, -1))
    walls = {
        f"wall{x}{y}": rectangle([reach * x, reach * y, 0], [-x, -y, 0], (reach, 1.1), bsdf=black)
        for x, y in sides
    }
    side, end = (reach - 0.005) / 2, (reach - 0.5) / 2
    pieces = {
        "left": rectangle([0, 0.005 + side, 1], [0, 0, -1], (reach, side), bsdf=black),
        "right": rectangle([0, -0.005 - side, 1], [0, 0, -1], (reach, side), bsdf=black),
        "front": rectangle([0.5 + end, 0, 1], [0, 0, -1], (end, 0.005), bsdf=black),
        "back": rectangle([-0.5 - end, 0, 1], [0, 0, -1], (end, 0.005), bsdf=black),
    }
    return load_dict({"type": "scene", "floor": floor(reach), **walls, **pieces, **light})


BELOW = PinholeCamera((0.0, -1.0, 0.5), (0.0, 0.0, 0.0), POINT)


@case("lamp seen through a gap of 1 cm", quick=True)
def lamp_behind_a_gap() -> Found:
    """The visible part of a lamp that fills the gap is the gap: 4 % of the samples of the lamp get through."""
    scene = behind_a_gap(lamp=lamp((0, 0, 2), (1.2, 0.2), 10.0))
    answer = REFLECTANCE * 10.0 * parallel_rectangle(0.5, 0.005, 1.0)
    frame = seen(scene, BELOW, max_depth=1, resolution=(32, 32))
    yield mean_check("light", "radiance of the floor", frame, answer, FORM_FACTOR)


@case("sky seen through a gap of 1 cm", quick=True)
def sky_behind_a_gap() -> Found:
    """Three in a thousand directions of a cosine lobe lead through the gap, as a portal or not."""
    scene = behind_a_gap(sky=constant(10.0))
    opening = np.array([[[-0.5, -0.005, 1.0], [0.0, 0.01, 0.0], [1.0, 0.0, 0.0]]])
    answer = REFLECTANCE * 10.0 * parallel_rectangle(0.5, 0.005, 1.0)
    for what, portals in (("through a portal", opening), ("without portals", None)):
        given = replace(scene, openings=portals)
        frame = seen(given, BELOW, max_depth=1, resolution=(64, 64))
        yield mean_check("light", f"radiance of the floor, {what}", frame, answer, FORM_FACTOR)


@case("lamp that touches a wall", quick=True)
def touching_lamp() -> Found:
    """A wall below a lamp that stands out from it: half of what a point at the seam sees is lamp."""
    wall = rectangle([0, 0, 0], [1, 0, 0], (2, 2), bsdf=diffuse(REFLECTANCE))
    scene = load_dict({"type": "scene", "wall": wall, "lamp": lamp((0.5, 0, 1), (0.5, 1), 1.0)})
    checks = []
    for gap in (0.5, 0.05, 0.001):
        point = (0.0, 0.0, 1.0 - gap)
        camera = PinholeCamera((2.0, 0.0, 0.2), point, POINT)
        answer = REFLECTANCE * perpendicular_rectangle(1.0, 1.0, gap)
        frame = seen(scene, camera, max_depth=1)
        checks.append(mean_check("light", f"radiance {1000 * gap:g} mm below", frame, answer, FORM_FACTOR))
    yield worst(checks)


def two_lamps(first: float, second: float) -> tuple[RenderedFrame, NDArray[np.float64]]:
    """A frame whose left half shows one lamp and whose right half another, and what it should hold."""
    left = rectangle([-1, 0, 0], [0, 0, 1], (1, 1), bsdf=diffuse(0.0), emitter=area(first))
    right = rectangle([1, 0, 0], [0, 0, 1], (1, 1), bsdf=diffuse(0.0), emitter=area(second))
    scene = load_dict({"type": "scene", "left": left, "right": right})
    camera = PinholeCamera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 1.0)
    frame = render_frame(scene, camera, resolution=(16, 12), channels=["radiance"], spp=16)
    answer = np.empty((12, 16, 3))
    answer[:, :8], answer[:, 8:] = first, second
    return frame, answer


@case("radiance 1e6 beside 1e-6", quick=True)
def bright_beside_dim() -> Found:
    """Half floats overflow at 65,504 and have 17 steps below 1e-6; the file must keep both lamps."""
    frame, answer = two_lamps(1e6, 1e-6)
    color = frame.arrays["color"]
    error = float(np.abs(color / answer - 1).max())
    yield Check("light", "radiance of both", error, 2.0**-20, "float32 sums of 16 samples")
    stored = exr.decode(exr.encode(frame.arrays), widen=True)["color"]
    error = float(np.abs(stored / answer - 1).max())
    yield Check("files", "the same, read again", error, exr.HALF_TOLERANCE, "the file's promise")
    shown = tone_map(color, reference_exposure(color))
    yield Check(
        "metrics", "display values outside [0, 1]", float(((shown < 0) | (shown > 1)).sum()), 0, "sRGB"
    )
    yield Check("metrics", "relMSE with itself", float(relmse(color, color)), 0, "an identity")


@case(
    "radiance {radiance:g} everywhere", radiance=(6.5e4, 6.6e4, 1e6, 1e-6, 1e-20, 1e30), quick=(6.6e4, 1e-6)
)
def one_radiance(radiance: float) -> Found:
    """At both ends of half floats and far beyond them."""
    frame, answer = two_lamps(radiance, radiance)
    error = float(np.abs(frame.arrays["color"] / answer - 1).max())
    yield Check("light", "radiance", error, 2.0**-20, "float32 sums of 16 samples")
    stored = exr.decode(exr.encode(frame.arrays), widen=True)["color"]
    error = float(np.abs(stored / answer - 1).max())
    yield Check("files", "the same, read again", error, exr.HALF_TOLERANCE, "the file's promise")
    error = float(frame.arrays["color_se"].max() / radiance)
    yield Check("error bars", "of light without noise", error, 2.0**-20, "float32 sums of 16 samples")
    shown = tone_map(stored, reference_exposure(stored))
    # Middle grey through the curve of sRGB.
    error = float(np.abs(shown - (1.055 * 0.18 ** (1 / 2.4) - 0.055)).max())
    yield Check("metrics", "middle grey (absolute)", error, 2.0**-20, "exposure to 0.18, then sRGB")


@case("radiance 3e38, beyond float32", quick=True)
def overflowing_lamp() -> Found:
    """Paths that overflow are counted, and nothing infinite is stored."""
    scene = load_dict({"type": "scene", "floor": floor(), "lamp": lamp((0, 0, 0.5), (0.5, 0.5), 3e38)})
    camera = PinholeCamera((0.0, -1.5, 1.0), (0.0, 0.0, 0.2), 1.0)
    frame = render_frame(scene, camera, resolution=(16, 16), channels=["radiance", "surface"], spp=16)
    yield Check("light", "values that are not finite", not_finite(frame.arrays), 0, "the contract")
    again = exr.decode(exr.encode(frame.arrays))
    yield Check("files", "values that are not finite", not_finite(again), 0, "the contract")


def panorama() -> NDArray[np.float32]:
    """A sky of mean 1 with a sun of one texel, (HEIGHT, WIDTH, 3)."""
    sky = np.zeros((HEIGHT, WIDTH, 3), dtype=np.float32)
    sky[SUN_ROW, SUN_COLUMN] = SUN
    sky += 1 - sky.mean()
    sky[SUN_ROW, SUN_COLUMN] = SUN
    return sky


def sunlit_floor(sky: NDArray[np.float32], *, row: float, rows: int) -> float:
    """Radiance of a grey floor below a panorama that is even but for its sun, whose texel is interpolated.

    The tent that bilinear interpolation makes of the sun's texel, times the cosine, integrated over the sphere. row:
    where the middle of the sun's texel is, of `rows` from pole to pole.
    """
    step = np.pi / rows
    offset = (np.arange(20000) + 0.5) / 10000 - 1
    theta = (row + offset) * step
    tent = ((1 - np.abs(offset)) * np.cos(theta) * np.sin(theta)).mean() * 2 * step
    even = float(sky[0, 0, 0])
    return REFLECTANCE * (even + (SUN - even) * tent * (2 * np.pi / WIDTH) / np.pi)


ROWS = (
    "Mitsuba spreads the rows of a panorama over one row less, so that a texel is 1/(rows − 1) too high; 0.2 % of the "
    "sun's light in a room of gibench"
)


@case("sun of 64,890 in a sky of mean 1", quick=True)
def sun_in_a_panorama() -> Found:
    """Half of the light comes from one texel in 131,072."""
    import mitsuba as mi

    sky = panorama()
    upright = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    light = {"type": "envmap", "bitmap": mi.Bitmap(sky), "to_world": upright}
    scene = load_dict({"type": "scene", "floor": floor(), "sky": light})
    frame = seen(scene, spot(45), max_depth=1, spp=4096)
    source = "interpolated texel, in float64; noise"
    theirs = sunlit_floor(sky, row=SUN_ROW, rows=HEIGHT - 1)
    yield mean_check("light", "radiance of the floor, rows as Mitsuba has them", frame, theirs, source)
    usual = sunlit_floor(sky, row=SUN_ROW + 0.5, rows=HEIGHT)
    yield mean_check("light", "the same, rows as a panorama has them", frame, usual, source, known=ROWS)

    with tempfile.TemporaryDirectory() as name:
        given = seen(from_file(sky, Path(name)), spot(45), max_depth=1)
        check = mean_check("files", "radiance of the floor, from a file", given, theirs, "")
    yield replace(check, bound=check.bound + 2.0**-7, source="8 bits of RGBE; noise")


def from_file(sky: NDArray[np.float32], folder: Path) -> Scene:
    """The floor below a panorama that has gone the way of a user's: .exr, then the .hdr beside a room."""
    import mitsuba as mi
    import OpenEXR

    from gibench.rendering.scene import wrap

    source = folder / "sky.exr"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: np.ascontiguousarray(sky[..., k]) for k, name in enumerate("RGB")}).write(
        str(source)
    )
    given = Environment("hdr", {"path": str(source), "rotation": 0.0, "scale": 1.0})
    emitter = write_panorama(given, folder, "environment.hdr")
    assert emitter is not None
    text = Element("scene", version="3.0.0")
    text.append(emitter)
    (folder / "scene.xml").write_bytes(tostring(text))
    outside = mi.load_file(str(folder / "scene.xml")).environment()
    return wrap(mi.load_dict({"type": "scene", "floor": floor(), "sky": outside}, optimize=False))


@case("lamp of no area", quick=True)
def lamp_of_no_area() -> Found:
    """Refused by name, whether it comes as a scene or as a lamp of a room."""
    for size in ((0.0, 0.0), (0.2, 0.0)):
        refused = False
        try:
            load_dict({"type": "scene", "floor": floor(), "lamp": lamp((0, 0, 1), size, 1.0)})
        except SceneError as error:
            refused = "'lamp' has an area of 0" in str(error)
        yield Check("checks", "scenes that are let pass", float(not refused), 0, "a light has an area")
    refused = False
    try:
        radiance_of(Light("lamp", "rectangle", (0.2, 0.0), (0, 0, 1), (0, 0, -1), 800.0, 2700.0))
    except BadLight:
        refused = True
    yield Check("checks", "lamps of rooms that are let pass", float(not refused), 0, "a light has an area")
