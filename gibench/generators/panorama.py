"""What lies outside the windows, as one panorama that goes with the room.

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

WIDTH = 1024
"""Texels around the horizon: one is 0.35° wide, two thirds of the sun's disc."""

SUN_RADIUS = math.radians(0.5338 / 2)
"""Of the sun that Mitsuba's `sunsky` draws."""

SUBSAMPLES = 24
"""Samples along each side of a texel that the sun may touch."""


def panorama(environment: Environment) -> NDArray[np.float32]:
    """Radiance from all directions, W·m⁻²·sr⁻¹, linear Rec. 709: (H, 2·H, 3) float32 with the zenith on top.

    Column i looks along azimuth π/2 − 2π(i + ½)/W, measured about +Z from +X, before the rotation of an "hdr"
    environment. The sun is averaged over the texels that it touches, so that its light is all there.
    """
    if environment.kind == "hdr":
        return _reduced(read_panorama(str(environment.parameters["path"]))) * float(
            environment.parameters["scale"]
        )
    height = WIDTH // 2
    rows, columns = np.mgrid[0 : height // 2, 0:WIDTH]
    values = environment.parameters
    image = np.zeros((height, WIDTH, 3), np.float32)
    if values["sky_scale"] > 0:
        sky = _evaluate(environment, "sky_scale", _directions(rows + 0.5, columns + 0.5))
        image[: height // 2] = sky * (values["sky_scale"] * values["scale"])
    if values["sun_scale"] > 0:
        towards = np.asarray(values["sun_direction"])
        reach = math.cos(SUN_RADIUS + math.pi / height)
        row, column = np.nonzero(_directions(rows + 0.5, columns + 0.5) @ towards > reach)
        inside = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES
        places = _directions(row[:, None, None] + inside[:, None], column[:, None, None] + inside)
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


def _directions(row: NDArray[np.float64], column: NDArray[np.float64]) -> NDArray[np.float64]:
    """World directions (…, 3) of places in the panorama, in texels from its upper left corner."""
    theta, phi = row * (2 * math.pi / WIDTH), column * (2 * math.pi / WIDTH)
    sine = np.sin(theta)
    return np.stack(np.broadcast_arrays(np.sin(phi) * sine, np.cos(phi) * sine, np.cos(theta)), axis=-1)


def _evaluate(environment: Environment, part: str, directions: NDArray[np.float64]) -> NDArray[np.float32]:
    """Radiance of the sky or the sun alone, at a scale of 1, along (…, 3) directions."""
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
    flat = directions.reshape(-1, 3).astype(np.float32)
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
    return np.maximum(light, 0).reshape(directions.shape).astype(np.float32)


def _reduced(image: NDArray[np.float64]) -> NDArray[np.float32]:
    """The image with at most WIDTH columns, by the mean over whole blocks of texels."""
    block = max(1, -(-image.shape[1] // WIDTH))
    height, width = image.shape[0] // block, image.shape[1] // block
    cut = image[: height * block, : width * block]
    return cut.reshape(height, block, width, block, 3).mean(axis=(1, 3)).astype(np.float32)
