"""Old scene files made new: what Mitsuba 0.5 and 0.6 wrote and Mitsuba 3 no longer reads, rule by rule.

Each rule is one function over the whole tree that notes what it did. Those of LEGACY apply to files of a version below
2, those of ALWAYS to every file. What has no counterpart becomes the nearest thing that there is, with a warning.

Reference: the manuals of Mitsuba 0.6 (2014) and Mitsuba 3.9, plugin by plugin.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import Node, SceneTree, new
from gibench.generators.imported.shipped import check_plugins
from gibench.generators.imported.transforms import triple


@dataclass(frozen=True)
class Change:
    """What a rule did somewhere. rule: its name. what: in words. where: "scene.xml:12". loss: the image may differ."""

    rule: str
    what: str
    where: str
    loss: bool = False


Note = Callable[..., None]
"""note(node, what, loss=False)"""

Rule = Callable[[Node, Note], None]
"""Rewrites the tree below a `<scene>` in place."""

_ONE_NUMBER = re.compile(r"\s*[-+.\deE]+\s*")


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


def _plugins(root: Node, tag: str, *types: str) -> list[Node]:
    return [n for n in root.everything() if n.tag == tag and (not types or n.type in types)]


def _parents(root: Node) -> dict[int, Node]:
    return {id(child): node for node in root.everything() for child in node}


def _become(node: Node, type: str, *children: Node) -> None:
    """Make a plugin another one with these children alone; it keeps its id and name."""
    node.set("type", type)
    node[:] = children


def _setting(like: Node, tag: str, name: str, value: object) -> Node:
    return new(tag, like, name=name, value=str(value))


def _number(node: Node, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SceneFileError(f"{node.where}: '{text}' is no number")
    return value


def _color(node: Node | None, default: float) -> tuple[float, float, float] | None:
    """A constant colour; None for a texture."""
    if node is None:
        return default, default, default
    words = re.split(r"[\s,]+", node.get("value", "").strip())
    if node.tag not in ("rgb", "float", "spectrum") or len(words) not in (1, 3) or ":" in words[0]:
        return None
    numbers = [_number(node, word) for word in words]
    return (numbers[0], numbers[0], numbers[0]) if len(numbers) == 1 else (numbers[0], numbers[1], numbers[2])


def _rgb(like: Node, name: str, color: tuple[float, ...]) -> Node:
    return new("rgb", like, name=name, value=" ".join(repr(round(c, 9)) for c in color))


# Names


def property_names(root: Node, note: Note) -> None:
    """camelCase names of properties become snake_case."""
    for node in root.everything():
        name = node.get("name")
        # The name of a material inside a mesh is that of a group in its file.
        if name is None or name == name.lower() or node.tag in ("default", "bsdf"):
            continue
        # IOR first, or its letters would be parted.
        better = re.sub(r"(?<=[a-z0-9])([A-Z])", r"_\1", name.replace("IOR", "Ior")).lower()
        node.set("name", better)
        note(node, f"{name} is {better}")


def transform_tags(root: Node, note: Note) -> None:
    """`<lookAt>` becomes `<lookat>`."""
    for node in root.everything():
        if node.tag == "lookAt":
            node.tag = "lookat"
            note(node, "<lookAt> is <lookat>")


def rotation_axes(root: Node, note: Note) -> None:
    """Axes of rotations become unit vectors, which they were taken for."""
    for node in root.everything():
        if node.tag != "rotate":
            continue
        axis = triple(node, 0.0)
        length = float(np.linalg.norm(axis))
        if length > 0 and abs(length - 1) > 1e-6:
            node.attrib.pop("value", None)
            node.attrib.update(zip("xyz", map(repr, (axis / length).tolist()), strict=True))
            note(node, "the axis of a rotation is a unit vector")


def animations(root: Node, note: Note) -> None:
    """Of an `<animation>` the first transformation stays: nothing moves here."""
    for node in root.everything():
        if node.tag == "animation":
            first = node.nodes("transform")[:1]
            name = node.get("name", "to_world")
            node.tag = "transform"
            node.attrib = {"name": name}
            node[:] = list(first[0]) if first else []
            note(node, "an animation stands still at its first transformation", loss=True)


GONE = ("max_smooth_angle", "srgb", "collapse", "fast_fresnel", "kd_intersection_cost", "kd_traversal_cost")
"""Settings without a counterpart: of smoothing meshes, of speed."""


def gone_settings(root: Node, note: Note) -> None:
    """Settings of shapes and materials that Mitsuba 3 does not know are left out."""
    for node in root.everything():
        for child in node.nodes("float", "integer", "boolean", "string"):
            if node.tag in ("shape", "bsdf") and child.get("name") in GONE:
                node.remove(child)
                note(child, f"{child.get('name')} is left out", loss=child.get("name") == "max_smooth_angle")


# Colours


def srgb_tags(root: Node, note: Note) -> None:
    """`<srgb>` becomes linear `<rgb>`."""
    for node in root.everything():
        if node.tag == "srgb":
            node.tag = "rgb"
            text = node.get("value", "")
            if not text.strip().startswith("#"):
                color = _color(node, 0.0)
                assert color is not None
                node.set("value", " ".join(repr(round(_decoded(c), 9)) for c in color))
            note(node, f"<srgb> {text} is linear <rgb> {node.get('value')}")


def hexadecimal_colors(root: Node, note: Note) -> None:
    """#rrggbb, which is sRGB as on web pages, becomes linear numbers."""
    for node in root.everything():
        text = node.get("value", "").strip()
        if node.tag in ("rgb", "spectrum") and text.startswith("#"):
            if not re.fullmatch(r"#[0-9a-fA-F]{6}", text):
                raise SceneFileError(f"{node.where}: '{text}' is no colour: write #rrggbb or three numbers")
            parts = [_decoded(int(text[i : i + 2], 16) / 255) for i in (1, 3, 5)]
            node.tag = "rgb"
            node.set("value", " ".join(repr(round(c, 9)) for c in parts))
            note(node, f"{text} is {node.get('value')}")


