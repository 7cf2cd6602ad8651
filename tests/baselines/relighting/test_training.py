"""Every network that relights learns to the bit the same again, also where its training was cut off."""

from __future__ import annotations

import dataclasses

import pytest
import torch
import trimesh

from gibench.baselines.neural_free_viewpoint_relighting import METHOD as NFVR
from gibench.baselines.neural_free_viewpoint_relighting.network import HashField
from gibench.baselines.neural_free_viewpoint_relighting.training import TrainingPlan, WaveletTransport
from gibench.baselines.neural_precomputed_radiance_transfer.network import TransferNetwork
from gibench.baselines.neural_precomputed_radiance_transfer.training import RadianceTransfer
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.vertex_features.field import VertexField
from gibench.baselines.vertex_features.remeshing import even_mesh
from tests.baselines.neural_free_viewpoint_relighting.made import FACES, Made
from tests.baselines.neural_precomputed_radiance_transfer.test_training import Pictures
from tests.baselines.training.cut_off import repeats_also_where_it_was_cut_off

UNIT = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def wavelets(field, pixels):
    """A learner of a network with features in a field."""
    settings = NFVR.settings({"network": "small", "faces": 16, "batch": pixels, "learned": 16})
    plan = dataclasses.replace(TrainingPlan.of(settings, seed=3), faces=FACES)
    return WaveletTransport(plan.network(field), Made(), Made(2, first=100), plan)


def hash_grid():
    return wavelets(lambda size: HashField(size, 12), 64)


def vertices():
    """A few dozen of them, whose gradients are sums over thousands of corners."""
    corners = [[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]]
    mesh = even_mesh([trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)], UNIT, 0.2)
    assert len(mesh.vertices) < 100
    return wavelets(lambda size: VertexField(mesh, UNIT, size.products), 2048)


def transfer():
    with seeded(3):
        network = TransferNetwork()
    return RadianceTransfer(network, Pictures(), Pictures(2, first=100), 64, 3)


LEARNERS = {"nfvr": hash_grid, "nprt": transfer, "vertex-features": vertices}


@pytest.fixture
def two_threads():
    """Sums of several threads come in any order."""
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("make", LEARNERS.values(), ids=LEARNERS)
def test_it_repeats_to_the_bit_also_where_it_was_cut_off(make, tmp_path, two_threads):
    repeats_also_where_it_was_cut_off(make, lambda learner: learner.batches(), tmp_path)
