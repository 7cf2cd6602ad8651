"""Formulas at the ends of their ranges: what runs in single precision against float64 NumPy, and what has seams."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench import metrics
from gibench.benchmarks.report.image_files import LARGEST, STEPS_PER_STOP, TOE, decode, encode
from gibench.datasets import exr
from gibench.metrics.errors import EmptyMaskWarning
from gibench.metrics.tone_map import linear_from_srgb, srgb_from_linear
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.denoise import denoise
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from gibench.stress.answers import Float64, not_finite
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import area, coat, diffuse, mesh, rectangle
from gibench.stress.views import SURFACE_SETS

NUMPY = "the same formula in float64 NumPy"

SINGLE = 2.0**-24
"""Relative rounding of float32."""

SEAM = 0.0031308
"""Value at which the curve of sRGB changes from a line to a power."""


def drjit(values: Any) -> Any:
    """A mi.Float of numbers."""
    import mitsuba as mi

    return mi.Float(np.asarray(values, dtype=np.float32).ravel())


def points(values: Any) -> Any:
    """A mi.Point3f of (N, 3) numbers."""
    import mitsuba as mi

    return mi.Point3f(np.ascontiguousarray(np.asarray(values, dtype=np.float32).T))


def numpy(values: Any) -> Float64:
    """An array of Dr.Jit as float64."""
    return np.array(values).astype(np.float64)


def apart(found: Float64, answer: Float64) -> float:
    """Largest difference, infinite where a number is not finite."""
    return float(np.abs(found - answer).max()) if np.isfinite(found).all() else float("inf")


@case("weights of multiple importance sampling", quick=True)
def mis_weights() -> Found:
    """Densities from 1e-30, of the sky from far away, to 1e30, of the middle of a near-mirror's lobe."""
    from gibench.rendering.light_sampling import mis_weight

    grid = np.concatenate([[0.0], 10.0 ** np.arange(-30, 31)]).astype(np.float32)
    first, second = (side.ravel() for side in np.meshgrid(grid, grid))
    a, b = first.astype(np.float64), second.astype(np.float64)
    answer = np.divide(a**2, a**2 + b**2, out=np.zeros_like(a), where=a > 0)
    found = numpy(mis_weight(drjit(first), drjit(second)))
    yield Check("light", "weight (absolute)", apart(found, answer), 8 * SINGLE, NUMPY)
    both = found + numpy(mis_weight(drjit(second), drjit(first)))
    error = float(np.abs(both[(first > 0) & (second > 0)] - 1).max())
    yield Check("light", "sum of both weights, less 1", error, 8 * SINGLE, "a partition of unity")


@case("footprint of a glossy lobe", quick=True)
def lobe_angles() -> Found:
    """From no roughness to 1, from the middle of the lobe to its end."""
    from gibench.baselines.image_space_gathering.gathering import WIDEST, lobe_angle

    roughness = np.array([0, 1e-30, 1e-6, 1e-4, 1e-3, 1e-2, 0.1, 0.5, 1], dtype=np.float32)
    share = np.array([0, 1e-30, 1e-6, 0.1, 0.5, 0.9, 0.999, 1 - 2.0**-16], dtype=np.float32)
    alpha, u = (side.ravel().astype(np.float64) for side in np.meshgrid(roughness, share))
    answer = np.minimum(2 * np.arctan(alpha * np.sqrt(u / (1 - u))), WIDEST)
    found = numpy(lobe_angle(drjit(alpha), drjit(u)))
    # 1 − u is exact in float32 from one half on, so that only a few operations round.
    yield Check("methods", "isg: angle (radians)", apart(found, answer), 16 * SINGLE, NUMPY)
    ends = numpy(lobe_angle(drjit(roughness), drjit(np.ones(len(roughness)))))
    wrong = float((~np.isfinite(ends)).sum() + (ends[roughness > 0.1] != np.float32(WIDEST)).sum() + ends[0])
    yield Check(
        "methods", "isg: ends of lobes that are not the widest", wrong, 0, "a lobe ends at the horizon"
    )


