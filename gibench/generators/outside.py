"""The ground outside the windows, without which a sky model leaves everything below the horizon black."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from gibench.generators.parts import Environment, Material

GROUND = "ground"  # name of its material and of its shape
LEVEL = -3.0  # the rooms lie one storey up, m
REACH = 1000.0  # from the house to its rim: far enough to lie at the horizon, m


def ground_material(environment: Environment) -> Material:
    """Diffuse, with the reflectance that the sky was computed for."""
    albedo = float(environment.parameters["albedo"])
    return Material(GROUND, GROUND, "diffuse", (albedo, albedo, albedo), parameters={"albedo": albedo})


def ground_element() -> Element:
    """The `<shape>` of a square around the foot of the house."""
    shape = Element("shape", type="rectangle", id=f"{GROUND}.0")
    transform = SubElement(shape, "transform", name="to_world")
    SubElement(transform, "scale", value=repr(REACH))
    SubElement(transform, "translate", z=repr(LEVEL))
    SubElement(shape, "ref", id=GROUND)
    return shape
