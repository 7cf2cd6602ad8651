"""The gallery is made from recipes that can be made, and shows what a run holds."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from gibench.benchmarks import gallery
from gibench.benchmarks.errors import ResultsError


def test_every_picture_has_a_recipe_and_a_title():
    found = gallery.recipes(rooms=20, spp=4)
    assert list(found) == list(gallery.TITLES)
    assert (found["rooms"].rooms, found["rooms"].views) == (20, 1)
    assert {"motion", "curvature", "indirect_specular", "reflected_normal"} <= set(found["channels"].channels)
    assert found["moving-light"].sequences["light"].moves == "light"
    assert found["channels"].spp == 4 * found["rooms"].spp
    assert found["environments"].lighting == "environments"


def test_a_wide_picture_is_made_narrow_and_named_on_the_page(tmp_path):
    wide = Image.fromarray(np.full((100, 3200, 3), 128, dtype=np.uint8))
    lines = gallery._shown(tmp_path, "rooms", wide, "Rooms.")
    assert "[![Rooms.](rooms.jpg)](rooms.jpg)" in lines
    with Image.open(tmp_path / "rooms.jpg") as picture:
        assert picture.size == (gallery.WIDEST, 50)


def test_a_run_without_a_whole_result_is_named(tmp_path):
    run = SimpleNamespace(root=tmp_path, records=lambda: [{"status": "failed"}])
    with pytest.raises(ResultsError, match="has no whole result: `gibench bench list"):
        gallery._methods(run)
