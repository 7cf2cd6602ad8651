import json
from pathlib import Path

import pytest

from gibench.datasets.errors import FolderError, RecipeError
from gibench.datasets.manifest import refuse_other
from gibench.datasets.recipes import Recipe, check_recipe, load_preset, load_recipe, preset_names
from gibench.rendering.channels import resolve


def test_presets_are_those_that_the_readme_names():
    assert preset_names() == ("paper", "small", "smoke", "unseen")
    smoke, small, paper, unseen = (load_preset(name) for name in ("smoke", "small", "paper", "unseen"))
    assert (smoke.rooms, smoke.views, smoke.resolution, smoke.spp, smoke.denoise) == (
        2,
        2,
        (64, 48),
        16,
        False,
    )
    assert (small.views, small.resolution, small.spp, small.denoise) == (4, (256, 192), 64, True)
    assert (paper.views, paper.resolution, paper.spp) == (20, (768, 512), 1024)
    # 30,000 frames of Gai et al.
    assert (unseen.rooms, unseen.views, unseen.resolution, unseen.spp) == (1500, 20, (768, 512), 1024)


def test_defaults_are_the_preset_small():
    assert Recipe() == load_preset("small")


def test_a_file_is_read_and_options_win(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('rooms = 7\nresolution = [32, 24]\nerror = 0.05\nchannels = ["depth", "color"]\n')
    recipe = load_recipe(path)
    assert (recipe.rooms, recipe.resolution, recipe.error, recipe.spp) == (7, (32, 24), 0.05, None)
    assert recipe.channels == ("color", "depth")
    changed = load_recipe(path, {"spp": 8, "rooms": 2, "channels": ("radiance",)})
    assert (changed.rooms, changed.spp, changed.error) == (2, 8, None)
    assert changed.channels == resolve(["radiance"])


def test_a_path_of_an_environment_counts_from_the_recipe(tmp_path):
    (tmp_path / "sky.exr").write_bytes(b"x")
    (tmp_path / "mine.toml").write_text('environment = "sky.exr"\n')
    assert load_recipe(tmp_path / "mine.toml").environment == str(tmp_path / "sky.exr")


def test_identity_leaves_out_the_number_of_rooms_and_takes_files_by_content(tmp_path):
    assert Recipe(rooms=3).identity() == Recipe(rooms=9).identity()
    assert Recipe(seed=3).identity() != Recipe(seed=4).identity()
    (tmp_path / "a.exr").write_bytes(b"light")
    (tmp_path / "b.exr").write_bytes(b"light")
    (tmp_path / "c.exr").write_bytes(b"other")
    a, b, c = (Recipe(environment=str(tmp_path / f"{name}.exr")).identity() for name in "abc")
    assert a == b != c


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("splits", {"train": 0.5, "test": 0.5}),
        ("sequences", {"a": {"views": 2}, "b": {"views": 2}}),
        ("environments", ["aerodynamics_workshop", "autoshop_01"]),
    ],
)
def test_the_order_of_tables_is_part_of_the_identity(tmp_path, key, values):
    light = {"lighting": "environments"} if key == "environments" else {}
    turned = values[::-1] if isinstance(values, list) else dict(reversed(values.items()))
    one, other = (check_recipe({**light, key: table}) for table in (values, turned))
    assert one != other
    assert one == check_recipe({**light, key: values})
    manifest = {"identity": one.identity(), "recipe": one.model_dump(mode="json"), "command": "make-dataset"}
    manifest = json.loads(json.dumps(manifest))
    refuse_other(tmp_path, manifest, one)
    refuse_other(tmp_path, manifest, Recipe.model_validate(manifest["recipe"]))
    with pytest.raises(FolderError, match=f"holds another dataset .order of {key}: "):
        refuse_other(tmp_path, manifest, other)


