"""What of a training its seconds are of."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gibench.baselines.neural_free_viewpoint_relighting import METHOD as NFVR
from gibench.baselines.neural_precomputed_radiance_transfer import METHOD as NPRT
from gibench.baselines.relighting import implementation as module
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.training.errors import TrainingError
from tests.baselines.neural_free_viewpoint_relighting.made import Made


class Counted(Made):
    """Made-up frames that count how often all of them were read."""

    reads = 0

    def __init__(self, *_):
        super().__init__(2, pixels=20)

    def read(self):
        type(self).reads += 1


@pytest.mark.parametrize(
    ("card", "settings"),
    [
        (NFVR, {"network": "small", "faces": 16, "table": 12}),
        (NFVR, {"network": "small", "faces": 16, "table": 12, "pixels": "uniform"}),
        (NPRT, {}),
    ],
    ids=["nfvr", "nfvr:uniform-pixels", "nprt"],
)
def test_frames_are_read_before_the_clock_of_any_method(card, settings, monkeypatch, tmp_path):
    monkeypatch.setattr(Counted, "reads", 0)
    monkeypatch.setattr(module, "held_out", lambda *_: ([0, 1], [2]))
    monkeypatch.setattr(module, "box_of", lambda *_: Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))
    monkeypatch.setattr(module, "Examples", Counted)
    method = card.load()(card.settings(settings))
    monkeypatch.setattr(type(method), "learner", lambda *_: SimpleNamespace(batches=lambda: None))
    clock = []

    def train(*_, **__):
        clock.append(Counted.reads)
        raise TrainingError("enough")

    monkeypatch.setattr(module, "train", train)
    training = SimpleNamespace(
        views=SimpleNamespace(sha256="0" * 64),
        seconds=1.0,
        seed=0,
        folder=tmp_path,
        checkpoint=tmp_path / "c",
    )
    with pytest.raises(TrainingError, match="enough"):
        method.train(training)
    assert clock == [1]
