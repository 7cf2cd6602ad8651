"""Imported rooms: where cameras may stand, what is written, and how a scene is lit anew."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.openings import find_openings
from gibench.generators.imported.orientation import oriented, pieces
from gibench.generators.imported.room import import_room, write_imported_room
from gibench.generators.imported.scene import ImportSettings, fingerprint, import_scene
from gibench.generators.imported.survey import survey
from gibench.generators.imported.turning import with_meshes_turned, without_flips
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.free_space import free_space
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_scene

from .files import SQUARE, image, one, room_file, written

SIZE = (32, 24)


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    scene = import_scene(room_file(tmp_path_factory.mktemp("room")))
    return import_room(scene, resolution=SIZE, views=3, path="walk", path_views=6)


def color(scene, camera, spp=256):
    view = PinholeCamera(camera.position, camera.target, camera.fov)
    return render_frame(scene, view, resolution=SIZE, channels=("color",), spp=spp).arrays["color"]


def test_its_own_camera_comes_first_then_stills_then_the_path(room):
    assert len(room.cameras) == 1 + 3 + 6
    np.testing.assert_allclose(room.cameras[0].position, (0.6, -2.2, 1.6))
    assert [camera.path for camera in room.cameras] == [""] * 4 + ["walk"] * 6
    assert [camera.step for camera in room.cameras[4:]] == list(range(6))


def test_cameras_stand_free_in_the_room(room):
    """By the boxes' own numbers, which the survey does not know."""
    for camera in room.cameras[1:]:
        x, y, z = camera.position
        assert abs(x) < 2.5 - 0.25
        assert abs(y) < 3 - 0.25
        assert 1.1 < z < 1.9
        for shape in room.scene.loaded.mi_scene.shapes():
            if shape.id().startswith("box"):
                box = shape.bbox()
                low, high = (np.array(corner).ravel() for corner in (box.min, box.max))
                outside = np.maximum(np.maximum(low - (x, y, z), (x, y, z) - high), 0)
                assert np.linalg.norm(outside) > 0.25, (shape.id(), camera)


def test_the_floor_is_found_with_what_stands_on_it(tmp_path):
    scene, found = oriented(import_scene(room_file(tmp_path)))
    stage = survey(scene.loaded, found)
    assert stage.floor == pytest.approx(0, abs=0.01)
    assert stage.height == pytest.approx(2.7, abs=0.02)
    import shapely

    # The boxes are lower than eyes, but nobody stands on them.
    boxes = [(-2.0, -2.4), (-2.0, 0.0), (2.0, 0.2), (0.0, 2.4), (0.0, -0.2)]
    assert not shapely.contains_xy(stage.free, *np.transpose(boxes)).any()
    assert shapely.contains_xy(stage.free, 0.0, -1.5)
    assert 5 < stage.free.area < 4.4 * 5.4


def test_the_same_seed_gives_the_same_cameras(room, tmp_path):
    again = import_room(
        import_scene(room_file(tmp_path)), resolution=SIZE, index=7, views=3, path="walk", path_views=6
    )
    assert again.cameras == room.cameras
    other = import_room(import_scene(room_file(tmp_path)), resolution=SIZE, seed=1, views=3)
    assert other.cameras[0] == room.cameras[0]
    assert other.cameras[1] != room.cameras[1]


def test_walls_that_turn_their_back_are_turned_round(tmp_path):
    """A cube whose faces look outward is a room to live in all the same."""
    right, _ = oriented(import_scene(room_file(tmp_path / "right")))
    wrong, found = oriented(import_scene(room_file(tmp_path / "wrong", flip="false")))
    assert [c for c in right.changes if c.rule == "orientation"] == []
    turned = [c for c in wrong.changes if c.rule == "orientation"]
    assert [c.where for c in turned] == ["scene.xml:8"]
    assert len(found) > 100
    shells = [next(s for s in x.loaded.mi_scene.shapes() if s.id() == "shell") for x in (right, wrong)]
    normals = [np.sign(_seen_from_inside(shell)) for shell in shells]
    assert normals == [1, 1]
    camera = wrong.cameras[0].at(SIZE)
    np.testing.assert_allclose(
        color(wrong.loaded, camera).mean(), color(right.loaded, camera).mean(), rtol=0.02
    )


def _seen_from_inside(shape) -> float:
    """Cosine between the normal of a wall and where it is seen from."""
    import mitsuba as mi

    ray = mi.Ray3f(mi.Point3f(0, 0, 1.2), mi.Vector3f(1, 0, 0))
    si = mi.load_dict({"type": "scene", "shape": shape}).ray_intersect(ray)
    return float(-np.array(si.n).ravel() @ [1, 0, 0])


