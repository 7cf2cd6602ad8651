"""The LLVM library that Dr.Jit is to load: named before Dr.Jit is imported, since that is when it looks for one.

It would take one that Linux distributions install, with which it aborts the process at the first kernel.
"""

from __future__ import annotations

import importlib.metadata
import os
import re
from pathlib import Path

LLVM_VARIABLE = "DRJIT_LIBLLVM_PATH"
LLVM_PACKAGE = "karellen-llvm-core"


def packaged_llvm() -> str | None:
    """The library that `karellen-llvm-core` put into this environment."""
    try:
        files = importlib.metadata.files(LLVM_PACKAGE) or []
    except importlib.metadata.PackageNotFoundError:
        return None
    pattern = re.compile(r"(libLLVM(-\d+)?(\.so(\.[\d.]+)?|\.dylib)|LLVM-C\.dll|LLVM\.dll)$")
    found = [Path(str(f.locate())) for f in files if pattern.match(f.name)]
    # The fully versioned file is the library itself, the others are links to it.
    found = sorted((p for p in found if p.exists()), key=lambda p: len(p.name), reverse=True)
    return str(found[0].resolve()) if found else None


def name_packaged_llvm() -> None:
    """Name the package's library in this process and those that it starts, unless the user has named one."""
    if LLVM_VARIABLE not in os.environ and (library := packaged_llvm()):
        os.environ[LLVM_VARIABLE] = library