def _decoded(value: float) -> float:
    """IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def scalar_spectra(root: Node, note: Note) -> None:
    """A `<spectrum>` of one number becomes grey.

    Mitsuba 0.x rendered such a light white; Mitsuba 3 takes it for an equal-energy spectrum, which is
    (1.205, 0.948, 0.909) in Rec. 709.
    """
    for node in root.everything():
        if node.tag == "spectrum" and _ONE_NUMBER.fullmatch(node.get("value", "")):
            node.tag = "rgb"
            note(node, f"a spectrum of {node.get('value')} is grey")


# Surfaces


def conductors(root: Node, note: Note) -> None:
    """What is outside of a metal (extEta) is folded into its own index of refraction."""
    for node in _plugins(root, "bsdf", "conductor", "roughconductor"):
        outside = node.property("ext_eta")
        if outside is None:
            continue
        node.remove(outside)
        text = outside.get("value", "")
        ior = {"air": 1.000277, "vacuum": 1.0, "water": 1.333}.get(text)
        if ior is None:
            ior = _number(outside, text)
        eta, k = node.property("eta"), node.property("k")
        colors = [_color(part, 0.0) for part in (eta, k) if part is not None]
        if abs(ior - 1) < 1e-3:
            note(outside, "extEta of air is left out")
        elif len(colors) == 2 and None not in colors and eta is not None and k is not None:
            for part, color in zip((eta, k), colors, strict=True):
                assert color is not None
                part.tag = "rgb"
                part.set("value", " ".join(repr(c / ior) for c in color))
            note(outside, f"eta and k are divided by extEta {text}")
        else:
            note(outside, f"extEta {text} of a metal by name is left out", loss=True)


def phong(root: Node, note: Note) -> None:
    """`phong` becomes a blend of `diffuse` and a rough mirror of the same albedos.

    α = √(2 / (n + 2)) gives the microfacets the same spread (Walter et al. 2007, section 5.2).
    """
    for node in _plugins(root, "bsdf", "phong"):
        exponent = (
            _number(node, node.value("exponent", "30")) if node.property("exponent") is not None else 30.0
        )
        alpha = math.sqrt(2 / (exponent + 2))
        _lobes(node, alpha, alpha)
        note(node, f"phong is diffuse and a GGX lobe of roughness {alpha:.3g}", loss=True)


def ward(root: Node, note: Note) -> None:
    """`ward` becomes a blend of `diffuse` and a rough mirror of its roughness."""
    for node in _plugins(root, "bsdf", "ward"):
        u, v = (_number(node, node.value(name, "0.1")) for name in ("alpha_u", "alpha_v"))
        _lobes(node, u, v)
        note(node, "ward is diffuse and a GGX lobe", loss=True)


def _lobes(node: Node, alpha_u: float, alpha_v: float) -> None:
    """A diffuse and a glossy lobe of the albedos of a legacy plugin with both."""
    diffuse, specular = node.property("diffuse_reflectance"), node.property("specular_reflectance")
    kd, ks = _color(diffuse, 0.5), _color(specular, 0.2)
    matte, shiny = new("bsdf", node, type="diffuse"), new("bsdf", node, type="roughconductor")
    shiny[:] = [
        _setting(node, "string", "material", "none"),
        _setting(node, "string", "distribution", "ggx"),
        _setting(node, "float", "alpha_u", repr(alpha_u)),
        _setting(node, "float", "alpha_v", repr(alpha_v)),
    ]
    share = 0.5
    if kd is not None and ks is not None and sum(kd) + sum(ks) > 0:
        share = sum(ks) / (sum(kd) + sum(ks))
        # Where all weight is on one lobe, the other is black and its colour does not matter.
        kd = tuple(min(1.0, c / max(1 - share, 1e-6)) for c in kd)  # type: ignore[assignment]
        ks = tuple(min(1.0, c / max(share, 1e-6)) for c in ks)  # type: ignore[assignment]
    for bsdf, name, color, part in (
        (matte, "reflectance", kd, diffuse),
        (shiny, "specular_reflectance", ks, specular),
    ):
        if color is not None:
            bsdf.append(_rgb(node, name, color))
        elif part is not None:
            part.set("name", name)
            bsdf.append(part)
    _become(node, "blendbsdf", _setting(node, "float", "weight", repr(round(share, 6))), matte, shiny)


def rough_diffuse(root: Node, note: Note) -> None:
    """`roughdiffuse` (Oren and Nayar) becomes `diffuse`."""
    for node in _plugins(root, "bsdf", "roughdiffuse"):
        color = node.property("reflectance", "diffuse_reflectance")
        if color is not None:
            color.set("name", "reflectance")
        _become(node, "diffuse", *([color] if color is not None else []))
        note(node, "roughdiffuse is diffuse", loss=True)


def coatings(root: Node, note: Note) -> None:
    """A coat over a diffuse surface becomes (rough) plastic; over anything else it is left out."""
    for node in _plugins(root, "bsdf", "coating", "roughcoating"):
        inner = next(iter(node.nodes("bsdf", "ref")), None)
        if inner is None:
            raise SceneFileError(f"{node.where}: {node.type} coats nothing: put a <bsdf> inside")
        old = node.type
        core = inner.nodes("bsdf")[0] if inner.type == "twosided" and inner.nodes("bsdf") else inner
        if core.tag == "bsdf" and core.type == "diffuse":
            color = core.property("reflectance")
            if color is not None:
                color.set("name", "diffuse_reflectance")
            kept = [
                p
                for p in (node.property(n) for n in ("int_ior", "ext_ior", "alpha", "distribution"))
                if p is not None
            ]
            if old == "coating":
                kept = [p for p in kept if p.get("name") in ("int_ior", "ext_ior")]
            _become(
                node,
                "plastic" if old == "coating" else "roughplastic",
                *kept,
                *([color] if color is not None else []),
            )
            note(node, f"{old} over diffuse is {node.type}", loss=True)
        elif inner.tag == "ref":
            # Something that stands for what it points at; nothing in Mitsuba 3 does only that.
            _become(node, "mask", _setting(node, "float", "opacity", 1), inner)
            note(node, f"{old} is left out, what it coats stays", loss=True)
        else:
            children = list(inner)
            _become(node, inner.type, *[c for c in children if isinstance(c, Node)])
            note(node, f"{old} is left out, what it coats stays", loss=True)


def mixtures(root: Node, note: Note) -> None:
    """`mixturebsdf` becomes nested `blendbsdf`."""
    for node in _plugins(root, "bsdf", "mixturebsdf"):
        parts = node.nodes("bsdf", "ref")
        text = node.value("weights")
        weights = [_number(node, word) for word in re.split(r"[\s,]+", text.strip()) if word]
        if len(parts) < 1 or len(weights) != len(parts) or min(weights) < 0 or sum(weights) <= 0:
            raise SceneFileError(f"{node.where}: mixturebsdf has {len(parts)} parts and the weights '{text}'")
        total = sum(weights)
        blended, so_far = parts[0], weights[0]
        for part, weight in zip(parts[1:], weights[1:], strict=True):
            so_far += weight
            outer = new("bsdf", node, type="blendbsdf")
            outer[:] = [
                _setting(node, "float", "weight", repr(weight / so_far if so_far else 0)),
                blended,
                part,
            ]
            blended = outer
        if len(parts) == 1:
            _become(node, "mask", _setting(node, "float", "opacity", 1), blended)
        else:
            _become(node, "blendbsdf", *[c for c in blended if isinstance(c, Node)])
        note(node, f"mixturebsdf of {len(parts)} is blendbsdf", loss=abs(total - 1) > 1e-3)


def translucent(root: Node, note: Note) -> None:
    """`difftrans` becomes `principledthin` that lets all light through diffusely."""
    for node in _plugins(root, "bsdf", "difftrans"):
        color = node.property("transmittance")
        kept = [_setting(node, "float", "diff_trans", 2), _setting(node, "float", "spec_trans", 0)]
        if color is not None:
            color.set("name", "base_color")
            kept.append(color)
        _become(node, "principledthin", *kept)
        note(node, "difftrans is principledthin", loss=True)


def distributions(root: Node, note: Note) -> None:
    """Microfacet distributions that are gone become the nearest: phong is beckmann, as (Ashikhmin) is ggx."""
    for node in root.everything():
        if (
            node.tag == "string"
            and node.get("name") == "distribution"
            and node.get("value") in ("phong", "as")
        ):
            better = {"phong": "beckmann", "as": "ggx"}[node.get("value", "")]
            note(node, f"distribution {node.get('value')} is {better}", loss=True)
            node.set("value", better)


def bump_scale(root: Node, note: Note) -> None:
    """A `scale` texture in a `bumpmap` becomes its strength; around any other texture it is left out."""
    parents = _parents(root)
    for node in _plugins(root, "texture", "scale"):
        inner = next(iter(node.nodes("texture", "ref")), None)
        if inner is None:
            raise SceneFileError(f"{node.where}: a scale texture without a texture inside")
        strength, parent = node.value("scale", "1"), parents[id(node)]
        if node.get("name"):
            inner.set("name", node.get("name", ""))
        parent[list(parent).index(node)] = inner
        parents[id(inner)] = parent
        if parent.type == "bumpmap":
            parent.append(_setting(node, "float", "scale", strength))
            note(node, f"a scale of {strength} is that of the bumpmap")
        else:
            note(node, f"a texture's scale of {strength} is left out", loss=True)


# Textures


def bitmap_gamma(root: Node, note: Note) -> None:
    """gamma = 1 of a bitmap becomes raw; any other is what the file itself says."""
    for node in _plugins(root, "texture", "bitmap") + _plugins(root, "emitter", "envmap"):
        gamma = node.property("gamma")
        if gamma is None:
            continue
        node.remove(gamma)
        value = _number(gamma, gamma.get("value", ""))
        if value == 1 and node.tag == "texture":
            node.append(_setting(gamma, "boolean", "raw", "true"))
            note(gamma, "gamma 1 is raw")
        else:
            note(gamma, f"gamma {value:g} is left to the image", loss=value not in (-1, 1, 2.2))


def texture_lookups(root: Node, note: Note) -> None:
    """Filters and wrap modes by their new names; shifts and scales of UVs as a transformation."""
    for node in _plugins(root, "texture"):
        kind = node.property("filter_type")
        if kind is not None and kind.get("value") not in ("bilinear", "nearest"):
            note(kind, f"filter {kind.get('value')} is bilinear", loss=True)
            kind.set("value", "bilinear")
        wraps = [w for w in (node.property(n) for n in ("wrap_mode_u", "wrap_mode_v")) if w is not None]
        if wraps:
            for wrap in wraps:
                node.remove(wrap)
            if node.property("wrap_mode") is None:
                node.append(_setting(node, "string", "wrap_mode", wraps[0].get("value")))
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
            value = {n: _number(p, p.get("value", "")) for n, p in given.items()}
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
    for node in _plugins(root, "texture", "gridtexture", "vertexcolors"):
        if node.type == "vertexcolors":
            _become(node, "mesh_attribute", _setting(node, "string", "name", "vertex_color"))
            note(node, "vertexcolors is mesh_attribute")
        else:
            width = node.property("line_width")
            if width is not None:
                node.remove(width)
            node.set("type", "checkerboard")
            note(node, "gridtexture is checkerboard", loss=True)


# Lights


def sun_and_sky(root: Node, note: Note) -> None:
    """`sun`, `sky` and `sunsky` become Mitsuba 3's `sunsky`, whose zenith is +z where it was +y."""
    renamed = {"sky": "sunsky", "sun": "sunsky", "sunsky": "sunsky"}
    gone = ("stretch", "resolution", "extend", "ext_resolution", "sampling_weight")
    for node in _plugins(root, "emitter", "sun", "sky", "sunsky"):
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
            factor_of_radius = _number(radius, radius.get("value", ""))
            aperture = 0.5358 * factor_of_radius
            if aperture > 0:
                node.append(_setting(radius, "float", "sun_aperture", repr(aperture)))
                note(radius, f"sunRadiusScale {factor_of_radius:g} is an aperture of {aperture:.4g} degrees")
            else:
                # A sun without size was a directional light of the same power.
                note(radius, "sunRadiusScale 0 is a sun of its true size", loss=True)
        for part_name, applies in (("sun_scale", old == "sky"), ("sky_scale", old == "sun")):
            if applies:
                node.append(_setting(node, "float", part_name, 0))
            elif node.property(part_name) is None and factor != "1":
                node.append(_setting(node, "float", part_name, factor))
        node.set("type", renamed[old])
        _zenith_up(node)
        note(node, f"{old} with its zenith at +y is sunsky with its zenith at +z, turned", loss=True)


