"""For all tests."""

from __future__ import annotations

import os
import signal

import pytest

from tests import blas

# Read when torch is loaded: threads that wait asleep, since those that spin starve whatever else runs.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

# A shell that runs the tests in the background has Ctrl-C ignored, by them and by all that they start, and nohup has
# the end of a terminal ignored.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        elsewhere = any(item.get_closest_marker(name) for name in ("performance", "stress"))
        if not elsewhere and blas.is_numerical(item.path):
            item.add_marker("blas")


@pytest.fixture(scope="session")
def workplace(tmp_path_factory):
    """A scheduler's file, and two workers with all threads of the machine that were started by hand."""
    from tests.clusters import two_workers

    with two_workers(tmp_path_factory.mktemp("dask")) as file:
        yield file


@pytest.fixture
def no_patience(monkeypatch):
    """Clusters of this machine whose workers count as silent for too long as soon as they are stopped."""
    from contextlib import contextmanager

    from gibench.datasets import cluster_opening
    from tests.clusters import no_patience_with_stopped_workers

    real = cluster_opening.opened

    @contextmanager
    def opened(cluster, *tasks):
        with real(cluster, *tasks) as address:
            if not cluster.startswith("local:"):
                yield address
                return
            with no_patience_with_stopped_workers(address):
                yield address

    monkeypatch.setattr(cluster_opening, "opened", opened)
