"""What results are made on: hardware, threads, variant, versions. Times compare only where all of it agrees."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import multiprocessing
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any

from gibench.benchmarks.errors import RunError

#: Packages whose version changes times or pixels, beside those that the renderer names itself.
PACKAGES = ("numpy", "torch")

#: What decides whether two times may be compared. The rest (memory, kernel of the system) is for people.
COMPARED = ("cpu", "cores", "threads", "gpu", "variant", "versions")


def examine(variant: str, threads: int) -> dict[str, Any]:
    """Facts about this machine: cpu, gpu, cores, threads, memory (bytes), platform, python, variant, versions.

    A process of its own looks, since loading a renderer may abort it. Raises RunError or what `select_variant` does.
    """
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        try:
            return pool.submit(_facts, variant, threads).result()
        except BrokenProcessPool:
            raise RunError("the renderer ends its process: `gibench doctor` shows why") from None


def _facts(variant: str, threads: int) -> dict[str, Any]:
    from gibench.datasets.room_making import machine
    from gibench.rendering import backend

    chosen = backend.select_variant(variant)
    facts = machine()
    versions = {"python": facts.pop("python"), **backend.versions()}
    for package in PACKAGES:
        with suppress(importlib.metadata.PackageNotFoundError):
            versions[package] = importlib.metadata.version(package)
    return {
        **facts,
        "gpu": backend.find_gpu() if chosen.startswith("cuda") else None,
        "threads": threads,
        "variant": chosen,
        "versions": versions,
    }


def digest(facts: Mapping[str, Any]) -> str:
    """What tells machines apart: 12 hexadecimal digits of the facts that times depend on."""
    compared = {name: facts[name] for name in COMPARED}
    return hashlib.sha256(json.dumps(compared, sort_keys=True).encode()).hexdigest()[:12]
