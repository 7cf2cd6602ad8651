import json
import subprocess
import sys

import numpy as np
import pytest

from gibench.errors import GibenchError
from gibench.generators import rooms
from gibench.generators.layouts.placement import RejectedRoom
from gibench.generators.materials import is_glossy
from gibench.generators.parts import Environment
from gibench.generators.rooms import GLOSSY_AREA, KINDS, UnknownKind, sample_room
from gibench.generators.scene_files import describe
from gibench.generators.view_checks import GRID
from tests.generators.rooms_at_hand import INDICES, SEED, joined, room


def same_objects(a, b):
    assert [t.name for t in a.objects] == [t.name for t in b.objects]
    for first, second in zip(a.objects, b.objects, strict=True):
        assert first.parameters == second.parameters
        np.testing.assert_array_equal(joined(first)[0], joined(second)[0])


def test_the_same_seed_and_index_give_the_same_room():
    a, b = sample_room(5, 3), sample_room(5, 3)
    assert json.dumps(describe(a)) == json.dumps(describe(b))
    same_objects(a, b)
    other = sample_room(5, 4)
    assert json.dumps(describe(a)) != json.dumps(describe(other))


def test_another_process_gives_the_same_room():
    code = (
        "import json; from gibench.generators.rooms import sample_room;"
        "from gibench.generators.scene_files import describe;"
        f"print(json.dumps(describe(sample_room({SEED}, 0, kind='living'))))"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert other.stdout.strip().splitlines()[-1] == json.dumps(describe(room(0)))


def test_lanes_are_apart():
    a = sample_room(5, 3, kind="office")
    fewer = sample_room(5, 3, kind="office", views=2)
    same_objects(a, fewer)
    assert a.cameras[0] == fewer.cameras[0] or len(a.cameras) != len(fewer.cameras)
    dark = sample_room(5, 3, kind="office", environment="none")
    same_objects(a, dark)
    assert a.lights == dark.lights
    assert a.cameras == dark.cameras
    assert dark.environment.kind == "none"
    walking = sample_room(5, 3, kind="office", path="walk", views=6)
    if walking.parameters["attempt"] == a.parameters["attempt"]:
        same_objects(a, walking)
    assert {c.path for c in walking.cameras} == {"walk"}
    assert len(walking.cameras) == 6


def test_a_path_beside_stills_leaves_the_room_and_its_stills_as_they_were():
    alone = sample_room(5, 3, kind="office", views=3)
    both = sample_room(5, 3, kind="office", views=3, path="walk", path_views=5)
    same_objects(alone, both)
    assert alone.lights == both.lights
    assert alone.environment == both.environment
    assert both.cameras[:3] == alone.cameras
    assert [(camera.path, camera.step) for camera in both.cameras[3:]] == [("walk", k) for k in range(5)]
    with pytest.raises(UnknownKind, match="5 cameras on no path"):
        sample_room(5, 3, path_views=5)


def test_names_are_unique_and_materials_known():
    for index in INDICES:
        a_room = room(index)
        names = [t.name for t in a_room.objects]
        assert len(set(names)) == len(names)
        for thing in a_room.objects:
            assert len({m for _, m in thing.shapes}) == len(thing.shapes), "shapes of a material are joined"
            for _, material in thing.shapes:
                assert a_room.materials[material].name == material


def test_meshes_keep_their_contract():
    for thing in room(0).objects:
        for mesh, _ in thing.shapes:
            assert np.isfinite(mesh.vertices).all()
            assert np.isfinite(mesh.uvs).all()
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
            assert mesh.faces.min() >= 0
            assert mesh.faces.max() < len(mesh.vertices)


def test_a_third_of_rooms_shows_reflections():
    glossy = 0
    more = (sample_room(SEED, 100 + k, kind=KINDS[k % 5], views=1) for k in range(20))
    for a_room in [*(room(index) for index in INDICES), *more]:
        listed = a_room.parameters["glossy"]
        glossy += bool(listed)
        for thing in a_room.objects:
            if thing.name in listed:
                area = 0.0
                for mesh, material in thing.shapes:
                    if is_glossy(a_room.materials[material]):
                        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
                        area += np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
                assert area > GLOSSY_AREA
    assert glossy >= 10


def test_rejections_are_counted_by_reason(monkeypatch):
    a_room = room(1)
    assert all(isinstance(k, str) and v > 0 for k, v in a_room.rejections.items())
    assert GRID == (24, 18)
    monkeypatch.setattr(rooms, "LEAST_FREE", 100.0)  # m² of floor
    with pytest.raises(RejectedRoom, match="failed 12 times") as caught:
        sample_room(1, 0, kind="living", width=3.0, depth=3.5, height=2.3, views=1)
    assert isinstance(caught.value, GibenchError)


def test_fixed_sizes_are_kept():
    a_room = sample_room(2, 0, kind="bedroom", width=4.25, height=2.9, views=1)
    assert a_room.parameters["shell"]["width"] == 4.25
    assert a_room.parameters["shell"]["height"] == 2.9


def test_environment_as_given():
    given = Environment("none", {})
    assert sample_room(2, 1, environment=given, views=1).environment is given
    assert sample_room(2, 1, environment="sunsky", views=1).environment.kind == "sunsky"


@pytest.mark.parametrize("options", [{"kind": "cellar"}, {"kinds": ["living", "attic"]}, {"path": "fly"}])
def test_unknown_names_are_refused(options):
    with pytest.raises(UnknownKind, match="there is no"):
        sample_room(0, 0, **options)


def test_kinds_are_drawn_from_those_asked_for():
    drawn = {sample_room(7, k, kinds=("office", "bathroom"), views=1).kind for k in range(6)}
    assert drawn == {"office", "bathroom"}
