"""Textures and how they are looked up."""

from __future__ import annotations

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node, copied, new, parents_of, replaced
from gibench.generators.imported.upgrading.rules import become, constant_color, number, plugins, rgb, setting


def scaled_textures(root: Node, note: Note) -> None:
    """A `scale` texture in a `bumpmap` becomes its strength; around any other texture the colours are multiplied.

    Of a bitmap the factor stays as its property FACTOR, until `images.multiplied` has made an image of the product.
    """
    by_id = {node.get("id"): node for node in root.everything() if node.tag != "ref" and node.get("id")}
    parents = parents_of(root)
    for node in plugins(root, "texture", "scale"):
        inner = next(iter(node.nodes("texture", "ref")), None)
        if inner is None:
            raise SceneFileError(f"{node.where}: a scale texture without a texture inside")
        factor, parent = node.property("scale"), parents[id(node)]
        color = constant_color(factor, 1.0)
        text = "1" if factor is None else factor.get("value", "")
        if color is None:
            raise SceneFileError(
                f"{node.where}: the scale '{text}' of a texture is no colour: write one or three numbers"
            )
        if parent.type == "bumpmap":
            _in_the_place_of(node, inner, parent, parents)
            parent.append(setting(node, "float", "scale", repr(sum(color) / 3)))
            note(node, f"a scale of {text} is that of the bumpmap")
            continue
        if inner.tag == "ref":
            target = by_id.get(inner.get("id"))
            if target is None or target.tag != "texture":
                raise SceneFileError(
                    f"{node.where}: nothing has the id '{inner.get('id')}' that <ref> asks for"
                )
            inner = copied(target)
            inner.attrib.pop("id", None)
        _in_the_place_of(node, inner, parent, parents)
        if _multiplied(inner, color):
            note(node, f"a texture's scale of {text} is multiplied into it")
        else:
            note(node, f"the scale of {text} of a {inner.type} texture is left out", loss=True)


FACTOR = "gibench_factor"
"""Of a bitmap: what its values are multiplied by before Mitsuba sees them."""

COLORS_OF = {"checkerboard": {"color0": 0.4, "color1": 0.2}, "gridtexture": {"color0": 0.2, "color1": 0.4}}
"""Names and defaults of the colours of textures; in Mitsuba 0.6 gridtexture has the line second."""


def _in_the_place_of(node: Node, inner: Node, parent: Node, parents: dict[int, Node]) -> None:
    for key in ("name", "id"):
        if node.get(key):
            inner.set(key, node.get(key, ""))
    replaced(parent, node, inner)
    parents[id(inner)] = parent


def _multiplied(texture: Node, factor: tuple[float, float, float]) -> bool:
    """Multiply the colours of a texture, in place; whether that can be done."""
    if texture.type == "bitmap":
        before = constant_color(texture.property(FACTOR), 1.0) or (1.0, 1.0, 1.0)
        for gone in [part for part in texture.nodes() if part.get("name") == FACTOR]:
            texture.remove(gone)
        texture.append(rgb(texture, FACTOR, tuple(a * b for a, b in zip(before, factor, strict=True))))
        return True
    if texture.type == "scale":  # one in another: the outer factor goes on to what is inside
        own = texture.property("scale")
        before = constant_color(own, 1.0) or (1.0, 1.0, 1.0)
        if own is not None:
            texture.remove(own)
        texture.append(rgb(texture, "scale", tuple(a * b for a, b in zip(before, factor, strict=True))))
        return True
    colors = COLORS_OF.get(texture.type, {})
    for name, default in colors.items():
        part = texture.property(name)
        color = constant_color(part, default)
        if color is None:
            return False
        if part is not None:
            texture.remove(part)
        texture.append(rgb(texture, name, tuple(a * b for a, b in zip(color, factor, strict=True))))
    return bool(colors)


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


def drawn_lines(root: Node, note: Note) -> None:
    """`wireframe` becomes the colour between its lines, `curvature` grey: nothing draws either on a surface."""
    by_use = parents_of(root)
    for node in plugins(root, "texture", "wireframe", "curvature"):
        color = constant_color(node.property("interior_color"), 0.5) if node.type == "wireframe" else None
        flat = rgb(node, "value", color or (0.5, 0.5, 0.5))
        what = f"{node.type} is the plain colour {flat.get('value')}"
        parent = by_use[id(node)]
        if node.get("id"):  # others may refer to it, and to a texture alone
            become(
                node,
                "checkerboard",
                rgb(node, "color0", color or (0.5,) * 3),
                rgb(node, "color1", color or (0.5,) * 3),
            )
        else:
            flat.set("name", node.get("name", ""))
            replaced(parent, node, flat)
        note(node, what, loss=True)


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