def _zenith_up(node: Node) -> None:
    transform = node.property("to_world")
    if transform is None:
        transform = new("transform", node, name="to_world")
        node.append(transform)
    # Operations apply in their order: first +z to +y, then what the scene says.
    transform.insert(0, new("rotate", node, x="1", angle="-90"))


def gone_lights(root: Node, note: Note) -> None:
    """`collimated` becomes a narrow `spot`."""
    for node in _plugins(root, "emitter", "collimated"):
        power, transform = node.property("power"), node.property("to_world")
        cutoff = 1.0
        solid_angle = 2 * math.pi * (1 - math.cos(math.radians(cutoff)))
        color = _color(power, 1.0) or (1.0, 1.0, 1.0)
        _become(
            node,
            "spot",
            _rgb(node, "intensity", tuple(c / solid_angle for c in color)),
            _setting(node, "float", "cutoff_angle", cutoff),
            *([transform] if transform is not None else []),
        )
        note(node, "collimated is a spot of one degree", loss=True)


# The rest


def media(root: Node, note: Note) -> None:
    """Media and subsurface scattering are left out."""
    for node in list(root.everything()):
        for child in node.nodes():
            inside = child.tag in ("medium", "subsurface") or (
                child.tag == "ref" and child.get("name") in ("interior", "exterior")
            )
            if inside:
                node.remove(child)
                note(child, f"<{child.tag}> is left out: gibench has no media", loss=True)


