"""Old scene files made new: what Mitsuba 0.5 and 0.6 wrote and Mitsuba 3 no longer reads, rule by rule.

Each rule is one function over the whole tree that notes what it did. Those of LEGACY apply to files of a version below
2, the others to every file. What has no counterpart becomes the nearest thing that there is, with a warning.

Reference: the manuals of Mitsuba 0.6 (2014) and Mitsuba 3.9, plugin by plugin.
"""

from __future__ import annotations

from gibench.generators.imported.changes import Change
from gibench.generators.imported.reading import SceneTree
from gibench.generators.imported.shipped import check_plugins
from gibench.generators.imported.tree import Node
from gibench.generators.imported.upgrading import (
    colors,
    left_out,
    lights,
    names,
    properties,
    surfaces,
    textures,
    thin_layers,
)
from gibench.generators.imported.upgrading.rules import Rule


def upgrade(tree: SceneTree) -> list[Change]:
    """Rewrite a scene for Mitsuba 3, in place, and say what was changed.

    Raises SceneFileError for plugins that do not exist and have no counterpart, with their place in the file.
    """
    changes = list(tree.changes)
    for rule in RULES:
        name = rule.__name__

        def note(node: Node, what: str, loss: bool = False, name: str = name) -> None:
            changes.append(Change(name, what, node.where, loss))

        rule(tree.root, note)
    check_plugins(tree.root)
    tree.root.set("version", "3.0.0")
    return changes


LEGACY: tuple[Rule, ...] = (
    names.property_names,
    names.transform_tags,
    names.rotation_axes,
    names.animations,
    names.gone_settings,
    colors.intents,
    colors.srgb_tags,
    colors.scalar_spectra,
    colors.black_bodies,
    surfaces.conductors,
    surfaces.phong,
    surfaces.ward,
    surfaces.rough_diffuse,
    surfaces.mixtures,
    thin_layers.scattering_layers,
    thin_layers.woven_cloth,
    surfaces.coatings,
    surfaces.translucent,
    surfaces.normal_maps,
    surfaces.distributions,
    textures.scaled_textures,
    textures.bitmap_gamma,
    textures.texture_lookups,
    textures.grid_textures,
    textures.drawn_lines,
    lights.sun_and_sky,
    lights.gone_lights,
    properties.unknown_properties,
)
"""Of files of Mitsuba 0.x alone, each of which may include one of another version."""

ALWAYS_FIRST: tuple[Rule, ...] = (colors.hexadecimal_colors, names.empty_rotations)
ALWAYS_LAST: tuple[Rule, ...] = (left_out.media, left_out.integrators, left_out.films)

RULES = (*ALWAYS_FIRST, *LEGACY, *ALWAYS_LAST)
"""In the order in which they apply."""