@case("penalty of a probe at extreme places", quick=True)
def probe_penalties() -> Found:
    """The probe at the camera, at the point, behind it, and ten kilometres away."""
    from gibench.baselines.unstructured_lumigraph.blending import (
        LEAST_RESOLUTION,
        RESOLUTION_WEIGHT,
        penalty,
    )

    places = np.array(
        [[0, 0, 0], [0, 0, 1], [0, 1e-6, 1], [1, 0, 0], [0, 0, -1], [1e-7, 0, 0], [1e4, 0, 0], [0, 0, 1e4]],
        float,
    )
    point, probe, camera = (places[index.ravel()] for index in np.meshgrid(*[np.arange(len(places))] * 3))
    keep = (point != camera).any(axis=1) & (point != probe).any(axis=1)
    point, probe, camera = point[keep], probe[keep], camera[keep]
    to_probe, to_camera = probe - point, camera - point
    near, far = np.linalg.norm(to_probe, axis=1), np.linalg.norm(to_camera, axis=1)
    angle = np.arctan2(
        np.linalg.norm(np.cross(to_probe, to_camera), axis=1), (to_probe * to_camera).sum(axis=1)
    )
    keep = near > 1e-5  # nearer, the distance is held there
    answer = angle + RESOLUTION_WEIGHT * np.maximum((near - far) / near, LEAST_RESOLUTION)
    found = numpy(penalty(points(point), points(probe), points(camera)))
    yield Check(
        "methods",
        "ulr: penalties that are not finite or not > 0",
        float((~(found > 0)).sum()),
        0,
        "its range",
    )
    error = apart(found[keep], answer[keep])
    yield Check("methods", "ulr: penalty (radians)", error, 16 * SINGLE * float(answer[keep].max()), NUMPY)
    same = penalty(points(places), points(places), points(places))
    lost = float((~np.isfinite(numpy(same))).sum())
    yield Check("methods", "ulr: not finite where all are one point", lost, 0, "its range")


@case("weights of probes at extreme penalties", quick=True)
def probe_weights() -> Found:
    """A softmax's hard cases: all equal, one far better, none that sees the point, a penalty of nearly nothing."""
    from gibench.baselines.unstructured_lumigraph.blending import HIDDEN, weights

    rows = np.array(
        [
            [1e-5, 1e-5, 1e-5, 1e-5, 1e-5],
            [1e-5, 1, 1, 1, 1],
            [1e-5, 1e-5, 1, 1, HIDDEN + 1],
            [HIDDEN + 0.1, HIDDEN + 0.2, HIDDEN + 0.3, HIDDEN + 0.4, HIDDEN + 0.5],
            [HIDDEN + 1, HIDDEN + 1, HIDDEN + 1, HIDDEN + 1, HIDDEN + 1],
            [0.1, HIDDEN + 0.2, HIDDEN + 0.3, 2 * HIDDEN, 2 * HIDDEN],
            [3.1, 3.2, 3.3, 3.4, 2 * HIDDEN],
            [1e-30, 1e-30, 0.5, 1, 2],
        ],
        dtype=np.float32,
    )
    found = np.stack([numpy(weight) for weight in weights([drjit(column) for column in rows.T])], axis=1)
    error = float(np.abs(found.sum(axis=1) - 1).max()) if np.isfinite(found).all() else np.inf
    yield Check("methods", "ulr: sum of weights, less 1", error, 8 * SINGLE, "a partition of unity")
    p = rows.astype(np.float64)
    p = np.where(p[:, :1] >= HIDDEN, p - HIDDEN, p)
    shares = np.where(p[:, :4] < HIDDEN, np.maximum(1 - p[:, :4] / p[:, 4:], 1e-6) / p[:, :4], 0)
    answer = shares / shares.sum(axis=1, keepdims=True)
    yield Check("methods", "ulr: weights (absolute)", apart(found, answer), 16 * SINGLE, NUMPY)


