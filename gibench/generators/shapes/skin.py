"""Round things: a skin over stacked rings, and what follows from it (revolved profiles, cylinders, tubes)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from gibench.generators.parts import FloatArray, IntArray, Mesh
from gibench.generators.shapes.affine import Points, cross, length
from gibench.generators.shapes.errors import ShapeError

_LID = 0.85  # from this share of area vectors that add up on, a strip between two rings counts as flat
_CREASE = np.radians(35)  # a profile that turns by more than this has an edge, by less it is a sampled curve


def skin(rings: ArrayLike, *, creases: Sequence[int] = (), closed: bool = False) -> Mesh:
    """A closed surface through a stack of rings.

    rings: (K, N, 3) m; each ring is a closed curve of N points, all in the same sense. Unless `closed` (the
    last ring joins the first, as in a torus), the first and the last ring must each have shrunk to a point.
    creases: rings (0 < k < K - 1; with `closed` 0 ≤ k < K) at which the surface has an edge; between them
    it is smooth. UVs: on a wall u runs across the rings and v around them (scaled by the wall's mean girth,
    so that the area is right); on what is nearly flat, like a lid, both are planar. The side that encloses
    a positive volume is the inside. Raises ShapeError for too few rings, rings that are no points at the
    ends, or no volume.
    """
    rings = np.asarray(rings, float)
    if rings.ndim != 3 or rings.shape[0] < 3 or rings.shape[1] < 3 or not np.all(np.isfinite(rings)):
        raise ShapeError(f"skin: needs finite rings (K ≥ 3, N ≥ 3, 3), got the shape {rings.shape}")
    if closed:
        start = creases[0] if creases else 0
        rings = np.roll(rings, -start, 0)
        creases = [(c - start) % len(rings) for c in creases][1:]
        smooth_seam = start == 0 and not creases
        rings = np.concatenate([rings, rings[:1]])
    else:
        smooth_seam = False
        if np.any(rings[[0, -1]] != rings[[0, -1], :1]):
            raise ShapeError("skin: the first and last ring must be points, or say closed=True")
    after = np.roll(rings, -1, 1)
    # The area vector of each quad (k, n), from its diagonals; right also where two corners coincide.
    areas = cross(after[1:] - rings[:-1], rings[1:] - after[:-1]) / 2
    centres = (rings[:-1] + rings[1:] + after[:-1] + after[1:]) / 4
    middle = rings.reshape(-1, 3).mean(0)
    volume = float(np.sum(areas * (centres - middle)))
    if not abs(volume) > 0:
        raise ShapeError("skin: the rings enclose no volume; check that they differ")
    sense = 1.0 if volume > 0 else -1.0
    areas = areas * sense
    strips = length(areas).sum(1)
    # A strip whose area vectors add up is level like a lid; one whose area vectors cancel is a wall.
    lids = length(areas.sum(1)) > _LID * strips
    edges = set(creases)
    begin, end = _normals(rings, areas, strips, edges, wrap=smooth_seam)
    bounds = [0, *sorted(edges | {int(k) + 1 for k in np.flatnonzero(lids[1:] != lids[:-1])}), len(rings) - 1]
    bands = list(itertools.pairwise(bounds))
    # A ring between two bands stands twice, and the seam's column too, so that v can run on to the full girth.
    around = rings.shape[1]
    columns = np.arange(around + 1) % around
    rows = np.concatenate([np.arange(first, last + 1) for first, last in bands])
    counts = np.diff(bounds)
    closing = np.zeros((len(rows), 1, 1), bool)
    closing[np.cumsum(counts + 1) - 1] = True
    uvs = np.empty((len(rows), around + 1, 2))
    rises = length(np.diff(rings, axis=0)).mean(1)
    widths = length(after - rings)
    for number, (first, last) in enumerate(bands):
        into = uvs[first + number : last + number + 1]
        if lids[first]:
            into[:] = _lid_uvs(rings[first : last + 1], areas[first:last].sum((0, 1)))[:, columns]
            continue
        u = np.concatenate([[0.0], np.cumsum(rises[first:last])])
        # Where around a ring a column stands is the same for all rings, or lines along the grain would spiral.
        share = np.concatenate([[0.0], np.cumsum(widths[first : last + 1].sum(0))])
        into[..., 0] = u[:, None]
        into[..., 1] = -sense * share / share[-1] * (strips[first:last].sum() / u[-1])
    row = np.arange(len(rings) - 1) + np.repeat(np.arange(len(bands)), counts)
    a = row[:, None] * (around + 1) + np.arange(around)
    b, c, d = a + 1, a + around + 2, a + around + 1
    point = np.all(rings == rings[:, :1], axis=(1, 2))
    faces = [np.stack([a, b, c], -1)[~point[:-1]], np.stack([a, c, d], -1)[~point[1:]]]
    triangles = np.concatenate([f.reshape(-1, 3) for f in faces]).astype(np.int32)
    if sense < 0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    normals = np.where(closing, end[rows], begin[rows])[:, columns]
    return Mesh(rings[rows][:, columns].reshape(-1, 3), triangles, normals.reshape(-1, 3), uvs.reshape(-1, 2))


def _normals(
    rings: FloatArray, areas: FloatArray, strips: FloatArray, edges: set[int], *, wrap: bool
) -> tuple[FloatArray, FloatArray]:
    """Unit normals (K, N, 3) of the rings, for the strips that begin and for those that end at each of them.

    They differ at the edges only. areas: (K - 1, N, 3) area vectors of the quads; strips: (K - 1,) their sums.
    """
    around = areas + np.roll(areas, 1, 1)
    # By area, but a small strip keeps a say of a quarter, lest its normals lean too far off its faces.
    before, after = np.concatenate([strips[-1:], strips]), np.concatenate([strips, strips[:1]])
    most = 3 * np.minimum(before, after)
    whole = np.concatenate([around[-1:], around, around[:1]])
    mixed = whole[:-1] * np.minimum(1, most / before)[:, None, None]
    mixed += whole[1:] * np.minimum(1, most / after)[:, None, None]
    begin, end = whole[1:].copy(), whole[:-1].copy()
    smooth = np.ones(len(rings), bool)
    smooth[list(edges)] = False
    smooth[[0, -1]] = wrap
    begin[smooth] = end[smooth] = mixed[smooth]
    for total, pole in ((begin, 0), (end, -1)):
        if np.all(rings[pole] == rings[pole, :1]):
            # One normal for all, unless it is the tip of a pointed cone.
            mean = total[pole].sum(0)
            if length(mean) > 0.6 * length(total[pole]).sum():
                total[pole] = mean
    return begin / length(begin)[..., None], end / length(end)[..., None]


def _lid_uvs(rings: FloatArray, area: FloatArray) -> FloatArray:
    """(k, N, 2) planar UVs of rings (k, N, 3), seen against the area vector (3,)."""
    normal = area / length(area)
    along = np.eye(3)[int(np.argmin(np.abs(normal[:2])))]
    along = along - normal * (normal @ along)
    along = along / length(along)
    return rings @ np.stack([along, cross(normal, along)], 1)


def circle(radius: float = 1.0, segments: int = 24) -> FloatArray:
    """(segments, 2) points of a circle, counter-clockwise from +x; on the axes exactly if 4 divides segments."""
    angles = np.arange(segments) * (2 * np.pi / segments)
    points = np.stack([np.cos(angles), np.sin(angles)], 1)
    points[np.abs(points) < 1e-12] = 0
    return radius * points


def superellipse(half_width: float, half_depth: float, power: float, segments: int = 48) -> FloatArray:
    """(segments, 2) points of |x/a|ᵖ + |y/b|ᵖ = 1, counter-clockwise from +x; p = 2 is an ellipse."""
    unit = circle(1.0, segments)
    scale = (np.abs(unit) ** power).sum(1, keepdims=True) ** (-1 / power)
    return unit * scale * [half_width, half_depth]


def fillet(points: Points, radius: ArrayLike, *, segments: int = 3, closed: bool = False) -> FloatArray:
    """A polyline (P, 2) whose corners are replaced by arcs.

    radius: of the arcs (m), one for all or (P,); limited to what the neighbouring edges allow, and 0 leaves a
    corner. The ends of an open polyline stay. Returns (Q, 2).
    """
    points = np.asarray(points, float)
    radii = np.broadcast_to(np.asarray(radius, float), len(points)).tolist()
    corners = points.tolist()
    sweep = np.linspace(-1, 1, segments + 1)
    result = []
    for k, (x, y) in enumerate(corners):
        if (not closed and k in (0, len(points) - 1)) or radii[k] <= 0:
            result.append(points[k : k + 1])
            continue
        (x0, y0), (x1, y1) = corners[k - 1], corners[(k + 1) % len(corners)]
        back_length, ahead_length = math.hypot(x0 - x, y0 - y), math.hypot(x1 - x, y1 - y)
        back = ((x0 - x) / back_length, (y0 - y) / back_length)
        ahead = ((x1 - x) / ahead_length, (y1 - y) / ahead_length)
        half = math.acos(min(1.0, max(-1.0, back[0] * ahead[0] + back[1] * ahead[1]))) / 2
        if half > math.pi / 2 - 0.02:  # all but straight
            result.append(points[k : k + 1])
            continue
        reach = min(radii[k] / math.tan(half), 0.49 * back_length, 0.49 * ahead_length)
        size = reach * math.tan(half)
        bisector = np.array([back[0] + ahead[0], back[1] + ahead[1]]) / (2 * math.cos(half))
        side = np.array([-bisector[1], bisector[0]])
        if side @ ahead < 0:
            side = -side
        turn = sweep[:, None] * (math.pi / 2 - half)
        centre = points[k] + bisector * (size / math.sin(half))
        result.append(centre + size * (np.sin(turn) * side - np.cos(turn) * bisector))
    return np.concatenate(result)


def profile_creases(profile: FloatArray, *, closed: bool = False) -> list[int]:
    """The points of a polyline (P, 2) at which it turns by more than 35°."""
    ends = np.concatenate([profile[-1:], profile, profile[:1]]) if closed else profile
    steps = np.diff(ends, axis=0)
    angles = np.arctan2(steps[:, 1], steps[:, 0])
    turns = np.abs((np.diff(angles) + np.pi) % (2 * np.pi) - np.pi)
    return [int(k) + (0 if closed else 1) for k in np.flatnonzero(turns > _CREASE)]


def revolve(profile: Points, *, segments: int = 24, closed: bool = False) -> Mesh:
    """The solid that a profile sweeps out around the z axis.

    profile: (P, 2) of (r, z) m, r ≥ 0; it starts and ends on the axis (r = 0), or is a loop off the axis with
    `closed` (a ring). Corners of more than 35° are edges. segments: around; a multiple of 4 makes the
    bounding box exact. Raises ShapeError if the profile crosses the axis or, unless closed, does not end on
    it.
    """
    profile = np.asarray(profile, float)
    if profile.min(0)[0] < 0 or (not closed and (profile[0, 0] != 0 or profile[-1, 0] != 0)):
        raise ShapeError("revolve: the profile must have r ≥ 0 and, unless closed, start and end at r = 0")
    ring = circle(1.0, segments)
    rings = np.empty((len(profile), segments, 3))
    rings[..., :2] = profile[:, None, :1] * ring
    rings[..., 2] = profile[:, None, 1]
    return skin(rings, creases=profile_creases(profile, closed=closed), closed=closed)


def stacked(outlines: ArrayLike, heights: ArrayLike) -> Mesh:
    """A solid through level outlines.

    outlines: (K, N, 2) m, each a closed curve; the first and last are shrunk to a point by this function.
    heights: (K,) m. Corners of more than 35° in the polyline of mean radius and height are edges.
    """
    outlines, heights = np.array(outlines, float), np.asarray(heights, float)
    for end in (0, -1):
        outlines[end] = outlines[end].mean(0)
    rings = np.concatenate(
        [outlines, np.broadcast_to(heights[:, None, None], (*outlines.shape[:2], 1))], axis=2
    )
    radii = np.linalg.norm(outlines - outlines.mean(1, keepdims=True), axis=2).mean(1)
    return skin(rings, creases=profile_creases(np.stack([radii, heights], 1)))


def loft(outline: Points, profile: Points) -> Mesh:
    """A solid of stacked, level copies of one outline; see `stacked`.

    outline: (N, 2), a closed curve around the origin. profile: (K, 5) rows (scale x, scale y, x, y, z): how
    large a copy is and where its origin lies.
    """
    outline, profile = np.asarray(outline, float), np.asarray(profile, float)
    return stacked(outline * profile[:, None, :2] + profile[:, None, 2:4], profile[:, 4])


def cylinder(
    radius: float,
    z0: float,
    z1: float,
    *,
    top_radius: float | None = None,
    bevel: float = 0.002,
    segments: int = 24,
    centre: tuple[float, float] = (0.0, 0.0),
) -> Mesh:
    """An upright cylinder, or a truncated cone with top_radius, with bevelled edges (m).

    The bevel is at most a third of the height and of the smaller radius. u runs along the wall, planar on the
    caps. Raises ShapeError for a radius or
    height ≤ 0.
    """
    top = radius if top_radius is None else top_radius
    if not min(radius, top, z1 - z0, bevel) > 0:
        raise ShapeError(
            f"cylinder: radii ({radius:g}, {top:g}), height ({z1 - z0:g}) and bevel ({bevel:g}) must be positive"
        )
    cut = min(bevel, (z1 - z0) / 3, radius / 3, top / 3)
    ring, faces = _cylinder_template(segments)
    around = ring[np.arange(segments + 1) % segments]
    levels = np.array([[radius - cut, z0], [radius, z0 + cut], [top, z1 - cut], [top - cut, z1]])
    # Bevel, wall, bevel: each strip has its own pair of rings, for it has its own normals.
    strips = levels[[0, 1, 1, 2, 2, 3]]
    steps = np.diff(levels, axis=0)
    lengths = np.hypot(*steps.T)
    slopes = np.repeat(steps / lengths[:, None], 2, 0)
    wall, normals = np.empty((2, 6, segments + 1, 3))
    wall[..., :2], wall[..., 2] = strips[:, None, :1] * around, strips[:, None, 1]
    normals[..., :2], normals[..., 2] = slopes[:, None, 1:] * around, -slopes[:, :1]
    rise = np.concatenate([[0.0], np.cumsum(lengths)])[[0, 1, 1, 2, 2, 3]]
    girth = (radius + top) * np.sin(np.pi / segments) * np.arange(segments + 1)
    wall_uvs = np.stack(np.broadcast_arrays(rise[:, None], -girth[None]), -1)
    caps = [np.column_stack([levels[k, 0] * ring, np.full(segments, levels[k, 1])]) for k in (0, 3)]
    cap_normals = np.repeat([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], segments, 0)
    return Mesh(
        np.concatenate([*caps, wall.reshape(-1, 3)]) + np.array([*centre, 0.0]),
        faces,
        np.concatenate([cap_normals, normals.reshape(-1, 3)]),
        np.concatenate([caps[0][:, :2] * [1, -1], caps[1][:, :2], wall_uvs.reshape(-1, 2)]),
    )


@lru_cache(maxsize=16)
def _cylinder_template(segments: int) -> tuple[FloatArray, IntArray]:
    """The unit circle (segments, 2) and the triangles of a cylinder: bottom cap, top cap, 3 strips."""
    fan = np.arange(1, segments - 1)
    cap = np.stack([np.zeros_like(fan), fan, fan + 1], 1)
    index = np.arange(6 * (segments + 1)).reshape(3, 2, segments + 1) + 2 * segments
    a, b, c, d = index[:, 0, :-1], index[:, 0, 1:], index[:, 1, 1:], index[:, 1, :-1]
    wall = np.stack([a, b, c, a, c, d], -1).reshape(-1, 3)
    faces = np.concatenate([cap[:, ::-1], cap + segments, wall]).astype(np.int32)
    faces.setflags(write=False)
    return circle(1.0, segments), faces


def sphere(
    radius: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0), *, segments: int = 24
) -> Mesh:
    """A sphere; its poles lie on the z axis. Raises ShapeError for a radius ≤ 0."""
    if not radius > 0:
        raise ShapeError(f"sphere: the radius must be positive, got {radius:g}")
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    profile = radius * np.stack([np.cos(angles), np.sin(angles)], 1)
    profile[[0, -1], 0] = 0
    mesh = revolve(profile, segments=segments)
    return Mesh(mesh.vertices + np.asarray(centre), mesh.faces, mesh.normals, mesh.uvs)


def torus(radius: float, tube_radius: float, *, segments: int = 32, sides: int = 12) -> Mesh:
    """A ring around the z axis at z = 0. Raises ShapeError if the tube is thicker than the ring is wide."""
    if not 0 < tube_radius < radius:
        raise ShapeError(f"torus: needs 0 < tube_radius < radius, got {tube_radius:g} and {radius:g}")
    return revolve(circle(tube_radius, sides) + np.array([radius, 0.0]), segments=segments, closed=True)


def tube(
    path: ArrayLike,
    radius: ArrayLike,
    *,
    sides: int = 12,
    closed: bool = False,
    caps: str = "flat",
    section: ArrayLike | None = None,
) -> Mesh:
    """A tube along a path of points.

    path: (K, 3) m, K ≥ 2, no two neighbours equal. radius: m, one for all or (K,). section: (N, 2) an own
    cross-section to be scaled by the radius, by default a circle of `sides` points; its first axis lies
    across the plane of the path's first bend. caps: "flat" or "round". closed: the path's end joins its
    start. The section is carried along without twisting and stands on the bisecting plane at every bend. u
    runs along the path. Raises ShapeError for a path that is too short or stands still.
    """
    path = np.asarray(path, float)
    steps = np.diff(np.concatenate([path, path[:1]]) if closed else path, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    if len(path) < 2 or not np.all(lengths > 0):
        raise ShapeError("tube: the path needs at least 2 points, no two neighbours equal")
    radii = np.broadcast_to(np.asarray(radius, float), len(path))
    headings = steps / lengths
    before = np.roll(headings, 1, 0) if closed else np.concatenate([headings[:1], headings])
    ahead = headings if closed else np.concatenate([headings, headings[-1:]])
    bisectors = before + ahead
    bisectors /= np.linalg.norm(bisectors, axis=1, keepdims=True)
    bends = cross(headings[:-1], headings[1:])
    bent = np.flatnonzero(np.linalg.norm(bends, axis=1) > 1e-9)
    across = bends[bent[0]] if len(bent) else np.eye(3)[int(np.argmin(np.abs(headings[0])))]
    across = across - headings[0] * (headings[0] @ across)
    across /= np.linalg.norm(across)
    outline = circle(1.0, sides) if section is None else np.asarray(section, float)
    frames = np.empty((len(path), 3))
    for k in range(len(path)):
        if k > 0 or closed:
            across = across - before[k] * (before[k] @ across)
            across = across / np.sqrt(across @ across)
        frames[k] = across
    up = cross(before, frames)
    flat = outline[:, :1] * frames[:, None] + outline[:, 1:] * up[:, None]
    flat *= radii[:, None, None]
    # Sheared onto the bisecting plane, so that both straight pieces keep their section.
    slant = np.maximum(np.sum(before * bisectors, 1), 0.3)
    slide = np.einsum("kni,ki->kn", flat, bisectors) / slant[:, None]
    stack = path[:, None] + flat - slide[..., None] * before[:, None]
    # Round sections of bent tubes are smooth across sharp bends of less than 35°, like any sampled curve.
    turns = np.arccos(np.clip(np.sum(before * ahead, 1), -1, 1))
    creases = [int(k) for k in np.flatnonzero(turns > _CREASE)]
    if closed:
        return skin(stack, creases=creases, closed=True)
    if caps == "round":
        lift = np.linspace(0, np.pi / 2, 5)[1:]
        start = path[0] + (
            np.cos(lift)[:, None, None] * (stack[0] - path[0])
            - (np.sin(lift)[:, None] * radii[0] * headings[0])[:, None]
        )
        end = path[-1] + (
            np.cos(lift)[:, None, None] * (stack[-1] - path[-1])
            + (np.sin(lift)[:, None] * radii[-1] * headings[-1])[:, None]
        )
        start[-1], end[-1] = start[-1].mean(0), end[-1].mean(0)
        return skin(np.concatenate([start[::-1], stack, end]), creases=[c + 4 for c in creases])
    ends = np.broadcast_to(path[[0, -1]][:, None], (2, len(outline), 3))
    last = len(stack)
    return skin(np.concatenate([ends[:1], stack, ends[1:]]), creases=[1, *[c + 1 for c in creases], last])


def rod(
    start: ArrayLike, end: ArrayLike, radius: float, *, end_radius: float | None = None, sides: int = 12
) -> Mesh:
    """A straight round rod between two points (3,) m, tapered with end_radius; see `cylinder`."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    span = float(np.linalg.norm(end - start))
    upright = cylinder(radius, 0.0, span, top_radius=end_radius, bevel=0.15 * radius, segments=sides)
    along = (end - start) / span
    across = cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    across /= np.linalg.norm(across)
    turn = np.stack([across, cross(along, across), along])  # rows: where the axes x, y and z go
    return Mesh(upright.vertices @ turn + start, upright.faces, upright.normals @ turn, upright.uvs)


