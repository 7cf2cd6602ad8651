"""The card says what there is: counted by hand on frames whose content is known."""

import json

import numpy as np

from gibench.datasets import open_dataset
from gibench.datasets.card import _Seen, card, channel_table
from gibench.datasets.folder import CARD
from gibench.datasets.making import make
from gibench.rendering.channels import PARTS
from tests.datasets.fakes import fake_work, tiny


def test_every_dataset_has_one_that_does_not_change(rooms_made):
    dataset = open_dataset(rooms_made)
    text = (rooms_made / CARD).read_text()
    assert text == card(rooms_made, dataset.manifest, dataset.frames)
    assert text.startswith("# 24 frames of 12 rooms, by gibench")
    assert "24 of 16 × 12 pixels" in text
    assert "| licence | CC0-1.0 |" in text
    assert "`make-dataset --rooms 12`" in text
    assert "open_dataset(" in text
    assert channel_table(dataset[0].channels) in text


def test_light_materials_depth_and_gloss_are_counted():
    seen = _Seen()
    ones = np.ones((2, 4, 3), np.float32)
    frame = {name: ones * weight for name, weight in zip(PARTS, (9, 1, 0, 2, 1), strict=True)}
    frame["depth"] = np.full((2, 4, 1), 3.0, np.float32)
    frame["material_id"] = np.array([[1, 1, 1, 2], [2, 2, 0, 1]], np.uint32)[..., None]
    frame["specular_albedo"] = ones * (frame["material_id"] == 1)
    frame["roughness"] = np.where(frame["material_id"] == 1, 0.05, 1.0).astype(np.float32)
    seen.add(frame, ["oak", "felt"], {"oak": {"family": "wood"}})
    assert seen.light() == [
        ("indirect of all reflected light", "75 (75 to 75) %"),
        ("specular of all reflected light", "25 (25 to 25) %"),
    ]
    assert dict(seen.lines()) == {
        "materials": "wood 57 %, of the scene 43 %",
        "depth": "3 (3 to 3) m",
        "gloss": "50 % with a specular lobe, of GGX alpha 0.05 (0.05 to 0.05); 50 % of alpha below 0.1",
    }


def test_lamps_stand_in_it_where_they_are_known_and_lit(tmp_path):
    root, recipe = tmp_path / "d", tiny(1, channels=("color",))
    make(root, recipe, command="make-dataset", work=fake_work(root, recipe))
    described = {
        "lights": [
            {"name": "table_lamp.0.shade", "lumens": 150.0, "kelvin": 2700.0},
            {"name": "table_lamp.0.above", "lumens": 300.0, "kelvin": 2700.0},
            {"name": "ceiling_panel.0.panel", "lumens": 1350.0, "kelvin": 4000.0},
        ],
        "environment": {"kind": "sunsky"},
    }
    (root / "rooms/000000/room.json").write_text(json.dumps(described))
    dataset = open_dataset(root)
    text = card(root, dataset.manifest, dataset.frames)
    assert "| lamps of a room | 2 (2 to 2) |" in text
    assert "| of a lamp | 900 (495 to 1305) lm, 2700 (2700 to 3870) K |" in text
    assert "| outside the windows | sunsky 1 |" in text
    lit = dataset.frames.assign(lighting="area-light")
    manifest = {**dataset.manifest, "recipe": {**dataset.manifest["recipe"], "lighting": "area-light"}}
    assert "lamps of a room" not in card(root, manifest, lit)
    for content in ("{", '{"lights": 3}', "[]"):  # a room.json that cannot be read adds nothing
        (root / "rooms/000000/room.json").write_text(content)
        text = card(root, dataset.manifest, dataset.frames)
        assert "radiance shown as white" in text
        assert "lamps of a room" not in text