def _shell(scene):
    return next(s for s in scene.loaded.mi_scene.shapes() if s.id() == "shell")


def _faces_away(scene, eye=(0, 0, 1.2)) -> np.ndarray:
    """Whether each triangle of the shell turns its back to a point."""
    mesh = _shell(scene)
    corners = np.array(mesh.vertex_positions_buffer()).reshape(-1, 3)[
        np.array(mesh.faces_buffer()).reshape(-1, 3)
    ]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.einsum("fc,fc->f", outward, np.array(eye) - corners.mean(axis=1)) < 0


@pytest.mark.parametrize("normals", [False, True])
@pytest.mark.parametrize("joined", [False, True])
def test_one_wall_of_a_shape_is_turned_by_itself(tmp_path, joined, normals):
    """Two triangles of a shell of twelve are wound the other way round, be they joined to the others or not."""
    from gibench.generators.parts import Mesh
    from gibench.generators.scene_files import write_ply

    file = room_file(tmp_path)
    cube = trimesh.creation.box(extents=(2, 2, 2))
    vertices, faces = np.array(cube.vertices), np.array(cube.faces, dtype=np.int32)[:, ::-1].copy()
    wall = np.flatnonzero(np.all(np.isclose(vertices[faces][..., 1], 1), axis=1))
    assert len(wall) == 2
    faces[wall] = faces[wall, ::-1]
    if not joined:
        vertices, faces = vertices[faces.ravel()], np.arange(36, dtype=np.int32).reshape(12, 3)
    inward = -vertices / np.linalg.norm(vertices, axis=1, keepdims=True) if normals else np.zeros((0, 3))
    write_ply(Mesh(vertices, faces, inward, np.zeros((0, 2))), tmp_path / "shell.ply")
    text = file.read_text()
    start = text.index('<shape type="cube" id="shell">')
    stop = text.index("</shape>", start)
    body = text[start:stop].replace(
        '<shape type="cube" id="shell">',
        '<shape type="ply" id="shell"><string name="filename" value="shell.ply"/>',
    )
    body = body.replace('<boolean name="flip_normals" value="true"/>', "")
    file.write_text(text[:start] + body + text[stop:])
    scene = import_scene(file)
    assert np.count_nonzero(_faces_away(scene)) == 2
    right, found = oriented(scene)
    assert [c.rule for c in right.changes].count("orientation") == 1
    assert not _faces_away(right).any()
    assert len(found) > 100
    camera = right.cameras[0].at(SIZE)
    np.testing.assert_allclose(
        color(right.loaded, camera).mean(), color(scene.loaded, camera).mean(), rtol=0.02
    )


