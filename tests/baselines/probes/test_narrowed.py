"""Probes whose first hits are less rough than the scene's materials."""

from __future__ import annotations

import re

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.probes import placement
from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.errors import ProbeError
from gibench.baselines.probes.maps import load_probes
from gibench.rendering.scene import load_dict, load_scene
from tests.baselines.sites import lit_box, site
from tests.rendering import scenes

SETTINGS = {"count": 1, "width": 32, "height": 16, "spp": 2048}


@pytest.fixture(autouse=True)
def in_the_middle(monkeypatch):
    """One probe, without a search for its place."""
    monkeypatch.setattr(placement, "place", lambda scene, count: np.zeros((count, 3), dtype=np.float32))


def metal(alpha):
    return {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha}


def saved(description, folder):
    """The scene as read from a file in the folder, as benchmarks have it."""
    folder.mkdir(exist_ok=True)
    state = mi.parser.parse_dict(mi.parser.ParserConfig(mi.variant()), description)
    text = mi.parser.write_string(state)
    (folder / "scene.xml").write_text(re.sub(r'(<shape type="\w+") name=', r"\1 id=", text))
    return load_scene(folder / "scene.xml")


def two_plates(floor, ceiling):
    """A box that emits, with a floor, and a ceiling in which the floor is seen."""
    box = lit_box(floor)
    box["wall2+"] = scenes.rectangle([0, 0, 1], [0, 0, -1], (1, 1), bsdf=ceiling)
    return box


def radiance(description, folder, factor):
    where = site(saved(description, folder), folder)
    probes = load_probes(where, ProbeSettings(**SETTINGS, first_roughness=factor), ("radiance",))
    return np.array(probes.arrays["radiance"]).astype(float).reshape(16, 32, 3)


def test_only_the_first_hit_is_narrowed(tmp_path):
    """A rough floor under a mirror: seen directly, and in the mirror, where it keeps its roughness."""
    mirror = {"type": "conductor", "material": "none"}
    rough, half = (two_plates(metal(alpha), mirror) for alpha in (0.4, 0.2))
    narrowed = radiance(rough, tmp_path / "narrowed", 0.5)
    plain = {alpha: radiance(room, tmp_path / str(alpha), 1) for alpha, room in ((0.4, rough), (0.2, half))}
    up, down = (
        slice(0, 4),
        slice(12, 16),
    )  # towards the mirror, and to the floor; seams between walls are left out

    def apart(one, other, rows):
        return np.abs(one[rows] - other[rows]).mean() / other[rows].mean()

    assert apart(plain[0.2], plain[0.4], down) > 0.04
    assert apart(plain[0.2], plain[0.4], up) > 0.04
    assert apart(narrowed, plain[0.4], up) < 0.01
    assert apart(narrowed, plain[0.4], down) > 0.04
    # Seen from above, most of what the floor reflects comes off the mirror, and then off the rougher floor.
    assert apart(narrowed, plain[0.2], down) < 0.5 * apart(plain[0.4], plain[0.2], down)


@pytest.mark.parametrize(
    ("rough", "narrow"),
    [
        (metal(0.3), metal(0.15)),
        (
            {"type": "roughplastic", "distribution": "ggx", "alpha": 0.3},
            {"type": "roughplastic", "distribution": "ggx", "alpha": 0.15},
        ),
        (
            {"type": "principled", "metallic": 1.0, "roughness": 0.6},
            {"type": "principled", "metallic": 1.0, "roughness": 0.6 * 0.5**0.5},
        ),
        (
            scenes.two_sided(**metal({"type": "checkerboard", "color0": 0.1, "color1": 0.4})),
            scenes.two_sided(**metal({"type": "checkerboard", "color0": 0.05, "color1": 0.2})),
        ),
        ({"type": "conductor", "material": "none"}, {"type": "conductor", "material": "none"}),
    ],
    ids=["metal", "plastic", "principled", "textured", "mirror"],
)
def test_half_is_the_material_of_half_alpha(tmp_path, rough, narrow):
    one = radiance(lit_box(rough), tmp_path / "one", 0.5)
    other = radiance(lit_box(narrow), tmp_path / "other", 1)
    wide = radiance(lit_box(rough), tmp_path / "one", 1)
    assert other.max() > 0.01
    np.testing.assert_array_equal(one, other)  # the same paths
    assert rough == narrow or np.abs(wide - other).mean() > 5e-3 * other.mean()


def test_other_bakes_stay_as_they_are(tmp_path):
    """A factor of 1 is no part of the key; another factor makes new radiance and nothing else."""
    where = site(saved(lit_box(metal(0.2)), tmp_path), tmp_path)
    for factor in (1.0, 0.5):
        small = ProbeSettings(**SETTINGS | {"spp": 1}, first_roughness=factor)
        load_probes(where, small, ("radiance", "distance"))
    keys = [(bake.folder / "bake.json").read_text() for bake in where.bakes.used]
    assert len(keys) == 4  # positions, two radiances, surfaces
    assert sum("first_roughness" in key for key in keys) == 1


def test_a_file_of_another_scene_is_refused(tmp_path):
    scene = load_dict(lit_box(metal(0.2)))
    settings = ProbeSettings(**SETTINGS | {"spp": 1}, first_roughness=0.5)
    with pytest.raises(ProbeError, match="is not there"):
        load_probes(site(scene, tmp_path), settings, ("radiance",))
    saved(scenes.box("metal"), tmp_path)
    with pytest.raises(ProbeError, match="other shapes"):
        load_probes(site(scene, tmp_path), settings, ("radiance",))


@pytest.mark.parametrize("factor", [0.0, -1.0, 1.5, float("nan")])
def test_factors_that_cannot_be(factor):
    with pytest.raises(ProbeError, match="first_roughness"):
        ProbeSettings(**SETTINGS, first_roughness=factor)
