"""How the networks of all parts learn: from points of the training frames, each part from those that lie in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Frames, Images
from gibench.baselines.moving_light.measure import CODE, Measure, area_of, per_flux, unit_vectors
from gibench.baselines.radiance_regression.network import PLACE, CellNetworks
from gibench.baselines.radiance_regression.partition import Pairs, Partition, partitioned
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.curves import Trained
from gibench.baselines.training.learner import Learner, Step
from gibench.baselines.training.loop import train
from gibench.baselines.training.losses.pixels import absolute, averaged
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.training.schedule import half_cosine, set_rate
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import AreaLight

STEPS = 200_000
"""Where no time is set."""

RATE = 2e-3
"""Of Adam at the start; it falls along half a cosine. Ren et al. use Levenberg-Marquardt on each small network."""

ROWS = 32
"""Points of each part in a step."""

KEPT = 4_000_000
"""Points that are kept of all frames, as evenly from each as from the others."""

PLANNED_FROM = 200_000
"""Of these, how many decide where the room is split."""

POINT_LANE = 6
"""Of random numbers: which pixels of a frame are kept."""


class Points(NamedTuple):
    """Surface points under a light. place: (M, 3), m. rest: what else the networks are given, (M, 16 or 19). code: of
    indirect light, (M, 3).
    """

    place: Tensor
    rest: Tensor
    code: Tensor


def described(
    images: Images, camera: PinholeCamera, area: AreaLight, measure: Measure, facing: bool
) -> tuple[Tensor, Tensor]:
    """Places (3, H, W), m, and all other inputs, (16 or 19, H, W): normal, view, light centre, material, and where the
    light faces if `facing`. What is seen far away counts as near: it would take parts of the room for itself.
    """
    place = images["position"]
    eye = place.new_tensor(camera.position)[:, None, None]
    centre = place.new_tensor(area.centre)[:, None, None].expand_as(place)
    parts = [images["normal"], unit_vectors(eye - place), measure.inside(centre)]
    parts += [images[name] for name in ("albedo", "specular_albedo", "roughness")]
    if facing:
        parts.append(place.new_tensor(area.direction)[:, None, None].expand_as(place))
    return measure.nearest(place), torch.cat(parts)


def points_of(frames: Frames, index: int, measure: Measure, most: int, seed: int, facing: bool) -> Points:
    """Surface points of a frame, `most` of them at most."""
    images, area = frames[index], area_of(frames, index)
    place, rest = described(images, frames.camera(index), area, measure, facing)
    indirect = images["indirect_diffuse"] + images["indirect_specular"]
    code = CODE.encode(per_flux(indirect, area) / measure.indirect)
    seen = (images["normal"] != 0).any(dim=0).flatten().nonzero()[:, 0]
    if len(seen) > most:
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(POINT_LANE, index)))
        seen = seen[torch.from_numpy(np.sort(random.choice(len(seen), most, replace=False)))]
    return Points(*(part.flatten(1)[:, seen].T.contiguous() for part in (place, rest, code)))


def all_points(frames: Frames, measure: Measure, seed: int, facing: bool) -> Points:
    """Of all frames, KEPT of them at most; what is no place is kept in half precision."""
    most = max(KEPT // len(frames), 1)
    found = [points_of(frames, index, measure, most, seed, facing) for index in range(len(frames))]
    place = torch.cat([points.place for points in found])
    return Points(place, *(torch.cat([points[k].half() for points in found]) for k in (1, 2)))


def room_of(points: Points, cells: int) -> Partition:
    """The parts of a room."""
    step = max(len(points.place) // PLANNED_FROM, 1)
    return partitioned(points.place[::step], points.code[::step].float(), cells)


def inputs_of(partition: Partition, place: Tensor, rest: Tensor, cells: Tensor) -> Tensor:
    """Rows for networks, (…, 19 or 22), of places and of what else is given, in their cells (…)."""
    local = (place - partition.centre[cells]) / partition.half[cells]
    return torch.cat([local.clamp(-2, 2), rest], dim=-1)


def predicted(networks: CellNetworks, partition: Partition, place: Tensor, rest: Tensor) -> Tensor:
    """Light at points, blended between their cells, (M, 3), in units of its mean."""
    pairs = partition.pairs(place)
    codes = networks.of_pairs(
        inputs_of(partition, place[pairs.point], rest[pairs.point], pairs.cell), pairs.cell
    )
    light = pairs.weight[:, None] * CODE.decode(codes)
    return torch.zeros_like(place).index_add_(0, pairs.point, light)


@dataclass(frozen=True)
class Sorted:
    """Pairs by cell. point: (P,). first, count: (C,), where each cell's begin and how many they are."""

    point: Tensor
    first: Tensor
    count: Tensor

    @staticmethod
    def of(pairs: Pairs, cells: int) -> Sorted:
        """Sort them."""
        order = torch.argsort(pairs.cell, stable=True)
        count = torch.bincount(pairs.cell, minlength=cells)
        return Sorted(pairs.point[order], count.cumsum(0) - count, count)


