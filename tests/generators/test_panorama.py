"""The panorama against the model that it was made from."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from gibench.generators.daylight import environment_xml, hdr, sunsky
from gibench.generators.panorama import panorama, write_panorama
from gibench.generators.parts import Environment
from gibench.rendering.backend import select_variant, threads_to_load
from tests.generators.test_daylight import CLEAR, LUMINANCE, hemisphere, illuminance, radiance


@pytest.fixture(scope="module")
def mi():
    select_variant("auto")
    import mitsuba

    return mitsuba


def loaded(mi, element, folder):
    scene = ElementTree.Element("scene", version="3.0.0")
    scene.append(element)
    ElementTree.ElementTree(scene).write(folder / "scene.xml")
    with threads_to_load():
        return mi.load_file(str(folder / "scene.xml")).environment()


def written(mi, environment, folder):
    return loaded(mi, write_panorama(environment, folder, "outside.hdr"), folder)


def lux_of(image):
    """Illuminance that a panorama gives to level ground, by quadrature over its rows."""
    rows = len(image) // 2
    edges = np.pi * np.arange(rows + 1) / len(image)
    weight = np.diff(np.sin(edges) ** 2) / 2 * (2 * np.pi)
    return 683 * float(weight @ (image[:rows].mean(1) @ LUMINANCE))


def test_the_sky_is_that_of_the_model(mi, tmp_path):
    environment = sunsky(**{**CLEAR, "sun": 0.0, "level": 0.3})
    # A texel or more above the horizon, where the model falls to 0 at once.
    directions = hemisphere(60, 120)
    directions = directions[directions[:, 2] > 0.02]
    seen = radiance(mi, written(mi, environment, tmp_path), directions)
    model = radiance(mi, loaded(mi, environment_xml(environment), tmp_path), directions)
    # RGBE: an 8-bit mantissa under the exponent of the brightest channel, cut off; and 1 % for interpolation.
    brightest = model.max(axis=1, keepdims=True)
    assert (np.abs(seen - model) <= brightest / 128 + 0.01 * model).all()


@pytest.mark.parametrize("degrees", [10, 45, 80])
def test_all_the_suns_light_is_there(mi, degrees):
    environment = sunsky(**{**CLEAR, "elevation": math.radians(degrees)})
    sky, sun = illuminance(mi, environment)
    alone = Environment("sunsky", {**environment.parameters, "sky_scale": 0.0})
    assert lux_of(panorama(alone)) == pytest.approx(sun, rel=0.02)
    assert lux_of(panorama(environment)) == pytest.approx(sky + sun, rel=0.02)


def test_the_sun_stands_where_the_model_has_it(mi, tmp_path):
    environment = sunsky(**{**CLEAR, "azimuth": math.radians(130), "elevation": math.radians(35)})
    directions = hemisphere(400, 800)
    brightest = directions[radiance(mi, written(mi, environment, tmp_path), directions)[:, 0].argmax()]
    assert math.degrees(math.acos(min(1.0, brightest @ environment.parameters["sun_direction"]))) < 0.7


def test_a_panorama_of_the_users_keeps_its_light_when_it_is_reduced(mi, tmp_path):
    rng = np.random.default_rng(0)
    image = rng.uniform(0.1, 2.0, (1024, 2048, 3)).astype(np.float32)
    with threads_to_load():
        mi.Bitmap(image).write(str(tmp_path / "big.exr"))
    environment = hdr(path=str(tmp_path / "big.exr"), rotation=0.8, lux=9000.0)
    assert panorama(environment).shape == (512, 1024, 3)
    assert lux_of(panorama(environment)) == pytest.approx(9000.0, rel=0.01)
    # The copy shines as the file itself would.
    directions = hemisphere()
    copy = radiance(mi, written(mi, environment, tmp_path), directions)
    itself = radiance(mi, loaded(mi, environment_xml(environment), tmp_path), directions)
    assert (copy @ LUMINANCE).mean() == pytest.approx((itself @ LUMINANCE).mean(), rel=0.01)


def test_nothing_outside_writes_nothing(tmp_path):
    assert write_panorama(Environment(), tmp_path, "outside.hdr") is None
    assert not list(tmp_path.iterdir())
