"""Emitters."""

from __future__ import annotations

import math

import numpy as np

from gibench.generators.imported.changes import Note
from gibench.generators.imported.transforms import matrix_of
from gibench.generators.imported.tree import Node, new
from gibench.generators.imported.upgrading import sun
from gibench.generators.imported.upgrading.rules import become, constant_color, number, plugins, rgb, setting


def sun_and_sky(root: Node, note: Note) -> None:
    """`sun`, `sky` and `sunsky` become Mitsuba 3's `sunsky`, whose zenith is +z where it was +y."""
    renamed = {"sky": "sunsky", "sun": "sunsky", "sunsky": "sunsky"}
    gone = ("stretch", "resolution", "extend", "ext_resolution", "sampling_weight")
    for node in plugins(root, "emitter", "sun", "sky", "sunsky"):
        old = node.type
        scale = node.property("scale")
        if scale is not None:
            node.remove(scale)
        factor = "1" if scale is None else scale.get("value", "1")
        for name in gone:
            part = node.property(name)
            if part is not None and name != "sampling_weight":
                node.remove(part)
                note(part, f"{name} of {old} is left out", loss=name in ("stretch", "extend"))
        radius = node.property("sun_radius_scale")
        if radius is not None:
            node.remove(radius)
            factor_of_radius = number(radius, radius.get("value", ""))
            aperture = 0.5358 * factor_of_radius
            if aperture > 0:
                node.append(setting(radius, "float", "sun_aperture", repr(aperture)))
                note(radius, f"sunRadiusScale {factor_of_radius:g} is an aperture of {aperture:.4g} degrees")
            else:
                # A sun without size was a directional light of the same power.
                note(radius, "sunRadiusScale 0 is a sun of its true size", loss=True)
        _sun_direction(node, note)
        for part_name, applies in (("sun_scale", old == "sky"), ("sky_scale", old == "sun")):
            if applies:
                node.append(setting(node, "float", part_name, 0))
            elif node.property(part_name) is None and factor != "1":
                node.append(setting(node, "float", part_name, factor))
        node.set("type", renamed[old])
        _zenith_up(node)
        note(node, f"{old} with its zenith at +y is sunsky with its zenith at +z, turned", loss=True)


def _sun_direction(node: Node, note: Note) -> None:
    """Where the sun stands at a place and a time becomes its direction: Mitsuba 3 has its axes elsewhere."""
    given = {name: node.property(name) for name in sun.DEFAULTS}
    for part in given.values():
        if part is not None:
            node.remove(part)
    if node.property("sun_direction") is not None:
        return
    values = {name: number(part, part.get("value", "")) for name, part in given.items() if part is not None}
    local = sun.direction(**{**sun.DEFAULTS, **values})
    world = matrix_of(node.property("to_world"))[:3, :3] @ local
    x, y, z = (repr(round(float(c), 9)) for c in world / np.linalg.norm(world))
    node.append(new("vector", node, name="sun_direction", x=x, y=y, z=z))
    when = ", ".join(f"{name} {value:g}" for name, value in values.items()) or "its default place and time"
    note(node, f"the sun of {when} stands at ({x}, {y}, {z})")


def _zenith_up(node: Node) -> None:
    transform = node.property("to_world")
    if transform is None:
        transform = new("transform", node, name="to_world")
        node.append(transform)
    # Operations apply in their order: first +z to +y, then what the scene says.
    transform.insert(0, new("rotate", node, x="1", angle="-90"))


def gone_lights(root: Node, note: Note) -> None:
    """`collimated` becomes a narrow `spot`."""
    for node in plugins(root, "emitter", "collimated"):
        power, transform = node.property("power"), node.property("to_world")
        cutoff = 1.0
        solid_angle = 2 * math.pi * (1 - math.cos(math.radians(cutoff)))
        color = constant_color(power, 1.0) or (1.0, 1.0, 1.0)
        become(
            node,
            "spot",
            rgb(node, "intensity", tuple(c / solid_angle for c in color)),
            setting(node, "float", "cutoff_angle", cutoff),
            *([transform] if transform is not None else []),
        )
        note(node, "collimated is a spot of one degree", loss=True)
