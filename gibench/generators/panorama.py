"""The world outside the windows, as one panorama that goes with the room.

A sun-and-sky model is evaluated once here rather than at every path vertex: the model is a third of what a furnished
room's kernel has to compile and a fifth of its time, and its numbers are part of the compiled code, so that no room
could use the kernel of the one before. An HDR file of the user's is copied in, so that the scene can be moved.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from numpy.typing import NDArray

from gibench.generators.daylight import environment_xml, read_panorama
from gibench.generators.parts import Environment

HEIGHT = 512
"""Rows; twice as many texels go around the horizon: one is 0.35° wide, two thirds of the sun's disc."""

SUN_RADIUS = math.radians(0.5338 / 2)
"""Of the sun that Mitsuba's `sunsky` draws."""

SUBSAMPLES = 24
"""Samples along each side of a texel that the sun may touch."""


def panorama(environment: Environment) -> NDArray[np.float32]:
    """Radiance from all directions, W·m⁻²·sr⁻¹, linear Rec. 709: (H, 2·H, 3) float32 with the zenith on top.

    Laid out as `gibench.rendering.latlong` says, before the rotation of an "hdr" environment. The sun is averaged over
    the texels that it touches, so that its light is all there.
    """
    # It loads SciPy, which those who only read of rooms do not need.
    from gibench.rendering.latlong import directions, resampled

    if environment.kind == "hdr":
        own = read_panorama(str(environment.parameters["path"])) * float(environment.parameters["scale"])
        return resampled(own, min(len(own), HEIGHT))
    rows, columns = np.mgrid[0 : HEIGHT // 2, 0 : 2 * HEIGHT]
    values = environment.parameters
    image = np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32)
    if values["sky_scale"] > 0:
        sky = _evaluate(environment, "sky_scale", directions(columns + 0.5, rows + 0.5, HEIGHT))
        image[: HEIGHT // 2] = sky * (values["sky_scale"] * values["scale"])
    if values["sun_scale"] > 0:
        towards = np.asarray(values["sun_direction"])
        reach = math.cos(SUN_RADIUS + math.pi / HEIGHT)
        row, column = np.nonzero(directions(columns + 0.5, rows + 0.5, HEIGHT) @ towards > reach)
        inside = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES
        places = directions(column[:, None, None] + inside, row[:, None, None] + inside[:, None], HEIGHT)
        sun = _evaluate(environment, "sun_scale", places).mean(axis=(1, 2))
        image[row, column] += sun * (values["sun_scale"] * values["scale"])
    return image


def write_panorama(environment: Environment, folder: Path, name: str) -> Element | None:
    """Write the panorama of an environment as `name`, an .hdr below `folder`; returns its `<emitter>`.

    None, and no file, for the kind "none". RGBE has room for the sun and keeps 8 bits of each value. (Mitsuba's reader
    and writer of OpenEXR never return in a process that may use one thread only.)
    """
    if environment.kind == "none":
        return None
    import mitsuba as mi

    mi.Bitmap(panorama(environment)).write(str(folder / name))
    emitter = Element("emitter", type="envmap", id="environment")
    SubElement(emitter, "string", name="filename", value=name)
    to_world = SubElement(emitter, "transform", name="to_world")
    SubElement(to_world, "rotate", x="1", angle="90")  # Mitsuba's panoramas have Y up
    rotation = float(environment.parameters.get("rotation", 0.0))
    SubElement(to_world, "rotate", z="1", angle=repr(math.degrees(rotation)))
    return emitter


def _evaluate(environment: Environment, part: str, towards: NDArray[np.float64]) -> NDArray[np.float32]:
    """Radiance of the sky or the sun alone, at a scale of 1, along (…, 3) unit directions."""
    from gibench.rendering.backend import is_scalar, select_variant

    select_variant()
    import drjit as dr
    import mitsuba as mi

    alone = {"sky_scale": 0.0, "sun_scale": 0.0, "scale": 1.0, part: 1.0}
    element = environment_xml(Environment("sunsky", {**environment.parameters, **alone}))
    assert element is not None
    scene = Element("scene", version="3.0.0")
    scene.append(element)
    emitter = mi.load_string(tostring(scene, encoding="unicode")).environment()
    flat = towards.reshape(-1, 3).astype(np.float32)
    if is_scalar():
        si = dr.zeros(mi.SurfaceInteraction3f)
        light = np.empty_like(flat)
        for number, direction in enumerate(flat):
            si.wi = mi.Vector3f(-direction)
            light[number] = np.array(emitter.eval(si))
    else:
        si = dr.zeros(mi.SurfaceInteraction3f, len(flat))
        si.wi = mi.Vector3f(-flat.T)
        light = np.array(emitter.eval(si)).T
    return np.maximum(light, 0).reshape(towards.shape).astype(np.float32)
