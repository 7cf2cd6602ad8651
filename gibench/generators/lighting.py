"""Electric light of a room: which fixtures hang on the ceiling, and how much light every lamp gives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gibench.generators.fixtures import sample_ceiling_panel, sample_downlight
from gibench.generators.layouts.placement import FloorPlan, Placed, RejectedRoom
from gibench.generators.layouts.relations import from_ceiling
from gibench.generators.light import (
    BULB_LUMENS,
    ROOM_LUMENS,
    fed,
    sample_bulb,
    sample_kelvin,
    sample_room_flux,
)

FIXTURE_LUMENS = 450.0  # least flux of a ceiling light
DOWNLIGHT_SPACING = 1.5  # m
DOWNLIGHT_SHARE = {"bathroom": 0.6, "dining-kitchen": 0.45, "office": 0.25}  # other kinds: 0.3
ENOUGH_LAMPS = 3  # rooms with that many bulbs may do without ceiling lights


def light_room(rng: np.random.Generator, plan: FloorPlan) -> None:
    """Hang ceiling lights where the plan leaves room, and set the flux of every lamp in it.

    rng: the lane of lights. The bulbs of the room add up to 1500 to 6000 lm, each gives 450 to 1600 lm, of which its
    shade keeps some. Raises RejectedRoom where no light can hang.
    """
    footprint = plan.shell.footprint
    x, y = footprint[:, 0], footprint[:, 1]
    area = 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
    target = sample_room_flux(rng, area)
    lamp_tone, ceiling_tone = sample_kelvin(rng), sample_kelvin(rng)
    lamps = [p for p in plan.placed if p.furniture.lights]
    bulbs = len(lamps)
    wants_none = rng.random() < 0.3 and bulbs >= ENOUGH_LAMPS
    fixtures = [] if wants_none else _fixtures(rng, plan)
    if bulbs + len(fixtures) == 0:
        raise RejectedRoom("no place for a light")

    target = max(target, FIXTURE_LUMENS * len(fixtures) + BULB_LUMENS[0] * bulbs)
    if target > ROOM_LUMENS[1]:
        raise RejectedRoom("too many lamps")
    fluxes = np.array([sample_bulb(rng) for _ in range(bulbs)])
    budget = target - FIXTURE_LUMENS * len(fixtures)
    if bulbs and (fluxes.sum() > budget or not fixtures):
        fluxes = _fit(fluxes, budget)
    if not fixtures and fluxes.sum() < ROOM_LUMENS[0]:
        raise RejectedRoom("too few lamps")
    for lamp, own in zip(lamps, fluxes.tolist(), strict=True):
        _set(plan, lamp, round(own, 1), lamp_tone)
    each = (target - float(fluxes.sum())) / max(1, len(fixtures))
    for fixture in fixtures:
        _set(plan, fixture, round(each, 1), ceiling_tone)


def _fit(fluxes: np.ndarray, total: float) -> np.ndarray:
    """Fluxes scaled towards a total, each kept within what a bulb gives."""
    low, high = BULB_LUMENS
    # Bisection on the scale: clipping makes the sum a growing function of it, but no simple one.
    lower, upper = 0.0, 10.0
    for _ in range(40):
        middle = (lower + upper) / 2
        if np.clip(middle * fluxes, low, high).sum() < total:
            lower = middle
        else:
            upper = middle
    return np.clip(lower * fluxes, low, high)


def _set(plan: FloorPlan, lamp: Placed, lumens: float, kelvin: float) -> None:
    lights = fed(lamp.furniture.lights, lumens, kelvin)
    parameters = {**lamp.furniture.parameters, "lumens": lumens, "kelvin": kelvin}
    plan.replace_furniture(lamp, replace(lamp.furniture, lights=lights, parameters=parameters))


def _fixtures(rng: np.random.Generator, plan: FloorPlan) -> list[Placed]:
    """Downlights in a grid, or panels along the longer side."""
    low, high = plan.shell.footprint.min(0), plan.shell.footprint.max(0)
    size = high - low
    if rng.random() < DOWNLIGHT_SHARE.get(plan.kind, 0.3):
        counts = np.clip(np.round(size / DOWNLIGHT_SPACING), 1, 3).astype(int)
        lamp = sample_downlight(rng, lumens=FIXTURE_LUMENS, kelvin=3000.0)
    else:
        across = int(size[1] > size[0])
        counts = np.ones(2, dtype=int)
        counts[across] = int(np.clip(round(size[across] / float(rng.uniform(2.2, 3.5))), 1, 3))
        lamp = sample_ceiling_panel(rng, lumens=FIXTURE_LUMENS, kelvin=3000.0)
    yaw = math.pi / 2 if rng.random() < 0.5 else 0.0
    placed = []
    for i in range(counts[0]):
        for j in range(counts[1]):
            xy = low + size * (np.array([i, j]) + 0.5) / counts
            fixture = from_ceiling(plan, lamp, (float(xy[0]), float(xy[1])), yaw)
            if fixture is not None:
                placed.append(fixture)
    return placed
