"""For all tests."""

from __future__ import annotations

import os
import signal

# Read when torch is loaded: threads that wait asleep, since those that spin starve whatever else runs.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

# A shell that runs the tests in the background has Ctrl-C ignored, by them and by all that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
