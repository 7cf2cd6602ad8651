"""Adaptive probes: what directions want, the map that gives it to them, its inverse, and lookups through both."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scipy.fft import dctn
from scipy.ndimage import gaussian_filter

from gibench.baselines.probes import placement
from gibench.baselines.probes.adaptive.inversion import inverse_map, lattice
from gibench.baselines.probes.adaptive.parameterization import CELLS, parameterize
from gibench.baselines.probes.adaptive.quasi_harmonic import areas, forward_map, triangle_areas
from gibench.baselines.probes.adaptive.resolution import FLOOR, SIDE, complexity, resolution_map
from gibench.baselines.probes.adaptive.warp import Warp
from gibench.baselines.probes.baking import MAPS, ProbeSettings
from gibench.baselines.probes.errors import ProbeError
from gibench.baselines.probes.maps import load_probes
from gibench.rendering.scene import load_dict
from tests.baselines.probes.test_baking import content, texel_directions
from tests.baselines.probes.test_mappings import columns, directions, vectors
from tests.baselines.sites import lit_box, site, where_rays_leave

ROWS, COLUMNS = 32, 64


def spots(seed=0, rows=ROWS, columns=COLUMNS):
    """Some places that want much, one of them across the seam, and a floor."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns] + 0.5
    wanted = np.zeros((rows, columns))
    places = [(0.0, 0.5), *rng.uniform(0, 1, (3, 2))]
    for centre, height in places:
        across = (x / columns - centre + 0.5) % 1 - 0.5
        wanted += np.exp(-((2 * across) ** 2 + (y / rows - height) ** 2) / (2 * 0.12**2))
    wanted = np.maximum(wanted / wanted.mean(), FLOOR)
    return wanted / wanted.mean()


def half_and_half():
    return np.where(np.arange(COLUMNS) < COLUMNS // 2, 1.0, 4.0) * np.ones((ROWS, 1))


WANTED = {
    "spots": spots(),
    "other spots": spots(1),
    "noise": np.exp(np.random.default_rng(2).normal(size=(ROWS, COLUMNS))),
    "steps": half_and_half(),
    "one texel": np.where(np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS) == 900, 1e6, 1.0),
    "almost nothing": np.where(spots() > 2, 1.0, 1e-12),
}


@pytest.mark.parametrize("name", WANTED)
def test_the_map_is_a_bijection(name):
    corners = forward_map(WANTED[name])
    assert triangle_areas(corners).min() > 0
    assert triangle_areas(corners).sum() == pytest.approx(ROWS * COLUMNS)
    # Corners at the rim slide along it, and the seam is the same line from both sides.
    np.testing.assert_array_equal(corners[:, 0, 0], 0)
    np.testing.assert_array_equal(corners[:, -1, 0], COLUMNS)
    np.testing.assert_array_equal(corners[0, :, 1], 0)
    np.testing.assert_array_equal(corners[-1, :, 1], ROWS)
    np.testing.assert_allclose(corners[:, 0, 1], corners[:, -1, 1], atol=1e-9)


def test_what_is_wanted_everywhere_moves_nothing():
    for value in (1.0, 1e-30, 1e30):
        corners = forward_map(np.full((ROWS, COLUMNS), value))
        np.testing.assert_allclose(corners, lattice((COLUMNS, ROWS), (COLUMNS, ROWS)), atol=1e-9)


def test_stripes_get_exactly_what_they_want():
    """In one dimension the equation says how the room is shared: in proportion to what is wanted."""
    np.testing.assert_allclose(areas(forward_map(half_and_half())), half_and_half() / 2.5, rtol=1e-6)


@pytest.mark.parametrize("name", ["spots", "other spots"])
def test_room_follows_what_is_wanted(name):
    wanted = WANTED[name]
    room = areas(forward_map(wanted))
    assert np.corrcoef(np.log(room).ravel(), np.log(wanted).ravel())[0, 1] > 0.9
    much = wanted > 2
    gained = (room[much].sum() / room.sum() - much.mean()) / (wanted[much].sum() / wanted.sum() - much.mean())
    assert 0.7 < gained < 1.1  # of what plain maps owe


