"""Version of the code that made a result: versions, and a digest of the sources that a method's implementation imports.

A method that is edited makes new results, without its version having to change; the results of all others stay.
"""

from __future__ import annotations

from typing import Any

import gibench
from gibench.baselines.sources import digest
from gibench.benchmarks.registry import Found


def code_version(found: Found) -> dict[str, Any]:
    """Keys: gibench, package (name and version), sources (16 hexadecimal digits)."""
    return {
        "gibench": gibench.__version__,
        "package": f"{found.package} {found.version}".strip(),
        "sources": digest(found.method.implementation.partition(":")[0]),
    }
