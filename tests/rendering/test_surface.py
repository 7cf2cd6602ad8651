"""Surface channels of every kind of material, against values that are worked out by hand, and their lobes."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.backend import select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict

from . import scenes

select_variant("auto")  # the materials below hold pictures, which are Mitsuba's

AIR = 1.000277
"""Index of refraction of air, Mitsuba's default outside (CRC Handbook)."""

GLASS = 1.5046
"""Mitsuba's default inside, BK7."""

PLASTIC = 1.49
"""Mitsuba's default of its plastics, polypropylene."""

COLOR = np.array([0.2, 0.4, 0.6])
GREY = np.full(3, 0.5)


def f0(inside: float, outside: float = AIR) -> float:
    return ((inside - outside) / (inside + outside)) ** 2


def rgb(color) -> dict:
    return {"type": "rgb", "value": list(map(float, color))}


DIFFUSE = {"type": "diffuse", "reflectance": rgb(COLOR)}
METAL = {
    "type": "roughconductor",
    "alpha": 0.3,
    "material": "none",
    "specular_reflectance": rgb(GREY),
    "distribution": "ggx",
}
COAT = {"type": "roughplastic", "diffuse_reflectance": rgb(COLOR), "alpha": 0.2}


def flat(value: float) -> dict:
    """A picture of one value: the bump and normal maps of a surface that is smooth."""
    import mitsuba as mi

    pixels = np.full((2, 2, 3), value, np.float32)
    pixels[..., 2] = max(value, 1.0 if value == 0.5 else value)  # as a normal map it points straight up
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True}


def two_sided(inner, back=None) -> dict:
    return {"type": "twosided", "front": inner, **({} if back is None else {"rear": back})}


def principled(**more) -> dict:
    return {"type": "principled", "base_color": rgb(COLOR), "roughness": 0.5, **more}


LUMINANCE = COLOR @ [0.2126, 0.7152, 0.0722]

# name: (material, albedo, specular albedo, roughness)
CASES = {
    "diffuse": (DIFFUSE, COLOR, 0, 1),
    "plastic": ({"type": "plastic", "diffuse_reflectance": rgb(COLOR)}, COLOR, f0(PLASTIC), 0),
    "plastic-two-sided": (
        two_sided({"type": "plastic", "diffuse_reflectance": rgb(COLOR), "int_ior": 1.7}),
        COLOR,
        f0(1.7),
        0,
    ),
    "roughplastic": (COAT, COLOR, f0(PLASTIC), 0.2),
    "conductor": ({"type": "conductor", "eta": rgb([0.2, 0.9, 1.1]), "k": rgb([3.9, 2.4, 2.2])}, 0, None, 0),
    "mirror": ({"type": "conductor", "material": "none", "specular_reflectance": rgb(GREY)}, 0, GREY, 0),
    "roughconductor": (METAL, 0, GREY, 0.3),
    "anisotropic": (
        {"type": "roughconductor", "material": "none", "alpha_u": 0.4, "alpha_v": 0.1},
        0,
        1,
        np.sqrt(0.04),
    ),
    "principled": (
        principled(metallic=0.3, specular=0.5),
        0.7 * COLOR,
        0.7 * 0.08 * 0.5 + 0.3 * COLOR,
        0.25,
    ),
    "principled-of-an-index": (principled(eta=1.5), COLOR, f0(1.5, 1.0), 0.25),
    "principled-tinted": (principled(specular=1.0, spec_tint=1.0), COLOR, 0.08 * COLOR / LUMINANCE, 0.25),
    "principled-glass": (
        principled(eta=1.5, spec_trans=0.5),
        0.5 * COLOR,
        f0(1.5, 1.0) + 0.5 * np.sqrt(COLOR) * (1 - f0(1.5, 1.0)),
        0.25,
    ),
    "dielectric": ({"type": "dielectric"}, 0, 1, 0),
    "black-glass": (
        {"type": "dielectric", "specular_transmittance": 0.0, "int_ior": 1.5},
        0,
        f0(1.5),
        0,
    ),
    "pane": ({"type": "thindielectric"}, 0, 1, 0),
    "black-pane": (
        {"type": "thindielectric", "specular_transmittance": 0.0, "int_ior": 1.5},
        0,
        2 * f0(1.5) / (1 + f0(1.5)),
        0,
    ),
    "roughdielectric": ({"type": "roughdielectric", "alpha": 0.2}, 0, 1, 0.2),
    "nothing": ({"type": "null"}, 0, 1, 0),
    "mask": ({"type": "mask", "opacity": 0.25, "b": two_sided(DIFFUSE)}, 0.25 * COLOR, 0.75, 0),
    "opaque-mask": ({"type": "mask", "opacity": 1.0, "b": two_sided(DIFFUSE)}, COLOR, 0, 1),
    "mask-of-metal": (
        {"type": "mask", "opacity": 0.5, "b": METAL},
        0,
        0.25 + 0.5,
        0.3 * 0.25 / 0.75,
    ),
    "bumpmap": ({"type": "bumpmap", "map": flat(0.25), "b": two_sided(COAT)}, COLOR, f0(PLASTIC), 0.2),
    "normalmap": ({"type": "normalmap", "normalmap": flat(0.5), "b": DIFFUSE}, COLOR, 0, 1),
    "blend": (
        {"type": "blendbsdf", "weight": 0.25, "a": DIFFUSE, "b": METAL},
        0.75 * COLOR,
        0.25 * GREY,
        0.3,
    ),
    "two-sided-blend": (
        two_sided({"type": "blendbsdf", "weight": 0.25, "a": DIFFUSE, "b": METAL}),
        0.75 * COLOR,
        0.25 * GREY,
        0.3,
    ),
    "blend-of-blends": (
        {
            "type": "blendbsdf",
            "weight": 0.5,
            "a": {"type": "blendbsdf", "weight": 0.5, "a": DIFFUSE, "b": METAL},
            "b": {"type": "mask", "opacity": 0.5, "b": two_sided(COAT)},
        },
        0.25 * COLOR + 0.25 * COLOR,
        0.25 * 0.5 + 0.25 * f0(PLASTIC) + 0.25,
        (0.25 * 0.5 * 0.3 + 0.25 * f0(PLASTIC) * 0.2) / (0.25 * 0.5 + 0.25 * f0(PLASTIC) + 0.25),
    ),
    "front": (two_sided(DIFFUSE, METAL), COLOR, 0, 1),
}


