"""Rolled, mirrored, off-centre and cropped cameras: rays and pictures of stock Mitsuba from the original file."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.own_cameras import read_camera_file
from gibench.generators.imported.room import import_room, write_imported_room
from gibench.generators.imported.scene import ImportSettings, import_scene
from gibench.rendering.backend import select_variant
from gibench.rendering.camera import RayGenerator
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_scene

from .files import SQUARE, room_file, written

AIM = '<lookat origin="0.6, -2.2, 1.6" target="0, 0.5, 1.1" up="{up}"/>'
STEEP = '<lookat origin="0.3 0.2 2.5" target="0.3 0.2 0" up="1 2 0"/>'
OFFSET = '<float name="principal_point_offset_x" value="0.2"/><float name="principal_point_offset_y" value="-0.15"/>'
WINDOW = (("crop_offset_x", 24), ("crop_offset_y", 8), ("crop_width", 32), ("crop_height", 24))

SENSORS = {
    "rolled": (AIM.format(up="0.5, 0.2, 1"), "", ()),
    "upside down": (AIM.format(up="0, 0, -1"), "", ()),
    "mirrored": ('<scale x="-1"/>' + AIM.format(up="0, 0, 1"), "", ()),
    "off-centre": (AIM.format(up="0, 0, 1"), OFFSET, ()),
    "cropped": (AIM.format(up="0, 0, 1"), "", WINDOW),
    "straight down": (STEEP, "", ()),
    "all at once": ('<scale x="-1"/>' + AIM.format(up="0.5, 0.2, 1"), OFFSET, WINDOW),
}


def sensor(name, axis="x"):
    steps, more, window = SENSORS[name]
    size = (("width", 64), ("height", 48)) if window else (("width", 32), ("height", 24))
    film = "".join(f'<integer name="{key}" value="{value}"/>' for key, value in (*size, *window))
    return (
        f'<sensor type="perspective"><float name="fov" value="70"/><string name="fov_axis" value="{axis}"/>{more}'
        f'<transform name="to_world">{steps}</transform>'
        f'<film type="hdrfilm">{film}<rfilter type="box"/></film></sensor>'
    )


def theirs(file):
    import mitsuba as mi

    return mi.load_file(str(file), optimize=False)


def stock_rays(sensor, size):
    """Origins and directions of stock Mitsuba's rays through the corners and the middle of the image."""
    import mitsuba as mi

    shares = np.array([(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5)], dtype=np.float32)
    rays, _ = sensor.sample_ray(0, 0.5, mi.Point2f(shares.T), mi.Point2f(0.5, 0.5))
    return shares * size, np.broadcast_to(np.array(rays.o), (3, 5)), np.array(rays.d)


@pytest.mark.parametrize("axis", ["x", "y", "diagonal", "larger"])
@pytest.mark.parametrize("name", SENSORS)
def test_rays_are_those_of_mitsuba(tmp_path, name, axis):
    """Of the original file, by our camera and by the one that is written."""
    select_variant()
    import mitsuba as mi

    file = written(tmp_path, SQUARE + sensor(name, axis), version="3.0.0")
    scene = import_scene(file, ImportSettings(up="z"))
    assert scene.resolution == (32, 24)
    assert [change for change in scene.changes if change.loss] == []
    room = import_room(scene, resolution=(32, 24), views=0)
    write_imported_room(room, tmp_path / "out", max_depth=3, resolution=(32, 24), spp=4)
    for one in (file, tmp_path / "out/scene.xml"):
        pixels, origins, directions = stock_rays(theirs(one).sensors()[0], (32, 24))
        generator = RayGenerator(room.cameras[0].pinhole, (32, 24))
        rays = generator.rays(mi.Point2f(pixels.T.astype(np.float32)))
        np.testing.assert_allclose(np.array(rays.d), directions, atol=3e-6)
        # Theirs begin at the near plane.
        past = origins - np.array(rays.o)
        np.testing.assert_allclose(np.cross(past.T, directions.T), 0, atol=1e-5)


def blocks(image):
    return np.asarray(image).reshape(6, 4, 8, 4, 3).mean((1, 3))


@pytest.mark.parametrize("name", SENSORS)
def test_the_picture_is_that_of_mitsuba(tmp_path, name):
    """Of the original file: blocks of 4 × 4 pixels within noise."""
    select_variant()
    import mitsuba as mi

    file = room_file(tmp_path)
    text = file.read_text()
    text = text[: text.index("<sensor")] + sensor(name) + text[text.index("</sensor>") + len("</sensor>") :]
    file.write_text(text)
    scene = import_scene(file, ImportSettings(up="z"))
    room = import_room(scene, resolution=(32, 24), views=0)
    write_imported_room(room, tmp_path / "out", max_depth=4, resolution=(32, 24), spp=4)
    frame = render_frame(
        load_scene(tmp_path / "out/scene.xml"),
        room.cameras[0].pinhole,
        resolution=(32, 24),
        channels=["radiance"],
        max_depth=3,
        spp=128,
        denoise=False,
    )
    integrator = mi.load_dict({"type": "path", "max_depth": 4, "rr_depth": 100})
    stock = [
        np.array(mi.render(theirs(file), integrator=integrator, spp=128, seed=seed))[..., :3]
        for seed in (1, 2)
    ]
    assert stock[0].shape == (24, 32, 3)
    noise = np.abs(blocks(stock[0]) - blocks(stock[1]))
    off = np.abs(blocks(frame.arrays["color"]) - blocks(stock[0]))
    assert off.mean() < 2 * noise.mean()
    # The picture has structure that another camera would not show there.
    assert np.abs(blocks(stock[0]) - blocks(stock[0][:, ::-1])).mean() > 5 * noise.mean()


