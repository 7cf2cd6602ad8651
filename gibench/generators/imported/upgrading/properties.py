"""Properties that a plugin does not ask for: Mitsuba 0.x only warned of them, Mitsuba 3 refuses the scene."""

from __future__ import annotations

from gibench.generators.imported.changes import Note
from gibench.generators.imported.tree import Node
from gibench.generators.imported.upgrading.rules import old
from gibench.generators.imported.upgrading.textures import FACTOR

_GGX = "alpha alpha_u alpha_v distribution sample_visible"
_IOR = "int_ior ext_ior"
_MESH = "filename face_normals flip_normals flip_tex_coords to_world"

KNOWN: dict[str, frozenset[str]] = {
    name: frozenset(words.split())
    for name, words in {
        "diffuse": "reflectance",
        "dielectric": f"specular_reflectance specular_transmittance {_IOR}",
        "thindielectric": f"specular_reflectance specular_transmittance {_IOR}",
        "roughdielectric": f"specular_reflectance specular_transmittance {_IOR} {_GGX}",
        "conductor": "specular_reflectance material eta k",
        "roughconductor": f"specular_reflectance material eta k {_GGX}",
        "plastic": f"diffuse_reflectance specular_reflectance nonlinear {_IOR}",
        "roughplastic": f"diffuse_reflectance specular_reflectance nonlinear {_IOR} {_GGX}",
        "null": "",
        "twosided": "",
        "mask": "opacity",
        "blendbsdf": "weight",
        "rectangle": "to_world face_normals flip_normals",
        "cube": "to_world face_normals flip_normals",
        "sphere": "to_world flip_normals center radius",
        "disk": "to_world flip_normals",
        "cylinder": "to_world flip_normals radius p0 p1",
        "ply": _MESH,
        "obj": _MESH,
        "serialized": f"{_MESH} shape_index",
        "bitmap": f"filename raw channel filter_type wrap_mode to_uv format accel {FACTOR}",
        "checkerboard": "to_uv color0 color1",
        "mesh_attribute": "scale name",
        "area": "radiance to_world sampling_weight",
        "point": "intensity position to_world sampling_weight",
        "spot": "intensity to_world cutoff_angle beam_width texture sampling_weight",
        "directional": "direction to_world irradiance sampling_weight",
        "constant": "radiance to_world sampling_weight",
        "sunsky": "to_world sampling_weight turbidity albedo sun_direction sun_scale sky_scale sun_aperture "
        "complex_sun",
        "envmap": "scale to_world sampling_weight filename mis_compensation",
    }.items()
}
"""Plugins of both Mitsubas, with the properties that Mitsuba 3.9 asks for (`channel` and FACTOR are gibench's)."""

PROPERTIES = (
    "float",
    "integer",
    "boolean",
    "string",
    "rgb",
    "spectrum",
    "vector",
    "point",
    "transform",
    "texture",
)


def unknown_properties(root: Node, note: Note) -> None:
    """Properties that a plugin does not know are left out, as they had no effect."""
    for node in list(old(root)):
        known = KNOWN.get(node.type)
        if known is None or node.tag not in ("bsdf", "shape", "texture", "emitter"):
            continue
        for child in node.nodes(*PROPERTIES):
            name = child.get("name", "")
            if name not in known:
                node.remove(child)
                note(child, f"{name or child.tag} of {node.type} is left out, as it has no such property")
