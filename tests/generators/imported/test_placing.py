"""Axes, units and cameras, against what Mitsuba makes of the same file."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.own_cameras import read_camera_file
from gibench.generators.imported.placing import UPRIGHT, placed_matrix, up_axis
from gibench.generators.imported.reading import read_tree
from gibench.generators.imported.scene import ImportSettings, import_scene
from gibench.generators.imported.transforms import matrix_of
from gibench.rendering.backend import select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame

from .files import SQUARE, numbers, one, written

STEPS = """<transform name="to_world">
<scale x="1" y="2" z="0.5"/><rotate x="1" y="2" z="-1" angle="33"/><translate value="1 -2 3"/>
<matrix value="0 -1 0 4 1 0 0 5 0 0 1 6 0 0 0 1"/><lookat origin="1 2 3" target="4 -2 1" up="0 0.2 1"/>
</transform>"""


def test_transformations_are_those_of_mitsuba(tmp_path):
    select_variant()
    import mitsuba as mi

    # Its rotations take the axis as it is: give it a unit one.
    axis = np.array([1, 2, -1]) / math.sqrt(6)
    steps = STEPS.replace('x="1" y="2" z="-1"', 'x="{}" y="{}" z="{}"'.format(*axis))
    file = written(tmp_path, f'<sensor type="perspective">{steps}</sensor>', version="3.0.0")
    mine = matrix_of(one(read_tree(file).root, "transform"))
    shape = mi.load_string(file.read_text().replace("sensor", "shape").replace("perspective", "rectangle"))
    theirs = np.array(mi.traverse(shape.shapes()[0])["to_world"].matrix).reshape(4, 4)
    np.testing.assert_allclose(mine, theirs, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_what_is_up_becomes_z_without_rounding(up):
    turn = UPRIGHT[up]
    np.testing.assert_array_equal(turn @ np.eye(3)["xyz".index(up)], [0, 0, 1])
    assert np.linalg.det(turn) == 1
    assert set(np.abs(turn).ravel()) == {0.0, 1.0}
    point = np.array([0.1, 1e17 / 3, -7e-19])
    np.testing.assert_array_equal(turn.T @ (turn @ point), point)


@pytest.mark.parametrize(
    ("camera", "up"),
    [
        ('<lookat origin="0 1 5" target="0 0 0" up="0 1 0"/>', "y"),
        ('<lookat origin="5 0 9" target="0 0 0" up="0 0 1"/>', "z"),
        ('<lookat origin="0 9 1" target="0 0 0" up="0 1 0.2"/>', "y"),  # looks steeply down
        ('<matrix value="-1 0 0 0 0 1 0 1 0 0 -1 4 0 0 0 1"/>', "y"),
    ],
)
def test_the_axis_that_is_up_is_that_of_the_camera(tmp_path, camera, up):
    file = written(
        tmp_path, f'<sensor type="perspective"><transform name="to_world">{camera}</transform></sensor>'
    )
    assert up_axis(read_tree(file).root) == up
    assert up_axis(read_tree(file).root, "x") == "x"
    assert up_axis(read_tree(written(tmp_path, SQUARE)).root) == "y"


def test_axes_and_scales_that_are_none(tmp_path):
    file = written(tmp_path, SQUARE)
    with pytest.raises(SceneFileError, match=r"--up: 'w' is not allowed; allowed are auto, x, y and z"):
        import_scene(file, ImportSettings(up="w"))
    for scale in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(SceneFileError, match=r"--scale: .* is not allowed; allowed is a number above 0"):
            import_scene(file, ImportSettings(scale=scale))


def placed(steps: str) -> str:
    return f'<transform name="to_world">{steps}</transform>'


LIT = f"""
<sensor type="perspective"><float name="fov" value="60"/>
{placed('<lookat origin="20 120 300" target="0 40 0" up="0 1 0"/>')}</sensor>
<bsdf type="diffuse" id="m"><rgb name="reflectance" value="0.6 0.5 0.4"/></bsdf>
<shape type="rectangle">{placed('<scale value="200"/><rotate x="1" angle="-90"/>')}<ref id="m"/></shape>
<shape type="sphere"><point name="center" x="30" y="40" z="10"/><float name="radius" value="40"/><ref id="m"/></shape>
<shape type="cube">{placed('<scale value="30"/><translate x="-60" y="30"/>')}<ref id="m"/></shape>
"""


LIGHTS = {
    "point": '<emitter type="point"><point name="position" x="-20" y="180" z="90"/>'
    '<rgb name="intensity" value="40000 30000 20000"/></emitter>',
    "spot": '<emitter type="spot"><rgb name="intensity" value="50000"/><float name="cutoff_angle" value="40"/>'
    + placed('<lookat origin="0 250 100" target="0 0 0" up="0 0 1"/>')
    + "</emitter>",
    "directional": '<emitter type="directional"><vector name="direction" x="0.3" y="-1" z="-0.4"/>'
    '<rgb name="irradiance" value="2 1.5 1"/></emitter>',
    "area": '<shape type="rectangle"><emitter type="area"><rgb name="radiance" value="5"/></emitter>'
    + placed('<scale value="50"/><rotate x="1" angle="90"/><translate y="220"/>')
    + "</shape>",
    "constant": '<emitter type="constant"><rgb name="radiance" value="0.7"/></emitter>',
    "sunsky": '<emitter type="sunsky"><vector name="sun_direction" x="0.4" y="0.8" z="0.3"/>'
    + placed('<rotate x="1" angle="-90"/>')
    + "</emitter>",
}


@pytest.mark.parametrize("light", LIGHTS)
def test_turned_and_scaled_a_scene_looks_the_same(tmp_path, light):
    """In centimetres and Y up, by Mitsuba's own tracer, and in metres and Z up, by this one."""
    select_variant()
    import mitsuba as mi

    file = written(tmp_path, LIT + LIGHTS[light], version="3.0.0")
    before = mi.load_file(str(file))
    sensor = mi.traverse(before.sensors()[0])
    sensor["film.size"] = [48, 36]
    sensor.update()
    integrator = mi.load_dict({"type": "path", "max_depth": 4})
    theirs = np.array(mi.render(before, integrator=integrator, spp=1024))[..., :3]
    scene = import_scene(file, ImportSettings(scale=0.01))
    assert (scene.up, scene.scale) == ("y", 0.01)
    camera = scene.cameras[0].at((48, 36))
    mine = render_frame(
        scene.loaded,
        PinholeCamera(camera.position, camera.target, camera.fov),
        resolution=(48, 36),
        channels=("color",),
        spp=1024,
        max_depth=3,
    ).arrays["color"]
    np.testing.assert_allclose(mine.mean((0, 1)), theirs.mean((0, 1)), rtol=0.02)
    blocks = [image.reshape(6, 6, 6, 8, 3).mean((1, 3)) for image in (mine, theirs)]
    np.testing.assert_allclose(blocks[0], blocks[1], rtol=0.12, atol=0.02 * theirs.mean())


