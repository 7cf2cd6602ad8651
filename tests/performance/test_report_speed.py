"""How soon the page of a full run opens, and what it weighs: 20 methods × 6 scenes × 60 frames.

Run on demand: pytest -m performance -s tests/performance/test_report_speed.py
"""

import time

import pytest

from gibench.benchmarks.report.page import write_page
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.conftest import browser  # noqa: F401
from tests.benchmarks.report.synthetic import Setting, SyntheticRun

pytestmark = pytest.mark.performance

METRICS = ("rmse", "rmse_display", "relmse", "dssim", "lpips_alex", "flip")
MOST_BYTES, MOST_SECONDS = 5e6, 2.0


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    chosen = [
        Setting(f"method-{number:02d}", {"spp": 4}, "spp=4", blur=0.5 + number / 5, ms=5 * 1.3**number)
        for number in range(20)
    ]
    out = tmp_path_factory.mktemp("full")
    run = SyntheticRun(
        out, chosen=chosen, scenes=6, frames=60, metrics=METRICS, measured=False, size=(320, 180)
    )
    start = time.perf_counter()
    summary = summarise(run, against="method-10")
    middle = time.perf_counter()
    path = write_page(run, summary, out)
    print(f"\nstatistics {middle - start:.1f} s, page {time.perf_counter() - middle:.1f} s")
    return path


def test_the_page_of_a_full_run_is_light_and_opens_at_once(full, browser):  # noqa: F811
    size = full.stat().st_size
    seconds = []
    for _ in range(5):
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        start = time.perf_counter()
        page.goto(full.as_uri())
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        seconds.append(time.perf_counter() - start)
        assert page.locator("#board tbody tr").count() == 20
        sorting = page.evaluate(
            "(() => { const start = performance.now(); document.querySelector('[data-key=ms]').click();"
            " return performance.now() - start; })()"
        )
        filtering = page.evaluate(
            "(() => { const start = performance.now(); const select = document.getElementById('metric');"
            " select.value = 'flip'; select.dispatchEvent(new Event('change')); return performance.now() - start; })()"
        )
        page.close()
    print(f"index.html {size / 1e6:.2f} MB; drawn after {', '.join(f'{s:.2f}' for s in seconds)} s; ")
    print(f"sorting {sorting:.0f} ms, another metric {filtering:.0f} ms")
    assert size <= MOST_BYTES
    assert sorted(seconds)[2] <= MOST_SECONDS
