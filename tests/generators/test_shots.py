"""Which frames share a light, which have one of their own, and what moves."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gibench.generators.area_lights import NoPlaceForLight
from gibench.generators.imported.room import ImportedRoom
from gibench.generators.parts import Camera
from gibench.generators.shots import TURN, Environments, lit, shot_before, shot_of
from gibench.rendering.lighting import Lighting
from gibench.rendering.panoramas import Panorama


def cameras(*paths: str) -> tuple[Camera, ...]:
    steps: dict[str, int] = {}
    made = []
    for number, path in enumerate(paths):
        made.append(Camera((float(number), 0, 1), (number, 1, 1), 1.0, path, steps.get(path, 0)))
        steps[path] = steps.get(path, -1) + 1 if not path else steps.get(path, 0) + 1
    return tuple(made)


def room(*paths: str, seed: int = 3, index: int = 0) -> ImportedRoom:
    return ImportedRoom(seed, index, scene=None, cameras=cameras(*paths))  # type: ignore[arg-type]


MAPS = tuple(Panorama.of(f"map {k}", np.random.default_rng(k).random((4, 8, 3)) + 0.1) for k in range(5))
LIGHTS = Environments(MAPS)


def test_stills_have_a_light_each_whatever_comes_after_them():
    stills = lit(room("", "", ""), LIGHTS, {})
    assert len(set(stills.lightings)) == 3
    more = lit(room("", "", "", "", "walk", "walk"), LIGHTS, {"walk": "camera"})
    assert more.lightings[:3] == stills.lightings
    assert lit(room("", "", "", seed=4), LIGHTS, {}).lightings[0] != stills.lightings[0]
    assert lit(room("", "", "", index=1), LIGHTS, {}).lightings[0] != stills.lightings[0]
    assert lit(room("", "", ""), LIGHTS, {}).lightings == stills.lightings


@pytest.mark.parametrize("moves", ["light", "both"])
def test_a_path_shares_its_light_or_moves_it_in_small_steps(moves):
    made = lit(room("", "a", "a", "a", "b", "b", "b"), LIGHTS, {"a": "camera", "b": moves})
    assert len(set(made.lightings[1:4])) == 1
    turning = [lighting.environment for lighting in made.lightings[4:]]
    assert len({environment.panorama for environment in turning}) == 1
    steps = np.diff([environment.rotation for environment in turning]) % (2 * math.pi)
    np.testing.assert_allclose(steps, TURN)
    # The light of a path does not depend on how many stills there are.
    fewer = lit(room("a", "a", "a", "b", "b", "b"), LIGHTS, {"a": "camera", "b": moves})
    assert fewer.lightings == made.lightings[1:]


def test_the_frame_before_is_that_of_the_same_path():
    made = lit(room("", "a", "a", "b"), LIGHTS, {"a": "light", "b": "camera"})
    assert [shot_before(made, view) for view in (0, 1, 3)] == [None, None, None]
    assert shot_before(made, 2) == shot_of(made, 1)
    assert shot_of(made, 1).lighting == made.lightings[1]
    assert shot_of(replace(made, lightings=()), 1).lighting == Lighting()


class Nowhere:
    """Source of a light that has no place."""

    def one(self, rng, cameras):
        raise NoPlaceForLight("no place for an area light", "leave this room out")

    moving = one


@pytest.mark.parametrize("paths", [("",), ("a", "a")])
def test_a_light_without_a_place_names_the_scene_file(paths):
    scene = SimpleNamespace(tree=SimpleNamespace(file="barn/scene.xml"))
    said = r"^room rejected: barn/scene\.xml: no place for an area light; leave this room out$"
    with pytest.raises(NoPlaceForLight, match=said):
        lit(replace(room(*paths), scene=scene), Nowhere(), {"a": "light"})


def test_stills_have_one_of_a_few_rotations_but_maps_still_turn():
    lights = replace(LIGHTS, rotations=3)
    made = lit(room(*[""] * 60, "a", "a"), lights, {"a": "light"}).lightings
    turns = {lighting.environment.rotation for lighting in made[:60]}
    np.testing.assert_allclose(sorted(turns), [0, 2 * math.pi / 3, 4 * math.pi / 3])
    assert len({lighting.environment for lighting in made[:60]}) == 3 * len(MAPS)
    step = (made[61].environment.rotation - made[60].environment.rotation) % (2 * math.pi)
    np.testing.assert_allclose(step, TURN)
