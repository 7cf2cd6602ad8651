import json
import math
from xml.etree import ElementTree

import numpy as np
import pytest

from gibench.generators.light import LUMENS_PER_WATT, radiance_of
from gibench.generators.light_shapes import TiltedLight, light_matrix, light_mesh, placed_light
from gibench.generators.parts import Light, Texture
from gibench.generators.scene_files import write_ply, write_room
from gibench.rendering.backend import select_variant
from tests.generators.rooms_at_hand import room


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("room")
    write_room(room(0), path, max_depth=5, resolution=(64, 48), spp=4)
    return path


def test_mitsuba_reads_the_ply_as_it_was(tmp_path):
    select_variant()
    import mitsuba as mi

    mesh = room(0).objects[-1].shapes[0][0]
    write_ply(mesh, tmp_path / "thing.ply")
    loaded = mi.load_dict({"type": "ply", "filename": str(tmp_path / "thing.ply")})
    values = mi.traverse(loaded)
    for name, expected in (
        ("vertex_positions", mesh.vertices),
        ("vertex_normals", mesh.normals),
        ("vertex_texcoords", mesh.uvs),
        ("faces", mesh.faces),
    ):
        np.testing.assert_allclose(
            np.array(values[name]).reshape(expected.shape), expected, rtol=1e-6, atol=1e-7
        )


def test_uvs_on_disk_count_tiles(folder):
    select_variant()
    import mitsuba as mi

    for thing in room(0).objects[:12]:
        for number, (mesh, name) in enumerate(thing.shapes):
            loaded = mi.load_dict(
                {"type": "ply", "filename": str(folder / "meshes" / f"{thing.name}.{number}.ply")}
            )
            reflectance = room(0).materials[name].reflectance
            tile = reflectance.size if isinstance(reflectance, Texture) else (1.0, 1.0)
            uv = np.array(mi.traverse(loaded)["vertex_texcoords"]).reshape(-1, 2)
            np.testing.assert_allclose(uv * tile, mesh.uvs, rtol=1e-5, atol=1e-5)


def test_stock_mitsuba_renders_the_scene(folder):
    select_variant()
    import mitsuba as mi

    # By default Mitsuba joins meshes of one material, which changes no pixel but loses the names.
    scene = mi.load_file(str(folder / "scene.xml"), optimize=False)
    assert len(scene.sensors()) == len(room(0).cameras)
    assert {s.id() for s in scene.shapes()} >= {
        f"{thing.name}.{k}" for thing in room(0).objects for k in range(len(thing.shapes))
    }
    image = np.array(mi.render(scene, sensor=0, spp=4))
    assert image.shape == (48, 64, 3)
    assert image.dtype == np.float32
    assert np.isfinite(image).all()
    assert (image.sum(2) > 0).mean() > 0.9


def test_lights_that_are_loaded_emit_their_lumens(folder):
    """Shape by shape: area, radiance and the colour that the eye sees, and shades of their cloth."""
    select_variant()
    import mitsuba as mi

    scene = mi.load_file(str(folder / "scene.xml"))
    shapes = {shape.id(): shape for shape in scene.shapes()}
    kinds = {light.shape for light in room(0).lights}
    assert "shade" in kinds
    for light in room(0).lights:
        shape = shapes[light.name]
        radiance = np.array(mi.traverse(shape.emitter())["radiance.value"]).ravel()
        flux = (
            LUMENS_PER_WATT * math.pi * float(shape.surface_area()[0]) * radiance @ [0.2126, 0.7152, 0.0722]
        )
        assert flux == pytest.approx(light.lumens, rel=0.005)
        if light.shape == "shade":
            assert shape.bsdf().id() == light.slot
            assert room(0).materials[light.slot].family == "fabric"