def test_an_intensity_that_cannot_be_scaled(tmp_path):
    light = '<emitter type="point"><spectrum name="intensity" value="400:1,700:2"/></emitter>'
    with pytest.raises(
        SceneFileError, match=r"the intensity of a point light is a <spectrum>, which cannot be scaled"
    ):
        import_scene(written(tmp_path, SQUARE + light, version="3.0.0"), ImportSettings(scale=0.1))


def sensor(*parts: str, type: str = "perspective", before: str = "", up: str = "0 0 1") -> str:
    to_world = placed(f'{before}<lookat origin="3 -4 2" target="0 0 1" up="{up}"/>')
    return f'<sensor type="{type}">{"".join(parts)}{to_world}</sensor>'


@pytest.mark.parametrize("resolution", [(64, 48), (48, 64)])
@pytest.mark.parametrize(
    "fov",
    [
        '<float name="fov" value="50"/>',
        *(
            f'<float name="fov" value="50"/><string name="fov_axis" value="{a}"/>'
            for a in ("y", "diagonal", "smaller", "larger")
        ),
        '<string name="focal_length" value="35mm"/>',
        "",
    ],
)
def test_fields_of_view_are_those_of_mitsuba(tmp_path, fov, resolution):
    """The ray through a corner of the image."""
    select_variant()
    import mitsuba as mi

    file = written(tmp_path, SQUARE + sensor(fov), version="3.0.0")
    (given,) = import_scene(file).cameras
    camera = given.at(resolution)
    frame = PinholeCamera(camera.position, camera.target, camera.fov)
    size = zip(("width", "height"), resolution, strict=True)
    film = "".join(f'<integer name="{name}" value="{value}"/>' for name, value in size)
    other = written(
        tmp_path, sensor(fov, f'<film type="hdrfilm">{film}</film>'), version="3.0.0", name="other.xml"
    )
    theirs = mi.load_file(str(other)).sensors()[0]
    ray, _ = theirs.sample_ray(0, 0, mi.Point2f(0, 0), mi.Point2f(0.5, 0.5))
    point = np.array(ray.o).ravel() + 5 * np.array(ray.d).ravel()
    x, y, _ = frame.project(point, resolution)
    assert (x, y) == pytest.approx((0, 0), abs=2e-3)


