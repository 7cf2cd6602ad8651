"""Every rule by what it makes of a line of an old file, and what Mitsuba then makes of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.films import Film, film_of
from gibench.generators.imported.upgrading import RULES, thin_layers
from gibench.rendering.backend import select_variant

from .files import SQUARE, numbers, one, upgraded


def rules_of(changes) -> set[str]:
    return {change.rule for change in changes}


def loads(root) -> object:
    """Mitsuba's own verdict on what a rule made."""
    from xml.etree.ElementTree import tostring

    select_variant()
    import mitsuba as mi

    return mi.load_string(tostring(root, encoding="unicode"))


def shape_of(bsdf: str) -> str:
    return f'<shape type="rectangle">{bsdf}</shape>'


def test_every_rule_has_a_test():
    source = (__import__("pathlib").Path(__file__)).read_text()
    for rule in RULES:
        assert f'"{rule.__name__}"' in source, rule.__name__


def test_a_new_file_is_left_as_it_is(tmp_path):
    body = (
        '<shape type="rectangle"><bsdf type="diffuse"><spectrum name="reflectance" value="0.5"/></bsdf>'
        '<emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape>'
    )
    root, changes = upgraded(tmp_path, body, version="3.0.0")
    assert changes == []
    assert [n.tag for n in root.everything()].count("spectrum") == 2


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("toWorld", "to_world"),
        ("intIOR", "int_ior"),
        ("extIOR", "ext_ior"),
        ("diffuseReflectance", "diffuse_reflectance"),
        ("alphaU", "alpha_u"),
        ("faceNormals", "face_normals"),
        ("sunRadiusScale", "sun_radius_scale"),
        ("high_quality_edges", "high_quality_edges"),
    ],
)
def test_names(tmp_path, old, new):
    root, changes = upgraded(tmp_path, f'<bsdf type="principled"><float name="{old}" value="1"/></bsdf>')
    assert root.nodes("bsdf")[0].nodes()[0].get("name") == new
    assert rules_of(changes) == ({"property_names"} if old != new else set())


def test_tags_of_transformations(tmp_path):
    look = '<lookAt origin="0,0,0" target="1,0,0" up="0,0,1"/>'
    body = f'<shape type="rectangle"><transform name="toWorld">{look}</transform></shape>'
    root, changes = upgraded(tmp_path, body)
    assert "transform_tags" in rules_of(changes)
    assert one(root, "lookat").get("target") == "1,0,0"
    loads(root)


def test_axes_of_rotations_are_unit_vectors(tmp_path):
    """Mitsuba 3 makes a shear of any other; a square that is only turned keeps its area."""
    turned = '<transform name="toWorld"><rotate x="1" y="1" angle="40"/></transform>'
    root, changes = upgraded(tmp_path, f'<shape type="rectangle">{turned}</shape>')
    assert "rotation_axes" in rules_of(changes)
    assert np.array(loads(root).shapes()[0].surface_area()).item() == pytest.approx(4, rel=1e-5)


def test_settings_that_are_gone(tmp_path):
    body = '<shape type="cube"><float name="maxSmoothAngle" value="30"/></shape>'
    root, changes = upgraded(tmp_path, body)
    assert [c.what for c in changes if c.rule == "gone_settings"] == ["max_smooth_angle is left out"]
    loads(root)


def test_an_animation_stands_still(tmp_path):
    body = (
        '<shape type="rectangle"><animation name="toWorld"><transform time="0"><translate x="1"/></transform>'
        '<transform time="1"><translate x="9"/></transform></animation></shape>'
    )
    root, changes = upgraded(tmp_path, body)
    assert [c.loss for c in changes if c.rule == "animations"] == [True]
    assert one(root, "translate").get("x") == "1"
    assert one(root, "transform").get("name") == "to_world"
    loads(root)


