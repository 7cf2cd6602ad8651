"""LPIPS: the distance of two images in the features of a trained network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.errors import RangeError
from gibench.metrics.inputs import FloatArray, Mask, MetricValue, check_size, display_pair, each_frame
from gibench.metrics.registry import register

if TYPE_CHECKING:
    from gibench.metrics.lpips_weights import Net

SMALLEST: dict[Net, int] = {"alex": 31, "vgg": 16}
"""Sides below which nothing is left of the image at the last layer of the network."""

_DESCRIPTION: dict[str, Any] = {
    "direction": "lower",
    "range": (0.0, float("inf")),
    "identity": 0.0,
    "units": "1",
    "values": "display",
    "reference": "Zhang et al. 2018, CVPR",
}


@register(name="lpips_vgg", options={"net": "vgg"}, **_DESCRIPTION)
@register(name="lpips_alex", options={"net": "alex"}, **_DESCRIPTION)
def lpips(pred: ArrayLike, ref: ArrayLike, *, net: Net = "alex") -> MetricValue:
    """Learned perceptual image patch similarity, version 0.1, by the authors' own network and weights.

    The first call fetches the weights where they are not cached (see `gibench.metrics.lpips_weights`) and
    builds the network; the process keeps it.

    Args:
        pred: display values in [0, 1], (H, W, 3) or (N, H, W, 3); see `gibench.metrics.tone_map`.
        ref: the reference, of the same shape.
        net: "alex", which the authors recommend for evaluation, or "vgg", which is often a training loss.

    Returns:
        A float, or (N,) for a batch, in [0, ∞).

    Raises:
        DtypeError, ShapeError, NonFiniteError: for inputs that are not such images.
        RangeError: for values outside [0, 1], or another network.
        ImageTooSmallError: for fewer than 31×31 (alex) or 16×16 (vgg) pixels.
        MissingDependencyError, WeightsError: when a package or the weights are missing, with what to do.

    References:
        Zhang, Isola, Efros, Shechtman & Wang 2018, The unreasonable effectiveness of deep features as a
        perceptual metric, CVPR.
    """
    if net not in SMALLEST:
        raise RangeError(f"net must be one of {', '.join(SMALLEST)}, not {net!r}")
    prediction, reference, batched = display_pair(pred, ref)
    check_size(reference, SMALLEST[net], f"LPIPS {net}")

    from gibench.metrics.lpips_network import shared_network

    network = shared_network(net)
    import torch

    def distance(p: FloatArray, r: FloatArray, _: Mask | None) -> float:
        tensors = (
            torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)[None], dtype=np.float32))
            for image in (p, r)
        )
        with torch.inference_mode():
            return float(network(*tensors, normalize=True))

    return each_frame(prediction, reference, None, batched, distance)
