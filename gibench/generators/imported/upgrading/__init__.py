"""Old scene files made new: what Mitsuba 0.5 and 0.6 wrote and Mitsuba 3 no longer reads, rule by rule.

Each rule is one function over the whole tree that notes what it did. Those of LEGACY apply to files of a version below
2, those of ALWAYS to every file. What has no counterpart becomes the nearest thing that there is, with a warning.

Reference: the manuals of Mitsuba 0.6 (2014) and Mitsuba 3.9, plugin by plugin.
"""

from __future__ import annotations

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import Node, SceneTree
from gibench.generators.imported.shipped import check_plugins
from gibench.generators.imported.upgrading import colors, left_out, lights, names, surfaces, textures
from gibench.generators.imported.upgrading.rules import Change, Rule


def upgrade(tree: SceneTree) -> list[Change]:
    """Rewrite a scene for Mitsuba 3, in place, and say what was changed.

    Raises SceneFileError for plugins that do not exist and have no counterpart, with their place in the file.
    """
    changes: list[Change] = []
    legacy = is_legacy(tree.root)
    for rule in (*LEGACY, *ALWAYS) if legacy else ALWAYS:
        name = rule.__name__

        def note(node: Node, what: str, loss: bool = False, name: str = name) -> None:
            changes.append(Change(name, what, node.where, loss))

        rule(tree.root, note)
    check_plugins(tree.root)
    tree.root.set("version", "3.0.0")
    return changes


def is_legacy(root: Node) -> bool:
    """Whether a scene was written for Mitsuba 0.x. Raises SceneFileError for a version that is none."""
    version = root.get("version", "")
    major = version.split(".")[0]
    if not major.isdigit():
        raise SceneFileError(
            f'{root.where}: <scene> has no version such as "0.5.0" or "3.0.0": add the one it is for'
        )
    return int(major) < 2


LEGACY: tuple[Rule, ...] = (
    names.property_names,
    names.transform_tags,
    names.rotation_axes,
    names.animations,
    names.gone_settings,
    colors.srgb_tags,
    colors.scalar_spectra,
    surfaces.conductors,
    surfaces.phong,
    surfaces.ward,
    surfaces.rough_diffuse,
    surfaces.mixtures,
    surfaces.coatings,
    surfaces.translucent,
    surfaces.distributions,
    textures.bump_scale,
    textures.bitmap_gamma,
    textures.texture_lookups,
    textures.grid_textures,
    lights.sun_and_sky,
    lights.gone_lights,
)
ALWAYS: tuple[Rule, ...] = (colors.hexadecimal_colors, left_out.media, left_out.integrators, left_out.films)
