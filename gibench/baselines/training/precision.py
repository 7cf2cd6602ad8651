"""Products of matrices in bfloat16, where a processor has instructions for them."""

from __future__ import annotations

from contextlib import AbstractContextManager

import torch

INSTRUCTIONS = ("_is_amx_tile_supported", "_is_avx512_bf16_supported")
"""torch's words for the instructions that multiply bfloat16 numbers: AMX, and AVX-512 BF16 (Zen 4 has it)."""


def multiplies() -> bool:
    """Whether this processor has instructions that multiply bfloat16 numbers."""
    return any(getattr(torch.cpu, name, lambda: False)() for name in INSTRUCTIONS)


def mixed(device: torch.device, *, pays: bool = True) -> AbstractContextManager[None]:
    """Within it, products of matrices and convolutions take bfloat16 numbers, if that is faster on the device.

    It is where a processor has instructions for them; elsewhere a step takes longer than in single precision. pays:
    whether it does for the network at all. Weights and what they learn by stay in single precision: backward passes
    are made outside.
    """
    enabled = pays and device.type == "cpu" and multiplies()
    return torch.autocast("cpu", torch.bfloat16, enabled=enabled)
