"""How long the smoke preset of a track takes with every method, from nothing to its scores: what CI runs.

Run on demand, with nothing else running: pytest -m performance -s tests/performance/test_smoke_boards.py
"""

import subprocess
import sys
import time

import pytest

from gibench.benchmarks.results import load

pytestmark = pytest.mark.performance

MOST_SECONDS = 90


@pytest.mark.parametrize("track", ["moving-light", "relight", "unseen-rooms"])
def test_a_smoke_board_of_every_method(track, tmp_path):
    words = ["bench", "run", "--track", track, "--preset", "smoke", "--out", str(tmp_path / "run")]
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "gibench", *words], check=True, capture_output=True)
    seconds = time.perf_counter() - start
    results = load(tmp_path / "run").results
    print(f"\n{track}: {len(results)} results of {results['method'].nunique()} methods in {seconds:.0f} s")
    assert (results["status"] == "ok").all()
    assert seconds < MOST_SECONDS