def test_ordinary_cameras_stay_ordinary(tmp_path):
    """Neither a film as large as its window nor an offset of 0 nor rounding makes an up or a principal point."""
    film = '<film type="hdrfilm"><integer name="width" value="33"/><integer name="height" value="21"/>'
    film += '<integer name="crop_width" value="33"/><integer name="crop_height" value="21"/></film>'
    body = '<sensor type="perspective"><float name="principal_point_offset_x" value="0"/><transform name="to_world">'
    body += f"{AIM.format(up='0.00001, 0, 1')}</transform>{film}</sensor>"
    scene = import_scene(written(tmp_path, SQUARE + body, version="3.0.0"), ImportSettings(up="z"))
    camera = scene.cameras[0].at((7, 5))
    assert (camera.up, camera.principal_point, camera.mirrored) == (None, (0, 0), False)
    assert camera.peculiarities == {}


@pytest.mark.parametrize(
    ("window", "said"),
    [
        (
            {"crop_width": 65},
            r"scene\.xml:\d+: the crop window 65x48 at 0, 0 is not within the film of 64x48",
        ),
        ({"crop_offset_x": 60, "crop_width": 8}, "not within the film"),
        ({"crop_offset_y": -1}, "not within the film"),
        ({"crop_height": 0}, "not within the film"),
        ({"crop_height": "x"}, "crop_height 'x' is no whole number"),
    ],
)
def test_windows_beyond_their_film_are_refused(tmp_path, window, said):
    size = {"width": 64, "height": 48, **window}
    film = "".join(f'<integer name="{name}" value="{value}"/>' for name, value in size.items())
    body = f'{SQUARE}<sensor type="perspective"><film type="hdrfilm">{film}</film></sensor>'
    with pytest.raises(SceneFileError, match=said):
        import_scene(written(tmp_path, body, version="3.0.0"))


def test_an_offset_that_is_none(tmp_path):
    offset = '<float name="principal_point_offset_y" value="1e30"/>'
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: an offset of 1e\+30 films is none"):
        import_scene(
            written(tmp_path, f'{SQUARE}<sensor type="perspective">{offset}</sensor>', version="3.0.0")
        )


def test_sheared_cameras_are_said(tmp_path):
    matrix = '<matrix value="-1 0.1 0 0 0 1 0 1 0 0 -1 4 0 0 0 1"/>'
    body = f'<sensor type="perspective"><transform name="to_world">{matrix}</transform></sensor>'
    scene = import_scene(written(tmp_path, SQUARE + body, version="3.0.0"))
    assert "a camera's shear or uneven scale is left out" in [c.what for c in scene.changes if c.loss]


def cameras_in(folder, *entries, placed=None):
    path, changes = folder / "cameras.json", []
    path.write_text(json.dumps([{"fov_degrees": 60, **entry} for entry in entries]))
    return read_camera_file(path, np.eye(4) if placed is None else placed, changes), [c.what for c in changes]


def test_a_camera_file_gives_up_and_the_principal_point(tmp_path):
    aim = {"origin": [0, 0, 0], "target": [0, 1, 0]}
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # y up to z up
    (rolled, level), said = cameras_in(
        tmp_path,
        {"origin": [0, 0, 5], "target": [0, 0, 0], "up": [1, 0, 0], "principal_point": [0.25, -0.5]},
        {"origin": [0, 0, 5], "target": [0, 0, 0], "up": [0, 3, 0]},
        placed=turn,
    )
    assert said == []
    camera = rolled.at((40, 30)).pinhole
    np.testing.assert_allclose(-camera.frame[1], (1, 0, 0), atol=1e-12)
    assert camera.centre((40, 30)) == (30, 0)
    assert level.up is None
    for wrong, message in (
        ({**aim, "up": [0, 2, 0]}, "up is along the view"),
        ({**aim, "up": [0, 0, 0]}, "up is along the view"),
        ({**aim, "up": [0, 0]}, "up is missing or not 3 numbers"),
        ({**aim, "principal_point": [1]}, "principal_point is missing or not 2 numbers"),
        ({**aim, "principal_point": [1e9, 0]}, r"a principal_point of 1e\+09, 0 is none"),
        ({"matrix": np.eye(4).tolist(), "up": [0, 0, 1]}, "'up' beside 'matrix'"),
    ):
        with pytest.raises(SceneFileError, match=f"camera 0: {message}"):
            cameras_in(tmp_path, wrong)


def test_matrices_of_another_convention_are_rendered_and_said(tmp_path):
    level = np.array([[-1, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])  # looks along y
    assert cameras_in(tmp_path, {"matrix": level.tolist()})[1] == []
    opencv = level @ np.diag([-1, -1, 1, 1])
    (camera,), said = cameras_in(tmp_path, {"matrix": opencv.tolist()})
    assert "roll of" in said[0]
    assert "180.0 degrees" in said[0].replace("-", "")
    assert len(said) == 1
    np.testing.assert_allclose(-camera.at((4, 3)).pinhole.frame[1], (0, 0, -1), atol=1e-12)
    (camera,), said = cameras_in(tmp_path, {"matrix": (level @ np.diag([-1, 1, 1, 1])).tolist()})
    assert "mirrored camera" in said[0]
    assert len(said) == 1
    assert np.linalg.det(camera.at((4, 3)).pinhole.frame) == pytest.approx(-1)
    assert camera.at((4, 3)).fov == pytest.approx(math.radians(60))