def test_pieces_end_where_the_winding_turns():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
    one = np.array([[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(pieces(square, one), [0, 0])
    np.testing.assert_array_equal(pieces(square, np.array([[0, 1, 2], [0, 3, 2]])), [0, 1])
    # Vertices that are split, as for texture seams, do not part them; another place does.
    split = np.concatenate([square[one.ravel()], square[one.ravel()] + 5])
    np.testing.assert_array_equal(pieces(split, np.arange(12).reshape(4, 3)), [0, 0, 1, 1])
    # A face without area, and three faces at one edge, are no trouble.
    assert len(set(pieces(square, np.array([[0, 0, 0], [0, 1, 2], [0, 1, 2], [2, 1, 3]])))) >= 2


@pytest.mark.parametrize("flat", ["false", "true"])
def test_a_mesh_is_turned_in_its_file(tmp_path, flat):
    """Place, normals and texture coordinates stay, and so does what a flag had turned."""
    sphere = trimesh.creation.icosphere(subdivisions=2)
    from gibench.generators.parts import Mesh
    from gibench.generators.scene_files import write_ply

    uvs = sphere.vertices[:, :2] * 0.5
    write_ply(Mesh(sphere.vertices, sphere.faces.astype(np.int32), sphere.vertices, uvs), tmp_path / "a.ply")
    body = (
        '<shape type="ply" id="s"><string name="filename" value="a.ply"/><boolean name="flip_normals" value="true"/>'
        f'<boolean name="face_normals" value="{flat}"/>'
        '<transform name="to_world"><scale x="2" y="1" z="1"/></transform></shape>'
    )
    scene = import_scene(written(tmp_path, body), ImportSettings(up="z"))
    camera = PinholeCamera((0.1, -4, 1), (0, 0, 0), 0.8)
    names = ("position", "normal", "geometric_normal", "curvature")

    def arrays(scene):
        return render_frame(scene, camera, resolution=(48, 36), channels=names).arrays

    before = arrays(scene.loaded)
    after_scene = without_flips(scene)
    assert one(after_scene.tree.root, "shape").property("flip_normals") is None
    after = arrays(after_scene.loaded)
    for name in names[:3]:  # these are turned to the viewer
        np.testing.assert_allclose(after[name], before[name], atol=2e-4, err_msg=name)

    def facing(scene):
        import mitsuba as mi

        si = scene.loaded.mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(0.2, 0.3, 1)))
        return float(np.array(si.n).ravel() @ [0.2, 0.3, 1]), np.array(si.uv).ravel()

    assert facing(scene)[0] < 0
    assert facing(after_scene)[0] < 0
    np.testing.assert_allclose(facing(scene)[1], facing(after_scene)[1], atol=1e-5)
    turned = {"s": np.ones(1, dtype=bool)}
    assert facing(with_meshes_turned(scene, turned))[0] > 0
    assert facing(with_meshes_turned(with_meshes_turned(scene, turned), turned))[0] < 0


def test_without_views_only_its_own_cameras_are_there(tmp_path):
    room = import_room(import_scene(room_file(tmp_path)), resolution=SIZE, views=0)
    assert len(room.cameras) == 1
    with pytest.raises(SceneFileError, match=r"has no camera of its own: ask for some with --views"):
        import_room(import_scene(written(tmp_path, SQUARE)), resolution=SIZE, views=0)


def test_where_nothing_is_enclosed_there_is_no_place_for_a_camera(tmp_path):
    with pytest.raises(SceneFileError, match=r"no place for a camera: nothing in the scene is enclosed"):
        import_room(import_scene(written(tmp_path, SQUARE)), resolution=SIZE, views=1)


def test_a_scale_that_cannot_be_is_named(tmp_path):
    """A room of 5 cm has no place to stand in."""
    scene = import_scene(room_file(tmp_path), ImportSettings(scale=0.01))
    with pytest.raises(SceneFileError, match=r"is --scale right\?"):
        import_room(scene, resolution=SIZE, views=1)


def test_daylight_comes_in_where_rays_go_out(tmp_path):
    """A room with a window of known place in its wall."""
    wall = '<transform name="to_world"><scale x="{}" y="{}"/>{}<translate x="{}" y="{}" z="{}"/></transform>'
    upright = '<rotate x="1" angle="90"/>'  # faces −y
    walls = [
        wall.format(3, 3, "", 0, 0, 0),
        wall.format(3, 3, '<rotate x="1" angle="180"/>', 0, 0, 3),
        wall.format(3, 1.5, '<rotate x="1" angle="-90"/>', 0, -3, 1.5),
        wall.format(1.5, 3, '<rotate y="1" angle="90"/>', -3, 0, 1.5),
        wall.format(1.5, 3, '<rotate y="1" angle="-90"/>', 3, 0, 1.5),
        # The wall at y = 3 has a window from −1 to 1 and 1 to 2.
        wall.format(1, 1.5, upright, -2, 3, 1.5),
        wall.format(1, 1.5, upright, 2, 3, 1.5),
        wall.format(1, 0.5, upright, 0, 3, 0.5),
        wall.format(1, 0.5, upright, 0, 3, 2.5),
    ]
    bsdf = '<bsdf type="twosided" id="w"><bsdf type="diffuse"/></bsdf>'
    body = bsdf + "".join(f'<shape type="rectangle">{w}<ref id="w"/></shape>' for w in walls)
    file = written(tmp_path, body + '<emitter type="constant"/>', version="3.0.0")
    scene = import_scene(file, ImportSettings(up="z")).loaded
    (opening,) = find_openings(scene, free_space(scene))
    corner, u, v = opening
    low, high = np.minimum(corner, corner + u + v), np.maximum(corner, corner + u + v)
    # All of the window, and little more than what the walls' thickness and the size of the cells make of it.
    assert (low <= (-1, 3.06, 1)).all()
    assert (high >= (1, 2.94, 2)).all()
    assert abs(corner[1] - 3) < 0.11
    assert (high - low)[0] * (high - low)[2] < 2.2 * 2 * 1
    assert np.cross(u, v)[1] < 0  # points inside


@pytest.fixture(scope="module")
def folder(room, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    write_imported_room(room, folder, max_depth=9, resolution=SIZE, spp=16)
    return folder


def test_what_is_written_is_what_was_imported(room, folder):
    written_scene = load_scene(folder / "scene.xml", share_kernels=True)
    assert written_scene.shapes == room.scene.loaded.shapes
    assert written_scene.materials == room.scene.loaded.materials
    for camera in (room.cameras[0], room.cameras[-1]):
        np.testing.assert_array_equal(color(written_scene, camera, 16), color(room.scene.loaded, camera, 16))


def test_equal_rooms_give_equal_files(room, folder, tmp_path):
    write_imported_room(room, tmp_path, max_depth=9, resolution=SIZE, spp=16)
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        assert (tmp_path / file.relative_to(folder)).read_bytes() == file.read_bytes(), file


def test_stock_mitsuba_opens_the_folder(folder):
    code = (
        "from gibench.rendering.backend import select_variant; select_variant('scalar_rgb'); import mitsuba as mi;"
        "s = mi.load_file('scene.xml'); print(len(s.sensors()), s.integrator().class_name())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.stdout.split() == ["10", "PathIntegrator"], done.stderr


def test_room_json_says_what_was_done(room, folder):
    said = json.loads((folder / "room.json").read_text())
    assert said["source"]["up"] == "z"
    assert said["source"]["scale"] == 1
    assert said["source"]["to_metres_z_up"] == np.eye(4).tolist()
    assert len(said["cameras"]) == len(room.cameras)
    assert said["lights"] == [{"type": "area", "where": "scene.xml:15"}]


def test_the_glb_has_the_same_triangles(room, folder):
    loaded = trimesh.load(folder / "room.glb")
    area = sum(float(mesh.area) for mesh in loaded.dump() if isinstance(mesh, trimesh.Trimesh))
    known = 2 * (5 * 6 + 5 * 2.7 + 6 * 2.7) + 0.8**2
    known += sum(24 * s * s for s in (0.4, 0.45, 0.35, 0.4, 0.35, 0.45, 0.5, 0.3, 0.3, 0.3))
    assert area == pytest.approx(known, rel=1e-5)


def test_files_of_equal_names_are_told_apart(tmp_path):
    body = ""
    for number, colour in enumerate([(255, 0, 0), (0, 255, 0)]):
        image(tmp_path / f"part {number}" / "wood.png", color=colour)
        texture = f'<string name="filename" value="part {number}\\wood.png"/>'
        body += (
            f'<shape type="cube"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">{texture}'
            "</texture></bsdf></shape>"
        )
    camera = '<sensor type="perspective"/>'
    scene = import_scene(written(tmp_path, body + camera))
    assert sorted(scene.files.values()) == ["textures/wood-2.png", "textures/wood.png"]
    write_imported_room(
        import_room(scene, resolution=SIZE, views=0), tmp_path / "out", max_depth=2, resolution=SIZE, spp=1
    )
    assert (tmp_path / "out/textures/wood-2.png").read_bytes() == (tmp_path / "part 1/wood.png").read_bytes()
    load_scene(tmp_path / "out/scene.xml")


def test_opacity_is_the_alpha_of_old_leaves(tmp_path):
    image(tmp_path / "leaf.png", mode="RGBA", color=(255, 255, 255, 64))
    texture = '<texture type="bitmap" name="opacity"><string name="filename" value="leaf.png"/></texture>'
    body = f'<shape type="rectangle"><bsdf type="mask">{texture}<bsdf type="diffuse"/></bsdf></shape>'
    scene = import_scene(written(tmp_path, body))
    assert any("is its alpha channel" in change.what for change in scene.changes)
    camera = PinholeCamera((0, -0.1, 3), (0, 0, 0), 0.2)
    tilted = import_scene(written(tmp_path, body), ImportSettings(up="z"))
    arrays = render_frame(tilted.loaded, camera, resolution=(8, 8), channels=("albedo",)).arrays
    np.testing.assert_allclose(arrays["albedo"], 0.5 * 64 / 255, atol=1e-3)
    new = import_scene(written(tmp_path, body, version="3.0.0"))
    assert not [change for change in new.changes if change.rule == "channels"]


def test_one_channel_of_an_image(tmp_path):
    image(tmp_path / "a.png", color=(10, 128, 255))
    texture = (
        '<texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/>'
        '<string name="channel" value="g"/></texture>'
    )
    body = f'<shape type="rectangle"><bsdf type="diffuse">{texture}</bsdf></shape>'
    scene = import_scene(written(tmp_path, body), ImportSettings(up="z"))
    camera = PinholeCamera((0, -0.1, 3), (0, 0, 0), 0.2)
    arrays = render_frame(scene.loaded, camera, resolution=(8, 8), channels=("albedo",)).arrays
    np.testing.assert_allclose(arrays["albedo"], ((128 / 255 + 0.055) / 1.055) ** 2.4, atol=1e-3)
    with pytest.raises(SceneFileError, match=r"channel 'x' of a\.png cannot be read"):
        import_scene(written(tmp_path, body.replace('value="g"', 'value="x"')))


def test_instances_are_copies_in_their_places(tmp_path):
    moved = '<transform name="to_world"><scale value="2"/><translate x="{}"/></transform>'
    group = f'<shape type="shapegroup" id="g"><shape type="cube">{moved.format(1)}</shape></shape>'
    body = group + "".join(f'<shape type="instance"><ref id="g"/>{moved.format(x)}</shape>' for x in (10, 20))
    scene = import_scene(written(tmp_path, body), ImportSettings(up="z"))
    assert scene.loaded.shapes == ("cube", "cube.2")
    boxes = [shape.bbox() for shape in sorted(scene.loaded.mi_scene.shapes(), key=lambda s: s.id())]
    for box, x in zip(boxes, (12, 22), strict=True):
        np.testing.assert_allclose(np.array(box.min).ravel(), (x - 4, -4, -4))
    with pytest.raises(SceneFileError, match="the instance refers to no shapegroup"):
        import_scene(written(tmp_path, '<shape type="instance"/>'))


ANALYTIC = {
    "disk": "",
    "sphere": '<float name="radius" value="0.8"/><point name="center" x="0.1" y="0.2" z="-0.1"/>',
    "cylinder": '<point name="p0" x="-0.5" y="0" z="-0.4"/><point name="p1" x="0.5" y="0.3" z="0.6"/>'
    '<float name="radius" value="0.5"/>',
}


@pytest.mark.parametrize("kind", ANALYTIC)
def test_analytic_shapes_look_like_their_meshes(tmp_path, kind):
    """Place, normals and texture coordinates, against Mitsuba's exact shape."""
    from gibench.rendering.backend import select_variant
    from gibench.rendering.scene import wrap

    select_variant()
    import mitsuba as mi

    checks = (
        '<texture type="checkerboard" name="reflectance"><rgb name="color0" value="0.9 .1 .1"/>'
        '<rgb name="color1" value=".1 .1 .9"/><transform name="to_uv"><scale x="7" y="5"/></transform></texture>'
    )
    turned = '<transform name="to_world"><rotate x="1" angle="50"/><rotate z="1" angle="20"/></transform>'
    bsdf = f'<bsdf type="twosided"><bsdf type="diffuse">{checks}</bsdf></bsdf>'
    file = written(tmp_path, f'<shape type="{kind}">{ANALYTIC[kind]}{turned}{bsdf}</shape>', version="3.0.0")
    exact, mesh = wrap(mi.load_file(str(file))), import_scene(file, ImportSettings(up="z"))
    assert one(mesh.tree.root, "shape").type == "ply"
    camera = PinholeCamera((2, -3, 2.0), (0, 0, 0), 0.7)
    a, b = (
        render_frame(scene, camera, resolution=(96, 72), channels=("surface",)).arrays
        for scene in (exact, mesh.loaded)
    )
    hit = (a["distance"] > 0) & (b["distance"] > 0)
    assert hit.mean() > 0.15
    assert ((a["distance"] > 0) ^ (b["distance"] > 0)).mean() < 2e-3  # the silhouette
    assert np.median(np.abs(a["distance"] - b["distance"])[hit]) < 4e-4
    assert np.percentile(np.abs(a["normal"] - b["normal"])[hit[..., 0]], 99) < 0.02
    assert (np.abs(a["albedo"] - b["albedo"]).max(-1, keepdims=True) > 0.01)[hit].mean() < 0.02


def test_lamps_mirrors_and_panes_stay_exact(tmp_path):
    body = (
        '<shape type="rectangle"><emitter type="area"/></shape><shape type="sphere"><bsdf type="dielectric"/></shape>'
        '<shape type="disk"><bsdf type="conductor"/></shape>'
    )
    scene = import_scene(written(tmp_path, body))
    assert [shape.type for shape in scene.tree.root.nodes("shape")] == ["rectangle", "sphere", "disk"]


def test_a_scene_counts_by_all_of_its_files(tmp_path):
    image(tmp_path / "a.png")
    texture = '<texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/></texture>'
    file = written(tmp_path, f'<shape type="cube"><bsdf type="diffuse">{texture}</bsdf></shape>')
    first = fingerprint(file, ImportSettings())
    assert fingerprint(file, ImportSettings(scale=2)) == first
    image(tmp_path / "a.png", color=(1, 2, 3))
    assert fingerprint(file, ImportSettings()) != first
