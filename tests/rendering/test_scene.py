"""What is read of a scene's file, and what is refused."""

from __future__ import annotations

import pytest
import trimesh

from gibench.rendering.backend import select_variant
from gibench.rendering.scene import SceneError, load_dict, load_scene

from . import scenes


@pytest.mark.parametrize("size", [(0.0, 0.0), (0.2, 0.0)])
def test_a_light_without_area_is_refused_by_its_name(size):
    lamp = scenes.rectangle([0, 0, 1], [0, 0, -1], size, emitter=scenes.area(1.0), id="lamp.0")
    with pytest.raises(SceneError, match=r"'lamp\.0' has an area of 0 m²"):
        load_dict({"type": "scene", "lamp": lamp})


@pytest.mark.parametrize("shape", ["sphere", "disk"])
def test_round_lights_without_area_are_refused(shape, tmp_path):
    size = '<float name="radius" value="0"/>' if shape == "sphere" else ""
    flat = "" if size else '<transform name="to_world"><scale value="0"/></transform>'
    text = f'<shape type="{shape}" id="bulb">{size}{flat}<emitter type="area"/></shape>'
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{text}</scene>')
    with pytest.raises(SceneError, match="'bulb' has an area of 0"):
        load_scene(tmp_path / "scene.xml")


def test_a_mesh_without_triangles_is_refused():
    import mitsuba as mi

    with pytest.raises(SceneError, match="no triangles"):
        load_dict({"type": "scene", "nothing": mi.Mesh("nothing", 0, 0)})


def test_a_small_light_and_a_scene_without_any_are_scenes():
    lamp = scenes.rectangle([0, 0, 1], [0, 0, -1], (1e-4, 1e-4), emitter=scenes.area(1.0))
    assert load_dict({"type": "scene", "lamp": lamp}).shapes == ("lamp",)
    assert load_dict({"type": "scene"}).shapes == ()


CAMERA = '<sensor type="perspective" id="camera.{}"><film type="hdrfilm"/></sensor>'


def search_path() -> list[str]:
    select_variant()
    import mitsuba as mi

    return [str(path) for path in mi.file_resolver()]


def written(folder, cameras: int, shape: str = '<string name="filename" value="meshes/one.ply"/>'):
    """A scene file of so many cameras, with a triangle in a folder beside it."""
    (folder / "meshes").mkdir()
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).export(folder / "meshes/one.ply")
    file = folder / "scene.xml"
    sensors = "".join(CAMERA.format(number) for number in range(cameras))
    file.write_text(
        f'<scene version="3.0.0">{sensors}<shape type="ply" id="one">{shape}</shape>'
        '<emitter type="constant"/></scene>'
    )
    return file


@pytest.mark.parametrize("cameras", [0, 1, 3])
def test_of_the_cameras_of_a_file_the_first_alone_is_read(tmp_path, cameras):
    before = search_path()
    scene = load_scene(written(tmp_path, cameras))
    assert [camera.id() for camera in scene.mi_scene.sensors()] == ["camera.0"][:cameras]
    assert scene.shapes == ("one",)
    assert search_path() == before


@pytest.mark.parametrize("cameras", [1, 3])
def test_what_mitsuba_refuses_is_told_however_many_cameras(tmp_path, cameras):
    file = written(tmp_path, cameras, '<string name="filename" value="meshes/two.ply"/>')
    before = search_path()
    with pytest.raises(SceneError, match=r"Mitsuba refuses .*scene\.xml: .*two\.ply"):
        load_scene(file)
    assert search_path() == before
    file.write_text(file.read_text().replace("</scene>", ""))
    with pytest.raises(SceneError, match=r"Mitsuba refuses .*scene\.xml"):
        load_scene(file)
