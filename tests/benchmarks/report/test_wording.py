import math

import pytest

from gibench.benchmarks.report.wording import against, metric_title, number, seconds, size
from gibench.metrics import METRICS


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (0.0123456, "0.0123"),
        (0.09996, "0.100"),
        (9.996, "10.0"),
        (123.4, "123"),
        (12345.6, "12346"),
        (1.5e6, "1.50e+06"),
        (1.23e-5, "1.23e−05"),
        (-0.5, "−0.500"),
        (math.nan, "–"),
        (math.inf, "∞"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


def test_durations_and_sizes_take_the_unit_that_suits_them():
    assert [seconds(value) for value in (0.5, 90, 7200, math.nan)] == ["0.500 s", "1.50 min", "2.00 h", "–"]
    assert [size(value) for value in (12, 1500, 2.5e6, 3e9)] == ["12 B", "1.50 kB", "2.50 MB", "3.00 GB"]


def test_every_metric_has_a_title():
    assert all(metric_title(name) != name for name in METRICS)


def test_what_metrics_are_against():
    names = ["rmse", "dssim", "relmse"]
    assert against(names, ()) == "All metrics are against the reference."
    some = against(names, {"rmse", "relmse"})
    assert some == (
        "Without bias against the truth, by samples that are not denoised: RMSE, relMSE. "
        "Against the reference: DSSIM."
    )
    assert against(["rmse"], {"rmse", "mse"}).endswith("not denoised: RMSE.")