@pytest.mark.parametrize(
    ("element", "expected", "rule"),
    [
        ('<srgb name="reflectance" value="0.5 0.25 1"/>', (0.2140411, 0.0508761, 1.0), "srgb_tags"),
        ('<srgb name="reflectance" value="#ff8000"/>', (1.0, 0.2158605, 0.0), "hexadecimal_colors"),
        (
            '<rgb name="reflectance" value="#804020"/>',
            (0.2158605, 0.0512695, 0.0144438),
            "hexadecimal_colors",
        ),
        ('<spectrum name="reflectance" value="0.25"/>', (0.25,), "scalar_spectra"),
    ],
)
def test_colors_become_linear(tmp_path, element, expected, rule):
    root, changes = upgraded(tmp_path, shape_of(f'<bsdf type="diffuse">{element}</bsdf>'))
    assert rule in rules_of(changes)
    np.testing.assert_allclose(numbers(one(root, "rgb").get("value")), expected, atol=2e-7)
    loads(root)


def test_a_colour_that_is_none(tmp_path):
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: '#80' is no colour"):
        upgraded(tmp_path, shape_of('<bsdf type="diffuse"><rgb name="reflectance" value="#80"/></bsdf>'))


def test_a_scalar_light_is_grey_and_would_else_be_tinted(tmp_path):
    """What Mitsuba makes of a light of a scalar spectrum: the tint that the rule takes away."""
    lamp = (
        '<shape type="rectangle"><emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape>'
    )

    def radiance(version):
        root, _ = upgraded(tmp_path, lamp, version=version)
        import mitsuba as mi

        emitter = loads(root).emitters()[0]
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(0, 0, 1)
        return np.array(emitter.eval(si)).ravel()

    np.testing.assert_allclose(radiance("0.6.0"), 2.0, rtol=1e-6)
    np.testing.assert_allclose(radiance("3.0.0") / 2, (1.21, 0.95, 0.91), atol=0.006)


def test_wavelengths_stay_a_spectrum(tmp_path):
    body = shape_of('<bsdf type="diffuse"><spectrum name="reflectance" value="400:0.1, 700:0.9"/></bsdf>')
    root, changes = upgraded(tmp_path, body)
    assert rules_of(changes) == set()
    assert one(root, "spectrum").get("value").startswith("400:")


@pytest.mark.parametrize("outside", ["1.5", "water", "air"])
def test_what_surrounds_a_conductor(tmp_path, outside):
    """Fresnel's equations know the ratio alone, so both ways to write it reflect the same."""
    ior = {"1.5": 1.5, "water": 1.333, "air": 1.0}[outside]
    body = shape_of(
        '<bsdf type="conductor"><rgb name="eta" value="0.2 0.9 1.1"/><rgb name="k" value="3.9 2.4 2.2"/>'
        + f'<{"float" if outside[0].isdigit() else "string"} name="extEta" value="{outside}"/></bsdf>'
    )
    root, changes = upgraded(tmp_path, body)
    assert "conductors" in rules_of(changes)
    assert not any(c.loss for c in changes)
    bsdf = one(root, "bsdf")
    assert bsdf.property("ext_eta") is None
    np.testing.assert_allclose(numbers(bsdf.value("eta")), np.array([0.2, 0.9, 1.1]) / ior, rtol=1e-6)
    np.testing.assert_allclose(numbers(bsdf.value("k")), np.array([3.9, 2.4, 2.2]) / ior, rtol=1e-6)
    loads(root)


def furnace(root) -> np.ndarray:
    """What a surface reflects of uniform light 1, seen at 20 degrees off its normal: by Mitsuba's own path tracer."""
    import mitsuba as mi

    scene = loads(root)
    bsdf = scene.shapes()[0].bsdf()
    angle = math.radians(20)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, 1 << 18)
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(math.sin(angle), 0, math.cos(angle))
    weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())[1]
    return np.array(weight).mean(axis=-1)


@pytest.mark.parametrize("plugin", ["phong", "ward"])
def test_lobes_of_gone_plugins_keep_their_albedos(tmp_path, plugin):
    body = shape_of(
        f'<bsdf type="{plugin}"><rgb name="diffuseReflectance" value="0.3 0.2 0.1"/>'
        # So sharp that next to nothing of a lobe is lost below the horizon.
        '<rgb name="specularReflectance" value="0.1 0.2 0.3"/><float name="exponent" value="2000"/>'
        '<float name="alphaU" value="0.03"/><float name="alphaV" value="0.03"/></bsdf>'
    )
    root, changes = upgraded(tmp_path, body)
    change = next(c for c in changes if c.rule in ("phong", "ward"))
    assert change.rule == plugin
    assert change.loss
    np.testing.assert_allclose(furnace(root), 0.4, atol=4e-3)


