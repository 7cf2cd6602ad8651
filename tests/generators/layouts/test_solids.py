import math

import numpy as np
import pytest
import shapely

from gibench.generators.layouts.solids import (
    component_boxes,
    corners,
    grown,
    meets_any,
    moved,
    overlap,
    rectangle,
    triangles,
    whole_box,
)
from gibench.generators.parts import Furniture, Mesh, Part
from gibench.generators.shapes import box, boxes, cylinder, merge
from tests.generators.rooms_at_hand import inside, surface_points


def random_boxes(rng, count):
    low = rng.uniform(0, 2, count)
    return np.column_stack(
        [
            rng.uniform(-2, 2, (count, 2)),
            rng.uniform(0.05, 1, (count, 2)),
            rng.uniform(-7, 7, count),
            low,
            low + rng.uniform(0.1, 1, count),
        ]
    )


def test_overlap_agrees_with_polygons():
    rng = np.random.default_rng(0)
    a, b = random_boxes(rng, 40), random_boxes(rng, 60)
    polygons = [shapely.polygons(corners(x)) for x in (a, b)]
    shared = shapely.area(shapely.intersection(polygons[0][:, None], polygons[1][None]))
    heights = np.minimum(a[:, None, 6], b[None, :, 6]) - np.maximum(a[:, None, 5], b[None, :, 5])
    np.testing.assert_array_equal(overlap(a, b), (shared > 1e-9) & (heights > 0))


def test_meeting_any_is_overlapping_one():
    rng = np.random.default_rng(2)
    for _ in range(200):
        a, b = random_boxes(rng, 2), random_boxes(rng, int(rng.integers(0, 5)))
        b[:, :2] *= 2
        assert meets_any(a, b) == overlap(a, b).any()


def test_touching_is_no_overlap():
    a = rectangle(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0)
    assert not overlap(a, rectangle(2.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0)).any()
    assert not overlap(a, rectangle(0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 2.0)).any()
    assert overlap(a, grown(rectangle(2.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0), 0.01)).all()
    assert overlap(np.zeros((0, 7)), a).shape == (0, 1)


def table():
    legs = boxes([[x, x + 0.05, y, y + 0.05, 0.0, 0.7] for x in (-0.5, 0.45) for y in (-0.4, 0.35)])
    top = box(-0.5, 0.5, -0.4, 0.4, 0.701, 0.74)
    return Furniture("dining_table", {}, (Part(merge([legs, top]), "wood"),))


def test_components_are_the_closed_surfaces():
    found = component_boxes(table())
    assert len(found) == 5
    assert np.isclose(found[:, 6], 0.7).sum() == 4
    assert whole_box(table())[0, 2:4] == pytest.approx([0.5, 0.4])


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2, -2.0])
def test_boxes_contain_what_they_stand_for(yaw):
    furniture = Furniture("x", {}, (Part(cylinder(0.3, 0.1, 0.9), "wood"), *table().parts))
    for own in (whole_box(furniture), component_boxes(furniture)):
        placed = moved(own, (1.0, 2.0, 0.5), yaw)
        low, high = furniture.bounds()
        for point in [low, high, [0.3, 0, 0.5], [0.0, 0.0, 0.72]]:
            turned = [
                math.cos(yaw) * point[0] - math.sin(yaw) * point[1] + 1.0,
                math.sin(yaw) * point[0] + math.cos(yaw) * point[1] + 2.0,
            ]
            areas = shapely.polygons(corners(grown(placed, 1e-9)))
            within = shapely.intersects_xy(areas, *turned)
            z = point[2] + 0.5
            if own is whole_box(furniture):
                assert (within & (placed[:, 5] <= z + 1e-9) & (placed[:, 6] >= z - 1e-9)).any()


def test_the_independent_inside_test_is_right():
    rng = np.random.default_rng(1)
    mesh = cylinder(0.5, 0.0, 1.0, segments=64)
    points = rng.uniform(-1, 1.5, (4000, 3))
    radius = np.hypot(points[:, 0], points[:, 1])
    found = inside(points, mesh.vertices, mesh.faces)
    deep = (radius < 0.49) & (points[:, 2] > 0.01) & (points[:, 2] < 0.99)
    out = (radius > 0.5) | (points[:, 2] < 0) | (points[:, 2] > 1)
    assert found[deep].all()
    assert not found[out].any()
    skin = surface_points(rng, mesh.vertices, mesh.faces, 500, 0.001)
    assert inside(skin, mesh.vertices, mesh.faces).all()


def test_interleaved_surfaces_share_a_box_and_others_do_not():
    one, two = box(0, 1, 0, 1, 0, 1), box(3, 4, 0, 1, 0, 1)
    together = merge([one, two])
    rng = np.random.default_rng(3)
    order = rng.permutation(len(together.vertices))
    number = np.argsort(order).astype(np.int32)
    shuffled = Mesh(
        together.vertices[order], number[together.faces], together.normals[order], together.uvs[order]
    )
    for mesh, count in ((together, 2), (shuffled, 1)):
        found = component_boxes(Furniture("box", {}, (Part(mesh, "wood"),)))
        assert len(found) == count
        low, high = (found[:, 0] - found[:, 2]).min(), (found[:, 0] + found[:, 2]).max()
        assert (low, high) == pytest.approx((0, 4))


def test_triangles_enclose_the_volume_of_the_boxes():
    boxes_ = random_boxes(np.random.default_rng(4), 20)
    vertices, faces = triangles(boxes_)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    signed = np.einsum("ij,ij->i", a, np.cross(b, c)).reshape(len(boxes_), 12).sum(1) / 6
    np.testing.assert_allclose(signed, 4 * boxes_[:, 2] * boxes_[:, 3] * (boxes_[:, 6] - boxes_[:, 5]))
    np.testing.assert_allclose(vertices.reshape(-1, 2, 4, 3)[:, 0, :, :2], corners(boxes_))
