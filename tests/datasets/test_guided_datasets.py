"""Datasets of guided paths: the guide is learned anew in every process, and alike."""

from __future__ import annotations

from gibench.cli.making import describe
from gibench.datasets import open_dataset
from gibench.datasets.making import make
from gibench.datasets.manifest import read_manifest
from gibench.datasets.recipes import check_recipe

TINY = {"seed": 4, "kinds": ["bathroom"], "views": 2, "resolution": [16, 12], "spp": 4, "sampling": "guided"}


def frames(root):
    return [path.read_bytes() for path in sorted(root.glob("rooms/*/frames/*.exr"))]


def test_workers_and_a_run_in_two_parts_change_no_bit(tmp_path, capsys):
    undisturbed, parts = tmp_path / "undisturbed", tmp_path / "parts"
    make(undisturbed, check_recipe({**TINY, "rooms": 2}))
    for rooms in (1, 2):
        make(parts, check_recipe({**TINY, "rooms": rooms}), workers=2)
    assert len(frames(undisturbed)) == 4
    assert frames(parts) == frames(undisturbed)
    # And they are guided.
    make(tmp_path / "plain", check_recipe({**TINY, "rooms": 1, "sampling": "plain"}))
    plain, guided = (open_dataset(root)[0]["color"] for root in (tmp_path / "plain", undisturbed))
    assert (plain != guided).any()
    # Which is said to whoever has a dataset: by its card and by `gibench dataset info`.
    for root, said in ((undisturbed, True), (tmp_path / "plain", False)):
        assert ("4 samples a pixel along guided paths" in (root / "DATASET.md").read_text()) == said
        describe(root, read_manifest(root))
        assert ("guided: lights and directions" in capsys.readouterr().out) == said


def test_paths_that_are_guided_unasked_are_said_to_be(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("gibench.datasets.recipes.GUIDED_FROM", 1)
    root = tmp_path / "many"
    make(root, check_recipe({**TINY, "rooms": 1, "views": 1, "sampling": None}))
    assert "along guided paths" in (root / "DATASET.md").read_text()
    describe(root, read_manifest(root))
    assert "guided: lights and directions" in capsys.readouterr().out