def test_the_exponent_of_phong_is_a_roughness(tmp_path):
    root, _ = upgraded(tmp_path, shape_of('<bsdf type="phong"><float name="exponent" value="198"/></bsdf>'))
    assert float(one(root, "bsdf", "roughconductor").value("alpha_u")) == pytest.approx(0.1)


def test_a_textured_phong(tmp_path):
    texture = '<texture type="checkerboard" name="diffuseReflectance"/>'
    root, _ = upgraded(tmp_path, shape_of(f'<bsdf type="phong">{texture}</bsdf>'))
    assert one(root, "texture").get("name") == "reflectance"
    loads(root)


def test_rough_diffuse(tmp_path):
    body = shape_of(
        '<bsdf type="roughdiffuse"><rgb name="reflectance" value="0.4"/><float name="alpha" value="0.3"/></bsdf>'
    )
    root, changes = upgraded(tmp_path, body)
    assert "rough_diffuse" in rules_of(changes)
    np.testing.assert_allclose(furnace(root), 0.4, atol=1e-3)


@pytest.mark.parametrize(("coat", "plastic"), [("coating", "plastic"), ("roughcoating", "roughplastic")])
def test_a_coat_over_diffuse_is_plastic(tmp_path, coat, plastic):
    inner = '<bsdf type="diffuse"><rgb name="reflectance" value="0.4 0.3 0.2"/></bsdf>'
    alpha = '<float name="alpha" value="0.2"/>' if coat == "roughcoating" else ""
    root, changes = upgraded(
        tmp_path, shape_of(f'<bsdf type="{coat}"><float name="intIOR" value="1.7"/>{alpha}{inner}</bsdf>')
    )
    assert "coatings" in rules_of(changes)
    bsdf = one(root, "bsdf", plastic)
    assert bsdf.value("int_ior") == "1.7"
    assert bsdf.value("diffuse_reflectance") == "0.4 0.3 0.2"
    loads(root)


def test_a_coat_over_metal_is_left_out(tmp_path):
    root, changes = upgraded(
        tmp_path,
        shape_of(
            '<bsdf type="coating"><bsdf type="conductor"><string name="material" value="Au"/></bsdf></bsdf>'
        ),
    )
    assert [c.loss for c in changes if c.rule == "coatings"] == [True]
    assert one(root, "bsdf").value("material") == "Au"
    loads(root)


def test_a_mixture_of_three_has_the_albedo_of_its_parts(tmp_path):
    parts = "".join(
        f'<bsdf type="diffuse"><rgb name="reflectance" value="{c}"/></bsdf>' for c in (0.1, 0.5, 0.9)
    )
    root, changes = upgraded(
        tmp_path,
        shape_of(f'<bsdf type="mixturebsdf"><string name="weights" value="0.5, 0.3, 0.2"/>{parts}</bsdf>'),
    )
    assert "mixtures" in rules_of(changes)
    np.testing.assert_allclose(furnace(root), 0.5 * 0.1 + 0.3 * 0.5 + 0.2 * 0.9, atol=4e-3)


def test_a_mixture_that_does_not_fit(tmp_path):
    with pytest.raises(SceneFileError, match=r"mixturebsdf has 1 parts and the weights '0\.5, 0\.5'"):
        upgraded(
            tmp_path,
            '<bsdf type="mixturebsdf"><string name="weights" value="0.5, 0.5"/><bsdf type="diffuse"/></bsdf>',
        )


def test_translucent_sheets(tmp_path):
    root, changes = upgraded(
        tmp_path, shape_of('<bsdf type="difftrans"><rgb name="transmittance" value="0.4"/></bsdf>')
    )
    assert "translucent" in rules_of(changes)
    assert one(root, "bsdf", "principledthin").value("base_color") == "0.4"
    loads(root)


def test_distributions(tmp_path):
    root, changes = upgraded(
        tmp_path, shape_of('<bsdf type="roughplastic"><string name="distribution" value="phong"/></bsdf>')
    )
    assert "distributions" in rules_of(changes)
    assert one(root, "bsdf").value("distribution") == "beckmann"
    loads(root)