def integrators(root: Node, note: Note) -> None:
    """Every integrator becomes a path tracer of the same depth."""
    for node in root.nodes("integrator"):
        if node.type == "path":
            continue
        depth = node.property("max_depth")
        note(node, f"integrator {node.type} is path", loss=node.type in ("direct", "ao", "depth"))
        _become(node, "path", *([depth] if depth is not None else []))


def films(root: Node, note: Note) -> None:
    """Films and samplers are those of whoever renders the scene: of a film the size stays, of a sampler nothing."""
    for sensor in root.nodes("sensor"):
        for part in sensor.nodes("film", "sampler"):
            if part.tag == "sampler":
                sensor.remove(part)
                continue
            if part.type != "hdrfilm":
                note(part, f"{part.type} is hdrfilm")
            if part.property("high_quality_edges") is not None:
                note(part, "high_quality_edges is left out")
            part[:] = [p for p in (part.property("width"), part.property("height")) if p is not None]
            part.set("type", "hdrfilm")


LEGACY: tuple[Rule, ...] = (
    property_names,
    transform_tags,
    rotation_axes,
    animations,
    gone_settings,
    srgb_tags,
    scalar_spectra,
    conductors,
    phong,
    ward,
    rough_diffuse,
    mixtures,
    coatings,
    translucent,
    distributions,
    bump_scale,
    bitmap_gamma,
    texture_lookups,
    grid_textures,
    sun_and_sky,
    gone_lights,
)
ALWAYS: tuple[Rule, ...] = (hexadecimal_colors, media, integrators, films)
