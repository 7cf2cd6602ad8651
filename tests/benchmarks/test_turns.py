"""On a machine that several workers share, nobody works beside a measurement."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from gibench.benchmarks import turns, worker


def test_renderer_and_scene_are_loaded_while_nobody_measures(tmp_path, monkeypatch):
    held = []

    @contextmanager
    def beside(file):
        held.append(file)
        yield
        held.pop()

    class Loading(Exception):
        pass

    def load(*arguments, **more):
        assert held == ["turn"]
        raise Loading

    monkeypatch.setattr(turns, "beside", beside)
    for name in ("gibench.rendering.backend.select_variant", "gibench.rendering.scene.load_scene"):
        monkeypatch.setattr(name, load)
    task = SimpleNamespace(threads=1, turn="turn", variant="", scene=None, site=tmp_path)
    with pytest.raises(Loading):
        worker._Session(None, task).run()
    held.clear()
    monkeypatch.setattr(worker, "lay_out", lambda files, site: site)
    with pytest.raises(Loading):
        worker._SceneSession(None, task, None).run(0.0)