def test_the_scale_of_a_bump_map(tmp_path):
    body = shape_of(
        '<bsdf type="bumpmap"><texture type="scale"><float name="scale" value="0.3"/><texture type="checkerboard"/>'
        '</texture><bsdf type="diffuse"/></bsdf>'
    )
    root, changes = upgraded(tmp_path, body)
    assert [c.loss for c in changes if c.rule == "scaled_textures"] == [False]
    assert one(root, "bsdf", "bumpmap").value("scale") == "0.3"
    loads(root)


def test_gamma_of_bitmaps(tmp_path):
    def bitmap(gamma):
        return (
            '<bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/>'
            f'<float name="gamma" value="{gamma}"/></texture></bsdf>'
        )

    root, changes = upgraded(tmp_path, shape_of(bitmap(1)))
    assert one(root, "texture").value("raw") == "true"
    assert [c.loss for c in changes if c.rule == "bitmap_gamma"] == [False]
    root, changes = upgraded(tmp_path, shape_of(bitmap(1.8)))
    assert one(root, "texture").property("raw") is None
    assert [c.loss for c in changes if c.rule == "bitmap_gamma"] == [True]


def test_lookups_of_textures(tmp_path):
    body = shape_of(
        '<bsdf type="diffuse"><texture type="checkerboard" name="reflectance"><float name="uscale" value="4"/>'
        '<float name="vscale" value="2"/><float name="uoffset" value="0.5"/></texture></bsdf>'
    )
    root, changes = upgraded(tmp_path, body)
    assert "texture_lookups" in rules_of(changes)
    from gibench.generators.imported.transforms import matrix_of

    np.testing.assert_allclose(matrix_of(one(root, "transform"))[:2] @ [1, 1, 0, 1], (4.5, 2.0))
    loads(root)
    body = shape_of(
        '<bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/>'
        '<string name="filterType" value="ewa"/><string name="wrapModeU" value="clamp"/>'
        '<float name="maxAnisotropy" value="8"/></texture></bsdf>'
    )
    root, _ = upgraded(tmp_path, body)
    texture = one(root, "texture")
    assert (texture.value("filter_type"), texture.value("wrap_mode")) == ("bilinear", "clamp")
    assert texture.property("max_anisotropy") is None


def test_gone_textures(tmp_path):
    for old, new in (("gridtexture", "checkerboard"), ("vertexcolors", "mesh_attribute")):
        root, changes = upgraded(
            tmp_path, shape_of(f'<bsdf type="diffuse"><texture type="{old}" name="reflectance"/></bsdf>')
        )
        assert "grid_textures" in rules_of(changes)
        assert one(root, "texture").type == new


def test_the_sun_rises_over_the_same_wall(tmp_path):
    """A sky whose zenith was +y sends its light from +y, and from nowhere below."""
    body = SQUARE + (
        '<emitter type="sunsky"><vector name="sunDirection" x="0.3" y="0.8" z="0.1"/>'
        '<float name="sunRadiusScale" value="2"/><float name="turbidity" value="4"/></emitter>'
    )
    root, changes = upgraded(tmp_path, body)
    assert "sun_and_sky" in rules_of(changes)
    assert float(one(root, "emitter").value("sun_aperture")) == pytest.approx(2 * 0.5358)
    import mitsuba as mi

    environment = loads(root).environment()

    def radiance(x, y, z):
        si = mi.SurfaceInteraction3f()
        si.wi = -mi.Vector3f(np.array([x, y, z]) / np.linalg.norm([x, y, z]))
        return np.array(environment.eval(si)).ravel().mean()

    assert radiance(0.3, 0.8, 0.1) > 100 * radiance(-0.8, 0.5, 0.1) > 0
    assert radiance(0.2, -0.5, 0.1) == 0
    assert radiance(0.9, 0.1, 0.9) > 0


