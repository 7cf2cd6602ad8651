"""The metrics once more, written as plainly as their definitions, to test the fast ones against."""

import math

import numpy as np

from gibench.metrics.flip import OPPONENT_FROM_RGB, PIXELS_PER_DEGREE, XYZ_FROM_RGB


def loop_mean(pred, ref, error):
    """Average an error over all values, one Python float at a time."""
    values = [error(float(p), float(r)) for p, r in zip(pred.ravel(), ref.ravel(), strict=True)]
    return math.fsum(values) / len(values)


LINEAR = {
    "mse": lambda p, r: loop_mean(p, r, lambda a, b: (a - b) ** 2),
    "rmse": lambda p, r: math.sqrt(loop_mean(p, r, lambda a, b: (a - b) ** 2)),
    "mae": lambda p, r: loop_mean(p, r, lambda a, b: abs(a - b)),
    "relmse": lambda p, r: loop_mean(p, r, lambda a, b: (a - b) ** 2 / (b**2 + 0.01)),
    "smape": lambda p, r: loop_mean(p, r, lambda a, b: abs(a - b) / (abs(a) + abs(b) + 0.01)),
}


def ssim(pred, ref):
    """SSIM window by window: weighted means and central moments of 11×11 pixels."""
    offsets = np.arange(-5, 6)
    weights = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    weights /= weights.sum()
    values = []
    for y in range(5, ref.shape[0] - 5):
        for x in range(5, ref.shape[1] - 5):
            for channel in range(3):
                window = np.s_[y - 5 : y + 6, x - 5 : x + 6, channel]
                p, r = pred[window], ref[window]
                mp, mr = (weights * p).sum(), (weights * r).sum()
                vp, vr = (weights * (p - mp) ** 2).sum(), (weights * (r - mr) ** 2).sum()
                cov = (weights * (p - mp) * (r - mr)).sum()
                luminance = (2 * mp * mr + 0.01**2) / (mp**2 + mr**2 + 0.01**2)
                values.append(luminance * (2 * cov + 0.03**2) / (vp + vr + 0.03**2))
    return np.mean(values)


def flip_map(pred, ref):
    """FLIP with whole two-dimensional kernels, from linear RGB; the paper's sections 4.1 to 4.3 in their order."""
    ppd = PIXELS_PER_DEGREE
    opponent = [np.einsum("ij,yxj->yxi", OPPONENT_FROM_RGB, image) - [16, 0, 0] for image in (pred, ref)]

    radius = math.ceil(3 * math.sqrt(0.04 / (2 * math.pi**2)) * ppd)
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1] / ppd
    kernels = []
    for terms in ([(1, 0.0047)], [(1, 0.0053)], [(34.1, 0.04), (13.5, 0.025)]):
        g = sum(a * math.sqrt(math.pi / b) * np.exp(-(math.pi**2) * (x**2 + y**2) / b) for a, b in terms)
        kernels.append(g / g.sum())
    labs = []
    for image in opponent:
        seen = np.stack([_correlate(image[..., c], kernels[c]) for c in range(3)], axis=-1)
        rgb = np.clip((seen + np.array([16, 0, 0])) @ np.linalg.inv(OPPONENT_FROM_RGB).T, 0, 1)
        labs.append(_hunt_lab(rgb))
    largest = _hyab(*(_hunt_lab(np.eye(3)[c]) for c in (1, 2))) ** 0.7
    error = _hyab(*labs) ** 0.7
    colour = np.where(
        error < 0.4 * largest,
        0.95 / (0.4 * largest) * error,
        0.95 + (error - 0.4 * largest) / (0.6 * largest) * 0.05,
    )

    sigma = 0.5 * 0.082 * ppd
    radius = math.ceil(3 * sigma)
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    g = np.exp(-(x**2 + y**2) / (2 * sigma**2))
    strengths = []
    for image in opponent:
        grey = (image[..., 0] + 16) / 116
        for kernel in (-x * g, (x**2 / sigma**2 - 1) * g):
            balanced = np.where(
                kernel > 0, kernel / kernel[kernel > 0].sum(), -kernel / kernel[kernel < 0].sum()
            )
            strengths.append(np.hypot(_correlate(grey, balanced), _correlate(grey, balanced.T)))
    edges, points = np.abs(strengths[0] - strengths[2]), np.abs(strengths[1] - strengths[3])
    feature = (np.maximum(edges, points) / math.sqrt(2)) ** 0.5
    return colour ** (1 - feature)


def _correlate(plane, kernel):
    radius = len(kernel) // 2
    padded = np.pad(plane, radius, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape)
    return np.einsum("yxij,ij->yx", windows, kernel)


def _hunt_lab(rgb):
    relative = rgb @ XYZ_FROM_RGB.T / XYZ_FROM_RGB.sum(axis=1)
    f = np.where(relative > (6 / 29) ** 3, np.cbrt(relative), relative / (3 * (6 / 29) ** 2) + 4 / 29)
    lightness = 116 * f[..., 1] - 16
    a, b = 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])
    return lightness, 0.01 * lightness * a, 0.01 * lightness * b


def _hyab(first, second):
    return np.abs(first[0] - second[0]) + np.hypot(first[1] - second[1], first[2] - second[2])
