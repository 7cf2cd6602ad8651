import math
import sys

import numpy as np
import pytest

from gibench.generators.light import (
    BULB_LUMENS,
    ROOM_LUMENS,
    BadLight,
    kelvin_to_rgb,
    radiance_of,
    sample_bulb,
    sample_kelvin,
    sample_room_flux,
)
from gibench.generators.parts import Light
from gibench.rendering.backend import select_variant
from tests.generators.flux import LUMINANCE, lumens_around

TONES = (2700.0, 3000.0, 3500.0, 4000.0, 5000.0, 6500.0)


def light(shape="rectangle", size=(0.6, 0.3), lumens=1000.0, kelvin=3000.0) -> Light:
    return Light("lamp", shape, size, (0.1, -0.2, 0.05), (0.0, 0.6, -0.8), lumens, kelvin)


@pytest.mark.parametrize(
    ("shape", "size"), [("rectangle", (0.6, 0.3)), ("disk", (0.25,)), ("sphere", (0.2,))]
)
def test_emitted_flux_integrates_back_to_the_lumens(shape, size):
    """All light that passes inward rays of a sphere around the lamp, traced by Mitsuba, is its flux."""
    select_variant("auto")
    import mitsuba as mi

    lamp = light(shape, size, lumens=1234.0)
    frame = mi.ScalarTransform4f().look_at(
        origin=list(lamp.centre), target=list(np.add(lamp.centre, lamp.direction)), up=[1, 0, 0]
    )
    half = (size[0] / 2, size[1] / 2) if shape == "rectangle" else (size[0], size[0])
    stretch = mi.ScalarTransform4f().scale([half[0], half[1], half[0] if shape == "sphere" else 1])
    scene = mi.load_dict(
        {
            "type": "scene",
            "lamp": {
                "type": shape,
                "to_world": frame @ stretch,
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(radiance_of(lamp))}},
            },
        }
    )
    flux = lumens_around(scene, (0.0, 0.0, 0.0), 1.0, 1 << 20)
    assert flux == pytest.approx(1234, rel=0.02)


def test_radiance_in_closed_form():
    # A sphere of radius 1/(2π) m has 1/π m², so that 683 lm are one watt into π · 1/π m²·sr.
    lamp = light("sphere", (1 / (2 * math.pi),), lumens=683.0)
    assert LUMINANCE @ radiance_of(lamp) == pytest.approx(1)
    one, two = light(size=(1.0, 1.0)), light(size=(2.0, 3.0))
    assert np.array(radiance_of(one)) == pytest.approx(6 * np.array(radiance_of(two)))


# Chromaticities of the black body: 2856 K is CIE illuminant A (CIE 015:2018, table 5); the others stand in
# Wyszecki and Stiles, Color Science, 2nd edition, table 1(3.3.4).
@pytest.mark.parametrize(
    ("kelvin", "xy"), [(2856.0, (0.4476, 0.4075)), (5000.0, (0.3451, 0.3516)), (6500.0, (0.3135, 0.3237))]
)
def test_colour_of_a_black_body(kelvin, xy):
    red, green, blue = kelvin_to_rgb(kelvin)
    # IEC 61966-2-1
    x, y, z = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ [
        red,
        green,
        blue,
    ]
    assert y == pytest.approx(1, abs=1e-3)
    assert (x / (x + y + z), y / (x + y + z)) == pytest.approx(xy, abs=1e-3)


def test_tones_of_rooms_are_those_of_the_library_without_it(monkeypatch):
    beside = [kelvin_to_rgb(kelvin + 1e-7) for kelvin in TONES]
    monkeypatch.setitem(sys.modules, "colour", None)
    assert np.allclose([kelvin_to_rgb(kelvin) for kelvin in TONES], beside, rtol=1e-9, atol=0)


def test_colours_have_luminance_one_and_grow_bluer():
    kelvins = [1000.0, 1500.0, 2000.0, 2700.0, 4000.0, 6500.0, 12000.0, 25000.0]
    colors = np.array([kelvin_to_rgb(k) for k in kelvins])
    assert colors @ LUMINANCE == pytest.approx(1)
    assert (colors >= 0).all()
    assert (np.diff(colors[:, 0]) < 0).all()
    assert (np.diff(colors[2:, 2]) > 0).all()
    assert (colors[3:, 2] > 0).all()  # nothing is clipped in the range of lamps


@pytest.mark.parametrize("kelvin", [0.0, 999.0, 25001.0, math.nan, math.inf])
def test_impossible_temperatures(kelvin):
    with pytest.raises(BadLight, match="K"):
        radiance_of(light(kelvin=kelvin))


@pytest.mark.parametrize("lumens", [0.0, -5.0, math.nan, math.inf])
def test_impossible_fluxes(lumens):
    with pytest.raises(BadLight, match=r"'lamp'.*lm"):
        radiance_of(light(lumens=lumens))


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ("disk", (0.0,)),
        ("rectangle", (0.1, 0.0)),
        ("rectangle", (0.1,)),
        ("sphere", (math.nan,)),
        ("cube", (1.0,)),
    ],
)
def test_impossible_shapes(shape, size):
    with pytest.raises(BadLight, match="'lamp'"):
        radiance_of(light(shape, size))


def test_sampled_lights_stay_in_their_ranges():
    rng = np.random.default_rng(0)
    bulbs = [sample_bulb(rng) for _ in range(300)]
    assert BULB_LUMENS[0] <= min(bulbs) < 520
    assert 1400 < max(bulbs) <= BULB_LUMENS[1]
    rooms = [sample_room_flux(rng, area) for area in np.linspace(8, 60, 300)]
    assert ROOM_LUMENS[0] <= min(rooms)
    assert max(rooms) <= ROOM_LUMENS[1]
    assert {sample_kelvin(rng) for _ in range(300)} == set(TONES)
    with pytest.raises(BadLight, match="floor"):
        sample_room_flux(rng, 0.0)