@pytest.mark.parametrize(("old", "dark"), [("sun", "sky_scale"), ("sky", "sun_scale")])
def test_sun_and_sky_alone(tmp_path, old, dark):
    root, _ = upgraded(tmp_path, SQUARE + f'<emitter type="{old}"><float name="scale" value="3"/></emitter>')
    emitter = one(root, "emitter")
    assert emitter.type == "sunsky"
    assert float(emitter.value(dark)) == 0
    other = {"sky_scale": "sun_scale", "sun_scale": "sky_scale"}[dark]
    assert float(emitter.value(other)) == 3
    loads(root)


def test_a_beam_is_a_narrow_spot(tmp_path):
    root, changes = upgraded(tmp_path, SQUARE + '<emitter type="collimated"/>')
    assert "gone_lights" in rules_of(changes)
    assert one(root, "emitter").type == "spot"
    loads(root)


@pytest.mark.parametrize("version", ["0.6.0", "3.0.0"])
def test_what_whoever_renders_decides(tmp_path, version):
    body = SQUARE + (
        '<integrator type="volpath"><integer name="max_depth" value="12"/></integrator>'
        '<sensor type="perspective"><film type="ldrfilm"><integer name="width" value="64"/>'
        '<boolean name="banner" value="false"/></film><sampler type="ldsampler"/></sensor>'
        '<medium type="homogeneous" id="fog"/><shape type="cube"><ref name="interior" id="fog"/></shape>'
    )
    root, changes = upgraded(
        tmp_path, body.replace("ldrfilm", "ldrfilm" if version[0] == "0" else "hdrfilm"), version=version
    )
    assert rules_of(changes) >= {"integrators", "media"}
    assert ("films" in rules_of(changes)) == (version == "0.6.0")
    assert one(root, "integrator").type == "path"
    assert one(root, "integrator").value("max_depth") == "12"
    assert [child.get("name") for child in one(root, "film").nodes()] == ["width"]
    assert not [n for n in root.everything() if n.tag in ("medium", "ref", "sampler")]


def test_edges_of_high_quality(tmp_path):
    body = SQUARE + (
        '<sensor type="perspective"><film type="hdrfilm"><boolean name="high_quality_edges" value="true"/></film>'
        "</sensor>"
    )
    root, changes = upgraded(tmp_path, body)
    assert [c.what for c in changes if c.rule == "films"] == ["high_quality_edges is left out"]
    assert one(root, "film").nodes() == []


def test_a_rotation_about_no_axis_is_left_out(tmp_path):
    turned = '<transform name="to_world"><rotate x="0" y="0" z="0" angle="{}"/><translate x="1"/></transform>'
    for version in ("0.6.0", "3.0.0"):
        for angle, loss in ((0, False), (30, True)):
            body = f'<shape type="rectangle">{turned.format(angle)}</shape>'
            root, changes = upgraded(tmp_path, body, version=version)
            assert [c.loss for c in changes if c.rule == "empty_rotations"] == [loss]
            assert [step.tag for step in one(root, "transform")] == ["translate"]
            loads(root)


def test_a_spectrum_of_three_numbers_is_rgb(tmp_path):
    body = shape_of('<bsdf type="diffuse"><spectrum name="reflectance" value="0.5, 0.25 .125"/></bsdf>')
    root, changes = upgraded(tmp_path, body)
    assert "scalar_spectra" in rules_of(changes)
    np.testing.assert_allclose(numbers(one(root, "rgb").get("value")), (0.5, 0.25, 0.125))
    root, _ = upgraded(tmp_path, body, version="3.0.0")
    assert one(root, "spectrum").get("value") == "0.5, 0.25 .125"


def test_a_black_body_by_plancks_law(tmp_path):
    """5000 K by quadrature with the CIE 1931 functions as Wyman et al. 2013 fit them: within 2 %."""
    body = (
        '<shape type="rectangle"><emitter type="area"><blackbody name="radiance" temperature="5000K" '
        'scale="0.001"/></emitter></shape>'
    )
    root, changes = upgraded(tmp_path, body)
    assert "black_bodies" in rules_of(changes)
    nm = np.arange(360.0, 831.0)

    def lobe(mean, low, high):
        return np.exp(-0.5 * ((nm - mean) / np.where(nm < mean, low, high)) ** 2)

    observer = np.array(
        [
            1.056 * lobe(599.8, 37.9, 31.0)
            + 0.362 * lobe(442.0, 16.0, 26.7)
            - 0.065 * lobe(501.1, 20.4, 26.2),
            0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
            1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
        ]
    )
    h, c, k = 6.62607015e-34, 299792458.0, 1.380649e-23
    metres = nm * 1e-9
    planck = 2 * h * c**2 / metres**5 / np.expm1(h * c / (metres * k * 5000)) * 1e-9
    xyz = observer @ planck / observer[1].sum()
    matrix = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    np.testing.assert_allclose(numbers(one(root, "rgb").get("value")), 0.001 * matrix @ xyz, rtol=0.02)
    loads(root)


