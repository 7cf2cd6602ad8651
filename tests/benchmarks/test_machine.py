"""The process that looks at a machine: it answers, is given up, and ends with whoever started it."""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
import time

import psutil
import pytest

from gibench.benchmarks import machine
from gibench.benchmarks.errors import RunError
from gibench.errors import GibenchError


def test_a_renderer_that_does_not_start_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(machine, "LONGEST_LOOK", 0.01)
    with pytest.raises(RunError, match=r"has not started within 0\.01 s"):
        machine.examine("scalar_rgb", 1)
    assert not multiprocessing.active_children()


def test_an_unknown_variant_keeps_its_error():
    with pytest.raises(GibenchError, match="scalar_grey"):
        machine.examine("scalar_grey", 1)


def test_nothing_is_left_of_a_command_that_is_killed_while_it_looks():
    """Once such processes stayed for good: they wait for work at a queue of which they hold the other end too."""
    code = "from gibench.benchmarks.machine import examine; examine('scalar_rgb', 1)"
    command = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE)
    parent, deadline = psutil.Process(command.pid), time.monotonic() + 60
    while not (children := parent.children(recursive=True)) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert children
    time.sleep(1)
    command.kill()
    command.communicate(timeout=120)  # its children hold the other end of stderr
    _, alive = psutil.wait_procs(children, timeout=60)
    assert not alive
