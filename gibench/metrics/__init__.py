"""Error measures for rendered images and sequences: arrays in, numbers or maps out.

Every image metric is called as `metric(pred, ref, …)` on float arrays (H, W, 3) or (N, H, W, 3). A metric is
one file (errors that each value has by itself share `linear`) and one line of the list below, which is also the order
of the registry `METRICS`.
"""

from typing import Any

# The order is that of the registry.
# isort: off
from gibench.metrics.linear import (
    mse as mse,
    rmse as rmse,
    mae as mae,
    relmse as relmse,
    smape as smape,
)
from gibench.metrics.psnr import psnr as psnr
from gibench.metrics.rmse_display import rmse_display as rmse_display
from gibench.metrics.ssim import ssim as ssim
from gibench.metrics.dssim import dssim as dssim
from gibench.metrics.lpips import lpips as lpips
from gibench.metrics.flip import flip as flip
from gibench.metrics.hdrflip import hdrflip as hdrflip
from gibench.metrics.warping_error import warping_error as warping_error
from gibench.metrics.mabd import mabd as mabd
from gibench.metrics.temporal_difference import temporal_difference as temporal_difference
from gibench.metrics.errors import (
    DtypeError as DtypeError,
    EmptyMaskWarning as EmptyMaskWarning,
    ImageTooSmallError as ImageTooSmallError,
    MetricInputError as MetricInputError,
    MissingDependencyError as MissingDependencyError,
    NonFiniteError as NonFiniteError,
    RangeError as RangeError,
    ShapeError as ShapeError,
    UnknownMetricError as UnknownMetricError,
    WeightsError as WeightsError,
)
from gibench.metrics.evaluate import evaluate as evaluate, evaluate_sequence as evaluate_sequence
from gibench.metrics.registry import METRICS as METRICS, Descriptor as Descriptor, metric as metric
from gibench.metrics.reprojection import visibility as visibility
from gibench.metrics.sequence import TemporalError as TemporalError
from gibench.metrics.statistics import (
    Interval as Interval,
    mean_interval as mean_interval,
    paired_difference as paired_difference,
)
from gibench.metrics.tone_map import reference_exposure as reference_exposure, tone_map as tone_map
from gibench.metrics.unbiased import (
    Truth as Truth,
    Unbiased as Unbiased,
    is_quadratic as is_quadratic,
    mean_of as mean_of,
)

# isort: on


def __getattr__(name: str) -> Any:
    # Loaded when asked for, since `python -m gibench.metrics.lpips_weights` must not find itself loaded.
    if name in ("fetch_weights", "weights_state"):
        from gibench.metrics import lpips_weights

        return getattr(lpips_weights, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