@pytest.mark.parametrize("temperature", ["0", "-5K", "warm", ""])
def test_a_black_body_of_no_temperature(tmp_path, temperature):
    body = f'<shape type="rectangle"><emitter type="area"><blackbody temperature="{temperature}"/></emitter></shape>'
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: '.*' is no"):
        upgraded(tmp_path, body)


def test_properties_that_a_plugin_does_not_know_are_left_out(tmp_path):
    body = shape_of(
        '<bsdf type="conductor"><float name="alpha" value="0.1"/><string name="material" value="Au"/></bsdf>'
    )
    root, changes = upgraded(tmp_path, body)
    assert [c.what for c in changes if c.rule == "unknown_properties"] == [
        "alpha of conductor is left out, as it has no such property"
    ]
    loads(root)
    root, changes = upgraded(tmp_path, body, version="3.0.0")
    assert rules_of(changes) == set()  # there Mitsuba itself refuses it


def test_the_properties_are_those_that_mitsuba_asks_for():
    from gibench.generators.imported.upgrading.properties import KNOWN
    from gibench.generators.imported.upgrading.textures import FACTOR

    select_variant()
    import mitsuba as mi

    def refused(type_: str, name: str) -> bool:
        plugin = f'type="{type_}"><float name="{name}" value="0.5"/>'
        if type_ in ("rectangle", "cube", "sphere", "disk", "cylinder"):
            text = f"<shape {plugin}</shape>"
        elif type_ in ("point", "spot", "directional", "constant", "sunsky"):
            text = f"<emitter {plugin}</emitter>"
        elif type_ == "area":
            text = f'<shape type="sphere"><emitter {plugin}</emitter></shape>'
        else:
            inner = {"blendbsdf": 2, "mask": 1, "twosided": 1}.get(type_, 0) * '<bsdf type="diffuse"/>'
            text = f'<shape type="sphere"><bsdf {plugin}{inner}</bsdf></shape>'
        try:
            mi.load_string(f'<scene version="3.0.0">{text}</scene>')
        except RuntimeError as problem:
            return "unreferenced" in str(problem)
        return False

    files = ("ply", "obj", "serialized", "bitmap", "envmap", "checkerboard", "mesh_attribute")
    for type_, names in KNOWN.items():
        if type_ in files:
            continue
        for name in names - {"channel", FACTOR}:
            assert not refused(type_, name), (type_, name)
        if type_ != "blendbsdf":
            assert refused(type_, "nobody_knows_this"), type_


@pytest.mark.parametrize(
    ("inner", "name", "expected"),
    [
        (
            '<texture type="checkerboard"><rgb name="color0" value="0.8 0.4 0.2"/></texture>',
            "color0",
            (0.4, 0.2, 0.1),
        ),
        ('<texture type="checkerboard"/>', "color1", (0.1,) * 3),
        (
            '<texture type="scale"><float name="scale" value="0.5"/><texture type="checkerboard"/></texture>',
            "color0",
            (0.1,) * 3,
        ),
    ],
)
def test_a_scale_is_multiplied_into_a_texture(tmp_path, inner, name, expected):
    texture = f'<texture type="scale" name="reflectance"><float name="scale" value="0.5"/>{inner}</texture>'
    root, changes = upgraded(tmp_path, shape_of(f'<bsdf type="diffuse">{texture}</bsdf>'))
    assert "scaled_textures" in rules_of(changes)
    np.testing.assert_allclose(numbers(one(root, "texture").value(name)), expected)
    loads(root)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ("", None),
        ('<float name="hour" value="9"/>', (0.615, 0.783, 0.096)),
        ('<float name="hour" value="12"/><float name="latitude" value="0"/><float name="longitude" value="0"/>'
         '<float name="timezone" value="0"/><integer name="month" value="3"/><integer name="day" value="20"/>',
         (0, 1, 0)),
    ],
)  # fmt: skip
def test_the_sun_by_hour_and_date(tmp_path, values, expected):
    """At the equator it is overhead at noon of an equinox; at nine in Tokyo it stands as Mitsuba 0.6 has it."""
    from gibench.generators.imported.upgrading import sun

    root, _ = upgraded(tmp_path, f'<emitter type="sunsky">{values}</emitter>')
    emitter = one(root, "emitter")
    found = [float(emitter.property("sun_direction").get(axis)) for axis in "xyz"]
    wanted = sun.direction(**sun.DEFAULTS) if expected is None else expected
    np.testing.assert_allclose(found, wanted, atol=0.04 if expected == (0, 1, 0) else 1e-3)
    assert not [n for n in emitter.nodes() if n.get("name") in sun.DEFAULTS]
    loads(root)


