"""The machine of results: hardware, threads, variant, versions. Times compare only where all of it agrees."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from gibench.benchmarks.errors import RunError
from gibench.errors import GibenchError
from gibench.processes import ChildProcess, ProcessEnded, TookTooLong

#: Packages whose version changes times or pixels, beside those that the renderer names itself.
PACKAGES = ("numpy", "torch")

#: Seconds that a process which loads a renderer and looks around may take.
LONGEST_LOOK = 600.0

#: What decides whether two times may be compared. The rest (memory, kernel of the system) is for people.
COMPARED = ("cpu", "cores", "threads", "gpu", "variant", "versions")


def examine(variant: str, threads: int) -> dict[str, Any]:
    """Facts about this machine: cpu, gpu, cores, threads, memory (bytes), platform, python, variant, versions.

    A process of its own looks, since loading a renderer may abort it. Raises RunError or what `select_variant` does.
    """
    try:
        with ChildProcess(_look, variant, threads) as process:
            found = process.receive(LONGEST_LOOK)
    except TookTooLong:
        raise RunError(
            f"the renderer has not started within {LONGEST_LOOK:g} s: see `gibench doctor`"
        ) from None
    except ProcessEnded:
        raise RunError("the renderer ends its process: `gibench doctor` shows why") from None
    if isinstance(found, GibenchError):
        raise found
    return dict(found)


def _look(connection: Connection, variant: str, threads: int) -> None:
    """Body of the process: send the facts, or what is wrong."""
    try:
        connection.send(_facts(variant, threads))
    except GibenchError as problem:
        connection.send(problem)


def _facts(variant: str, threads: int) -> dict[str, Any]:
    from gibench.rendering import backend
    from gibench.rendering.machine import machine

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
    """Digest of a machine: 12 hexadecimal digits of the facts that times depend on."""
    compared = {name: facts[name] for name in COMPARED}
    return hashlib.sha256(json.dumps(compared, sort_keys=True).encode()).hexdigest()[:12]
