"""Camera placement: stills and walks through the free floor of a room.

Every candidate stands where a person who came in through the door can stand, and is judged by rays before it
is taken (see `view_checks`). What is refused is counted by reason.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from gibench.errors import GibenchError
from gibench.generators.parts import Camera, FloatArray
from gibench.generators.trajectories import NoFarView, Spread, differences, spread_stills
from gibench.generators.view_checks import CheckedView, check_views
from gibench.generators.visibility import Caster

HEIGHTS = (1.2, 1.8)  # of the camera above the floor, m
FOV = (math.radians(50), math.radians(90))  # horizontal field of view
BATCH = 24  # candidates judged at once
STILL_BATCHES = 12  # batches before a room is given up, at least
PICKED = (
    24  # stills up to which the richest that differ most are picked; of more, every one that passes is taken
)
TRIED_PER_STILL = 8  # candidates for each of many stills before a room is given up
PATH_TRIES = 40  # curves before a room is given up
SHARPEST_BEND = 0.3  # turn of a walk within a sixtieth of its length, radians
PATHS = ("walk", "orbit", "eight")
LEAST_DIFFERENCE = 0.7  # between two stills of a room, as `_difference` counts it


@dataclass(frozen=True)
class PathPlan:
    """A sequence of frames of a room, by its name. kind: one of PATHS. moves: "camera", "light" or "both".

    Where the light alone moves the camera stands still.
    """

    name: str
    kind: str
    frames: int
    moves: str = "camera"

    def named(self, cameras: Sequence[Camera]) -> tuple[Camera, ...]:
        """Its cameras, in order, with its name."""
        return tuple(replace(camera, path=self.name, step=step) for step, camera in enumerate(cameras))


class NoView(GibenchError):
    """A room in which not enough views pass. reasons: how often candidates were refused, by reason."""

    def __init__(self, what: str, reasons: Counter[str]) -> None:
        """what: "stills" or the kind of path."""
        worst = ", ".join(f"{reason} {count}" for reason, count in reasons.most_common(3))
        super().__init__(f"no {what} passed the view checks ({worst}); the next try draws the room again")
        self.what, self.reasons = what, reasons


class ViewSpace:
    """The facts of a room that cameras are placed by.

    free: polygon of the ground where a camera may stand. things: (N, 3) middles of what is worth looking at.
    shell_owners: see `view_checks.check_views`.
    """

    def __init__(
        self,
        free: shapely.Geometry,
        height: float,
        things: FloatArray,
        caster: Caster,
        shell_owners: int,
        floor: float = 0.0,
    ) -> None:
        """height: of the room, floor: where its floor lies, metres."""
        self.free, self.height, self.things, self.floor = free, height, things, floor
        self.caster, self.shell_owners = caster, shell_owners
        shapely.prepare(self.free)

    def check(self, cameras: Sequence[Camera]) -> list[CheckedView]:
        """See `view_checks.check_views`."""
        return check_views(self.caster, cameras, self.shell_owners)

    def points(self, rng: np.random.Generator, count: int) -> FloatArray:
        """(count, 2) points spread over the free floor."""
        x0, y0, x1, y1 = self.free.bounds
        found = np.zeros((0, 2))
        while len(found) < count:
            tried = rng.uniform((x0, y0), (x1, y1), (4 * count, 2))
            found = np.concatenate([found, tried[shapely.contains_xy(self.free, tried)]])
        return found[:count]


def sample_stills(
    rng: np.random.Generator, stage: ViewSpace, count: int
) -> tuple[tuple[Camera, ...], Counter[str]]:
    """Draw `count` single views: few that differ from each other, or many as they come.

    Returns them and how often candidates were refused, by reason. Raises NoView when the tries run out.
    """
    chosen: list[Camera] = []
    refused: Counter[str] = Counter()
    picked = count <= PICKED
    for _ in range(max(STILL_BATCHES, math.ceil(TRIED_PER_STILL * count / BATCH))):
        passed, reasons = _candidates(rng, stage)
        refused += reasons
        if not picked:
            chosen += [v.camera for v in passed[: count - len(chosen)]]
            passed = []
        # Rich views that show what the others do not, so that a handful of frames tells what the room has.
        while passed and len(chosen) < count:
            worth = [v.objects + 6.0 * _difference(v.camera, chosen) for v in passed]
            best = passed.pop(int(np.argmax(worth)))
            if _difference(best.camera, chosen) >= LEAST_DIFFERENCE:
                chosen.append(best.camera)
            else:
                refused["like another"] += 1
        if len(chosen) == count:
            return tuple(chosen), refused
    raise NoView("stills", refused)


def sample_spread(
    rng: np.random.Generator, stage: ViewSpace, count: int, spread: Spread, beside: Sequence[Camera] = ()
) -> tuple[tuple[Camera, ...], Counter[str]]:
    """Draw `count` stills along walks, and away from these and from the cameras `beside`.

    Returns them and how often candidates were refused, by reason. Raises NoView when the tries run out.
    """

    def candidates() -> tuple[list[Camera], Counter[str]]:
        passed, refused = _candidates(rng, stage)
        return [view.camera for view in passed], refused

    try:
        return spread_stills(
            count, spread, lambda frames: sample_path(rng, stage, "walk", frames), candidates, beside
        )
    except NoFarView:
        raise NoView(
            "stills away from the trajectories", Counter({"near a trajectory": spread.far})
        ) from None


def _candidates(rng: np.random.Generator, stage: ViewSpace) -> tuple[list[CheckedView], Counter[str]]:
    """Views anywhere that pass, of a batch, and how many did not, by reason."""
    views = stage.check([_candidate(rng, stage, xy) for xy in stage.points(rng, BATCH)])
    return [v for v in views if not v.reason], Counter(v.reason for v in views if v.reason)


def _candidate(rng: np.random.Generator, stage: ViewSpace, xy: FloatArray) -> Camera:
    """A camera at a point, turned to something far enough to show its surroundings."""
    z = stage.floor + rng.uniform(HEIGHTS[0], min(HEIGHTS[1], stage.height - 0.4))
    away = np.hypot(*(stage.things[:, :2] - xy).T)
    weights = np.clip(away - 0.8, 0.05, 3.0)
    aim = stage.things[int(rng.choice(len(weights), p=weights / weights.sum()))]
    # Eyes wander around what they look at, and look down a little rather than straight at the ground.
    yaw = math.atan2(aim[1] - xy[1], aim[0] - xy[0]) + float(rng.normal(0.0, 0.25))
    pitch = float(rng.normal(-0.12, 0.09))
    fov = float(rng.uniform(*FOV))
    return camera_at((float(xy[0]), float(xy[1]), float(z)), yaw, pitch, fov)


def camera_at(
    position: tuple[float, float, float], yaw: float, pitch: float, fov: float, path: str = "", step: int = 0
) -> Camera:
    """A camera that looks along a direction: yaw from +x counter-clockwise, pitch up, radians."""
    pitch = min(max(pitch, -0.45), 0.25)
    direction = (math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch))
    x, y, z = (p + 2.0 * d for p, d in zip(position, direction, strict=True))
    return Camera(position, (x, y, z), fov, path, step)


def _difference(camera: Camera, others: Sequence[Camera]) -> float:
    """How much a camera differs from the most similar of others, 2 at most; see `differences`."""
    return float(differences(camera, others).min(initial=2.0))


def sample_path(
    rng: np.random.Generator, stage: ViewSpace, kind: str, frames: int
) -> tuple[tuple[Camera, ...], Counter[str]]:
    """Draw a smooth path of `frames` views, every one of which passes.

    kind: "walk" (through the free floor, looking ahead), "orbit" (on an arc around something, looking at it) or
    "eight" (a figure eight). Returns the cameras in order, and how often paths were refused, by reason of their first
    refused view. Raises NoView when the tries run out.
    """
    draw = {"walk": _walk, "orbit": _orbit, "eight": _eight}[kind]
    refused: Counter[str] = Counter()
    for _ in range(PATH_TRIES):
        drawn = draw(rng, stage, frames)
        if drawn is None:
            refused[f"{kind}: no free curve"] += 1
            continue
        xy, yaw = drawn
        z = stage.floor + float(rng.uniform(HEIGHTS[0] + 0.2, min(HEIGHTS[1], stage.height - 0.5)))
        fov = float(rng.uniform(math.radians(65), FOV[1]))
        pitch = float(rng.normal(-0.12, 0.05))
        cameras = [
            camera_at((float(p[0]), float(p[1]), z), float(a), pitch, fov, kind, step)
            for step, (p, a) in enumerate(zip(xy, yaw, strict=True))
        ]
        reason = next((v.reason for v in stage.check(cameras) if v.reason), "")
        if not reason:
            return tuple(cameras), refused
        refused[f"{kind}: {reason}"] += 1
    raise NoView(kind, refused)


def sample_planned(
    rng: np.random.Generator, stage: ViewSpace, plan: PathPlan
) -> tuple[tuple[Camera, ...], Counter[str]]:
    """Draw the cameras of a sequence, which bear its name. Returns and raises what `sample_path` does."""
    if plan.moves == "light":
        (still,), refused = sample_stills(rng, stage, 1)
        drawn: tuple[Camera, ...] = (still,) * plan.frames
    else:
        drawn, refused = sample_path(rng, stage, plan.kind, plan.frames)
    return plan.named(drawn), refused


Curve = tuple[FloatArray, FloatArray]  # (N, 2) places and (N,) yaws


def _inside(stage: ViewSpace, xy: FloatArray) -> bool:
    return bool(stage.free.covers(shapely.LineString(xy)))


def _spaced(xy: FloatArray, frames: int) -> FloatArray:
    """A dense polyline resampled to equal steps."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    at = np.linspace(0.0, length[-1], frames)
    return np.column_stack([np.interp(at, length, xy[:, k]) for k in (0, 1)])