def test_a_film_keeps_its_window_and_what_an_integrator_hides_is_named(tmp_path):
    film = (
        '<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/>'
        '<integer name="crop_offset_x" value="{}"/><integer name="crop_width" value="{}"/></film>'
    )
    body = (
        '<integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>'
        '<sensor type="perspective">'
    )
    root, changes = upgraded(tmp_path, body + film.format(8, 16) + "</sensor>", version="3.0.0")
    assert [c.what for c in changes if c.loss] == [
        "hide_emitters is left out: lamps and the environment are seen"
    ]
    assert film_of(one(root, "sensor")) == Film((64, 48), (8, 0), (16, 48))
    _, changes = upgraded(
        tmp_path, body.replace("true", "false") + film.format(0, 64) + "</sensor>", version="3.0.0"
    )
    assert not [c for c in changes if c.loss]


def test_the_texture_of_a_normal_map(tmp_path):
    from .files import image

    image(tmp_path / "n.png")
    bitmap = '<texture type="bitmap" name="normals"><string name="filename" value="n.png"/></texture>'
    root, changes = upgraded(
        tmp_path, shape_of(f'<bsdf type="normalmap">{bitmap}<bsdf type="diffuse"/></bsdf>')
    )
    assert "normal_maps" in rules_of(changes)
    assert one(root, "texture").get("name") == "normalmap"
    assert one(root, "texture").value("raw") == "true"


@pytest.mark.parametrize("tag", ["sensor", "integrator"])
def test_what_is_left_out_or_replaced_may_be_unknown(tmp_path, tag):
    root, _ = upgraded(tmp_path, f'<{tag} type="nobody_knows"><sampler type="ldsampler"/></{tag}>{SQUARE}')
    assert one(root, "shape").type == "rectangle"


def test_the_intent_of_a_colour_is_left_out(tmp_path):
    body = shape_of(
        '<bsdf type="diffuse"><rgb name="reflectance" intent="reflectance" value=".1 .2 .3"/></bsdf>'
    )
    root, changes = upgraded(tmp_path, body)
    assert rules_of(changes) == {"intents"}
    assert one(root, "rgb").get("intent") is None


@pytest.mark.parametrize(
    ("texture", "color"), [("wireframe", (0.1, 0.2, 0.3)), ("curvature", (0.5, 0.5, 0.5))]
)
@pytest.mark.parametrize("id", ["", ' id="t"'])
def test_drawn_lines_are_plain(tmp_path, texture, color, id):
    inside = f'<texture name="reflectance" type="{texture}"{id}><rgb name="interiorColor" value=".1 .2 .3"/></texture>'
    root, changes = upgraded(tmp_path, shape_of(f'<bsdf type="diffuse">{inside}</bsdf>'))
    assert "drawn_lines" in rules_of(changes)
    found = [node for node in root.everything() if node.tag == "rgb"]
    assert {tuple(numbers(node.get("value"))) for node in found} == {color}
    loads(root)


def test_a_coat_inside_of_another(tmp_path):
    inner = '<bsdf type="coating"><bsdf type="diffuse"/></bsdf>'
    root, _ = upgraded(tmp_path, shape_of(f'<bsdf type="coating">{inner}</bsdf>'))
    assert one(root, "bsdf").type == "plastic"


