"""`gibench doctor`: what rendering would use on this machine, and what is missing."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from typing import Annotated, Any

import typer

import gibench
from gibench.cli.output import say

#: Packages whose versions matter when something goes wrong; the last ones come with extras.
PACKAGES = ("mitsuba", "drjit", "mitsuba-oidn", "numpy", "OpenEXR", "pandas", "torch", "lpips")

#: Columns of what stands beside the names.
WIDTH = 66

# A bad LLVM library aborts the whole process, and the doctor must live to tell.
_PROBE = "import json; from gibench.rendering import backend; print(json.dumps(backend.describe()))"


def doctor(as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False) -> None:
    """Say what rendering would use on this machine, and what is missing with the command that mends it."""
    facts = examine()
    if as_json:
        say(json.dumps(facts, indent=1, ensure_ascii=False))
    else:
        _print(facts)
    if facts["variant"] is None:
        raise typer.Exit(1)


def examine() -> dict[str, Any]:
    """Return what `backend.describe` says, and `machine`, `packages` and `lpips_weights`; all JSON-able."""
    from gibench.rendering.machine import machine

    facts = {**_rendering(), "machine": machine(), "packages": _packages(), "lpips_weights": _weights()}
    weights = facts["lpips_weights"]
    if weights["state"] != "cached":
        facts["notes"].append(
            f"the LPIPS weights are {weights['state']}, which only LPIPS needs: {weights['command']}"
        )
    if facts["packages"]["torch"] is None:
        facts["notes"].append("torch is missing, which only benchmarks need: pip install 'gibench[bench]'")
    return facts


def _rendering() -> dict[str, Any]:
    probe = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, text=True, check=False)
    last = probe.stdout.strip().splitlines()[-1:]
    if probe.returncode == 0 and last:
        return dict(json.loads(last[0]))
    reason = " ".join((probe.stderr.strip().splitlines() or ["no message"])[-1].split())
    return {
        "variant": None,
        "problem": f"loading the renderer ended with code {probe.returncode}: {reason}",
        "llvm": None,
        "gpu": None,
        "denoiser": None,
        "versions": {},
        "notes": [
            "the renderer does not load: unset DRJIT_LIBLLVM_PATH, then pip install --force-reinstall mitsuba"
        ],
    }


def _packages() -> dict[str, str | None]:
    from importlib.metadata import PackageNotFoundError, version

    found: dict[str, str | None] = {"gibench": gibench.__version__}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found


def _weights() -> dict[str, str]:
    from gibench.metrics import weights_state

    found = weights_state()
    return {"state": found.state, "detail": found.detail, "command": found.command}


def _print(facts: dict[str, Any]) -> None:
    llvm, machine = facts["llvm"], facts["machine"]
    memory = machine["memory"] / 2**30
    rows = {
        "variant": facts["variant"] or f"none works: {facts['problem']}",
        "LLVM": "none found" if llvm is None else f"{llvm['version']} ({llvm['origin']})\n{llvm['path']}",
        "GPU": facts["gpu"] or "none found",
        "denoiser": f"mitsuba-oidn {facts['denoiser']}" if facts["denoiser"] else "none found",
        "processor": f"{machine['cpu']}\n{machine['cores']} cores, {memory:.0f} GiB of memory",
        "system": f"{machine['platform']}\nPython {machine['python']}",
        "packages": "\n".join(
            f"{name} {number or 'is missing'}" for name, number in facts["packages"].items()
        ),
        "LPIPS weights": facts["lpips_weights"]["state"],
        "to mend": "\n".join(facts["notes"]) or "nothing",
    }
    for name, text in rows.items():
        lines = [piece for line in text.splitlines() for piece in _wrapped(line, is_note=name == "to mend")]
        for i, line in enumerate(lines):
            say(f"{name if i == 0 else '':<14}{line}")


def _wrapped(line: str, *, is_note: bool) -> list[str]:
    """A line in pieces that fit 80 columns beside the names; paths, and the command that ends a note, stay whole."""
    command: list[str] = []
    if is_note and len(line) > WIDTH and ": " in line:
        line, _, last = line.rpartition(": ")
        line, command = f"{line}:", [last]
    return textwrap.wrap(line, WIDTH, break_long_words=False, break_on_hyphens=False) + command
