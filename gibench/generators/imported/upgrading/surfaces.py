"""Materials that are gone, as the nearest that there is."""

from __future__ import annotations

import math
import re

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node, copied, new, parents_of, wrapped
from gibench.generators.imported.upgrading.rules import (
    become,
    constant_color,
    number,
    old,
    plugins,
    rgb,
    setting,
)


def conductors(root: Node, note: Note) -> None:
    """The medium outside of a metal (extEta) is folded into its own index of refraction."""
    for node in plugins(root, "bsdf", "conductor", "roughconductor"):
        outside = node.property("ext_eta")
        if outside is None:
            continue
        node.remove(outside)
        text = outside.get("value", "")
        ior = {"air": 1.000277, "vacuum": 1.0, "water": 1.333}.get(text)
        if ior is None:
            ior = number(outside, text)
        if ior <= 0:
            raise SceneFileError(f"{outside.where}: extEta is {text}: an index of refraction is above 0")
        eta, k = node.property("eta"), node.property("k")
        colors = [constant_color(part, 0.0) for part in (eta, k) if part is not None]
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
    for node in plugins(root, "bsdf", "phong"):
        exponent = (
            number(node, node.value("exponent", "30")) if node.property("exponent") is not None else 30.0
        )
        if not exponent >= 0:
            raise SceneFileError(f"{node.where}: phong has an exponent of {exponent:g}: give one from 0")
        alpha = math.sqrt(2 / (exponent + 2))
        lobes(node, alpha, alpha)
        note(node, f"phong is diffuse and a GGX lobe of roughness {alpha:.3g}", loss=True)


def ward(root: Node, note: Note) -> None:
    """`ward` becomes a blend of `diffuse` and a rough mirror of its roughness."""
    for node in plugins(root, "bsdf", "ward"):
        u, v = (number(node, node.value(name, "0.1")) for name in ("alpha_u", "alpha_v"))
        lobes(node, u, v)
        note(node, "ward is diffuse and a GGX lobe", loss=True)