def surface_of(bsdf, side: float = 1.0, channels=("albedo", "specular_albedo", "roughness")):
    """Channels in the middle of a plane of this material, seen from above or below."""
    plane = scenes.rectangle([0, 0, 0], [0, 0, 1], (20, 20), bsdf=bsdf)
    camera = PinholeCamera((0.1, 0.2, 2.0 * side), (0.1, 0.25, 0), 0.5)
    frame = render_frame(
        load_dict({"type": "scene", "p": plane}), camera, resolution=(9, 9), channels=channels
    )
    return [frame.arrays[name][4, 4] for name in channels]


@pytest.mark.parametrize("name", CASES)
def test_of_every_material(name):
    bsdf, albedo, specular, roughness = CASES[name]
    found = surface_of(bsdf)
    np.testing.assert_allclose(found[0], np.broadcast_to(albedo, 3), atol=2e-6)
    if specular is None:  # Fresnel at normal incidence
        eta, k = np.array([0.2, 0.9, 1.1]), np.array([3.9, 2.4, 2.2])
        specular = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    np.testing.assert_allclose(found[1], np.broadcast_to(specular, 3), atol=2e-5)
    np.testing.assert_allclose(found[2], roughness, atol=2e-5)


def test_each_side_has_its_own_material():
    found = surface_of(two_sided(DIFFUSE, METAL), side=-1.0)
    np.testing.assert_allclose(found[0], 0)
    np.testing.assert_allclose(found[1], GREY, atol=1e-6)
    np.testing.assert_allclose(found[2], 0.3, atol=1e-6)


def test_textures_reach_through_layers():
    """Two leaves of a blend whose weight is a picture: the surface is one or the other."""
    weight = {"type": "checkerboard", "color0": 0.0, "color1": 1.0, "to_uv": _scaled(40)}
    blend = {"type": "blendbsdf", "weight": weight, "a": DIFFUSE, "b": METAL}
    plane = scenes.rectangle([0, 0, 0], [0, 0, 1], (20, 20), bsdf=two_sided(blend))
    camera = PinholeCamera((0.1, 0.2, 3.0), (0.1, 0.25, 0), 0.9)
    frame = render_frame(
        load_dict({"type": "scene", "p": plane}),
        camera,
        resolution=(64, 64),
        channels=("albedo", "roughness"),
    ).arrays
    matte = frame["roughness"][..., 0] == 1
    assert 0.2 < matte.mean() < 0.8
    np.testing.assert_allclose(frame["albedo"][matte], np.broadcast_to(COLOR, (matte.sum(), 3)), atol=1e-6)
    np.testing.assert_allclose(frame["albedo"][~matte], 0)
    np.testing.assert_allclose(frame["roughness"][~matte], 0.3, atol=1e-6)


def _scaled(factor):
    import mitsuba as mi

    return mi.ScalarTransform4f().scale([factor, factor, 1])