def test_a_recipe_survives_json():
    recipe = load_preset("paper")
    assert Recipe.model_validate(recipe.model_dump(mode="json")) == recipe


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("rooms = 0", "rooms: 0 is not allowed; allowed is an integer from 1"),
        ('rooms = "4"', "rooms: '4' is not allowed; allowed is an integer"),
        ("views = 2.5", "views: 2.5 is not allowed; allowed is an integer"),
        ("denoise = 1", "denoise: 1 is not allowed; allowed is true or false"),
        ("resolution = [256]", "resolution: [256] is not allowed; allowed is two integers [width, height]"),
        ("resolution = [256, -1]", "resolution: [256, -1] is not allowed"),
        ('resolution = ["a", 2]', "allowed is two integers [width, height]"),
        ("kinds = []", "kinds: [] is not allowed; allowed is a list of room kinds"),
        ('kinds = ["livingroom"]', "no kind 'livingroom'; did you mean 'living'"),
        ('channels = ["colour"]', "did you mean color"),
        ("error = 2.0", "error: 2.0 is not allowed; allowed is a number between 0 and 1"),
        ("spp = 4\nerror = 0.1", "spp and error are both set"),
        ("spp = 1", "color_se needs spp from 2 on; raise spp, or name channels without color_se"),
        ("error = 0.1\nspp_cap = 63", "spp_cap: 63 is not allowed; allowed is an integer from 64"),
        (
            'error = 0.1\nchannels = ["radiance_cue_2", "depth"]',
            "radiance cues need spp where no radiance is asked for: give it in place of error",
        ),
        ("splits = {train = nan}", "the shares do not sum to 1"),
        ("splits = {train = 2.0, test = -1.0}", "the shares do not sum to 1"),
        ("roms = 4", "unknown key 'roms'; did you mean 'rooms'"),
        ('path = "fly"', 'path: \'fly\' is not allowed; allowed is "stills", "walk"'),
        ("splits = {train = 0.5}", "the shares do not sum to 1"),
        ("splits = {train = 1.5, test = -0.5}", "the shares do not sum to 1"),
        ('splits = {"../../escaped" = 1.0}', "'../../escaped' is no name: letters, digits and _"),
        ('splits = {"a/b" = 0.5, test = 0.5}', "'a/b' is no name"),
        ('splits = {"50%" = 1.0}', "'50%' is no name"),
        ('splits = {"" = 1.0}', "'' is no name"),
        ('environment = "sunsk"', "there is no file"),
        ("rooms = ", "is no valid TOML"),
    ],
)
def test_what_is_wrong_is_said_with_file_key_and_what_is_allowed(tmp_path, text, says):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(RecipeError) as caught:
        load_recipe(path)
    message = str(caught.value)
    assert says in message
    assert "mine.toml" in message
    assert "\n" not in message


def test_wrong_options_are_named_as_options():
    with pytest.raises(RecipeError, match=r"^--rooms: 0 is not allowed; allowed is an integer from 1"):
        load_preset("small", {"rooms": 0})
    with pytest.raises(RecipeError, match=r"^--kind: no kind 'kitchen'; did you mean 'dining-kitchen'"):
        load_preset("small", {"kinds": ("kitchen",)})
    with pytest.raises(RecipeError, match="both set"):
        load_preset("small", {"spp": 4, "error": 0.1})
    with pytest.raises(RecipeError, match=r"^--error: radiance cues need spp"):
        load_preset("small", {"error": 0.1, "channels": ("lighting",)})
    assert load_preset("small", {"error": 0.1, "channels": ("lighting", "color")}).error == 0.1


def test_missing_files_and_presets():
    with pytest.raises(RecipeError, match=r"no preset 'smal'; did you mean 'small'\?"):
        load_preset("smal")
    with pytest.raises(RecipeError, match="cannot be read: No such file"):
        load_recipe(Path("nowhere.toml"))
    with pytest.raises(RecipeError, match=r"there is no file /nowhere\.exr"):
        check_recipe({"environment": "/nowhere.exr"})


def test_a_path_beside_stills():
    both = Recipe(views=3, path="walk", path_views=5)
    assert list(both.rendered_views()) == list(range(8))
    assert list(both.model_copy(update={"rendered": "stills"}).rendered_views()) == [0, 1, 2]
    assert list(both.model_copy(update={"rendered": "path"}).rendered_views()) == [3, 4, 5, 6, 7]
    assert list(Recipe(views=3, path="walk").rendered_views()) == [0, 1, 2]
    assert both.identity()["path_views"] == 5
    with pytest.raises(
        RecipeError, match="recipe: path_views needs a path: set path to walk, orbit or eight"
    ):
        check_recipe({"path_views": 2})
    with pytest.raises(
        RecipeError, match='rendered is "path", but only rooms with path_views, sequences or held_out'
    ):
        check_recipe({"path": "walk", "rendered": "path"})


def test_datasets_begun_before_there_were_paths_beside_stills_can_be_continued():
    assert not {"path_views", "rendered"} & Recipe(path="walk").identity().keys()


