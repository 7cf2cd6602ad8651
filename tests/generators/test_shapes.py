import numpy as np
import pytest

from gibench.generators import shapes
from tests.generators.mesh_checks import area, assert_sound, face_vectors, pieces, uv_areas, volume

RING = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])  # an L of area 3


def waves() -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 2, 9), indexing="ij")
    return np.stack([x, y, 0.05 * np.sin(7 * x)], -1)


SHAPES = {
    "box": lambda: shapes.box(0, 1, -2, 0, 3, 6, bevel=0.01),
    "sharp box": lambda: shapes.box(0, 1, -2, 0, 3, 6, bevel=0),
    "flat box": lambda: shapes.box(0, 1, 0, 2, 0, 0.001, bevel=0.01),
    "boxes": lambda: shapes.boxes([[0, 1, 0, 1, 0, 1], [2, 3, 0, 0.1, 0, 5]]),
    "rounded box": lambda: shapes.rounded_box((-0.5, 0.5, -0.3, 0.3, 0, 0.2), 0.05),
    "swollen box": lambda: shapes.rounded_box(
        (-0.5, 0.5, -0.3, 0.3, 0, 0.2), 0.05, swell=(0, 0.01, 0.03), flat=3
    ),
    "pillow": lambda: shapes.pillow(0.5, 0.4, 0.15),
    "odd pillow": lambda: shapes.pillow(0.5, 0.4, 0.15, cells=9),
    "cylinder": lambda: shapes.cylinder(0.2, 1, 3),
    "cone": lambda: shapes.cylinder(0.2, 1, 3, top_radius=0.01),
    "sphere": lambda: shapes.sphere(0.3, (1, 2, 3)),
    "torus": lambda: shapes.torus(0.3, 0.05),
    "revolved": lambda: shapes.revolve(
        shapes.fillet([[0, 0], [0.2, 0], [0.3, 0.5], [0.1, 1], [0, 1]], [0, 0.02, 0.5, 0.01, 0])
    ),
    "bent tube": lambda: shapes.tube(shapes.bend([[0, 0, 0], [0, 0, 1], [0, 1, 1], [1, 1, 1]], 0.2), 0.02),
    "round tube": lambda: shapes.tube([[0, 0, 0], [1, 2, 3]], 0.1, caps="round"),
    "tapered tube": lambda: shapes.tube(
        shapes.bezier([[0, 0, 0], [0, 0, 1], [1, 0, 1]], 9), np.linspace(0.1, 0.01, 9)
    ),
    "closed tube": lambda: shapes.tube(
        np.column_stack([shapes.circle(0.5), np.zeros(24)]), 0.02, closed=True
    ),
    "tubes": lambda: shapes.tubes(
        [shapes.bezier([[0, 0, 0], [0, 0, 1], [x, 1, 1]], 7) for x in (0.0, 0.5, -1.0)], 0.02
    ),
    "rod": lambda: shapes.rod([0, 0, 0], [0.3, -0.5, 0.2], 0.02, end_radius=0.01),
    "loft": lambda: shapes.loft(
        shapes.superellipse(0.8, 0.4, 4),
        [[0, 0, 0, 0, 0], [1, 1, 0, 0, 0], [0.5, 0.7, 0.1, 0, 1], [0, 0, 0.1, 0, 1]],
    ),
    "extruded": lambda: shapes.extrude(RING, 0, 0.5, bevel=0.02),
    "extruded round": lambda: shapes.extrude(shapes.rounded_rectangle(0, 1, 0, 2, 0.1), 0, 0.5),
    "extruded with hole": lambda: shapes.extrude(
        shapes.rectangle(0, 1, 0, 2),
        0,
        0.1,
        holes=(shapes.rounded_rectangle(0.3, 0.6, 0.3, 0.9, 0.1),),
        grain=1,
    ),
    "frame": lambda: shapes.frame(
        0, 1, 0, 2, shapes.fillet([[0, 0], [0.05, 0], [0.05, 0.02], [0, 0.03]], 0.004, closed=True)
    ),
    "sheet": lambda: shapes.sheet(waves(), 0.01),
    "leaf": lambda: shapes.leaf(0.3, 0.1),
    "mirrored": lambda: shapes.mirror_x(shapes.cylinder(0.2, 0, 1, centre=(1, 0))),
    "sheared": lambda: shapes.transform(
        shapes.cylinder(0.2, 0, 1), [[1, 0, 0.5, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    ),
    "repeated": lambda: shapes.repeat_at(shapes.sphere(0.2), [[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
}
CURVED = ("rounded box", "swollen box", "pillow", "odd pillow", "sphere", "torus", "revolved", "closed tube")
# Of the others, a leaf is folded, and a loft and a shear stretch what they are made from.
FLAT = [name for name in SHAPES if name not in (*CURVED, "repeated", "round tube", "leaf", "loft", "sheared")]


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_keep_the_contract_of_meshes(name):
    assert_sound(SHAPES[name]())


@pytest.mark.parametrize("name", FLAT)
def test_uvs_are_metric(name):
    mesh = SHAPES[name]()
    areas = np.linalg.norm(face_vectors(mesh), axis=1)
    assert uv_areas(mesh).sum() == pytest.approx(areas.sum(), rel=0.03)


@pytest.mark.parametrize("name", CURVED)
def test_uvs_of_curved_shapes_keep_the_area_roughly(name):
    mesh = SHAPES[name]()
    assert uv_areas(mesh).sum() == pytest.approx(area(mesh), rel=0.2)


def test_a_bevelled_box_has_the_volume_of_a_box_without_its_edges():
    a, b, c, cut = 1.0, 2.0, 3.0, 0.05
    mesh = shapes.box(0, a, 0, b, 0, c, bevel=cut)
    # Off the edges comes a prism each; of the cube of side `cut` at a corner a sixth remains.
    edges = cut**2 / 2 * 4 * (a + b + c - 6 * cut)
    assert volume(mesh) == pytest.approx(a * b * c - edges - 8 * 5 / 6 * cut**3, rel=1e-12)
    assert volume(shapes.box(0, a, 0, b, 0, c, bevel=0)) == pytest.approx(a * b * c, rel=1e-12)


def test_every_face_of_a_box_has_its_own_area_in_the_texture():
    mesh = SHAPES["box"]()
    np.testing.assert_allclose(uv_areas(mesh), np.linalg.norm(face_vectors(mesh), axis=1), rtol=1e-9)


def test_the_grain_runs_along_a_board():
    mesh = shapes.box(0, 0.1, 0, 2, 0, 0.02, bevel=0)
    top = np.flatnonzero(mesh.normals[:, 2] == 1)
    ends = mesh.vertices[top][:, 1], mesh.uvs[top][:, 0]
    assert abs(np.corrcoef(*ends)[0, 1]) == pytest.approx(1)
    across = shapes.box(0, 0.1, 0, 2, 0, 0.02, bevel=0, grain=0)
    assert abs(np.corrcoef(across.vertices[top][:, 0], across.uvs[top][:, 0])[0, 1]) == pytest.approx(1)


def test_textures_are_not_mirrored():
    for mesh in (
        shapes.box(0, 1, 0, 2, 0, 3),
        SHAPES["rounded box"](),
        SHAPES["cylinder"](),
        SHAPES["bent tube"](),
    ):
        a, b, c = np.moveaxis(mesh.uvs[mesh.faces], 1, 0)
        ab, ac = b - a, c - a
        assert np.all(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] > -1e-12)


def test_a_cylinder_is_a_prism_over_a_regular_polygon():
    n, r, h = 24, 0.5, 2.0
    mesh = shapes.cylinder(r, 0, h, bevel=1e-9, segments=n)
    base = n / 2 * r**2 * np.sin(2 * np.pi / n)
    assert volume(mesh) == pytest.approx(base * h, rel=1e-6)
    assert area(mesh) == pytest.approx(2 * base + n * 2 * r * np.sin(np.pi / n) * h, rel=1e-6)


def test_a_truncated_cone_has_the_volume_of_a_frustum():
    n, low, high, h = 64, 0.5, 0.2, 1.0
    mesh = shapes.cylinder(low, 0, h, top_radius=high, bevel=1e-9, segments=n)
    inscribed = n / (2 * np.pi) * np.sin(2 * np.pi / n)
    assert volume(mesh) == pytest.approx(
        np.pi * h / 3 * (low**2 + low * high + high**2) * inscribed, rel=1e-6
    )


@pytest.mark.parametrize(
    ("make", "exact_volume", "exact_area"),
    [
        (lambda n: shapes.sphere(0.3, segments=n), 4 / 3 * np.pi * 0.3**3, 4 * np.pi * 0.3**2),
        (
            lambda n: shapes.torus(0.5, 0.1, segments=n, sides=n),
            2 * np.pi**2 * 0.5 * 0.1**2,
            4 * np.pi**2 * 0.5 * 0.1,
        ),
    ],
)
def test_spheres_and_rings_converge_with_the_square_of_the_step(make, exact_volume, exact_area):
    coarse, fine = make(32), make(64)
    for measure, exact in ((volume, exact_volume), (area, exact_area)):
        errors = exact - measure(coarse), exact - measure(fine)
        assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


def test_normals_of_a_sphere_point_from_its_centre():
    mesh = shapes.sphere(0.3, (1, 2, 3), segments=48)
    used = np.unique(mesh.faces)
    outward = (mesh.vertices[used] - [1, 2, 3]) / 0.3
    assert np.sum(outward * mesh.normals[used], 1).min() > 0.999


def test_a_tube_has_the_volume_of_its_path_times_its_section():
    path = shapes.bend([[0, 0, 0], [0, 0, 1], [0, 1, 1]], 0.3, segments=24)
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    section = 16 / 2 * 0.05**2 * np.sin(2 * np.pi / 16)
    assert volume(shapes.tube(path, 0.05, sides=16)) == pytest.approx(length * section, rel=1e-3)


def test_an_extrusion_has_the_volume_of_its_outline_times_its_height():
    mesh = shapes.extrude(RING, 0, 0.5, bevel=1e-7)
    assert volume(mesh) == pytest.approx(3 * 0.5, rel=1e-5)
    hole = shapes.rectangle(0.2, 0.6, 0.2, 0.7)
    holed = shapes.extrude(shapes.rectangle(0, 1, 0, 2), 0, 0.1, holes=(hole,), bevel=1e-7)
    assert volume(holed) == pytest.approx((2 - 0.2) * 0.1, rel=1e-5)


def test_a_frame_has_the_volume_of_its_mitred_sides():
    width = 0.05
    mesh = shapes.frame(0, 1, 0, 2, [[0, 0], [width, 0], [width, 0.02], [0, 0.02]])
    assert volume(mesh) == pytest.approx((1 * 2 - (1 - 2 * width) * (2 - 2 * width)) * 0.02, rel=1e-9)


def test_a_sheet_has_the_volume_of_its_area_times_its_thickness():
    flat = waves() * [1, 1, 0]
    assert volume(shapes.sheet(flat, 0.01)) == pytest.approx(2 * 0.01, rel=1e-9)


@pytest.mark.parametrize("swell", [(0, 0, 0), (0.01, 0.02, 0.03)])
@pytest.mark.parametrize("flat", [1, 2, 5])
def test_rounded_boxes_fill_their_extents(swell, flat):
    extents = (-0.5, 0.7, -0.3, 0.2, 0.1, 0.4)
    mesh = shapes.rounded_box(extents, 0.06, swell=swell, flat=flat)
    np.testing.assert_allclose(mesh.vertices.min(0), extents[::2], atol=1e-12)
    np.testing.assert_allclose(mesh.vertices.max(0), extents[1::2], atol=1e-12)


def test_a_rounded_box_of_full_radius_is_a_sphere():
    mesh = shapes.rounded_box((-1, 1, -1, 1, -1, 1), 0.98, arc=12, flat=1)
    distances = np.linalg.norm(mesh.vertices, axis=1)
    assert distances.min() > 0.98
    assert distances.max() < 1.02


def test_repeating_and_scaling_keeps_the_texture_metric():
    matrix = shapes.rotation("z", 1.0) @ np.diag([3.0, 3.0, 3.0, 1.0])
    mesh = shapes.repeat(shapes.box(0, 1, 0, 2, 0, 3), [matrix, np.eye(4)])
    np.testing.assert_allclose(uv_areas(mesh), np.linalg.norm(face_vectors(mesh), axis=1), rtol=1e-9)
    assert volume(mesh) == pytest.approx(28 * volume(shapes.box(0, 1, 0, 2, 0, 3)))


def test_fit_reaches_the_box_asked_for():
    mesh = shapes.fit(shapes.sphere(0.2), [0, 1, 2], [1, 3, 5])
    np.testing.assert_allclose(
        [mesh.vertices.min(0), mesh.vertices.max(0)], [[0, 1, 2], [1, 3, 5]], atol=1e-12
    )
    assert_sound(mesh)


def test_merged_meshes_stay_pieces():
    assert len(pieces(shapes.merge([shapes.sphere(0.1), shapes.box(1, 2, 0, 1, 0, 1)]))) == 2


def test_a_fillet_touches_both_edges():
    line = shapes.fillet([[0, 0], [1, 0], [1, 1]], 0.2, segments=8)
    np.testing.assert_allclose(np.linalg.norm(line[1:-1] - [0.8, 0.2], axis=1), 0.2, atol=1e-12)
    np.testing.assert_allclose(line[[1, -2]], [[0.8, 0], [1, 0.2]], atol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: shapes.box(0, 0, 0, 1, 0, 1),
        lambda: shapes.box(0, 1, 0, 1, 0, 1, bevel=-1),
        lambda: shapes.rounded_box((0, 1, 0, 1, 0, 1), 0.0),
        lambda: shapes.pillow(0, 1, 1),
        lambda: shapes.cylinder(-1, 0, 1),
        lambda: shapes.sphere(0),
        lambda: shapes.torus(0.1, 0.2),
        lambda: shapes.revolve([[0.1, 0], [1, 0], [0, 1]]),
        lambda: shapes.tube([[0, 0, 0], [0, 0, 0]], 0.1),
        lambda: shapes.extrude([[0, 0], [1, 1], [1, 0], [0, 1]], 0, 1),
        lambda: shapes.extrude(shapes.rectangle(0, 1, 0, 0.01), 0, 1, bevel=0.1),
        lambda: shapes.frame(0, 1, 0, 1, [[0, 0], [0.6, 0], [0.6, 0.1]]),
        lambda: shapes.sheet(waves()[:1], 0.01),
        lambda: shapes.leaf(0, 1),
        lambda: shapes.merge([]),
        lambda: shapes.transform(shapes.sphere(1), np.diag([1, 1, 0, 1])),
        lambda: shapes.repeat(shapes.sphere(1), [np.diag([-1, 1, 1, 1])]),
        lambda: shapes.skin(np.zeros((4, 8, 3))),
    ],
)
def test_impossible_shapes_are_refused_in_one_line(wrong):
    with pytest.raises(shapes.ShapeError) as error:
        wrong()
    assert "\n" not in str(error.value)
