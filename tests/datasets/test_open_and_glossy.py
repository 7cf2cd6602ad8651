"""Recipes whose rooms lack a ceiling or are polished, from the file to the room."""

import pytest

from gibench.datasets.errors import RecipeError
from gibench.datasets.recipes import check_recipe
from gibench.datasets.room_making import sampled_room
from gibench.generators.imported.room import ImportedRoom
from tests.generators.imported.files import room_file


def test_datasets_of_closed_rooms_are_what_they_were():
    assert not {"opened", "gloss"} & set(check_recipe({}).identity())
    assert check_recipe({"opened": "stage", "gloss": "much"}).identity()["opened"] == "stage"


@pytest.mark.parametrize(
    ("key", "value", "allowed"), [("opened", "roof", "ceiling"), ("gloss", "some", "much")]
)
def test_what_is_not_allowed_is_named(key, value, allowed):
    with pytest.raises(RecipeError, match=allowed) as caught:
        check_recipe({key: value})
    assert key in str(caught.value)
    assert "\n" not in str(caught.value)


def test_scenes_bring_their_own_gloss(tmp_path):
    with pytest.raises(RecipeError, match="gloss is set, but scenes bring their own materials"):
        check_recipe({"scenes": [str(room_file(tmp_path))], "gloss": "much"})


def test_an_opened_room_has_the_lights_and_cameras_of_the_closed_one():
    recipe = {"rooms": 1, "views": 1, "kinds": ["living"], "lighting": "area-light"}
    closed = sampled_room(check_recipe(recipe), 0)
    opened = sampled_room(check_recipe({**recipe, "opened": "stage"}), 0)
    assert opened.cameras == closed.cameras
    assert opened.lightings == closed.lightings
    assert "ceiling" in {thing.name for thing in closed.objects}
    assert "ceiling" not in {thing.name for thing in opened.objects}


def test_scene_files_are_opened_too(tmp_path):
    recipe = {"scenes": [str(room_file(tmp_path))], "views": 1, "opened": "ceiling"}
    room = sampled_room(check_recipe(recipe), 0)
    assert isinstance(room, ImportedRoom)
    assert "lamp" not in room.scene.loaded.shapes
    assert len(room.openings) == 0
    assert any(change.rule == "opened" for change in room.scene.changes)
