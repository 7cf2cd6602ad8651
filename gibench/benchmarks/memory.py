"""Peak memory of a process."""

from __future__ import annotations

import resource
import sys
from contextlib import suppress
from pathlib import Path


def reset_peak() -> None:
    """Forget the peak of memory so far, where the system can (Linux; the GPU always)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    if drjit := sys.modules.get("drjit"):
        drjit.detail.malloc_clear_statistics()
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available() and torch.cuda.is_initialized():
        torch.cuda.reset_peak_memory_stats()


def peak_mb() -> float:
    """Largest resident memory of this process since `reset_peak`, in 10⁶ bytes."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def gpu_peak_mb() -> float | None:
    """Largest memory on the GPU since `reset_peak`, in 10⁶ bytes; None without one."""
    total, is_there = 0.0, False
    mitsuba, drjit = sys.modules.get("mitsuba"), sys.modules.get("drjit")
    if mitsuba is not None and drjit is not None and str(mitsuba.variant()).startswith("cuda"):
        total, is_there = total + drjit.detail.malloc_watermark(drjit.JitBackend.CUDA), True
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available() and torch.cuda.is_initialized():
        total, is_there = total + torch.cuda.max_memory_allocated(), True
    return total / 1e6 if is_there else None
