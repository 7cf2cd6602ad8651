"""Area lights, environments and shots: what they are, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import AreaLight, EnvironmentMap, Lighting, LightingError, Shot
from gibench.rendering.panoramas import Panorama

LIGHT = AreaLight((0.2, -0.1, 1.9), (0.3, 0.2, -2.0), 0.4, 0.3, (8, 7, 6))


def panorama(seed: int = 0, size: tuple[int, int] = (32, 16)) -> Panorama:
    """Uneven light from everywhere, brightest where the seed says."""
    rng = np.random.default_rng(seed)
    return Panorama.of(f"map {seed}", rng.random((size[1], size[0], 3)) ** 4 * 2)


@pytest.mark.parametrize("direction", [(0, 0, -1), (0, 0, 1), (1, 0, 0), (0.3, 0.2, -2.0), (1e-7, 0, -1)])
@pytest.mark.parametrize("up", [None, (0.3, 1.0, 0.1)])
def test_a_light_is_a_rectangle_with_its_front_along_its_direction(direction, up):
    light = AreaLight((1, 2, 3), direction, 0.4, 0.3, (1, 1, 1), up)
    np.testing.assert_allclose(light.axes @ light.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(light.axes) > 0
    np.testing.assert_allclose(light.direction, np.array(direction) / np.linalg.norm(direction), atol=1e-12)
    a, b, c, d = light.corners
    np.testing.assert_allclose(np.cross(b - a, d - a), 0.12 * np.array(light.direction), atol=1e-12)
    np.testing.assert_allclose((a + b + c + d) / 4, (1, 2, 3), atol=1e-12)
    np.testing.assert_allclose(sorted([np.linalg.norm(b - a), np.linalg.norm(d - a)]), [0.3, 0.4])
    unit = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]])
    np.testing.assert_allclose((unit @ light.to_world.T)[:, :3], light.corners, atol=1e-12)


def test_a_light_of_known_flux():
    radiance = 1000 / (683 * np.pi * 0.5)
    assert AreaLight((0, 0, 0), (0, 0, 1), 1.0, 0.5, (radiance,) * 3).luminous_flux == pytest.approx(1000)
    assert AreaLight((0, 0, 0), (0, 0, 1), 1.0, 0.5, (4.0, 2.0, 0.0)).intensity.tolist() == [2, 1, 0]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"direction": (0, 0, 0)}, "must have a length"),
        ({"direction": (0, 0, 1), "up": (0, 0, 2)}, "an angle to it"),
        ({"width": 0.0}, "longer than 0"),
        ({"height": -1.0}, "longer than 0"),
        ({"width": float("nan")}, "finite"),
        ({"centre": (0, 0, float("inf"))}, "finite"),
        ({"radiance": (1, -1, 1)}, "negative"),
        ({"radiance": (1, 1)}, "three numbers"),
    ],
)
def test_what_is_no_light_is_refused_in_one_line(change, why):
    given = {"centre": (0, 0, 0), "direction": (0, 0, 1), "width": 1, "height": 1, "radiance": (1, 1, 1)}
    with pytest.raises(LightingError, match=why) as caught:
        AreaLight(**{**given, **change})
    assert "\n" not in str(caught.value)


def test_a_lighting_is_one_or_the_other_or_the_scenes_own():
    sky = EnvironmentMap(panorama())
    assert [Lighting(LIGHT).kind, Lighting(environment=sky).kind, Lighting().kind] == [
        "area-light",
        "environment",
        "own",
    ]
    with pytest.raises(LightingError, match="not both"):
        Lighting(LIGHT, sky)
    with pytest.raises(LightingError, match="rotation"):
        EnvironmentMap(panorama(), float("nan"))


def test_lightings_compare_and_hash_by_what_they_are():
    again = AreaLight(list(LIGHT.centre), np.array(LIGHT.direction), 0.4, 0.3, (8.0, 7.0, 6.0))
    camera = PinholeCamera((0, 0, 0), (1, 0, 0), 1.0)
    assert Shot(camera, Lighting(again)) == Shot(camera, Lighting(LIGHT))
    same, other = (Lighting(environment=EnvironmentMap(panorama(seed), 0.5)) for seed in (0, 1))
    assert same == Lighting(environment=EnvironmentMap(panorama(0), 0.5)) != other
    assert len({same, other, Lighting(LIGHT), Lighting(again), Lighting()}) == 4
