"""Textures and how they are looked up."""

from __future__ import annotations

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import Node, new
from gibench.generators.imported.upgrading.rules import Note, become, number, parents_of, plugins, setting


def bump_scale(root: Node, note: Note) -> None:
    """A `scale` texture in a `bumpmap` becomes its strength; around any other texture it is left out."""
    parents = parents_of(root)
    for node in plugins(root, "texture", "scale"):
        inner = next(iter(node.nodes("texture", "ref")), None)
        if inner is None:
            raise SceneFileError(f"{node.where}: a scale texture without a texture inside")
        strength, parent = node.value("scale", "1"), parents[id(node)]
        if node.get("name"):
            inner.set("name", node.get("name", ""))
        parent[list(parent).index(node)] = inner
        parents[id(inner)] = parent
        if parent.type == "bumpmap":
            parent.append(setting(node, "float", "scale", strength))
            note(node, f"a scale of {strength} is that of the bumpmap")
        else:
            note(node, f"a texture's scale of {strength} is left out", loss=True)


def bitmap_gamma(root: Node, note: Note) -> None:
    """gamma = 1 of a bitmap becomes raw; any other is what the file itself says."""
    for node in plugins(root, "texture", "bitmap") + plugins(root, "emitter", "envmap"):
        gamma = node.property("gamma")
        if gamma is None:
            continue
        node.remove(gamma)
        value = number(gamma, gamma.get("value", ""))
        if value == 1 and node.tag == "texture":
            node.append(setting(gamma, "boolean", "raw", "true"))
            note(gamma, "gamma 1 is raw")
        else:
            note(gamma, f"gamma {value:g} is left to the image", loss=value not in (-1, 1, 2.2))


def texture_lookups(root: Node, note: Note) -> None:
    """Filters and wrap modes by their new names; shifts and scales of UVs as a transformation."""
    for node in plugins(root, "texture"):
        kind = node.property("filter_type")
        if kind is not None and kind.get("value") not in ("bilinear", "nearest"):
            note(kind, f"filter {kind.get('value')} is bilinear", loss=True)
            kind.set("value", "bilinear")
        wraps = [w for w in (node.property(n) for n in ("wrap_mode_u", "wrap_mode_v")) if w is not None]
        if wraps:
            for wrap in wraps:
                node.remove(wrap)
            if node.property("wrap_mode") is None:
                node.append(setting(node, "string", "wrap_mode", wraps[0].get("value")))
            note(node, "wrapModeU and wrapModeV are wrap_mode", loss=len({w.get("value") for w in wraps}) > 1)
        wrap_mode = node.property("wrap_mode")
        if wrap_mode is not None and wrap_mode.get("value") not in ("repeat", "mirror", "clamp"):
            note(wrap_mode, f"wrap mode {wrap_mode.get('value')} is clamp", loss=True)
            wrap_mode.set("value", "clamp")
        for gone in ("max_anisotropy", "cache"):
            part = node.property(gone)
            if part is not None:
                node.remove(part)
                note(part, f"{gone} is left out")
        names = ("uscale", "vscale", "uoffset", "voffset")
        given = {n: p for n in names if (p := node.property(n)) is not None}
        if given:
            value = {n: number(p, p.get("value", "")) for n, p in given.items()}
            for part in given.values():
                node.remove(part)
            transform = new("transform", node, name="to_uv")
            transform[:] = [
                new("scale", node, x=str(value.get("uscale", 1)), y=str(value.get("vscale", 1))),
                new("translate", node, x=str(value.get("uoffset", 0)), y=str(value.get("voffset", 0))),
            ]
            node.append(transform)
            note(node, "uscale, vscale, uoffset and voffset are to_uv")


def grid_textures(root: Node, note: Note) -> None:
    """`gridtexture` becomes `checkerboard`, `vertexcolors` a mesh attribute."""
    for node in plugins(root, "texture", "gridtexture", "vertexcolors"):
        if node.type == "vertexcolors":
            become(node, "mesh_attribute", setting(node, "string", "name", "vertex_color"))
            note(node, "vertexcolors is mesh_attribute")
        else:
            width = node.property("line_width")
            if width is not None:
                node.remove(width)
            node.set("type", "checkerboard")
            note(node, "gridtexture is checkerboard", loss=True)