def test_more_steps_come_nearer(monkeypatch):
    def owed(iterations):
        monkeypatch.setattr("gibench.baselines.probes.adaptive.quasi_harmonic.ITERATIONS", iterations)
        return np.abs(np.log(areas(forward_map(spots())) / spots())).mean()

    assert owed(3) < 0.7 * owed(1) < 0.7 * np.abs(np.log(spots())).mean()


def test_the_inverse_takes_moved_points_back():
    corners = forward_map(spots())
    size = (2 * COLUMNS, 2 * ROWS)
    points = lattice(size, (COLUMNS, ROWS))
    back = inverse_map(corners, points)
    # Along the rim points stay on the rim.
    np.testing.assert_allclose(back[:, 0, 0], 0, atol=1e-6)
    np.testing.assert_allclose(back[:, -1, 0], COLUMNS, atol=1e-6)
    np.testing.assert_allclose(back[0, :, 1], 0, atol=1e-6)
    np.testing.assert_allclose(back[-1, :, 1], ROWS, atol=1e-6)
    # Forth again, through the triangles as a kernel sees them.
    identity = lattice(size, size)
    warp = Warp((COLUMNS, ROWS), corners[None].astype(np.float32), identity[None].astype(np.float32))
    x, y = back.reshape(-1, 2).T.astype(np.float32)
    moved = columns(warp.moved(mi.UInt32(0), mi.Point2f(x, y)))
    np.testing.assert_allclose(moved, points.reshape(-1, 2), atol=1e-3)


def test_a_map_with_a_hole_is_refused():
    corners = lattice((8, 4), (8, 4))
    corners[:, :4, 0] *= 0.5
    corners[:, 4:, 0] += 2
    corners[:, 4] = np.nan
    with pytest.raises(ProbeError, match="without texels"):
        inverse_map(corners, lattice((8, 4), (8, 4)))