class Regressing(Learner):
    """The networks of a room."""

    def __init__(
        self,
        points: Points,
        partition: Partition,
        judged: Sequence[Points],
        *,
        seed: int,
        seconds: float | None,
        device: str = "cpu",
    ) -> None:
        """judged: frames that are held out."""
        self.points, self.seed, self.seconds = points, seed, seconds
        self.sorted = Sorted.of(partition.pairs(points.place), partition.cells)
        self.partition = partition.to(device)
        with seeded(seed):
            networks = CellNetworks(partition.cells, PLACE + points.rest.shape[-1])
        networks.begin_at(self._means())
        self.cells = networks.to(device)
        self.judged = [Points(*(part.to(device) for part in one)) for one in judged]
        optimiser = torch.optim.Adam(self.cells.parameters(), lr=RATE, fused=True)
        super().__init__({"cells": self.cells}, {"cells": optimiser})

    def _means(self) -> Tensor:
        """Mean code of each cell; that of all where it has no point."""
        cell = torch.arange(self.partition.cells).repeat_interleave(self.sorted.count)
        codes = self.points.code[self.sorted.point].float()
        sums = torch.zeros(self.partition.cells, 3).index_add_(0, cell, codes)
        whole = codes.mean(dim=0) if len(codes) else torch.full((3,), -1.0)
        count = self.sorted.count[:, None]
        return torch.where(count > 0, sums / count.clamp(min=1), whole)

    def trained(self, checkpoint: Checkpoint | None) -> Trained:
        """Train until the budget is spent."""
        budget = Budget(steps=None if self.seconds else STEPS, seconds=self.seconds)
        return train(self, self.batches, budget, seed=self.seed, checkpoint=checkpoint, title="rrf")

    @staticmethod
    def batches(first: int) -> Iterator[None]:
        """Steps draw their points themselves."""
        while True:
            yield None

    def error(self) -> Tensor:
        """Of what is held out: mean absolute difference of codes."""
        errors = [
            absolute(CODE.encode(predicted(self.cells, self.partition, one.place, one.rest)), one.code)
            for one in self.judged
            if len(one.place)
        ]
        return torch.stack(errors).mean() if errors else torch.zeros(())

    def step(self, batch: Any, now: Step) -> dict[str, Tensor]:
        """Down the mean difference of codes, over all cells that have points."""
        set_rate(self.optimisers["cells"], RATE * half_cosine(now.progress))
        count = self.sorted.count[:, None]
        drawn = torch.from_numpy(now.random.random((self.partition.cells, ROWS)))
        which = (drawn * count).long().clamp(max=(count - 1).clamp(min=0)) + self.sorted.first[:, None]
        has = (count > 0).to(self.device)
        if not len(self.sorted.point):
            return {"pixels": torch.zeros(())}
        point = self.sorted.point[which.clamp(max=len(self.sorted.point) - 1)]
        place, rest, code = (part[point].to(self.device).float() for part in self.points)
        cell = torch.arange(self.partition.cells, device=self.device)[:, None].expand(-1, ROWS)
        inputs = inputs_of(self.partition, place, rest, cell)
        loss = averaged((self.cells(inputs) - code).abs(), has[..., None].float())
        self.descend("cells", loss)
        return {"pixels": loss.detach()}
