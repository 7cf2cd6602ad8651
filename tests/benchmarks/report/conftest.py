"""A made-up report on disk, and a real browser to open it with."""

from __future__ import annotations

import shutil

import pytest

from gibench.benchmarks.report.image_files import write_images
from gibench.benchmarks.report.page import write_page
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.synthetic import SyntheticRun


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    return SyntheticRun(tmp_path_factory.mktemp("results"), frames=3, failed=("ulr",))


@pytest.fixture(scope="session")
def summary(run):
    return summarise(run, against="rtrt")


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