def test_what_a_pinhole_does_and_what_it_cannot_do(tmp_path):
    odd = sensor(type="thinlens", before='<scale x="-1"/>', up="0.3 0 1") + '<sensor type="orthographic"/>'
    scene = import_scene(written(tmp_path, SQUARE + odd, version="3.0.0"))
    said = " / ".join(change.what for change in scene.changes)
    for what in ("thin lens is a pinhole", "orthographic sensor is left out"):
        assert what in said
    assert "mirror" not in said
    assert "roll" not in said
    (camera,) = scene.cameras
    assert camera.mirrored
    assert camera.up is not None


def camera_file(folder, content):
    path = folder / "cameras.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_a_camera_file_counts_in_the_scene_files_coordinates(tmp_path):
    placed = placed_matrix("y", 0.01)
    matrix = np.eye(4)
    matrix[:3, 3] = (100, 200, 300)
    entries = [
        {"origin": [100, 200, 300], "target": [100, 200, 400], "fov_degrees": 60},
        {"matrix": matrix.tolist(), "fov_degrees": 60},
    ]
    for camera in read_camera_file(camera_file(tmp_path, entries), placed):
        np.testing.assert_allclose(camera.position, (1, -3, 2))
        towards = np.subtract(camera.target, camera.position)
        np.testing.assert_allclose(towards / np.linalg.norm(towards), (0, -1, 0), atol=1e-12)
        assert camera.at((64, 48)).fov == pytest.approx(math.radians(60))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "is no JSON"),
        ("[]", "no list of cameras, or an empty one"),
        ('{"origin": 1}', "no list of cameras"),
        ([1], "camera 0: it is no object"),
        (
            [{"origin": [0, 0, 0], "target": [1, 0, 0], "fov": 60}],
            "camera 0: unknown key 'fov'; known are fov_degrees",
        ),
        ([{"origin": [0, 0, 0], "target": [1, 0, 0]}], "camera 0: fov_degrees is missing or not a number"),
        ([{"origin": [0, 0], "target": [1, 0, 0], "fov_degrees": 60}], "origin is missing or not 3 numbers"),
        ([{"origin": [0, 0, 0], "target": [0, 0, 0], "fov_degrees": 60}], "are the same point"),
        ([{"origin": [0, 0, 0], "target": [1, 0, 0], "fov_degrees": 180}], "between 0 and 180"),
        ([{"matrix": [[0] * 4] * 4, "fov_degrees": 60}], "transformation is singular"),
        (
            '[{"origin": [0, 0, NaN], "target": [1, 0, 0], "fov_degrees": 60}]',
            "origin is missing or not 3 numbers",
        ),
    ],
)
def test_camera_files_that_are_none(tmp_path, content, says):
    with pytest.raises(SceneFileError, match=says):
        read_camera_file(camera_file(tmp_path, content), np.eye(4))


@pytest.mark.parametrize(
    ("step", "says"),
    [
        ('<rotate angle="30"/>', "<rotate> has no axis"),
        ('<matrix value="1 2 3"/>', "is not 9 or 16 finite number"),
        ('<lookat origin="0 0 0" target="0 0 0"/>', "looks nowhere"),
        ('<warp x="1"/>', "<warp> is no transformation"),
        ('<translate x="nan"/>', "is not 1 finite number"),
    ],
)
def test_transformations_that_are_none(tmp_path, step, says):
    file = written(
        tmp_path, f'<sensor type="perspective"><transform name="to_world">{step}</transform></sensor>'
    )
    with pytest.raises(SceneFileError, match=rf"scene\.xml:2: .*{says}"):
        matrix_of(one(read_tree(file).root, "transform"))


def test_the_numbers_of_the_file_stay(tmp_path):
    moved = placed('<translate x="0.123456789012345678" y="-7e-9"/>')
    scene = import_scene(written(tmp_path, f'<shape type="cube">{moved}</shape>'))
    steps = one(scene.tree.root, "transform").nodes()
    assert steps[0].get("x") == "0.123456789012345678"
    np.testing.assert_array_equal(numbers(steps[1].get("value")).reshape(4, 4), placed_matrix("y", 1))
