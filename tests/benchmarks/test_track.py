import copy
import math
import os
from collections import Counter

import pytest

from gibench.baselines.method import Knob, Variant
from gibench.benchmarks.errors import TrackError
from gibench.benchmarks.orders import ordered_methods
from gibench.benchmarks.registry import installed
from gibench.benchmarks.settings import choices
from gibench.benchmarks.track import CHANNELS_OF, MOVING, check_track, load_track, track_names
from gibench.generators.rooms import sample_room
from gibench.rendering.render import MAX_DEPTH
from tests.benchmarks import toys
from tests.benchmarks.conftest import TINY


def changed(change) -> dict:
    values = copy.deepcopy(TINY)
    change(values, values["presets"]["tiny"])
    return values


def test_the_presets_of_the_walkthrough_are_what_the_issue_asks_for():
    track = load_track("walkthrough")
    assert track_names() == ("moving-light", "relight", "unseen-rooms", "walkthrough")
    smoke, cpu, paper = (track.preset(name) for name in ("smoke", "cpu", "paper"))
    assert smoke.rooms == 1
    assert min(smoke.recipe("reference").resolution) >= 31  # what LPIPS needs
    assert cpu.rooms >= 4
    assert cpu.recipe("reference").resolution == (320, 180)
    assert cpu.room["path_views"] >= 24
    assert paper.recipe("reference").resolution == (1920, 1080)
    for preset in (smoke, cpu, paper):
        training, reference = preset.recipe("training"), preset.recipe("reference")
        assert training.views <= 20
        assert reference.spp > training.spp
        assert reference.denoise
        again = preset.recipe("reference-again")
        assert again.sample_seed != reference.sample_seed
        assert again.model_copy(update={"sample_seed": reference.sample_seed}) == reference
        assert {*MOVING, *(c for part in track.parts for c in CHANNELS_OF[part])} <= set(reference.channels)
        assert reference.max_depth == training.max_depth == MAX_DEPTH


def test_training_views_and_references_are_of_the_same_rooms_and_no_frame_is_both():
    preset = check_track(TINY).preset("tiny")
    training, reference = preset.recipe("training"), preset.recipe("reference")
    rooms = []
    for recipe in (training, reference):
        room = sample_room(
            recipe.seed,
            0,
            kinds=recipe.kinds,
            views=recipe.views,
            path=recipe.path,
            path_views=recipe.path_views,
        )
        rooms.append(room)
    assert rooms[0].cameras == rooms[1].cameras
    assert not set(training.rendered_views()) & set(reference.rendered_views())
    assert {rooms[1].cameras[view].path for view in reference.rendered_views()} == {"walk"}
    assert {rooms[0].cameras[view].path for view in training.rendered_views()} == {""}


def test_a_preset_is_like_another_but_for_what_it_says():
    def add(track, tiny):
        tiny["room"]["kinds"] = ["office"]
        track["presets"]["shiny"] = {
            "like": "tiny",
            "rooms": 2,
            "room": {"gloss": "much", "kinds": ["living", "bedroom"]},
        }

    values = changed(add)
    before = copy.deepcopy(values)
    track = check_track(values)
    assert values == before
    tiny, shiny = track.preset("tiny"), track.preset("shiny")
    assert (tiny.rooms, tiny.recipe("reference").gloss) == (TINY["presets"]["tiny"]["rooms"], "any")
    assert (shiny.rooms, shiny.recipe("reference").gloss) == (2, "much")
    room = tiny.room | {"gloss": "much", "kinds": ["living", "bedroom"]}
    assert shiny == tiny.model_copy(update={"rooms": 2, "room": room})


