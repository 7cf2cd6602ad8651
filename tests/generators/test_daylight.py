import json
import math
import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from gibench.generators.daylight import (
    BadEnvironment,
    environment_xml,
    hdr,
    sample_daylight,
    sample_hdr,
    sample_sunsky,
    sunsky,
)
from gibench.generators.parts import Environment
from gibench.rendering.backend import select_variant, threads_to_load

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
CLEAR = {
    "elevation": math.radians(45),
    "azimuth": 0.5,
    "turbidity": 3.0,
    "albedo": 0.2,
    "sun": 1.0,
    "sky": 1.0,
    "level": 1.0,
}
SUN_RADIUS = math.radians(0.5338 / 2)


@pytest.fixture(scope="module")
def mi():
    select_variant("auto")
    import mitsuba

    return mitsuba


def emitter(mi, environment: Environment):
    scene = ElementTree.Element("scene", version="3.0.0")
    scene.append(environment_xml(environment))
    with threads_to_load():
        return mi.load_string(ElementTree.tostring(scene, encoding="unicode")).environment()


def radiance(mi, environment, directions):
    """(N, 3) radiance that arrives from the directions, (N, 3) unit."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, len(directions))
    si.wi = mi.Vector3f(-np.asarray(directions, np.float32).T)
    return np.array(environment.eval(si)).T


def hemisphere(rows=200, columns=400):
    """Directions, one in each of rows × columns cells of equal solid angle."""
    z, phi = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) * 2 * np.pi / columns)
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], -1).reshape(-1, 3)


def cap(centre, angle, count=64):
    """As `hemisphere`, for the cap of the given angle around a direction."""
    z, phi = np.meshgrid(
        1 - (1 - math.cos(angle)) * (np.arange(count) + 0.5) / count,
        (np.arange(count) + 0.5) * 2 * np.pi / count,
    )
    side = np.cross(centre, [0, 0, 1])
    side /= np.linalg.norm(side)
    r = np.sqrt(1 - z**2)[..., None]
    around = np.cos(phi)[..., None] * side + np.sin(phi)[..., None] * np.cross(centre, side)
    return (z[..., None] * centre + r * around).reshape(-1, 3)


def illuminance(mi, environment: Environment) -> tuple[float, float]:
    """Lux that sky and sun give to level ground, by quadrature over the emitter that Mitsuba builds."""
    values = environment.parameters
    total = []
    for part, other in (("sky_scale", "sun_scale"), ("sun_scale", "sky_scale")):
        alone = Environment("sunsky", {**values, other: 0.0})
        if values[part] == 0:
            total.append(0.0)
            continue
        sun = part == "sun_scale"
        directions = cap(np.array(values["sun_direction"]), SUN_RADIUS) if sun else hemisphere()
        solid_angle = 2 * np.pi * (1 - math.cos(SUN_RADIUS)) if sun else 2 * np.pi
        light = radiance(mi, emitter(mi, alone), directions)
        assert (light >= 0).all()
        total.append(float(683 * solid_angle * (light @ LUMINANCE * directions[:, 2]).mean()))
    return total[0], total[1]


def test_a_clear_day_is_as_bright_as_measured(mi):
    """Against the clear sky of IES, "Calculation of daylight availability", J. IES 13(4), 1984."""
    sky, sun = illuminance(mi, sunsky(**CLEAR))
    sine = math.sin(CLEAR["elevation"])
    assert sky == pytest.approx(800 + 15500 * sine**0.5, rel=0.35)
    assert sun == pytest.approx(127500 * math.exp(-0.21 / sine) * sine, rel=0.15)


def test_level_and_shares_scale_the_light(mi):
    sky, sun = illuminance(mi, sunsky(**CLEAR))
    dim_sky, dim_sun = illuminance(mi, sunsky(**{**CLEAR, "level": 0.25, "sky": 0.5}))
    assert dim_sky == pytest.approx(sky * 0.125, rel=1e-4)
    assert dim_sun == pytest.approx(sun * 0.25, rel=1e-4)


def test_the_sun_stands_where_it_should(mi):
    environment = sunsky(**{**CLEAR, "azimuth": math.radians(90), "elevation": math.radians(30)})
    toward = np.array([0.0, math.cos(math.radians(30)), 0.5])
    assert environment.parameters["sun_direction"] == pytest.approx(toward)
    seen = radiance(mi, emitter(mi, environment), np.array([toward, toward * [1, -1, 1], [0.0, 0.0, -1.0]]))
    assert seen[0].min() > 1000 * seen[1].max() > 0
    assert seen[2] == pytest.approx(0)


@pytest.mark.parametrize("turbidity", [2.0, 8.0])
def test_nothing_is_negative_over_the_permitted_range(mi, turbidity):
    for elevation in (math.radians(5), math.radians(30), math.radians(90)):
        environment = sunsky(**{**CLEAR, "turbidity": turbidity, "elevation": elevation})
        assert (radiance(mi, emitter(mi, environment), hemisphere(60, 120)) >= 0).all()


def test_sampled_days_are_plausible(mi):
    rng = np.random.default_rng(0)
    lux = np.array([illuminance(mi, sample_sunsky(rng)) for _ in range(8)])
    assert (lux.sum(1) > 300).all()
    assert (lux.sum(1) < 25e3).all()
    natural = np.array([illuminance(mi, sample_sunsky(rng, level=1.0)) for _ in range(4)])
    assert (natural.sum(1) > 3e3).all()
    assert (natural.sum(1) < 120e3).all()
    assert (lux[:, 1] == 0).any()
    assert (lux[:, 1] > 0).any()


def panorama(mi, folder: Path, values, name="sky.exr") -> str:
    with threads_to_load():
        mi.Bitmap(np.asarray(values, np.float32)).write(str(folder / name))
    return str(folder / name)


@pytest.mark.parametrize("name", ["sky.exr", "sky.hdr"])
def test_a_panorama_gives_the_illuminance_asked_for(mi, tmp_path, name):
    y, x = np.mgrid[0:64, 0:128]
    image = np.stack([1 + 0.5 * np.sin(x / 20), 1 + np.cos(y / 10) ** 2, np.full(x.shape, 0.3)], -1)
    environment = hdr(path=panorama(mi, tmp_path, image, name), rotation=1.0, lux=12345.0)
    directions = hemisphere()
    light = radiance(mi, emitter(mi, environment), directions)
    assert 683 * 2 * np.pi * (light @ LUMINANCE * directions[:, 2]).mean() == pytest.approx(12345, rel=0.01)


def test_a_uniform_panorama_in_closed_form(mi, tmp_path):
    """Radiance L from everywhere gives π·L."""
    environment = hdr(path=panorama(mi, tmp_path, np.full((16, 32, 3), 0.7)), rotation=0.0, lux=683 * np.pi)
    assert environment.parameters["scale"] == pytest.approx(1 / 0.7, rel=1e-6)


def test_the_zenith_is_up_and_rotation_turns_about_it(mi, tmp_path):
    image = np.full((32, 64, 3), 0.1)
    image[0:2] = 5.0  # zenith
    image[15:17, 20:22] = 9.0  # a lamp on the horizon
    path = panorama(mi, tmp_path, image)
    still, turned = hdr(path=path, rotation=0.0, lux=1e4), hdr(path=path, rotation=math.pi / 2, lux=1e4)
    azimuth = np.arange(360)
    ring = np.stack([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), np.zeros(360)], -1)
    one, two = (radiance(mi, emitter(mi, e), ring)[:, 0] for e in (still, turned))
    assert np.roll(one, 90) == pytest.approx(two, rel=0.05, abs=0.05 * float(one.max()))
    up = radiance(mi, emitter(mi, still), np.array([[0.01, 0, 1.0], [0.01, 0, -1.0]]))[:, 0]
    assert up[0] == pytest.approx(50 * up[1], rel=0.05)


def test_parameters_are_plain_json(mi, tmp_path):
    path = panorama(mi, tmp_path, np.ones((8, 16, 3)))
    rng = np.random.default_rng(0)
    for environment in (sample_sunsky(rng), sample_hdr(rng, path=path)):
        values = json.loads(json.dumps(environment.parameters))
        again = Environment(environment.kind, values)
        assert ElementTree.tostring(environment_xml(again)) == ElementTree.tostring(
            environment_xml(environment)
        )
    assert environment_xml(Environment()) is None


def test_draws_by_kind(mi, tmp_path):
    path = panorama(mi, tmp_path, np.ones((8, 16, 3)))
    rng = np.random.default_rng(0)
    assert {sample_daylight(rng).kind for _ in range(40)} == {"none", "sunsky"}
    assert {sample_daylight(rng, path=path).kind for _ in range(40)} == {"none", "hdr"}
    assert sample_daylight(rng, kind="sunsky", elevation=0.5).parameters["sun_direction"][2] == pytest.approx(
        math.sin(0.5)
    )
    with pytest.raises(BadEnvironment, match="'hdr' needs the path"):
        sample_daylight(rng, kind="hdr")
    with pytest.raises(BadEnvironment, match="'fog'"):
        sample_daylight(rng, kind="fog")


@pytest.mark.parametrize(
    "changes",
    [
        {"elevation": 0.01},
        {"turbidity": 1.0},
        {"albedo": 1.5},
        {"sun": -1.0},
        {"level": math.nan},
        {"azimuth": math.inf},
    ],
)
def test_impossible_skies(changes):
    with pytest.raises(BadEnvironment, match=next(iter(changes))):
        sunsky(**{**CLEAR, **changes})


def test_a_sky_that_emits_nothing():
    with pytest.raises(BadEnvironment, match="emits nothing"):
        sunsky(**{**CLEAR, "sun": 0.0, "sky": 0.0})


def test_bad_panoramas(mi, tmp_path):
    with pytest.raises(BadEnvironment, match="no such file"):
        hdr(path=str(tmp_path / "missing.hdr"), rotation=0.0, lux=1e4)
    (tmp_path / "text.hdr").write_text("not an image")
    with pytest.raises(BadEnvironment, match="not readable"):
        hdr(path=str(tmp_path / "text.hdr"), rotation=0.0, lux=1e4)
    for value, message in ((np.nan, "not finite"), (np.inf, "not finite"), (-1.0, "negative")):
        image = np.ones((8, 16, 3))
        image[1, 2, 0] = value
        with pytest.raises(BadEnvironment, match=message):
            hdr(path=panorama(mi, tmp_path, image, f"{value}.exr"), rotation=0.0, lux=1e4)
    with pytest.raises(BadEnvironment, match="black"):
        hdr(path=panorama(mi, tmp_path, np.zeros((8, 16, 3)), "black.exr"), rotation=0.0, lux=1e4)
    with pytest.raises(BadEnvironment, match="positive"):
        hdr(path=panorama(mi, tmp_path, np.ones((8, 16, 3))), rotation=0.0, lux=0.0)


@pytest.mark.skipif(
    "GIBENCH_EXTERNAL" not in os.environ, reason="GIBENCH_EXTERNAL names no folder with hdri/"
)
def test_real_panoramas(mi):
    files = sorted((Path(os.environ["GIBENCH_EXTERNAL"]) / "hdri").glob("*.hdr"))
    assert files
    directions = hemisphere(400, 800)
    for file in files:
        environment = hdr(path=str(file), rotation=2.0, lux=20e3)
        light = radiance(mi, emitter(mi, environment), directions)
        lux = 683 * 2 * np.pi * (light @ LUMINANCE * directions[:, 2]).mean()
        assert lux == pytest.approx(20e3, rel=0.1)  # a sun of one or two texels is coarse for any quadrature


def test_a_panorama_without_colour_is_grey(tmp_path):
    import OpenEXR

    from gibench.generators.daylight import read_panorama

    luminance = np.random.default_rng(0).random((8, 16), dtype=np.float32)
    file = str(tmp_path / "grey.exr")
    OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"Y": luminance}
    ).write(file)
    np.testing.assert_array_equal(read_panorama(file), np.stack([luminance] * 3, axis=-1))
