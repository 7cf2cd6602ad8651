"""The machine that renders: what it is, and the name of its processor."""

from __future__ import annotations

import platform
from functools import cache
from pathlib import Path
from typing import Any

from gibench.rendering import backend


def machine() -> dict[str, Any]:
    """This machine: operating system, processor, cores, memory (bytes), Python."""
    import psutil

    return {
        "platform": platform.platform(),
        "cpu": _cpu(),
        "cores": psutil.cpu_count(logical=True),
        "memory": psutil.virtual_memory().total,
        "python": platform.python_version(),
    }


def processor() -> str:
    """Name of what renders in this process: of the GPU where the variant is CUDA's, else of the CPU."""
    variant = backend.current_variant()
    return " ".join(((backend.find_gpu() if variant.startswith("cuda") else None) or _cpu()).split())


@cache
def _cpu() -> str:
    information = Path("/proc/cpuinfo")
    if information.is_file():
        for line in information.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
