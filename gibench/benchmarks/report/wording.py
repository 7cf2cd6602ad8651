"""Wording of numbers and metrics for people: the same in tables, plots and on the page."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

_TITLES = {
    "rmse": "RMSE",
    "rmse_display": "RMSE (display)",
    "relmse": "relMSE",
    "mse": "MSE",
    "mae": "MAE",
    "smape": "SMAPE",
    "psnr": "PSNR (dB)",
    "ssim": "SSIM",
    "dssim": "DSSIM",
    "lpips_alex": "LPIPS (AlexNet)",
    "lpips_vgg": "LPIPS (VGG)",
    "flip": "FLIP",
    "hdrflip": "HDR-FLIP",
    "warping_error": "Warping error",
    "mabd": "MABD error",
    "temporal_difference": "Temporal difference",
}

MISSING = "–"


def printable(text: str) -> str:
    """Text of a file without what steers a terminal or turns the direction of reading; line breaks stay."""
    return "".join(
        sign if sign.isprintable() or sign == "\n" else "\N{REPLACEMENT CHARACTER}" for sign in text
    )


def metric_title(name: str) -> str:
    """Name a metric as its papers do."""
    return _TITLES.get(name, name)


def against(metrics: Iterable[str], unbiased: Collection[str]) -> str:
    """Say which of some metrics are against the truth, and which against the reference."""
    chosen = list(metrics)
    truly = [metric_title(name) for name in chosen if name in unbiased]
    others = [metric_title(name) for name in chosen if name not in unbiased]
    if not truly:
        return "All metrics are against the reference."
    told = f"Without bias against the truth, by samples that are not denoised: {', '.join(truly)}."
    return told + (f" Against the reference: {', '.join(others)}." if others else "")


def number(value: float, digits: int = 3) -> str:
    """Write a number with so many significant digits, without an exponent between 1e-4 and 1e6."""
    if not math.isfinite(value):
        return MISSING if math.isnan(value) else ("∞" if value > 0 else "−∞")
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if not -5 < magnitude < 6:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    return f"{value:.{max(0, digits - 1 - magnitude)}f}".replace("-", "−")


def seconds(value: float) -> str:
    """Write a duration in the unit that suits it."""
    if not math.isfinite(value):
        return MISSING
    for size, unit in ((3600.0, "h"), (60.0, "min")):
        if value >= size:
            return f"{number(value / size)} {unit}"
    return f"{number(value)} s"


def size(value: float) -> str:
    """Write a number of bytes in the unit that suits it (1 kB = 1000 B)."""
    if not math.isfinite(value):
        return MISSING
    for factor, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if value >= factor:
            return f"{number(value / factor)} {unit}"
    return f"{value:.0f} B"