def furnace(bsdf, side: float = 1.0, spp: int = 1024) -> dict[str, np.ndarray]:
    """What a plane under uniform light 1 from everywhere sends to a camera that looks nearly straight at it."""
    plane = scenes.rectangle([0, 0, 0], [0, 0, 1], (20, 20), bsdf=bsdf)
    light = {"type": "constant", "radiance": rgb([1, 1, 1])}
    camera = PinholeCamera((0.1, 0.2, 2.0 * side), (0.1, 0.25, 0), 0.3)
    frame = render_frame(
        load_dict({"type": "scene", "p": plane, "l": light}),
        camera,
        resolution=(8, 8),
        channels=("radiance",),
        spp=spp,
    ).arrays
    return {name: values.astype(np.float64).mean((0, 1)) for name, values in frame.items()}


@pytest.mark.parametrize("name", CASES)
def test_parts_sum_to_what_mitsuba_says_whatever_the_material(name):
    """The sum against the mean weight of Mitsuba's own samples; and nothing in a lobe that the material lacks."""
    bsdf, albedo, specular, _ = CASES[name]
    parts = furnace(bsdf)
    total = sum(parts[part] for part in parts if part not in ("color", "color_se"))
    np.testing.assert_allclose(total, parts["color"], rtol=1e-6)
    np.testing.assert_allclose(parts["color"], _albedo(bsdf), rtol=0.02, atol=2e-3)
    if np.all(np.equal(albedo, 0)):
        assert (parts["direct_diffuse"] == 0).all()
    if specular is not None and np.all(np.equal(specular, 0)):
        # Exactly 0, but where another side or another opacity of the material has such a lobe.
        dust = 1e-6 if name in ("opaque-mask", "front") else 0.0
        np.testing.assert_allclose(parts["direct_specular"], 0, atol=dust)


def _albedo(bsdf) -> np.ndarray:
    """Directional albedo at nearly normal incidence, transmission included."""
    import mitsuba as mi

    plane = scenes.rectangle([0, 0, 0], [0, 0, 1], (20, 20), bsdf=bsdf)
    material = mi.load_dict({"type": "scene", "p": plane}).shapes()[0].bsdf()
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, 1 << 18)
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(0, 0.025, 1) / np.hypot(0.025, 1)
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    si.n = mi.Normal3f(0, 0, 1)
    si.uv = mi.Point2f(0.505, 0.51)
    si.dp_du, si.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
    _, weight = material.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    return np.nan_to_num(np.array(weight)).mean(axis=-1)


@pytest.mark.parametrize(("metallic", "spec_trans"), [(0.0, 0.0), (0.4, 0.0), (1.0, 0.0)])
def test_the_diffuse_lobe_of_principled(metallic, spec_trans):
    """Without a specular lobe all of it is diffuse, all metal is none; in between the diffuse share is what is left."""
    matte = furnace(principled(metallic=0.0, specular=0.0), spp=4096)["direct_diffuse"]
    parts = furnace(principled(metallic=metallic, spec_trans=spec_trans, specular=0.5), spp=4096)
    np.testing.assert_allclose(parts["direct_diffuse"], (1 - metallic) * matte, rtol=5e-3, atol=1e-6)
    assert (parts["direct_specular"] > 0).all()


def test_principled_without_a_specular_lobe_is_all_diffuse():
    parts = furnace(principled(metallic=0.0, specular=0.0))
    np.testing.assert_allclose(parts["direct_specular"], 0, atol=2e-6)
    np.testing.assert_allclose(parts["direct_diffuse"], parts["color"], rtol=1e-5)


def test_principled_inside_of_others():
    half = {"type": "blendbsdf", "weight": 0.5, "a": DIFFUSE, "b": principled(metallic=1.0)}
    parts = furnace(half, spp=4096)
    np.testing.assert_allclose(parts["direct_diffuse"], 0.5 * COLOR, rtol=5e-3)
    below = furnace(two_sided(principled(metallic=0.4, specular=0.5)), side=-1.0, spp=4096)
    above = furnace(two_sided(principled(metallic=0.4, specular=0.5)), spp=4096)
    np.testing.assert_allclose(below["direct_diffuse"], above["direct_diffuse"], rtol=5e-3)


@pytest.mark.parametrize("dust", [6e-8, 1e-7])
def test_a_blend_of_one_material_but_for_rounding_has_its_roughness(dust):
    """A lobe that only the rounding of a weight lets in is none: the surface is diffuse, not a polished metal."""
    blend = {"type": "blendbsdf", "weight": dust, "a": DIFFUSE, "b": METAL}
    assert surface_of(two_sided(blend), channels=("roughness",))[0] == 1
    blend["weight"] = 0.01
    assert surface_of(two_sided(blend), channels=("roughness",))[0] == pytest.approx(0.3, abs=1e-5)