def test_glossy_rooms_of_the_walkthrough_are_cpu_with_much_gloss():
    track = load_track("walkthrough")
    cpu, glossy = track.preset("cpu"), track.preset("glossy")
    assert glossy == cpu.model_copy(update={"room": cpu.room | {"gloss": "much"}})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda t, p: t["presets"].update(other={"like": "tniy"}),
            r"presets\.other\.like: no preset 'tniy' that stands for itself; did you mean 'tiny'\?",
        ),
        (
            lambda t, p: t["presets"].update(other={"like": "other"}),
            r"presets\.other\.like: no preset 'other'",
        ),
        (
            lambda t, p: t["presets"].update(other={"like": ["tiny"]}),
            r"presets\.other\.like: no preset \['tiny'",
        ),
        (lambda t, p: t["presets"].update(other={"like": "tiny", "roms": 2}), r"presets\.other\.roms: Extra"),
        (lambda t, p: t.update(presets=3), "track: presets: Input should be"),
        (lambda t, p: t["presets"].update(other=3), r"presets\.other"),
        (lambda t, p: t.update(presetz={}), "track: presetz: Extra inputs"),
        (lambda t, p: t.update(metrics=["rmsee"]), r"metrics: no metric 'rmsee'; did you mean 'rmse'"),
        (lambda t, p: t.update(parts=["full", "gloss"]), r"parts\.1"),
        (lambda t, p: p.update(rooms=0), r"presets\.tiny\.rooms"),
        (lambda t, p: p["budget"].update(render=-1), r"presets\.tiny\.budget\.render"),
        (lambda t, p: p["budget"].update(render=math.nan), r"presets\.tiny\.budget\.render"),
        (
            lambda t, p: p["room"].pop("path_views"),
            "preset tiny: room: path_views, held_out, sequences are missing",
        ),
        (lambda t, p: p["room"].update(path="stills"), "preset tiny: reference: path_views needs a path"),
        (lambda t, p: p["room"].update(kinds=["barn"]), "preset tiny: reference: kinds: no kind 'barn'"),
        (lambda t, p: p["training"].update(spq=3), "preset tiny: training: unknown key 'spq'"),
        (
            lambda t, p: p["reference"].update(channels=["radiance"]),
            "preset tiny: reference: channels lacks position, shape_id, motion, motion_valid, which scoring needs",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_place(change, says):
    with pytest.raises(TrackError, match=says):
        check_track(changed(change))


def test_unknown_tracks_presets_and_files(tmp_path):
    with pytest.raises(TrackError, match=r"no track 'walktrough'; did you mean 'walkthrough'\?"):
        load_track("walktrough")
    with pytest.raises(TrackError, match=r"no preset 'cpus'; did you mean 'cpu'\?"):
        load_track("walkthrough").preset("cpus")
    with pytest.raises(TrackError, match=r"none\.toml cannot be read: No such file"):
        load_track(str(tmp_path / "none.toml"))
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(TrackError, match=r"pipe\.toml is no regular file"):
        load_track(str(tmp_path / "pipe.toml"))
    (tmp_path / "bad.toml").write_text("id = ")
    with pytest.raises(TrackError, match=r"bad\.toml is no valid TOML"):
        load_track(str(tmp_path / "bad.toml"))


def sizes(name: str, preset: str = "cpu") -> tuple[list[int], list[int], tuple[int, int]]:
    """Rooms to train on and frames of each, frames of each room that is scored, and the size of them all."""
    size = load_track(name).preset(preset)
    training, reference = size.recipe("training"), size.recipe("reference")
    return (
        [training.rooms, len(training.rendered_views())],
        [len(reference.rendered_views(room=room)) for room in range(reference.rooms)],
        training.resolution,
    )


def test_the_presets_of_the_tracks_with_other_light_and_other_rooms():
    """What is trained on and what is scored at the size of two cores."""
    assert sizes("moving-light") == ([2, 1000], [60 + 24 + 24] * 2, (128, 128))
    assert sizes("relight") == ([2, 500], [40 + 24 + 24] * 2, (128, 128))
    assert sizes("unseen-rooms") == ([200, 4], [3 + 16] * 4 + [3] * 20, (192, 128))
    for name in ("moving-light", "relight", "unseen-rooms"):
        track = load_track(name)
        # The networks for unseen rooms predict one lobe, as their paper does.
        lobes = ("diffuse", "specular") if name == "unseen-rooms" else ()
        assert track.parts == ("full", "indirect", *lobes)
        assert {"mae", "mse", "psnr", "ssim", "lpips_alex"} <= set(track.metrics)
        assert "warping_error" in track.sequence_metrics


def test_the_presets_for_the_papers_have_their_sizes():
    """Gao et al. 2022, sections 3.7.2 and 4.1; Raghavan et al. 2023, section 5; Gai et al., sections 4 to 5.2.

    Sequences come on top: two of 120 frames, and paths of 60 in ten rooms.
    """
    # Eight scenes with 5000 images each, and 100 of new views and lights.
    assert sizes("moving-light", "paper") == ([8, 5000], [100 + 120 + 120] * 8, (256, 256))
    # Four scenes with 4000 images each.
    assert sizes("relight", "paper") == ([4, 4000], [200 + 120 + 120] * 4, (512, 512))
    # 30,000 images of 1500 layouts, and 1000 of others.
    assert sizes("unseen-rooms", "paper") == ([1500, 20], [20 + 60] * 10 + [20] * 40, (768, 512))
    training, reference = (
        load_track("moving-light").preset("paper").recipe(r) for r in ("training", "reference")
    )
    assert training.spp == 1024
    assert training.max_depth == reference.max_depth == 16


def test_relight_trains_on_real_and_rendered_maps_and_is_scored_near_and_far(tmp_path):
    for name, maps, far, rotations in (("cpu", 15 + 100, 20, 0), ("paper", 1000, 100, 3)):
        preset = load_track("relight").preset(name)
        plain = preset.recipe("training")
        assert preset.panoramas is not None
        assert len(plain.environment_files()) + preset.panoramas.count == maps
        assert plain.rotations == rotations
        (tmp_path / "room.exr").touch()
        both = preset.recipe("training", panoramas=tmp_path)
        assert both.environments == ("train", str(tmp_path))
        assert preset.recipe("reference", panoramas=tmp_path) == preset.recipe("reference")
        reference = preset.recipe("reference")
        groups = Counter(reference.nearness(view) for view in reference.rendered_views())
        assert groups["near"] == groups["far"] == far
        assert not {m.name for m in plain.environment_files()} & {
            m.name for m in reference.environment_files()
        }


def test_every_track_takes_scene_files_in_the_place_of_rooms(tmp_path):
    (tmp_path / "scene.xml").touch()
    scenes = {"scenes": (str(tmp_path / "scene.xml"),), "up": "y"}
    for name in track_names():
        for preset in load_track(name).presets.values():
            reference = preset.recipe("reference", scenes=scenes)
            training = preset.recipe("training", preset.training_rooms, scenes)
            assert (reference.scenes, reference.up, reference.gloss) == (scenes["scenes"], "y", "any")
            if preset.training_rooms is None:
                assert training.scenes == scenes["scenes"]
            else:  # what is trained on are rooms all the same
                assert training == preset.recipe("training")


ROOMS = {"prepare_on": "rooms"}
OWN = {"training_rooms": 3, "training_seed": 9}


@pytest.mark.parametrize(
    ("track", "preset", "says"),
    [
        ({}, OWN, 'training_rooms and training_seed need prepare_on = "rooms"'),
        (ROOMS, {}, 'prepare_on = "rooms" needs training, training_rooms and training_seed'),
        (
            ROOMS,
            OWN | {"training_seed": 4},
            "the rooms to train on would be those that are scored; choose another",
        ),
        (ROOMS, OWN | {"training": None}, 'prepare_on = "rooms" needs training'),
        ({}, {"panoramas": {"count": 1}}, "panoramas needs training with environments"),
        (
            {},
            {"budget": {"training": 60, "prepare": 60, "render": 5}},
            r"training \(60 s\) must be below prepare \(60 s\), after which the process is killed",
        ),
    ],
)
def test_trainings_that_cannot_be_are_refused(track, preset, says):
    def change(t, p):
        t.update(track)
        p.update(preset)

    with pytest.raises(TrackError, match=says):
        check_track(changed(change))


def test_other_training_seconds():
    track = check_track(changed(lambda t, p: p.update(budget={"training": 9, "prepare": 60, "render": 5})))
    shorter = track.with_training_seconds("tiny", 3)
    assert shorter.preset("tiny").budget.training == 3
    assert track.preset("tiny").budget.training == 9
    assert shorter.preset("tiny").recipe("training") == track.preset("tiny").recipe("training")
    with pytest.raises(TrackError, match=r"training \(60 s\) must be below prepare \(60 s\)"):
        track.with_training_seconds("tiny", 60)
    with pytest.raises(TrackError, match="preset tiny of track walkthrough has nothing to train on"):
        check_track(changed(lambda t, p: p.update(training=None))).with_training_seconds("tiny", 3)


def test_rooms_to_train_on_are_others_than_those_that_are_scored():
    track = check_track(changed(lambda t, p: (t.update(ROOMS), p.update(OWN))))
    preset = track.preset("tiny")
    training, reference = preset.recipe("training"), preset.recipe("reference")
    assert (training.rooms, training.seed, training.rendered, training.path) == (3, 9, "all", "stills")
    assert (reference.rooms, reference.seed) == (1, 4)
    scenes = preset.recipe("training", scenes={"scenes": ("nowhere.xml",)})
    assert scenes == training


def test_a_method_that_trains_where_there_is_nothing_to_train_on():
    track = check_track(changed(lambda t, p: p.pop("training")))
    for method in (toys.found("Plain", trains=True), toys.CONSTANT):
        with pytest.raises(TrackError, match="trains, but walkthrough, preset tiny, has no views"):
            ordered_methods(track, "tiny", [method], {})
    assert ordered_methods(track, "tiny", [toys.PLAIN], {})


def test_a_variant_runs_once_at_the_base_of_its_method():
    knobs = tuple(
        Knob(name, default, (1, 2, 3, 4), "a number")
        for name, default in (("size", 1), ("rays", 1), ("parts", 1), ("shared", 1))
    )
    variants = (Variant("large", {"size": 4}), Variant("wide", {"size": 4, "shared": 4}))
    method, large, wide = toys.card("Plain", knobs=knobs, variants=variants).with_variants()
    tables = {"plain": {"base": {"size": 2, "parts": 2}, "vary": {"rays": [2, 3, 4]}}}
    values = {"knobs": {"shared": 2}, "methods": tables}

    def run(method):
        preset = check_track(changed(lambda t, p: p.update(values))).preset("tiny")
        return [tuple(choice.settings.values()) for choice in choices(method, preset.plan(method), {})]

    assert run(method) == [(2, 2, 2, 2), (2, 3, 2, 2), (2, 4, 2, 2)]
    # What is swept stays at its default.
    assert run(large) == [(4, 1, 2, 2)]
    assert run(wide) == [(4, 1, 2, 4)]
    tables["plain:large"] = {"base": {"parts": 3}, "vary": {"shared": [3, 4]}}
    assert run(large) == [(4, 1, 3, 3), (4, 1, 3, 4)]


def test_presets_give_variants_what_their_methods_have():
    cpu = load_track("moving-light").preset("cpu")
    for id in ("rrf", "rrf:facing"):
        (choice,) = choices(installed().get(id).method, cpu.plan(installed().get(id).method), {})
        assert choice.settings["cells"] == 256
        assert choice.label == id