@case("directions on probe maps", quick=True)
def probe_directions() -> Found:
    """Poles, seams, lengths from 1e-30 to 1e30, and no direction at all."""
    from gibench.baselines.probes.mappings import LatLong, Octahedral

    rng = np.random.default_rng(0)
    axes = np.array(
        [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float
    )
    spread = np.concatenate([axes, rng.normal(size=(1000, 3))])
    lengths = np.concatenate([spread * length for length in (1e-30, 1e-10, 1.0, 1e10, 1e30)])
    for mapping in (LatLong(256, 128), Octahedral(256, 256)):
        at = np.array(mapping.coordinates(points(lengths)))
        back = numpy(mapping.direction(type(mapping.coordinates(points(lengths)))(at))).T
        unit = lengths / np.linalg.norm(lengths, axis=1, keepdims=True)
        error = apart(back, unit)
        # A texel of 256 around is held to 2⁻¹⁶ of it, which is this angle.
        bound = 2 * np.pi * 256 * SINGLE
        yield Check(
            "probes", f"{mapping.name}: there and back (radians)", error, bound, "float32 of 256 texels"
        )
        nowhere = np.array(mapping.coordinates(points(np.zeros((1, 3)))))
        lost = float((~np.isfinite(nowhere)).sum())
        yield Check("probes", f"{mapping.name}: no direction", lost, 0, "a texel")


@case("tone mapping at 0, at its seam, and at 1e6", quick=True)
def tone_curve() -> Found:
    """Single precision against double, and the curve's own promises."""
    beside = np.float32(SEAM) + np.arange(-64, 65) * np.spacing(np.float32(SEAM))
    values = np.concatenate([[0, 1e-45, 1e-38, 1e-20, 1e-6], beside, np.linspace(0, 1, 1001)]).astype(
        np.float32
    )
    exact = np.where(
        values <= SEAM, 12.92 * values.astype(float), 1.055 * values.astype(float) ** (1 / 2.4) - 0.055
    )
    shown = srgb_from_linear(values)
    yield Check("metrics", "sRGB (absolute)", apart(shown.astype(float), exact), 4 * SINGLE, NUMPY)
    # Both pieces of the standard's curve meet to 7 digits, and no better.
    fall = float(
        np.maximum(-np.diff(np.sort(values) * 0 + srgb_from_linear(np.sort(values)).astype(float)), 0).max()
    )
    yield Check(
        "metrics", "largest fall of the curve (absolute)", fall, 5e-8 + 2 * SINGLE, "IEC 61966-2-1's own step"
    )
    grid = np.concatenate([np.linspace(0, 1, 100001), SEAM + np.linspace(-1e-8, 1e-8, 2001)])
    error = float(np.abs(linear_from_srgb(np.asarray(srgb_from_linear(grid), dtype=np.float64)) - grid).max())
    yield Check("metrics", "there and back (absolute)", error, 1e-8, "the standard's rounded thresholds")
    image = np.array([0, 1e-30, 1e-6, 1, 6.5e4, 1e6, 1e30, 3e38], dtype=np.float32)
    image = np.broadcast_to(image[:, None, None], (8, 2, 3))
    for exposure in (1e-30, 1.0, 1e30):
        mapped = metrics.tone_map(image, exposure)
        wrong = float((~((mapped >= 0) & (mapped <= 1))).sum())
        yield Check("metrics", f"outside [0, 1], exposure {exposure:g}", wrong, 0, "its range")


@case("log codes at 0, at their ends, and at 1e6", quick=True)
def log_codes() -> Found:
    """Ten bits of the report's images: there and back is half a step of 2^(1/40)."""
    exposed = np.concatenate([[0.0], np.geomspace(1e-12, 1e6, 20001)])
    codes = encode(exposed)
    wrong = float(((codes < 0) | (codes > LARGEST)).sum() + (np.diff(codes) < 0).sum() + abs(int(codes[0])))
    yield Check("files", "codes out of range or order", wrong, 0, "0 to 1023, rising")
    largest = TOE * (2 ** (LARGEST / STEPS_PER_STOP) - 1)
    inside = exposed <= largest
    error = np.abs(decode(codes[inside]) - exposed[inside]) / (exposed[inside] + TOE)
    half = 2 ** (0.5 / STEPS_PER_STOP) - 1
    yield Check("files", "there and back, of x + 2⁻¹⁰", float(error.max()), half * (1 + 1e-9), "half a step")


def images() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A reference with values from 0 to 6e4 and a prediction of it."""
    rng = np.random.default_rng(0)
    reference = np.exp(rng.normal(0, 2, (32, 40, 3))).astype(np.float32)
    reference[:4], reference[4, :4] = 0, 6e4
    prediction = reference * rng.uniform(0.8, 1.25, reference.shape).astype(np.float32)
    return np.minimum(prediction, 6.5e4), reference


def errors_of(prediction: Any, reference: Any, **given: Any) -> dict[str, float]:
    """Every metric of single images that needs no download."""
    names = [name for name, one in metrics.METRICS.items() if one.inputs == "image" and "lpips" not in name]
    exposure = metrics.reference_exposure(reference)
    shown = metrics.tone_map(prediction, exposure), metrics.tone_map(reference, exposure)
    found = {}
    for name in names:
        one = metrics.METRICS[name]
        pair = (prediction, reference) if one.values == "linear" else shown
        found[name] = float(one(*pair, **{key: value for key, value in given.items() if one.accepts(key)}))
    return found


@case("metrics of half floats and of single ones", quick=True)
def half_and_single() -> Found:
    """The same numbers in float16, float32 and float64 are the same image."""
    prediction, reference = (image.astype(np.float16) for image in images())
    half, single, double = (
        errors_of(prediction.astype(kind), reference.astype(kind))
        for kind in (np.float16, np.float32, np.float64)
    )
    error = max(abs(half[name] / single[name] - 1) for name in single)
    yield Check("metrics", "float16 against float32", error, 0, "float16 is computed as float32")
    exposure = metrics.reference_exposure(reference)
    shown = [metrics.tone_map(image, exposure).astype(float) for image in (prediction, reference)]
    error = max(abs(double[name] / single[name] - 1) for name in single)
    # Display values that are rounded differ by this share of what is measured.
    bound = 16 * SINGLE / float(np.abs(shown[0] - shown[1]).mean())
    yield Check("metrics", "float64 against float32", error, bound, "16 roundings, over the mean error")


@case("metrics of black, equal, huge and tiny images", quick=True)
def degenerate_images() -> Found:
    """Finite, within their range, and what they are for equal images."""
    _, reference = images()
    black = np.zeros_like(reference)
    given: dict[str, Callable[[], tuple[Any, Any]]] = {
        "black": lambda: (black, black),
        "equal": lambda: (reference, reference),
        "black against lit": lambda: (black, reference),
        "lit against black": lambda: (reference, black),
        "1e30": lambda: (reference * 1e25, reference * 1.1e25),
        "1e-30": lambda: (reference * 1e-33, reference * 1.1e-33),
    }
    for name, pair in given.items():
        found = errors_of(*pair())
        wrong = [key for key, value in found.items() if not within(value, *metrics.METRICS[key].range)]
        yield Check(
            "metrics", f"out of range, {name}: {', '.join(wrong) or 'none'}", len(wrong), 0, "docs/metrics.md"
        )
    for name in ("black", "equal"):
        found = errors_of(*given[name]())
        wrong = [key for key, value in found.items() if metrics.METRICS[key].identity not in (None, value)]
        yield Check(
            "metrics", f"not its identity, {name}: {', '.join(wrong) or 'none'}", len(wrong), 0, "an identity"
        )


def within(value: float, low: float, high: float) -> bool:
    """Whether a number lies in a closed interval; NaN does not."""
    return bool(low <= value <= high)


@case("empty masks", quick=True)
def empty_masks() -> Found:
    """NaN and a warning: an error of 0 over nothing would be a lie."""
    prediction, reference = images()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = errors_of(prediction, reference, mask=np.zeros(reference.shape[:2], dtype=bool))
    takes = [name for name in found if metrics.METRICS[name].accepts("mask")]
    wrong = sum(not np.isnan(found[name]) for name in takes)
    yield Check("metrics", f"metrics of {len(takes)} that are not NaN", wrong, 0, "docs/metrics.md")
    warned = sum(issubclass(one.category, EmptyMaskWarning) for one in told)
    yield Check(
        "metrics", "metrics that do not warn", float(max(len(takes) - warned, 0)), 0, "docs/metrics.md"
    )


@case("training inputs from half floats", quick=True)
def training_inputs() -> Found:
    """Inputs of a network from a file against the rendered values."""
    from gibench.datasets.torch_frames import TorchFrames

    lamp = rectangle([0, 0, 1], [0, 0, -1], (0.3, 0.3), bsdf=diffuse(0.0), emitter=area(9e4))
    floor = rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=coat(0.05, 0.4, 0.2, 1e-3))
    scene = load_dict({"type": "scene", "lamp": lamp, "floor": floor})
    camera = PinholeCamera((0.0, -2.0, 0.9), (0.0, 0.0, 0.3), 1.0)
    channels = ["radiance", "surface", "reflection"]
    arrays = render_frame(scene, camera, resolution=(32, 24), channels=channels, spp=16).arrays
    with TemporaryDirectory() as folder:
        file = Path(folder) / "0000.exr"
        file.write_bytes(exr.encode(arrays))
        tensors = TorchFrames(Path(folder), [file.name], list(arrays))[0]
    lost = float(sum((~tensor.isfinite()).sum().item() for tensor in tensors.values()))
    yield Check("files", "values that are not finite", lost, 0, "the contract")
    dark = exr.dark_radiance(arrays)
    worst = 0.0
    for name, rendered in arrays.items():
        given = np.moveaxis(tensors[name].numpy(), 0, -1).astype(np.float64)
        least = dark if exr.is_radiance(exr.CHANNELS[name]) else exr.DARK
        error = np.abs(given - rendered) / np.maximum(np.abs(rendered.astype(np.float64)), max(least, 1e-30))
        worst = max(worst, float(error.max()))
    # Color is the sum of what is stored, so the rounding of five parts may meet in it.
    yield Check(
        "files", "tensors against what was rendered", worst, 5 * exr.HALF_TOLERANCE, "the file's promise"
    )


@case("singular curvature", quick=True)
def singular_curvature() -> Found:
    """The pole of a sphere, where u and v are no coordinates; a mesh whose texture has no area; a flat floor."""
    import mitsuba as mi

    camera = PinholeCamera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 0.2)
    ball = load_dict({"type": "scene", "ball": {"type": "sphere", "radius": 0.5, "bsdf": diffuse(0.5)}})
    frame = render_frame(
        ball, camera, resolution=(33, 33), channels=SURFACE_SETS, previous_camera=camera
    ).arrays
    yield Check("surface", "values that are not finite, pole", not_finite(frame), 0, "the contract")
    off_pole = frame["curvature"].astype(np.float64).reshape(-1, 2)
    error = float(np.abs(np.delete(off_pole, len(off_pole) // 2, axis=0) / -2 - 1).max())
    yield Check(
        "surface", "curvature beside the pole", error, 1e-3, "1 / radius; float32 of 1 − cos θ at 0.2°"
    )

    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    shape = mi.Mesh("floor", 4, 2, has_vertex_normals=True, has_vertex_texcoords=True)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = corners.ravel()
    parameters["faces"] = [0, 1, 2, 0, 2, 3]
    parameters["vertex_normals"] = np.tile([0, 0, 1], 4).astype(np.float32)
    parameters["vertex_texcoords"] = np.zeros(8)
    parameters.update()
    for what, flat in (
        ("texture without area", shape),
        ("no texture", mesh(corners, [[0, 1, 2], [0, 2, 3]])),
    ):
        scene = load_dict({"type": "scene", "floor": flat})
        frame = render_frame(scene, camera, resolution=(16, 16), channels=SURFACE_SETS).arrays
        yield Check("surface", f"values that are not finite, {what}", not_finite(frame), 0, "the contract")
        bent = float(np.abs(frame["curvature"]).max())
        yield Check("surface", f"curvature of a floor, {what}", bent, 0, "a floor is flat")


EVEN = "OIDN's network is not exact: it changes an image that is even by up to 6 % at its corners"


@case("denoising of extreme images", quick=True)
def extreme_images() -> Found:
    """The same picture at all magnitudes, one colour everywhere, black, and one lit pixel."""
    noisy = np.random.default_rng(0).gamma(2.0, 0.5, (48, 64, 3)).astype(np.float32)
    usual = denoise(noisy).astype(np.float64)
    for scale in (1e-30, 1e-6, 1e6, 1e30):
        found = denoise((noisy * np.float32(scale)).astype(np.float32)).astype(np.float64) / float(
            np.float32(scale)
        )
        error = apart(found / usual, np.ones_like(usual))
        yield Check(
            "denoiser", f"the same image times {scale:g}", error, 2.0**-10, "half floats inside of OIDN"
        )
    even = denoise(np.ones((48, 64, 3), dtype=np.float32)).astype(np.float64)
    yield Check(
        "denoiser", "an even image", apart(even, np.ones_like(even)), 2.0**-10, "nothing to remove", EVEN
    )
    black = denoise(np.zeros((32, 32, 3), dtype=np.float32))
    yield Check("denoiser", "a black image (absolute)", float(black.max()), 0, "exactly 0")
    firefly = np.zeros((32, 32, 3), dtype=np.float32)
    firefly[16, 16] = 1e30
    yield Check(
        "denoiser", "not finite, one pixel of 1e30", not_finite({"x": denoise(firefly)}), 0, "the contract"
    )