def lobes(node: Node, alpha_u: float, alpha_v: float) -> None:
    """A diffuse and a glossy lobe of the albedos of a legacy plugin with both."""
    diffuse, specular = node.property("diffuse_reflectance"), node.property("specular_reflectance")
    kd, ks = constant_color(diffuse, 0.5), constant_color(specular, 0.2)
    matte, shiny = new("bsdf", node, type="diffuse"), new("bsdf", node, type="roughconductor")
    shiny[:] = [
        setting(node, "string", "material", "none"),
        setting(node, "string", "distribution", "ggx"),
        setting(node, "float", "alpha_u", repr(alpha_u)),
        setting(node, "float", "alpha_v", repr(alpha_v)),
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
            bsdf.append(rgb(node, name, color))
        elif part is not None:
            part.set("name", name)
            bsdf.append(part)
    become(node, "blendbsdf", setting(node, "float", "weight", repr(round(share, 6))), matte, shiny)


def rough_diffuse(root: Node, note: Note) -> None:
    """`roughdiffuse` (Oren and Nayar) becomes `diffuse`."""
    for node in plugins(root, "bsdf", "roughdiffuse"):
        color = node.property("reflectance", "diffuse_reflectance")
        if color is not None:
            color.set("name", "reflectance")
        become(node, "diffuse", *([color] if color is not None else []))
        note(node, "roughdiffuse is diffuse", loss=True)


def coatings(root: Node, note: Note) -> None:
    """A coat over a diffuse surface becomes (rough) plastic; over anything else it is left out."""
    by_id = {node.get("id"): node for node in root.everything() if node.tag == "bsdf" and node.get("id")}
    for node in reversed(plugins(root, "bsdf", "coating", "roughcoating")):  # a coat inside of another first
        inner = next(iter(node.nodes("bsdf", "ref")), None)
        if inner is not None and inner.tag == "ref" and inner.get("id") in by_id:
            inner = copied(by_id[inner.get("id", "")])
            for part in inner.everything():
                if part.tag != "ref":
                    part.attrib.pop("id", None)
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
            become(
                node,
                "plastic" if old == "coating" else "roughplastic",
                *kept,
                *([color] if color is not None else []),
            )
            note(node, f"{old} over diffuse is {node.type}", loss=True)
        elif inner.tag == "ref":
            wrapped(node, inner)
            note(node, f"{old} is left out, what it coats stays", loss=True)
        else:
            parent = parents_of(root).get(id(node))
            if inner.type == "twosided" and parent is not None and parent.type == "twosided":
                inner = inner.nodes("bsdf", "ref")[0] if inner.nodes("bsdf", "ref") else inner
            if inner.tag == "ref":
                wrapped(node, inner)
            else:
                become(node, inner.type, *inner.nodes())
            note(node, f"{old} is left out, what it coats stays", loss=True)


def mixtures(root: Node, note: Note) -> None:
    """`mixturebsdf` becomes nested `blendbsdf`."""
    for node in plugins(root, "bsdf", "mixturebsdf"):
        parts = node.nodes("bsdf", "ref")
        text = node.value("weights")
        weights = [number(node, word) for word in re.split(r"[\s,]+", text.strip()) if word]
        if len(parts) < 1 or len(weights) != len(parts) or min(weights) < 0 or sum(weights) <= 0:
            raise SceneFileError(f"{node.where}: mixturebsdf has {len(parts)} parts and the weights '{text}'")
        total = sum(weights)
        blended, so_far = parts[0], weights[0]
        for part, weight in zip(parts[1:], weights[1:], strict=True):
            so_far += weight
            outer = new("bsdf", node, type="blendbsdf")
            outer[:] = [
                setting(node, "float", "weight", repr(weight / so_far if so_far else 0)),
                blended,
                part,
            ]
            blended = outer
        if len(parts) == 1:
            wrapped(node, blended)
        else:
            become(node, "blendbsdf", *[c for c in blended if isinstance(c, Node)])
        note(node, f"mixturebsdf of {len(parts)} is blendbsdf", loss=abs(total - 1) > 1e-3)


def translucent(root: Node, note: Note) -> None:
    """`difftrans` becomes `principledthin` that lets all light through diffusely."""
    for node in plugins(root, "bsdf", "difftrans"):
        color = node.property("transmittance")
        kept = [setting(node, "float", "diff_trans", 2), setting(node, "float", "spec_trans", 0)]
        if color is not None:
            color.set("name", "base_color")
            kept.append(color)
        become(node, "principledthin", *kept)
        note(node, "difftrans is principledthin", loss=True)


def normal_maps(root: Node, note: Note) -> None:
    """The texture of a `normalmap`, which had any name, is called normalmap; it holds directions, not colours."""
    by_id = {node.get("id"): node for node in root.everything() if node.tag != "ref" and node.get("id")}
    for node in plugins(root, "bsdf", "normalmap"):
        for part in node.nodes("texture", "ref"):
            target = by_id.get(part.get("id"), part) if part.tag == "ref" else part
            if target.tag != "texture":
                continue
            if part.get("name") != "normalmap":
                part.set("name", "normalmap")
                note(part, "the texture of a normalmap is called normalmap")
            if target.type == "bitmap" and target.property("raw") is None:
                target.append(setting(target, "boolean", "raw", "true"))


def distributions(root: Node, note: Note) -> None:
    """Microfacet distributions that are gone become the nearest: phong is beckmann, as (Ashikhmin) is ggx."""
    for node in old(root):
        if (
            node.tag == "string"
            and node.get("name") == "distribution"
            and node.get("value") in ("phong", "as")
        ):
            better = {"phong": "beckmann", "as": "ggx"}[node.get("value", "")]
            note(node, f"distribution {node.get('value')} is {better}", loss=True)
            node.set("value", better)
