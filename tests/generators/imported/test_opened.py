"""Ceilings and walls cut out of scene files."""

import numpy as np
import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.opened import opened_scene
from gibench.generators.imported.orientation import oriented
from gibench.generators.imported.scene import import_scene
from gibench.generators.imported.turning import without_flips
from gibench.generators.opened import UnknownOpening
from gibench.rendering.free_space import fan
from tests.generators.imported.files import room_file


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A scene and points of its free space."""
    scene, found = oriented(import_scene(room_file(tmp_path_factory.mktemp("room"))))
    return without_flips(scene), found


def faces(scene, name):
    return next(s for s in scene.loaded.mi_scene.shapes() if s.id() == name).face_count()


def escaping(scene, found, towards):
    return float((~np.isfinite(fan(scene.loaded, found[::9], np.array([towards]))[0])).mean())


def test_the_ceiling_and_its_lamp_are_cut_out(room):
    scene, found = room
    assert faces(scene, "shell") == 12
    opened = opened_scene(scene, "ceiling", found)
    assert faces(opened, "shell") == 10
    assert "lamp" not in opened.loaded.shapes
    assert set(scene.loaded.shapes) - set(opened.loaded.shapes) == {"lamp"}
    assert escaping(opened, found, (0.0, 0, 1)) > 0.99
    assert escaping(opened, found, (0.0, -1, 0)) == 0
    assert {change.what for change in opened.changes} - {change.what for change in scene.changes} == {
        "the ceiling is taken away"
    }
    # What is left is where it was.
    box = next(s for s in opened.loaded.mi_scene.shapes() if s.id() == "shell").bbox()
    np.testing.assert_allclose(
        np.array([box.min, box.max]).reshape(2, 3), [[-2.5, -3, 0], [2.5, 3, 2.7]], atol=1e-5
    )


def test_a_stage_is_open_behind_its_camera(room):
    scene, found = room
    stage = opened_scene(scene, "stage", found)
    assert faces(stage, "shell") == 8
    assert escaping(stage, found, (0.0, -1, 0)) > 0.5
    assert escaping(stage, found, (0.0, 1, 0)) == 0
    assert "the wall at -y is taken away" in {change.what for change in stage.changes}


def test_nothing_is_taken_away_where_nothing_is_asked_for(room):
    scene, found = room
    assert opened_scene(scene, "none", found) is scene
    with pytest.raises(UnknownOpening, match="'roof' is not allowed"):
        opened_scene(scene, "roof", found)


def test_a_ceiling_that_cannot_be_taken_away_is_named(tmp_path):
    """Two slopes that meet in a ridge: each is one face or two, and reaches far down."""
    vault = "".join(
        f'<shape type="rectangle" id="vault{k}"><transform name="to_world"><scale x="4" y="4" z="1"/>'
        f'<rotate x="1" angle="{180 + tilt}"/><translate z="2.2"/></transform><ref id="wall"/></shape>'
        for k, tilt in enumerate((-35, 35))
    )
    scene, found = oriented(import_scene(room_file(tmp_path, extra=vault)))
    with pytest.raises(SceneFileError, match=r"the ceiling cannot be taken away: \d+% of the room") as caught:
        opened_scene(without_flips(scene), "ceiling", found)
    assert "\n" not in str(caught.value)
