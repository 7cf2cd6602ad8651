"""Networks of parts: their published size, points one by one and together, learning, and parts without a point."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.moving_light.measure import CODE, Measure, per_flux
from gibench.baselines.radiance_regression import training
from gibench.baselines.radiance_regression.network import CellNetworks, parameters_of_a_cell
from gibench.baselines.radiance_regression.partition import Partition, partitioned
from gibench.baselines.radiance_regression.training import (
    Points,
    Regressing,
    described,
    inputs_of,
    predicted,
)
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.loop import train
from tests.baselines.neural_global_illumination.test_inputs import AREA, CAMERA, MEASURE, frame


def made(count=3000, seed=0):
    """Points whose light rises with their height."""
    generator = torch.Generator().manual_seed(seed)
    place, rest = torch.rand(count, 3, generator=generator), torch.rand(count, 16, generator=generator)
    code = CODE.encode(2 * place[:, 2:].expand(-1, 3))
    return Points(place, rest, code)


def learner(points=None, partition=None, cells=8):
    points = made() if points is None else points
    partition = partition or partitioned(points.place, points.code, cells)
    return Regressing(points, partition, [made(200, 1)], seed=3, seconds=1.0)


def test_a_network_has_the_size_of_the_paper():
    assert parameters_of_a_cell() == 12_995
    assert 4 * parameters_of_a_cell() == 51_980
    with torch.device("meta"):
        networks = CellNetworks(1000)
    assert sum(one.numel() for one in networks.parameters()) == 12_995_000


@torch.no_grad()
@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 700])
def test_points_of_any_number_are_as_one_by_one(count, monkeypatch):
    monkeypatch.setattr("gibench.baselines.radiance_regression.network.AT_ONCE", 128)
    torch.manual_seed(0)
    networks = CellNetworks(5)
    inputs, cells = torch.randn(count, 19), torch.randint(0, 5, (count,))
    found = networks.of_pairs(inputs, cells)
    assert found.shape == (count, 3)
    for one, cell, code in zip(inputs[:20], cells[:20], found[:20], strict=True):
        torch.testing.assert_close(networks(one[None, None], cell[None])[0, 0], code, rtol=1e-4, atol=1e-5)


def test_it_learns_and_repeats_to_the_bit():
    def learnt():
        one = learner()
        return train(one, one.batches, Budget(steps=40, look_every=40), seed=3)

    first, again = learnt(), learnt()
    assert first.best.error < 0.5 * first.curve[0].error
    for name, tensor in first.weights["cells"].items():
        assert torch.equal(tensor, again.weights["cells"][name])


def test_cells_without_a_point_begin_and_stay_at_the_mean():
    points = made()
    partition = partitioned(points.place, points.code, 8)
    below = points.place[:, 2] < 0.1
    few = Points(*(part[below] for part in points))
    one = learner(few, partition)
    empty = one.sorted.count == 0
    assert empty.any()
    assert not empty.all()
    before = [weights[empty].clone() for weights in one.cells.parameters()]
    found = train(one, one.batches, Budget(steps=3, look_every=3), seed=3)
    assert torch.isfinite(torch.tensor(found.best.error))
    for weights, old in zip(one.cells.parameters(), before, strict=True):
        assert torch.equal(weights[empty], old)
    with torch.no_grad():
        light = predicted(one.cells, partition, points.place, points.rest)
    assert light.isfinite().all()


def test_a_room_of_which_nothing_is_seen():
    nothing = Points(torch.zeros(0, 3), torch.zeros(0, 16), torch.zeros(0, 3))
    one = learner(nothing, partitioned(nothing.place, nothing.code, 64))
    train(one, one.batches, Budget(steps=2, look_every=2), seed=3)
    assert one.error().isfinite()


@torch.no_grad()
def test_light_is_continuous_across_parts():
    torch.manual_seed(0)
    points = made()
    partition = partitioned(points.place, points.code, 16)
    networks = CellNetworks(partition.cells)
    networks.begin_at(torch.rand(16, 3) - 0.9)
    way = torch.linspace(0, 1, 2001)[:, None].expand(-1, 3).contiguous()
    light = predicted(networks, partition, way, points.rest[:1].expand(2001, -1))
    assert (light[1:] - light[:-1]).abs().max() < 0.1 * light.max()


def test_inputs_in_closed_form():
    images = frame()
    place, rest = described(images, CAMERA, AREA, MEASURE, False)
    assert torch.equal(place, images["position"])
    told = described(images, CAMERA, AREA, MEASURE, True)[1]
    assert torch.equal(told[:16], rest)
    assert told[16:, 2, 3].tolist() == list(AREA.direction)
    normal, view, centre, albedo, specular, roughness = rest.split([3, 3, 3, 3, 3, 1])
    assert torch.equal(normal, images["normal"])
    towards = torch.tensor(CAMERA.position)[:, None, None] - place
    torch.testing.assert_close(view, towards / towards.norm(dim=0))
    assert centre[:, 0, 0].tolist() == [0, 0, 1]  # at the ceiling
    for name, part in (("albedo", albedo), ("specular_albedo", specular), ("roughness", roughness)):
        assert torch.equal(part, images[name])
    points = made()
    partition = partitioned(points.place, points.code, 4)
    cells = torch.tensor([0, 3])
    rows = inputs_of(partition, partition.centre[cells], points.rest[:2], cells)
    assert rows.shape == (2, 19)
    assert not rows[:, :3].any()


def test_what_is_far_away_counts_as_near():
    """The ground outside of a window takes no part of the room for itself."""
    images = frame()
    images["position"][:, 0, 0] = torch.tensor([1000.0, -1000.0, 0.5])
    place, _ = described(images, CAMERA, AREA, MEASURE, False)
    assert place[:, 0, 0].tolist() == [4, -4, 0.5]
    assert torch.equal(place[:, 1:], images["position"][:, 1:])


def test_which_way_a_light_faces_can_be_learned():
    """Two lights at one place, one of them facing up: the same to networks that are not told."""
    points = made()
    up = torch.arange(len(points.place)) % 2 == 0
    code = torch.where(up, -0.5, -0.9)[:, None].expand(-1, 3)
    facing = torch.where(up, 1.0, -1.0)[:, None] * torch.tensor([[0.0, 0.0, 1.0]])
    left = []
    for rest in (points.rest, torch.cat([points.rest, facing.to(points.rest.dtype)], dim=1)):
        lit = Points(points.place, rest, code)
        one = Regressing(lit, partitioned(lit.place, lit.code, 4), [lit], seed=3, seconds=1.0)
        left.append(train(one, one.batches, Budget(steps=60, look_every=60), seed=3).best.error)
    assert left[1] < 0.3 * left[0]


def test_a_larger_and_dimmer_light_is_the_same_light():
    import dataclasses

    light = frame()["indirect_diffuse"]
    larger = dataclasses.replace(AREA, width=1.0, height=1.0, radiance=(1.0, 0.5, 0.0))
    torch.testing.assert_close(per_flux(light, larger), per_flux(light, AREA))


def test_points_of_a_frame_are_those_that_are_seen(monkeypatch):
    images = frame(8, 8)
    images["normal"][:, 0] = 0

    class One:
        rows = None

        def __len__(self):
            return 1

        def __getitem__(self, index):
            return images

        def camera(self, index):
            return CAMERA

    monkeypatch.setattr(training, "area_of", lambda frames, index: AREA)
    whole = training.points_of(One(), 0, MEASURE, 1000, 0, False)
    assert len(whole.place) == 56
    few = training.points_of(One(), 0, MEASURE, 10, 0, False)
    assert few.place.shape == (10, 3)
    assert (few.place[:, None] == whole.place[None]).all(dim=2).any(dim=1).all()
    assert torch.equal(training.points_of(One(), 0, MEASURE, 10, 0, False).place, few.place)
    assert isinstance(MEASURE, Measure)


def test_partitions_are_kept_with_weights():
    points = made()
    partition = partitioned(points.place, points.code, 8)
    again = Partition(**partition.tensors())
    assert torch.equal(again.pairs(points.place).cell, partition.pairs(points.place).cell)
