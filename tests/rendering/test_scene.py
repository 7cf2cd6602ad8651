"""What is refused when a scene is loaded."""

from __future__ import annotations

import pytest

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
