"""A made-up report on disk, and a real browser to open it with."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from gibench.benchmarks.report.image_files import write_images
from gibench.benchmarks.report.page import write_page
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.synthetic import Setting, SyntheticRun


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    return SyntheticRun(tmp_path_factory.mktemp("results"), frames=3, failed=("ulr",))


@pytest.fixture(scope="session")
def summary(run):
    return summarise(run, against="rtrt")


@pytest.fixture(scope="session")
def crowded(tmp_path_factory):
    """Thirty settings of twenty methods with long names, many of them at nearly one place."""
    rng = np.random.default_rng(2)
    chosen = [
        Setting(
            f"a-method-with-a-name-{number:02d}",
            kind=("probes", "network", "lightmap", "path-traced")[number % 4],
            blur=float(2 + rng.normal(0, 0.02 if number < 10 else 1.0) ** 2),
            ms=float(20 * (1 + 0.02 * number) if number < 10 else 20 * 1.2**number),
        )
        for number in range(20)
    ]
    chosen += [
        Setting(
            "path-traced",
            {"spp": 2**power},
            f"spp={2**power}",
            "path-traced",
            noise=2.0 ** (-power / 2),
            ms=30 * 2**power,
        )
        for power in range(10)
    ]
    run = SyntheticRun(tmp_path_factory.mktemp("crowded"), chosen=chosen, scenes=2, frames=5, measured=False)
    return run, summarise(run)


@pytest.fixture(scope="session")
def page_file(run, summary, tmp_path_factory):
    out = tmp_path_factory.mktemp("page")
    write_images(run, summary.results[summary.results["status"] == "ok"], out)
    return write_page(run, summary, out)


@pytest.fixture(scope="session")
def browser():
    """Headless Chromium as Debian packages it, driven by Playwright."""
    playwright = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        pytest.skip("no Chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        # Chromium's own sandbox does not start for root or in most containers; the page is ours.
        chromium = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield chromium
        chromium.close()