def _aimed(xy: FloatArray, aim: FloatArray) -> FloatArray:
    """Yaws that look from places (N, 2) at points (N, 2) or (2,)."""
    towards = aim - xy
    return np.arctan2(towards[:, 1], towards[:, 0])


def _walk(rng: np.random.Generator, stage: ViewSpace, frames: int) -> Curve | None:
    from scipy.interpolate import CubicSpline  # not needed by those who build no room

    best: FloatArray | None = None
    for _ in range(12):
        knots = stage.points(rng, 4)
        # The shortest order of four points from the first keeps the curve from crossing itself.
        order = [0]
        while len(order) < 4:
            rest = [k for k in range(4) if k not in order]
            order.append(min(rest, key=lambda k: float(np.hypot(*(knots[k] - knots[order[-1]])))))
        knots = knots[order]
        t = np.concatenate([[0.0], np.cumsum(np.sqrt(np.hypot(*np.diff(knots, axis=0).T)))])
        dense = CubicSpline(t, knots, bc_type="natural")(np.linspace(0.0, t[-1], 60))
        length = float(np.hypot(*np.diff(dense, axis=0).T).sum())
        if length > 0.8 and _sharpest_bend(dense) < SHARPEST_BEND and _inside(stage, dense):
            best = dense
            break
    if best is None:
        return None
    xy = _spaced(best, frames)
    # Looking at a slow mean of what lies around keeps walls out of the middle of the view.
    aim = stage.things[int(rng.integers(len(stage.things)))][:2]
    other = stage.things[int(rng.integers(len(stage.things)))][:2]
    blend = np.linspace(0.0, 1.0, frames)[:, None]
    return xy, _aimed(xy, aim * (1 - blend) + other * blend)


