"""Materials as Mitsuba reads them."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from gibench.generators.materials.color import decode
from gibench.generators.materials.metal import NORMAL_REFLECTANCE
from gibench.generators.materials.roles import GLOSSY_ALPHA
from gibench.generators.parts import Material, Texture

_REFLECTANCE = {
    "diffuse": "reflectance",
    "roughplastic": "diffuse_reflectance",
    "roughconductor": "specular_reflectance",
    "conductor": "specular_reflectance",
}


def bsdf_xml(material: Material, texture_path: str | None = None) -> Element:
    """The `<bsdf>` element of a material, twosided, with the material's name as its id.

    texture_path: where the scene finds the PNG of a textured material, relative to the scene file; not read
    here and not needed for materials of one colour. UVs of the scene's meshes count tiles of the texture
    (`tile_size`). Row 0 of the image lies at v = 0 and rows follow growing v, as Mitsuba reads a PNG: no flip.
    """
    outer = Element("bsdf", type="twosided", id=material.name)
    inner = SubElement(outer, "bsdf", type=material.bsdf)
    if material.bsdf in ("roughplastic", "roughconductor"):
        SubElement(inner, "string", name="distribution", value="ggx")
        SubElement(inner, "float", name="alpha", value=repr(float(material.alpha)))
    if material.bsdf == "roughplastic":
        SubElement(inner, "float", name="int_ior", value=repr(float(material.ior)))
        SubElement(inner, "boolean", name="nonlinear", value="false")
    if material.bsdf in ("roughconductor", "conductor"):
        SubElement(inner, "string", name="material", value=material.conductor)
    name = _REFLECTANCE[material.bsdf]
    if isinstance(material.reflectance, Texture):
        if texture_path is None:
            raise ValueError(f"material {material.name} is textured and needs the path of its PNG")
        texture = SubElement(inner, "texture", type="bitmap", name=name)
        SubElement(texture, "string", name="filename", value=texture_path)
    else:
        SubElement(inner, "rgb", name=name, value=" ".join(repr(float(c)) for c in material.reflectance))
    return outer


def tile_size(material: Material) -> tuple[float, float]:
    """Metres that one unit of u and of v cover on meshes of this material: a tile, or (1, 1) without a texture."""
    return material.reflectance.size if isinstance(material.reflectance, Texture) else (1.0, 1.0)


def base_color(material: Material) -> tuple[float, float, float]:
    """Mean colour, linear Rec. 709: the diffuse reflectance, or what a metal reflects at normal incidence."""
    if isinstance(material.reflectance, Texture):
        mean = decode(material.reflectance.pixels).mean((0, 1))
    else:
        mean = np.asarray(material.reflectance)
        if material.bsdf in ("roughconductor", "conductor"):
            mean = mean * np.asarray(NORMAL_REFLECTANCE[material.conductor])
    return float(mean[0]), float(mean[1]), float(mean[2])


def is_glossy(material: Material) -> bool:
    """Whether reflections can be made out: a mirror, or a coat or a metal of alpha ≤ `GLOSSY_ALPHA`."""
    return material.bsdf == "conductor" or (material.bsdf != "diffuse" and material.alpha <= GLOSSY_ALPHA)