def test_scattering_once_by_its_closed_forms():
    none, some = np.zeros(3), np.full(3, 2.0)
    thick = thin_layers.layer(some, 2 * some, 1e5)
    # Of the albedo, ∫∫ xy / (x + y) over the unit square, which is 2/3 (1 − ln 2).
    np.testing.assert_allclose(thick[0], 0.5 * 2 / 3 * (1 - np.log(2)), rtol=1e-5)
    np.testing.assert_allclose(thick[1:], 0, atol=1e-4)
    np.testing.assert_allclose(thin_layers.layer(none, none, 1), [none, none, none + 1], atol=1e-12)
    # A thin layer scatters 2 τ of diffuse light, half of it back.
    back, through, straight = thin_layers.layer(some, some, 1e-6)
    np.testing.assert_allclose(back, through, rtol=1e-2)
    np.testing.assert_allclose(1 - straight, back + through, rtol=1e-2)
    for thickness in (0.1, 1, 10):
        assert np.all(sum(thin_layers.layer(some, some, thickness)) < 1)  # what scatters twice is lost


@pytest.mark.parametrize(
    ("settings", "kind"),
    [
        ("", "mask"),
        ('<float name="thickness" value="1000"/>', "principledthin"),
        ('<string name="material" value="Ketchup"/>', "mask"),
        ('<spectrum name="sigmaS" value="0"/><spectrum name="sigmaA" value="0"/>', "mask"),
        ('<spectrum name="sigmaT" value="8"/><rgb name="albedo" value=".9 .5 .1"/>', "principledthin"),
    ],
)
def test_scattering_layers(tmp_path, settings, kind):
    root, changes = upgraded(tmp_path, shape_of(f'<bsdf type="hk">{settings}<phase type="hg"/></bsdf>'))
    assert "scattering_layers" in rules_of(changes)
    assert next(node for node in root.everything() if node.tag == "bsdf").type == kind
    loads(root)


def test_a_scattering_layer_of_nothing_known(tmp_path):
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: hk: nothing is known of the material 'mud'"):
        upgraded(tmp_path, shape_of('<bsdf type="hk"><string name="material" value="mud"/></bsdf>'))
    with pytest.raises(SceneFileError, match="negative"):
        upgraded(tmp_path, shape_of('<bsdf type="hk"><float name="thickness" value="-1"/></bsdf>'))


def test_woven_cloth_has_the_mean_colour_of_its_yarns(tmp_path):
    yarns = '<rgb name="warp_kd" value=".2 .4 .6"/><spectrum name="weft_kd" value="0"/><float name="ks" value="1"/>'
    root, changes = upgraded(
        tmp_path, shape_of(f'<bsdf type="irawan"><string name="filename" value="a.wv"/>{yarns}</bsdf>')
    )
    assert "woven_cloth" in rules_of(changes)
    np.testing.assert_allclose(numbers(one(root, "rgb").get("value")), (0.1, 0.2, 0.3))
    assert one(root, "bsdf").type == "diffuse"


@pytest.mark.parametrize("metal", ["roughconductor", "twosided"])
@pytest.mark.parametrize("outer", ["{}", '<bsdf type="twosided">{}</bsdf>'])
def test_a_coat_over_what_stands_elsewhere(tmp_path, metal, outer):
    """Coats of two sides of two sides are what exporters of Mitsuba 0.5 wrote."""
    inside = "" if metal == "roughconductor" else '<bsdf type="roughconductor"/>'
    coat = outer.format('<bsdf type="coating"><ref id="metal"/></bsdf>')
    root, changes = upgraded(
        tmp_path, f'<bsdf type="{metal}" id="metal">{inside}</bsdf>{shape_of(coat)}<emitter type="constant"/>'
    )
    assert "coatings" in rules_of(changes)
    loads(root)


def test_a_mixture_of_one_may_have_two_sides(tmp_path):
    one_part = '<bsdf type="mixturebsdf"><string name="weights" value="1"/><bsdf type="plastic"/></bsdf>'
    root, _ = upgraded(tmp_path, shape_of(f'<bsdf type="twosided">{one_part}</bsdf>'))
    loads(root)
