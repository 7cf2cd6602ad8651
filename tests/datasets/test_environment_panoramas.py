"""Panoramas of rooms: they look where they should, and the same command continues."""

import importlib.metadata
import json

import numpy as np
import pytest

from gibench.datasets.environment_panoramas import make_environments, panorama_from, room_seed
from gibench.datasets.errors import FolderError
from gibench.generators.environments.files import environment_files, read_environment
from gibench.rendering.backend import VARIANTS, select_variant
from gibench.rendering.latlong import directions, for_envmap


def test_every_direction_is_where_it_should_be():
    """In a scene that is nothing but an environment the panorama is that environment again."""
    select_variant()
    import mitsuba as mi

    from gibench.rendering.scene import load_dict

    towards = directions(np.arange(128) + 0.5, np.arange(64)[:, None] + 0.5, 64)
    image = (1.5 + towards + 0.3 * towards[..., [1, 2, 0]] * towards[..., [2, 0, 1]]).astype(np.float32)
    to_world = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    emitter = {"type": "envmap", "bitmap": mi.Bitmap(for_envmap(image)), "to_world": to_world}
    speck = {"type": "sphere", "center": [0, 0, -1000], "radius": 0.01}
    scene = load_dict({"type": "scene", "environment": emitter, "speck": speck})
    seen = panorama_from(scene, (0.3, -0.2, 0.1), spp=4, seed=0)
    towards = directions(np.arange(256) + 0.5, np.arange(128)[:, None] + 0.5, 128)
    expected = 1.5 + towards + 0.3 * towards[..., [1, 2, 0]] * towards[..., [2, 0, 1]]
    np.testing.assert_allclose(seen, expected, atol=0.03)


def test_the_same_command_continues_and_gives_the_same_pixels(tmp_path):
    done = []
    files = make_environments(
        tmp_path / "maps", count=1, seed=5, spp=1, height=16, on_done=lambda n, of: done.append((n, of))
    )
    content, when = files[0].read_bytes(), files[0].stat().st_mtime_ns
    assert make_environments(tmp_path / "maps", count=1, seed=5, spp=1, height=16) == files
    assert files[0].stat().st_mtime_ns == when
    assert done == [(1, 1)]
    # One that was not finished has no file, and is made again.
    files[0].unlink()
    make_environments(tmp_path / "maps", count=1, seed=5, spp=1, height=16)
    assert files[0].read_bytes() == content
    assert sorted(p.name for p in (tmp_path / "maps").iterdir()) == [
        "environments.json",
        *(file.name for file in files),
    ]
    listed = environment_files(str(tmp_path / "maps"))
    assert [entry.path for entry in listed] == [file.resolve() for file in files]
    assert all((read_environment(entry.path) > 0).any() for entry in listed)


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(FolderError, match="holds something else"):
        make_environments(tmp_path, count=1, seed=0, spp=1, height=16)
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "environments.json").write_text('{"seed": 1, "spp": 1, "height": 16}')
    with pytest.raises(FolderError, match="panoramas of other settings"):
        make_environments(tmp_path / "maps", count=1, seed=0, spp=1, height=16)
    (tmp_path / "maps" / "environments.json").write_text("{")
    with pytest.raises(FolderError, match="is damaged"):
        make_environments(tmp_path / "maps", count=1, seed=0, spp=1, height=16)


def test_what_a_killed_run_leaves_of_its_record_stops_nothing(tmp_path):
    (tmp_path / ".environments.json.partial-1230000099").write_text("{")
    assert len(make_environments(tmp_path, count=1, seed=5, spp=1, height=16)) == 1


def test_panoramas_of_another_variant_or_other_versions_are_not_mixed_in(tmp_path):
    settings = {"count": 1, "seed": 5, "spp": 1, "height": 16}
    record = tmp_path / "environments.json"
    make_environments(tmp_path, **settings)
    made = json.loads(record.read_text())
    assert made["variant"] in VARIANTS
    assert made["versions"]["mitsuba"] == importlib.metadata.version("mitsuba")
    for key, other in (
        ("variant", "scalar_rgb"),
        ("versions", {**made["versions"], "mitsuba": "0"}),
    ):
        record.write_text(json.dumps({**made, key: other}))
        with pytest.raises(
            FolderError, match=r"was begun with something else \((variant: scalar_rgb|mitsuba: 0) there"
        ):
            make_environments(tmp_path, **settings | {"count": 2})
        assert len(list(tmp_path.iterdir())) == 2
    # What an older version began goes on.
    record.write_text(json.dumps({"seed": 5, "spp": 1, "height": 16}))
    assert len(make_environments(tmp_path, **settings | {"count": 2})) == 2
    assert json.loads(record.read_text()) == {"seed": 5, "spp": 1, "height": 16}


def test_no_dataset_has_the_rooms():
    assert len({room_seed(seed) for seed in range(100)} | set(range(100))) == 200
    assert 0 <= room_seed(2**63 - 1) < 2**63