def test_the_scene_says_what_was_asked(folder):
    root = ElementTree.parse(folder / "scene.xml").getroot()
    assert root.find("integrator").get("type") == "path"
    assert root.find("integrator/integer[@name='max_depth']").get("value") == "5"
    for sensor, camera in zip(root.findall("sensor"), room(0).cameras, strict=True):
        assert sensor.find("string[@name='fov_axis']").get("value") == "x"
        assert math.radians(float(sensor.find("float[@name='fov']").get("value"))) == pytest.approx(
            camera.fov
        )
        origin = [float(v) for v in sensor.find("transform/lookat").get("origin").split(",")]
        assert tuple(origin) == camera.position
        assert sensor.find("film/rfilter").get("type") == "box"
        assert sensor.find("film/string[@name='component_format']").get("value") == "float32"
        assert sensor.find("sampler").get("type") == "independent"
    assert {b.get("id") for b in root.findall("bsdf")} == set(room(0).materials)
    for shape in root.findall("shape"):
        assert shape.find("ref").get("id") in room(0).materials
    emitters = root.findall("shape/emitter")
    assert len(emitters) == len(room(0).lights)
    for emitter, light in zip(emitters, room(0).lights, strict=True):
        values = [float(v) for v in emitter.find("rgb").get("value").split()]
        np.testing.assert_allclose(values, radiance_of(light))


def test_files_are_complete_and_moderate_in_number(folder):
    root = ElementTree.parse(folder / "scene.xml").getroot()
    named = {e.get("value") for e in root.iter("string") if e.get("name") == "filename"}
    written = {str(p.relative_to(folder)) for p in folder.rglob("*") if p.suffix in (".ply", ".png", ".hdr")}
    assert named == written
    textured = [m for m in room(0).materials.values() if isinstance(m.reflectance, Texture)]
    assert len(list((folder / "textures").glob("*.png"))) == len(textured)
    assert len(written) < 300


def test_writing_again_gives_the_same_bytes(folder, tmp_path):
    write_room(room(0), tmp_path, max_depth=5, resolution=(64, 48), spp=4)
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            assert path.read_bytes() == (tmp_path / path.relative_to(folder)).read_bytes()


def test_room_json_describes_the_room(folder):
    def refuse(value):
        raise AssertionError(value)

    text = (folder / "room.json").read_text()
    described = json.loads(text, parse_constant=refuse)
    a_room = room(0)
    assert described["kind"] == a_room.kind
    assert [o["name"] for o in described["objects"]] == [o.name for o in a_room.objects]
    assert len(described["lights"]) == len(a_room.lights)
    assert len(described["cameras"]) == len(a_room.cameras)
    assert set(described["materials"]) == set(a_room.materials)
    assert described["parameters"]["shell"]["width"] == a_room.parameters["shell"]["width"]


LIGHTS = [
    Light("a", "rectangle", (0.6, 0.2), (1.0, 2.0, 2.5), (0.0, 0.0, -1.0), 1000.0, 3000.0),
    Light("b", "rectangle", (0.6, 0.2), (1.0, 2.0, 1.5), (0.6, 0.8, 0.0), 1000.0, 3000.0),
    Light("c", "disk", (0.3,), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), 1000.0, 3000.0),
    Light("d", "sphere", (0.1,), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), 1000.0, 3000.0),
]


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.name)
def test_light_meshes_have_the_right_size_and_side(light):
    mesh = light_mesh(light, segments=200)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a) / 2
    area = np.linalg.norm(cross, axis=1).sum()
    expected = {"rectangle": 0.12, "disk": math.pi * 0.09, "sphere": 4 * math.pi * 0.01}[light.shape]
    assert area == pytest.approx(expected, rel=0.03)
    if light.shape != "sphere":
        np.testing.assert_allclose(cross.sum(0) / area, light.direction, atol=1e-9)
        # Mitsuba's unit shapes face +z.
        np.testing.assert_allclose(light_matrix(light)[:3, 2], light.direction)
        assert np.linalg.det(light_matrix(light)[:3, :3]) > 0


def test_a_turned_lamp_turns_its_light():
    placed = placed_light(LIGHTS[0], "lamp.0", (1.0, 0.0, 0.1), math.pi / 2)
    assert placed.name == "lamp.0.a"
    np.testing.assert_allclose(placed.centre, (-1.0, 1.0, 2.6))
    assert placed.size == (0.2, 0.6)
    assert placed.lumens == LIGHTS[0].lumens
    side = placed_light(LIGHTS[1], "lamp.0", (0.0, 0.0, 0.0), math.pi)
    np.testing.assert_allclose(side.direction, (-0.6, -0.8, 0.0))
    with pytest.raises(TiltedLight):
        placed_light(LIGHTS[0], "lamp.0", (0.0, 0.0, 0.0), 0.3)
