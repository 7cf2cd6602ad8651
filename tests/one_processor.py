"""Code on one processor, where Mitsuba may use one thread alone."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

needs_affinity = pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity"), reason="needs a process that can be kept to one processor"
)


def run_on_one_processor(code: str) -> None:
    """In a process of its own, which is to end by itself within two minutes."""
    keep = "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
    subprocess.run([sys.executable, "-c", keep + code], check=True, timeout=120)