def tubes(paths: ArrayLike, radii: ArrayLike, *, sides: int = 6) -> Mesh:
    """Many thin tubes at once, with closed ends, for stems and wires.

    paths: (N, K, 3) m, K ≥ 3. radii: m, broadcast to (N, K). Unlike `tube`, the sections stand across the
    direction of the path at each point, which is right for gentle bends in one plane. u runs along the paths.
    """
    paths = np.asarray(paths, float)
    number, count = paths.shape[:2]
    radii = np.broadcast_to(np.asarray(radii, float), (number, count))
    headings = np.gradient(paths, axis=1)
    headings /= np.linalg.norm(headings, axis=2, keepdims=True)
    # One reference for a whole path, so that its sections do not twist: the normal of the plane it bends in.
    chord = paths[:, -1] - paths[:, 0]
    plane = np.cross(headings[:, 0], chord)
    straight = np.linalg.norm(plane, axis=1) < 1e-3 * np.linalg.norm(chord, axis=1)
    reference = np.where(straight[:, None], np.eye(3)[np.argmin(np.abs(chord), axis=1)], plane)[:, None]
    across = np.cross(headings, reference)
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    ring = circle(1.0, sides)[np.arange(sides + 1) % sides]
    outward = (
        ring[:, 0, None] * across[:, :, None] + ring[:, 1, None] * np.cross(headings, across)[:, :, None]
    )
    wall = paths[:, :, None] + radii[:, :, None, None] * outward
    steps = np.linalg.norm(np.diff(paths, axis=1), axis=2)
    u = np.concatenate([np.zeros((number, 1)), np.cumsum(steps, 1)], 1)[..., None]
    v = -2 * np.sin(np.pi / sides) * radii[..., None] * np.arange(sides + 1)
    index = np.arange(count * (sides + 1)).reshape(count, sides + 1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    caps = index.size + np.arange(2 * sides).reshape(2, sides)
    fan = np.arange(1, sides - 1)
    first = np.stack([caps[0, 0] + 0 * fan, caps[0, fan + 1], caps[0, fan]], 1)
    last = np.stack([caps[1, 0] + 0 * fan, caps[1, fan], caps[1, fan + 1]], 1)
    faces = np.concatenate([np.stack([a, b, c, a, c, d], -1).reshape(-1, 3), first, last])
    ends = wall[:, [0, -1], :sides].reshape(number, -1, 3)
    end_normals = np.repeat(np.stack([-headings[:, 0], headings[:, -1]], 1), sides, 1)
    flat = np.stack([radii[:, :1], radii[:, -1:]], 1) * ring[:sides].reshape(1, 1, -1)
    size = index.size + 2 * sides
    return Mesh(
        np.concatenate([wall.reshape(number, -1, 3), ends], 1).reshape(-1, 3),
        (faces[None] + np.arange(number)[:, None, None] * size).reshape(-1, 3).astype(np.int32),
        np.concatenate([outward.reshape(number, -1, 3), end_normals], 1).reshape(-1, 3),
        np.concatenate(
            [np.stack(np.broadcast_arrays(u, v), -1).reshape(number, -1, 2), flat.reshape(number, -1, 2)], 1
        ).reshape(-1, 2),
    )


def bezier(points: ArrayLike, count: int) -> FloatArray:
    """(count, D) points along the Bézier curve of the control points (P, D)."""
    layer = np.asarray(points, float)[:, None]
    t = np.linspace(0, 1, count)[:, None]
    while len(layer) > 1:
        layer = (1 - t) * layer[:-1] + t * layer[1:]
    return layer[0]


def bend(points: ArrayLike, radius: float, *, segments: int = 4) -> FloatArray:
    """A polyline (P, 3) whose inner corners are replaced by arcs of the radius (m). Returns (Q, 3).

    What `fillet` does, in space: a bent metal tube.
    """
    points = np.asarray(points, float)
    result = [points[:1]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        first = before - corner
        first_length = np.linalg.norm(first)
        first = first / first_length
        second = after - corner
        second_length = np.linalg.norm(second)
        second = second / second_length
        across = second - first * (first @ second)
        across_length = np.linalg.norm(across)
        if across_length < 1e-9:
            continue
        frame = np.stack([first, across / across_length])
        plane = np.array([[first_length, 0.0], [0.0, 0.0], [second_length * (first @ second), 0.0]])
        plane[2, 1] = second_length * across_length
        result.append(corner + fillet(plane, radius, segments=segments)[1:-1] @ frame)
    return np.concatenate([*result, points[-1:]])