def test_complexity_is_that_of_the_definition():
    """Against the sums of section 4.2.1, written out for a few texels."""
    normal = np.random.default_rng(0).normal(size=(20, 40, 3))
    n = np.arange(SIDE)
    scale = np.where(n == 0, np.sqrt(1 / SIDE), np.sqrt(2 / SIDE))
    found = complexity(normal)
    for row, column in ((10, 20), (0, 5), (19, 0), (3, 39)):
        rows = np.clip(row + n - SIDE // 2, 0, 19)
        block = normal[np.ix_(rows, (column + n - SIDE // 2) % 40)]
        total = 0.0
        for p in n:
            for q in n:
                basis = np.outer(
                    scale[p] * np.cos(np.pi * (n + 0.5) * p / SIDE),
                    scale[q] * np.cos(np.pi * (n + 0.5) * q / SIDE),
                )
                response = np.abs((block * basis[..., None]).sum(axis=(0, 1))).sum()
                total += np.hypot(p, q) ** 5 * response / SIDE**2
        assert found[row, column] == pytest.approx(total, rel=1e-4)


def test_normals_that_are_alike_are_not_complex_whatever_rounds_them():
    rng = np.random.default_rng(0)
    for normal in [(0.0, 0.0, 1.0), (0.6, 0.0, -0.8), *rng.normal(size=(6, 3))]:
        flat = np.tile(np.array(normal, dtype=np.float32) / np.float32(np.linalg.norm(normal)), (40, 64, 1))
        np.testing.assert_array_equal(complexity(flat), 0)
        # As an interpolated normal comes out of a renderer: off by a unit in the last place, up or down.
        rounded = np.nextafter(flat, np.where(rng.random(flat.shape) < 0.5, -2, 2).astype(np.float32))
        np.testing.assert_array_equal(complexity(rounded), 0)
    np.testing.assert_array_equal(complexity(np.zeros((40, 64, 3))), 0)


@pytest.mark.parametrize(("turn", "tolerance"), [(1e-2, 0.01), (1e-3, 0.03), (1e-4, 0.3)])
def test_normals_that_hardly_turn_still_count(turn, tolerance):
    """Radians a texel, against a transform in double precision: what is taken for rounding is little of it."""
    angle = turn * np.arange(64)
    normal = np.tile(np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1), (40, 1, 1))
    responses = np.abs(dctn(normal[:SIDE, 24 : 24 + SIDE], axes=(0, 1), norm="ortho")).sum(axis=-1)
    weight = np.hypot(*np.indices((SIDE, SIDE))) ** 5 / SIDE**2
    assert complexity(normal)[20, 32] == pytest.approx((weight * responses).sum(), rel=tolerance)


def flat_room(rows=32, columns=64):
    """Guides of a place where everything is alike."""
    return (
        np.ones((rows, columns)),
        np.ones((rows, columns)),
        np.tile([0.0, 0.0, 1.0], (rows, columns, 1)),
        np.ones((rows, columns)),
    )


def test_each_term_asks_for_more():
    smooth, distance, normal, facing = flat_room()
    left = slice(8, 24), slice(8, 24)

    def ratio(**changed):
        guides = {"smoothness": smooth, "distance": distance, "normal": normal, "facing": facing} | changed
        wanted = resolution_map(**guides)
        assert wanted.mean() == pytest.approx(1)
        return wanted[16, 16] / wanted[16, 48]

    def with_left(values, value):
        changed = values.copy()
        changed[left] = value
        return changed

    bumps = normal.copy()
    bumps[left] = np.random.default_rng(0).normal(size=(16, 16, 3))
    bumps /= np.linalg.norm(bumps, axis=-1, keepdims=True)
    assert ratio() == pytest.approx(1)
    assert ratio(smoothness=with_left(smooth, 0.2)) < 0.5
    assert ratio(distance=with_left(distance, 3.0)) > 3
    assert ratio(facing=with_left(facing, 0.1)) > 3
    assert ratio(normal=bumps) > 3


def test_guides_that_are_extreme():
    smooth, distance, normal, facing = flat_room()
    for guides in (
        (0 * smooth, distance, normal, facing),  # nothing glossy
        (1e-7 * np.random.default_rng(0).random(smooth.shape), distance, normal, facing),  # nothing but dust
        (smooth, 0 * distance, 0 * normal, 0 * facing),  # nothing at all
    ):
        np.testing.assert_array_equal(resolution_map(*guides), 1)
    for scale in (1e-3, 1e3):  # metres or millimetres
        np.testing.assert_allclose(
            resolution_map(smooth, distance * scale, normal, facing),
            resolution_map(smooth, distance, normal, facing),
            rtol=1e-9,
        )
    grazing = resolution_map(smooth, distance, normal, np.where(np.arange(64) < 2, 0.0, 1.0) * facing)
    assert np.isfinite(grazing).all()
    assert grazing.min() > 0


def guides_with_a_mirror():
    """A round mirror, near the seam, in a diffuse room."""
    rows, columns = 128, 256
    y, x = np.mgrid[:rows, :columns]
    mirror = np.hypot((x + 20) % columns - 20, y - 70) < 22
    return {
        "distance": np.full((rows, columns, 1), 2.0),
        "normal": np.tile([0.0, 0.0, 1.0], (rows, columns, 1)),
        "roughness": np.where(mirror, 0.05, 1.0)[..., None],
    }, mirror


def test_lookups_go_there_and_back():
    guides, mirror = guides_with_a_mirror()
    size = (96, 48)
    forward, inverse = parameterize(guides, np.ones((128, 256)), size)
    assert forward.shape == (CELLS[1] + 1, CELLS[0] + 1, 2)
    warp = Warp(size, np.stack([lattice(CELLS, size), forward]), np.stack([lattice(size, size), inverse]))
    row, column = np.indices((size[1], size[0])).reshape(2, -1).astype(np.float32) + 0.5
    at = mi.Point2f(column, row)
    probe = mi.UInt32(1)
    plain = warp.plain(probe, at)
    apart = np.linalg.norm(columns(warp.moved(probe, plain)) - columns(at), axis=1)
    assert np.mean(apart) < 0.1
    assert apart.max() < 1  # texels, where two cells meet: a neighbour at most
    # Texels are small on the mirror and large off it; all together they cover the map.
    stretch = np.array(warp.stretch(probe, at))
    assert (stretch**2).mean() == pytest.approx(1, rel=0.02)
    x, y = columns(plain).T
    on_mirror = gaussian_filter(mirror.astype(float), 2)[
        np.minimum(y * 128 / 48, 127).astype(int), np.minimum(x * 256 / 96, 255).astype(int)
    ]
    assert stretch[on_mirror > 0.99].mean() < 0.5
    assert stretch[on_mirror < 0.01].mean() > 1.1
    assert (on_mirror > 0.5).mean() > 5 * mirror.mean()
    # The other probe of the two is plain.
    np.testing.assert_allclose(columns(warp.plain(mi.UInt32(0), at)), columns(at), atol=1e-4)
    np.testing.assert_allclose(np.array(warp.stretch(mi.UInt32(0), at)), 1, atol=1e-4)


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """Two probes over a rough floor between walls that emit."""
    floor = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 0.1, "id": "metal"}
    where = site(load_dict(lit_box(floor)), tmp_path_factory.mktemp("adaptive"))
    with pytest.MonkeyPatch.context() as patch:
        points = np.array([[0, 0, 0], [0.3, -0.2, -0.4]], dtype=np.float32)
        patch.setattr(placement, "place", lambda scene, count: points[:count])
        made = {}
        for mapping in ("lat-long", "adaptive"):
            settings = ProbeSettings(2, 64, 32, 64, mapping=mapping)
            made[mapping] = load_probes(where, settings, tuple(MAPS))
        made["fine"] = load_probes(where, ProbeSettings(2, 256, 128, 64), ("radiance",))
    return where, made


def test_maps_hold_what_their_texels_look_at(room):
    _, made = room
    probes = made["adaptive"]
    row, column = np.indices((32, 64)).reshape(2, -1).astype(np.float32) + 0.5
    for probe in range(2):
        which, at = mi.UInt32(probe), mi.Point2f(column, row)
        towards = columns(probes.direction(which, at)).astype(float)
        point = columns(probes.position(which))[0].astype(float)
        hit, face = where_rays_leave(np.tile(point, (len(towards), 1)), towards)
        found = content(probes, "distance", probe)[:, 0]
        np.testing.assert_allclose(found, np.linalg.norm(hit - point, axis=1), rtol=1e-4)
        floor = (face == (2, -1)).all(axis=1)
        assert np.mean(content(probes, "roughness", probe)[:, 0][floor] < 0.2) > 0.99
        np.testing.assert_array_equal(np.array(probes.texel_at(which, at)), probe * 2048 + np.arange(2048))
        # The floor has more texels than in a plain map.
        plain = content(made["lat-long"], "roughness", probe)[:, 0] < 0.2
        assert floor.mean() > 1.5 * plain.mean()
        assert np.array(probes.stretch(which, at))[floor].mean() < 0.7


def to_the_floor(point, margin=0.1):
    """Directions from a point to the floor, its nadir and the seam among them; not next to its edges."""
    d = directions(20000)
    hit, face = where_rays_leave(np.tile(point, (len(d), 1)), d)
    return d[(face == (2, -1)).all(axis=1) & (np.abs(hit[:, :2]) < 1 - margin).all(axis=1)]


def test_lookups_are_better_where_the_floor_is_far_and_seen_flat(room):
    """Against the distance to the floor, in closed form, and against radiance with as many texels as it takes."""
    _, made = room
    probe = mi.UInt32(1)
    point = columns(made["adaptive"].position(probe))[0].astype(float)
    d = to_the_floor(point)
    d = d[d[:, 2] > -np.sin(np.radians(40))]
    assert len(d) > 500
    expected = {"distance": (1 + point[2]) / -d[:, 2], "radiance": made["fine"]}
    for name, truth in expected.items():
        if name == "radiance":
            truth = np.array(truth.bilinear(name, probe, vectors(d)))
        found = {m: np.array(made[m].bilinear(name, probe, vectors(d))) for m in ("lat-long", "adaptive")}
        errors = {m: np.abs(value - truth).mean() for m, value in found.items()}
        assert errors["adaptive"] < 0.8 * errors["lat-long"], name


def test_coordinates_and_directions_are_inverse(room):
    _, made = room
    probes, d = made["adaptive"], to_the_floor([0, 0, 0], 0)
    at = probes.coordinates(mi.UInt32(0), vectors(d))
    x, y = columns(at).T
    assert ((x >= 0) & (x <= 64) & (y >= 0) & (y <= 32)).all()
    back = columns(probes.direction(mi.UInt32(0), at))
    angle = np.linalg.norm(back - d, axis=1)
    texel = np.pi / 32 * np.array(probes.stretch(mi.UInt32(0), at))
    assert (angle / texel).mean() < 0.05
    assert (angle / texel).max() < 1
    assert angle[texel < 0.5 * np.pi / 32].max() < 0.1 * np.pi / 32
    texel = np.array(probes.texel(mi.UInt32(0), vectors(d)))
    np.testing.assert_array_equal(texel, np.array(probes.texel_at(mi.UInt32(0), at)))


@pytest.mark.parametrize("mapping", ["lat-long", "adaptive"])
def test_weights_of_corners_beside_the_map(room, mapping):
    probes = room[1][mapping]
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-70, 140, 2000), rng.uniform(-8, 40, 2000)
    corners = probes.corners_at(mi.UInt32(1), mi.Point2f(x.astype(np.float32), y.astype(np.float32)))
    np.testing.assert_allclose(sum(np.array(weight) for _, weight in corners), 1, atol=1e-5)
    assert all((np.array(texel) // 2048 == 1).all() for texel, _ in corners)


def test_plain_probes_are_the_identity(room):
    _, made = room
    probes, d = made["lat-long"], directions()
    at = probes.coordinates(mi.UInt32(0), vectors(d))
    np.testing.assert_array_equal(columns(at), columns(probes.mapping.coordinates(vectors(d))))
    np.testing.assert_allclose(columns(probes.direction(mi.UInt32(0), at)), d, atol=2e-6)
    assert np.array(probes.stretch(mi.UInt32(0), at)).tolist() == [1]
    # Beside the map: once around, and beyond a pole.
    aside = mi.Point2f(mi.Float([64.5, -0.5, 3.5]), mi.Float([3.5, 3.5, -7]))
    np.testing.assert_array_equal(np.array(probes.texel_at(mi.UInt32(0), aside)), [3 * 64, 3 * 64 + 63, 3])


def test_where_nothing_is_glossy_adaptive_probes_are_plain(tmp_path, monkeypatch):
    monkeypatch.setattr(placement, "place", lambda scene, count: np.zeros((1, 3), dtype=np.float32))
    where = site(load_dict(lit_box({"type": "diffuse", "id": "matte"})), tmp_path)
    probes = load_probes(where, ProbeSettings(1, 32, 16, 1, mapping="adaptive"), ("radiance", "distance"))
    assert not np.array(probes.arrays["radiance"]).any()
    row, column = np.indices((16, 32)).reshape(2, -1).astype(np.float32) + 0.5
    moved = columns(probes.direction(mi.UInt32(0), mi.Point2f(column, row)))
    np.testing.assert_allclose(moved, texel_directions(probes), atol=1e-5)
