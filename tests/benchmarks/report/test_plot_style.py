import math

import pytest

from gibench.benchmarks.report.plot_style import COLOURS, LINES, MARKERS, log_ticks, look, tick_text


def test_methods_differ_in_grey_and_in_colour():
    looks = {(look(n)["color"], look(n)["marker"], str(look(n)["linestyle"])) for n in range(280)}
    assert len(looks) == len(COLOURS) * len(MARKERS) * len(LINES) == 280
    # The eight neighbours of a small plot differ by marker alone, without any colour.
    assert len({look(n)["marker"] for n in range(8)}) == 8


@pytest.mark.parametrize("low", [1e-6, 0.013, 0.9, 37.0, 2e4])
@pytest.mark.parametrize("ratio", [1.3, 2.0, 4.0, 30.0, 1e4, 1e12])
def test_logarithmic_ticks_are_round_inside_and_neither_few_nor_many(low, ratio):
    ticks = log_ticks(low, low * ratio)
    assert 2 <= len(ticks) <= 9
    assert all(low <= tick <= low * ratio for tick in ticks)
    assert all(math.isclose(float(tick_text(tick).replace("−", "-")), tick) for tick in ticks)
