import json

import numpy as np
import pytest

from gibench.generators.materials import MATERIALS, BadMaterial, build_material, mean_luminance
from gibench.generators.materials.color import DARKEST, LIGHTEST, decode
from gibench.generators.materials.roles import Role
from gibench.generators.parts import Texture

ROLE = Role("floor", (0.25, 0.4), (0.02, 0.3))
NOT_REPEATED = {"picture"}


def sampled(family: str, count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    return [MATERIALS[family].sample(rng, ROLE) for _ in range(count)]


def same(one, two) -> bool:
    if isinstance(one.reflectance, Texture) != isinstance(two.reflectance, Texture):
        return False
    if isinstance(one.reflectance, Texture):
        equal = np.array_equal(one.reflectance.pixels, two.reflectance.pixels)
        equal &= one.reflectance.size == two.reflectance.size
    else:
        equal = one.reflectance == two.reflectance
    fields = ("name", "family", "bsdf", "alpha", "ior", "conductor")
    return equal and all(getattr(one, f) == getattr(two, f) for f in fields)


@pytest.mark.parametrize("family", MATERIALS)
def test_parameters_rebuild_the_material_through_json(family):
    for material in sampled(family, 3):
        assert material.family == family
        parameters = json.loads(json.dumps(material.parameters))
        assert parameters == material.parameters
        assert same(material, build_material(family, parameters))


@pytest.mark.parametrize("family", MATERIALS)
def test_equal_generators_draw_equal_materials_and_others_differ(family):
    first, again, other = sampled(family, 1)[0], sampled(family, 1)[0], sampled(family, 1, seed=1)[0]
    assert same(first, again)
    assert first.name != other.name


@pytest.mark.parametrize("family", MATERIALS)
def test_textures_are_small_bytes_of_known_size_and_sane_reflectance(family):
    for material in sampled(family, 4):
        if not isinstance(material.reflectance, Texture):
            continue
        pixels, size = material.reflectance.pixels, material.reflectance.size
        assert pixels.dtype == np.uint8
        assert pixels.ndim == 3
        assert pixels.shape[2] == 3
        assert pixels.flags.c_contiguous
        assert max(pixels.shape) <= 1024
        assert min(size) >= 0.04
        assert max(size) <= 4.0
        linear = decode(pixels)
        assert linear.min() >= DARKEST - 0.002  # half a level of eight bits
        assert linear.max() <= LIGHTEST
        assert mean_luminance(pixels) == pytest.approx(material.parameters["luminance"], abs=0.01)


@pytest.mark.parametrize("family", sorted(set(MATERIALS) - NOT_REPEATED))
def test_textures_have_no_seam(family):
    """The step across the border is like the steps inside: not larger than the largest, and usual in the mean."""
    seams, inner = [], []
    for material in sampled(family, 6, seed=3):
        if not isinstance(material.reflectance, Texture):
            pytest.skip("one colour")
        grey = decode(material.reflectance.pixels) @ [0.2126, 0.7152, 0.0722]
        for axis in (0, 1):
            steps = np.abs(np.diff(grey, axis=axis)).mean(axis=1 - axis)
            seam = np.abs(grey.take(0, axis) - grey.take(-1, axis)).mean()
            # Where two large tiles make the texture, one joint inside is all there is to compare the border with.
            assert seam <= 2 * steps.max() + 1e-3
            seams.append(seam)
            # At a joint the border may be as rough as the roughest row.
            inner.append(steps.max())
    assert np.mean(seams) <= np.mean(inner)


@pytest.mark.parametrize("family", sorted(set(MATERIALS) - {"metal", "mirror"}))
def test_a_fixed_parameter_wins_and_leaves_the_others(family):
    free = MATERIALS[family].sample(np.random.default_rng(7), ROLE).parameters
    fixed = MATERIALS[family].sample(np.random.default_rng(7), ROLE, luminance=0.3).parameters
    assert fixed["luminance"] == 0.3
    # What depends on the reflectance (the species of a wood, the paint on bricks) was drawn for it before.
    assert {k: v for k, v in fixed.items() if k != "luminance"} == {
        k: v for k, v in free.items() if k != "luminance"
    }


@pytest.mark.parametrize("family", MATERIALS)
def test_unknown_parameters_are_refused(family):
    with pytest.raises(BadMaterial, match="no parameter 'sparkle'"):
        MATERIALS[family].sample(np.random.default_rng(0), ROLE, sparkle=1)


@pytest.mark.parametrize(
    ("family", "changes"),
    [
        ("paint", {"luminance": 0.97}),
        ("paint", {"alpha": 1.5}),
        ("paint", {"luminance": float("nan")}),
        ("stone", {"kind": "cheese"}),
        ("fabric", {"weave": "knit"}),
        ("rug", {"wools": 9}),
        ("picture", {"size": [0.0, 1.0]}),
        ("metal", {"finish": "mithril"}),
        ("mirror", {"reflectance": 1.0}),
        ("parquet", {"pattern": "spiral"}),
        ("wallpaper", {"pattern": "plaid"}),
        ("tile", {"count": [3, 4]}),
        ("tile", {"bond": "none"}),
    ],
)
def test_impossible_parameters_are_refused(family, changes):
    parameters = {**sampled(family, 1)[0].parameters, **changes}
    with pytest.raises(BadMaterial, match=family):
        build_material(family, parameters)


def test_bricks_have_their_size_and_planks_theirs():
    brick = sampled("brick", 1)[0].reflectance
    assert brick.size[0] / 6 == pytest.approx(0.21 + 0.01)
    assert brick.size[1] / 16 == pytest.approx(0.065 + 0.01)
    planks = sampled("planks", 1)[0]
    assert planks.reflectance.size[1] == pytest.approx(planks.parameters["rows"] * planks.parameters["width"])
    assert 0.1 <= planks.parameters["width"] <= 0.2
