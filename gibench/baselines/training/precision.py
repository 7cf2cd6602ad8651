"""Products of matrices in bfloat16, where a processor has units for them."""

from __future__ import annotations

from contextlib import AbstractContextManager

import torch


def has_tiles() -> bool:
    """Whether this processor multiplies tiles of bfloat16 numbers (AMX)."""
    supported = getattr(torch.cpu, "_is_amx_tile_supported", None)
    return bool(supported and supported())


def mixed(device: torch.device, *, pays: bool = True) -> AbstractContextManager[None]:
    """Within it, products of matrices and convolutions take bfloat16 numbers, if that is faster on the device.

    It is where a processor has tiles; without them a step takes longer than in single precision. pays: whether it does
    for the network at all. Weights and what they learn by stay in single precision: backward passes are made outside.
    """
    enabled = pays and device.type == "cpu" and has_tiles()
    return torch.autocast("cpu", torch.bfloat16, enabled=enabled)