def _sharpest_bend(xy: FloatArray) -> float:
    """Largest turn between two steps of a polyline resampled to 60 equal ones, radians."""
    steps = np.diff(_spaced(xy, 61), axis=0)
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    return float(np.abs(turns).max())


def _orbit(rng: np.random.Generator, stage: ViewSpace, frames: int) -> Curve | None:
    aim = stage.things[int(rng.integers(len(stage.things)))][:2] + rng.normal(0.0, 0.2, 2)
    angles = np.linspace(0.0, 2 * math.pi, 120, endpoint=False) + rng.uniform(0, 2 * math.pi)
    for radius in rng.uniform(1.2, 3.2, 6):
        ring = aim + radius * np.column_stack([np.cos(angles), np.sin(angles)])
        free = shapely.contains_xy(stage.free, ring)
        start, length = _longest_run(free)
        if length * radius * (angles[1] - angles[0]) > 0.8:
            arc = ring[(start + np.arange(length)) % len(ring)]
            if _inside(stage, arc):
                xy = _spaced(arc, frames)
                return xy, _aimed(xy, aim)
    return None


def _longest_run(flags: FloatArray) -> tuple[int, int]:
    """Start and length of the longest run of True on a ring."""
    if flags.all():
        return 0, len(flags)
    doubled = np.concatenate([flags, flags])
    best, start, run = (0, 0), 0, 0
    for k, flag in enumerate(doubled):
        if flag:
            start, run = (k, 1) if run == 0 else (start, run + 1)
            if run > best[1]:
                best = (start % len(flags), run)
        else:
            run = 0
    return best


def _eight(rng: np.random.Generator, stage: ViewSpace, frames: int) -> Curve | None:
    t = np.linspace(0.0, 2 * math.pi, 121)
    shape = np.column_stack([np.sin(t), np.sin(t) * np.cos(t)])
    for xy in stage.points(rng, 12):
        angle = rng.uniform(0, math.pi)
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        for scale in (1.2, 0.8, 0.55, 0.4):
            curve = xy + (scale * shape * [1.0, rng.uniform(0.5, 1.0)]) @ turn
            if _inside(stage, curve):
                aim = stage.things[int(rng.integers(len(stage.things)))][:2]
                if np.hypot(*(aim - xy)) < scale + 0.8:
                    continue
                # The last place would be the first again.
                places = _spaced(curve, frames + 1)[:-1]
                return places, _aimed(places, aim)
    return None
