import numpy as np
import pytest

from gibench.generators.materials import (
    MATERIALS,
    ROOM_KINDS,
    SLOTS,
    BadMaterial,
    UnknownSlot,
    base_color,
    is_glossy,
    sample_material,
)
from gibench.generators.materials.color import luminance_of

EXPECTED = [
    "floor",
    "ceiling",
    "wall",
    "skirting",
    "door",
    "window_frame",
    "sill",
    "splashback",
    "wood",
    "lacquer",
    "fabric",
    "leather",
    "linen",
    "carpet",
    "curtain",
    "metal",
    "chrome",
    "brass",
    "ceramic",
    "stone",
    "plastic",
    "screen",
    "mirror",
    "paper",
    "picture",
    "leaf",
    "soil",
    "lampshade",
    "rattan",
    "pot",
    "enamel",
    "glassware",
]

# Reflectances of lighting practice: EN 12464-1:2021, section 4.2.2.
PRACTICE = {"ceiling": (0.7, 0.9), "wall": (0.3, 0.8), "floor": (0.2, 0.4)}
FURNITURE = ("wood", "lacquer", "fabric", "leather", "carpet", "curtain", "rattan", "stone")


def test_every_slot_has_a_rule_for_every_room():
    assert set(EXPECTED) <= set(SLOTS)
    for rule in SLOTS.values():
        assert set(rule.rooms) <= set(ROOM_KINDS)
        for weights in (rule.families, *rule.rooms.values()):
            assert set(weights) <= set(MATERIALS)
            assert sum(weights.values()) == pytest.approx(1)
    used = {name for rule in SLOTS.values() for w in (rule.families, *rule.rooms.values()) for name in w}
    assert used == set(MATERIALS)


@pytest.mark.parametrize("slot", [*PRACTICE, *FURNITURE])
def test_mean_reflectances_are_those_of_lighting_practice(slot):
    low, high = PRACTICE.get(slot, (0.2, 0.7))
    rng = np.random.default_rng(11)
    for i in range(20):
        material = sample_material(rng, slot, room_kind=ROOM_KINDS[i % 5])
        assert low - 0.01 <= luminance_of(base_color(material)) <= high + 0.01


def test_no_surface_reflects_more_than_nine_tenths():
    rng = np.random.default_rng(12)
    for slot in SLOTS:
        for _ in range(4):
            assert max(base_color(sample_material(rng, slot))) <= 0.9


def test_walls_are_mostly_near_neutral():
    rng = np.random.default_rng(13)
    colors = np.array([base_color(sample_material(rng, "wall")) for _ in range(60)])
    saturation = 1 - colors.min(1) / colors.max(1)
    assert np.median(saturation) < 0.25
    assert saturation.max() > 0.2


def test_roughness_runs_from_near_mirror_to_matt():
    rng = np.random.default_rng(14)
    alphas = [
        sample_material(rng, slot).alpha
        for slot in ("ceramic", "lacquer", "glassware", "wood")
        for _ in range(40)
    ]
    assert 0.005 <= min(alphas) < 0.007
    assert max(alphas) > 0.35
    assert sample_material(rng, "curtain").bsdf == "diffuse"


@pytest.mark.parametrize("kind", ROOM_KINDS)
@pytest.mark.parametrize("slot", ["floor", "stone", "lacquer"])
def test_a_glossy_surface_can_be_had(slot, kind):
    rng = np.random.default_rng(15)
    for _ in range(3):
        material = sample_material(rng, slot, room_kind=kind, glossy=True)
        assert is_glossy(material)
        assert 0.005 <= material.alpha <= 0.1


def test_family_and_parameters_can_be_fixed():
    material = sample_material(np.random.default_rng(0), "floor", family="stone", kind="granite", alpha=0.03)
    assert (material.family, material.parameters["kind"], material.alpha) == ("stone", "granite", 0.03)


def test_bad_requests_name_what_is_near():
    rng = np.random.default_rng(0)
    with pytest.raises(UnknownSlot, match=r"'flor'.*floor"):
        sample_material(rng, "flor")
    with pytest.raises(UnknownSlot, match=r"'bedrom'.*bedroom"):
        sample_material(rng, "wall", room_kind="bedrom")
    with pytest.raises(UnknownSlot, match="material family 'woood'"):
        sample_material(rng, "wood", family="woood")
    with pytest.raises(BadMaterial, match="polish"):
        sample_material(rng, "fabric", glossy=True)