def test_stills_that_are_held_out_go_with_the_path():
    def views(**keys) -> list[int]:
        room = keys.pop("room", 0)
        return list(check_recipe({"views": 5, "held_out": 2, **keys}).rendered_views(room=room))

    assert views(rendered="stills") == [0, 1, 2]
    assert views(rendered="path") == [3, 4]
    path = {"path": "walk", "path_views": 3, "path_rooms": 1}
    assert views(rendered="path", **path) == [3, 4, 5, 6, 7]
    assert views(rendered="path", room=1, **path) == [3, 4]
    assert views(**path) == list(range(8))
    with pytest.raises(RecipeError, match="held_out is 6 of 5 views"):
        views(held_out=6)


def test_recipes_without_held_out_stills_are_what_they_were():
    new = {"held_out", "path_rooms", "rendered", "trajectories", "far", "rotations"}
    assert not new & check_recipe({"views": 5}).identity().keys()


def test_stills_along_trajectories_and_far_from_them():
    keys = {"views": 9, "held_out": 4, "trajectories": 2, "far": 1, "path": "walk", "path_views": 2}
    recipe = check_recipe(keys)
    assert [recipe.nearness(view) for view in range(11)] == [""] * 5 + ["near"] * 3 + ["far"] + [""] * 2
    assert [recipe.nearness(view, given=2) for view in (6, 7, 10, 11)] == ["", "near", "far", ""]
    assert check_recipe({"views": 9, "held_out": 4}).nearness(8) == ""
    assert {"trajectories": 2, "far": 1}.items() <= recipe.identity().items()
    with pytest.raises(RecipeError, match="far is 5 of 4 stills that are held out"):
        check_recipe(keys | {"far": 5})
    with pytest.raises(RecipeError, match="there are no trajectories to be far from: set trajectories"):
        check_recipe(keys | {"trajectories": 0})
    with pytest.raises(RecipeError, match="the views lie on the path: leave path out"):
        check_recipe({"views": 9, "trajectories": 2, "path": "walk"})
    with pytest.raises(RecipeError, match='rotations is set, but not the lighting: set lighting to "env'):
        check_recipe({"rotations": 3})


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"views = " + b"[" * 5000 + b"]" * 5000, "too many brackets"),
        (b"views = " + b"9" * 5000, "no valid TOML"),
        (b'environment = "' + b"x" * 5000 + b'"', "there is no file"),
        (b'environment = "a\\u0000b"', "no name of a file"),
        (b"scenes = [1, 2]", r"scenes: \[1, 2\] is not allowed"),
        (b'scenes = ["a.xml", 5]', "scenes: .* is not allowed"),
        (b"views = \xff", "no valid TOML"),
    ],
)
def test_whatever_a_recipe_holds_is_answered_in_a_line(tmp_path, content, says):
    (tmp_path / "r.toml").write_bytes(content)
    with pytest.raises(RecipeError, match=says) as refused:
        load_recipe(tmp_path / "r.toml")
    assert "\n" not in str(refused.value)


def test_a_byte_order_mark_is_skipped(tmp_path):
    (tmp_path / "r.toml").write_bytes(b"\xef\xbb\xbfviews = 3\n")
    assert load_recipe(tmp_path / "r.toml").views == 3


def test_many_paths_of_a_room_are_guided_where_nothing_is_said():
    """From as many on as learning pays for, in the light that the room keeps."""
    assert [load_preset(name).room_sampling for name in ("smoke", "small", "paper", "unseen")] == [
        "plain",
        "guided",
        "guided",
        "guided",
    ]
    many = {"views": 2, "resolution": [256, 256], "spp": 64}
    assert check_recipe(many).room_sampling == "guided"
    assert check_recipe({**many, "views": 1}).room_sampling == "plain"
    assert check_recipe({**many, "lighting": "area-light"}).room_sampling == "plain"
    assert (
        check_recipe({**many, "spp": 1, "channels": ["depth"], "sampling": "guided"}).room_sampling
        == "guided"
    )
    # What was begun as one of them is not continued as the other.
    assert check_recipe(many).identity() == check_recipe({**many, "sampling": "guided"}).identity()
    assert check_recipe(many).identity() != check_recipe({**many, "sampling": "plain"}).identity()
    assert "sampling" not in check_recipe({**many, "sampling": "plain"}).identity()
