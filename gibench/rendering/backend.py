"""Choice of the Mitsuba variant, and of the LLVM library that its CPU backend compiles with.

Dr.Jit loads LLVM when it is imported and aborts the process with versions before 19, which Linux distributions still
install. The library therefore comes from the PyPI package `karellen-llvm-core`, which `gibench.llvm` names, unless the
user has set DRJIT_LIBLLVM_PATH, which wins.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib.metadata
import logging
import os
import platform
import re
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from gibench.errors import GibenchError
from gibench.llvm import LLVM_PACKAGE, LLVM_VARIABLE, packaged_llvm

MINIMUM_LLVM = 19
"""Dr.Jit 1.5 stops with "Cannot select: fminimum" under LLVM 14 to 16; 19 to 23 are known to work."""

VARIANTS = ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")
"""Best first: the order in which "auto" tries them."""

log = logging.getLogger(__name__)


class BackendError(GibenchError):
    """No renderer of the kind asked for runs on this machine."""


@dataclass(frozen=True)
class LlvmLibrary:
    """An LLVM shared library. origin: "environment" (the user's), "package" (PyPI) or "system"."""

    path: str
    version: str
    origin: str

    @property
    def usable(self) -> bool:
        """Whether Dr.Jit can be trusted with it. What the user has chosen is not second-guessed."""
        return self.origin == "environment" or _major(self.version) >= MINIMUM_LLVM


def _major(version: str) -> int:
    found = re.match(r"\d+", version)
    return int(found.group()) if found else 0


def _llvm_version(path: str) -> str:
    """Version of an LLVM library, from the library itself (LLVM 16 and later) or else from its file name."""
    try:
        query = ctypes.CDLL(path).LLVMGetVersion
    except (OSError, AttributeError):
        in_name = re.search(r"(\d+(?:\.\d+)*)", Path(path).name.replace("LLVM-C", ""))
        return in_name.group(1) if in_name else "unknown"
    parts = [ctypes.c_uint() for _ in range(3)]
    query(*(ctypes.byref(p) for p in parts))
    return ".".join(str(p.value) for p in parts)


def _system_llvm() -> list[str]:
    """LLVM libraries where Linux and Homebrew keep them, newest first."""
    folders = ["/usr/lib", "/usr/lib64", "/usr/local/lib", f"/usr/lib/{platform.machine()}-linux-gnu"]
    folders += ["/opt/homebrew/opt/llvm/lib", "/usr/local/opt/llvm/lib"]
    names = {
        str(p.resolve()) for f in folders for g in ("libLLVM*.so*", "libLLVM*.dylib") for p in Path(f).glob(g)
    }
    versions = {n: _major(m.group(1)) for n in names if (m := re.search(r"libLLVM[-.]?(?:so\.)?(\d+)", n))}
    return sorted(versions, key=lambda n: versions[n], reverse=True)


@cache
def find_llvm() -> LlvmLibrary | None:
    """The LLVM library that would be used: the user's choice, else the PyPI package's, else a new enough system one.

    An old system library is returned too where nothing better exists, marked as not `usable`, so that it can be
    reported; `select_variant` never loads it.
    """
    chosen, packaged = os.environ.get(LLVM_VARIABLE), packaged_llvm()
    if chosen and chosen != packaged:
        return LlvmLibrary(chosen, _llvm_version(chosen), "environment")
    if packaged:
        return LlvmLibrary(packaged, _llvm_version(packaged), "package")
    for path in _system_llvm():
        # By name only: an old library must not even be mapped into the process.
        in_name = re.search(r"(\d+(?:\.\d+)*)", Path(path).name)
        return LlvmLibrary(path, in_name.group(1) if in_name else "unknown", "system")
    return None


@cache
def find_gpu() -> str | None:
    """Name of the first CUDA device that the driver offers, or None."""
    for name in ("libcuda.so.1", "nvcuda.dll"):
        with contextlib.suppress(OSError, AttributeError):
            cuda = ctypes.CDLL(name)
            device, text, count = ctypes.c_int(), ctypes.create_string_buffer(256), ctypes.c_int()
            if cuda.cuInit(0) or cuda.cuDeviceGetCount(ctypes.byref(count)) or not count.value:
                return None
            if cuda.cuDeviceGet(ctypes.byref(device), 0) or cuda.cuDeviceGetName(text, 256, device):
                return None
            return text.value.decode(errors="replace")
    return None


def _works(variant: str) -> str | None:
    """Traces one ray under `variant`; returns None where that works, else the reason why it does not."""
    import mitsuba as mi

    try:
        mi.set_variant(variant)
        if variant.startswith("llvm"):
            _refuse_old_llvm()
        scene = mi.load_dict({"type": "scene", "shape": {"type": "rectangle"}})
        distance = scene.ray_intersect(mi.Ray3f([0, 0, 1], [0, 0, -1])).t
        value = float(distance if variant.startswith("scalar") else distance[0])
    except BackendError:
        raise
    except Exception as error:
        return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
    return None if abs(value - 1) < 1e-5 else f"a ray of length 1 came back with length {value}"


def _prepare(variant: str) -> str | None:
    """The reason why `variant` cannot be tried at all, or None. Points Dr.Jit at the right LLVM."""
    if variant.startswith("cuda") and find_gpu() is None:
        return "no CUDA device was found"
    if variant.startswith("llvm"):
        library = find_llvm()
        if library is None or not library.usable:
            found = "none was found" if library is None else f"{library.path} is version {library.version}"
            return f"LLVM {MINIMUM_LLVM} or later is needed and {found}; run: pip install {LLVM_PACKAGE}"
        os.environ.setdefault(LLVM_VARIABLE, library.path)
    return None


def _refuse_old_llvm() -> None:
    """Raises BackendError where Dr.Jit has loaded an LLVM that aborts the process at the first kernel.

    So it does when it is imported before gibench, which names a better one. To be called once LLVM is loaded.
    """
    maps = Path("/proc/self/maps")
    if not maps.exists():
        return
    loaded = {
        str(Path(path).resolve()): path
        for path in re.findall(r"/\S*libLLVM\S*", maps.read_text(encoding="utf-8", errors="replace"))
    }
    named = os.environ.get(LLVM_VARIABLE)
    if not loaded or (named and str(Path(named).resolve()) in loaded):
        return  # an old one beside it belongs to the graphics driver
    for path in loaded.values():
        in_name = re.search(r"(\d+(?:\.\d+)*)", Path(path).name)
        if in_name is None or _major(in_name.group(1)) >= MINIMUM_LLVM:
            return
    raise BackendError(
        f"Dr.Jit was imported before gibench and loaded {path}, which is older than LLVM {MINIMUM_LLVM} and aborts at "
        "the first kernel: import gibench before mitsuba and drjit"
    )


def select_variant(name: str = "auto") -> str:
    """Makes a Mitsuba variant current and returns its name.

    name: "auto" takes `cuda_ad_rgb` where a GPU works, else `llvm_ad_rgb`, else `scalar_rgb` with a warning
    (it is many times slower); or one of VARIANTS. Repeated calls with what is already current cost nothing.

    Raises BackendError for an unknown name, or for a variant that cannot run here, with the reason.
    """
    if name != "auto" and name not in VARIANTS:
        raise BackendError(f"unknown variant {name!r}: choose auto, {', '.join(VARIANTS)}")
    current = current_variant()
    if current in VARIANTS and name in ("auto", current):
        if current.startswith("llvm"):
            _refuse_old_llvm()
        return current

    reasons: list[str] = []
    for variant in VARIANTS if name == "auto" else (name,):
        reason = _prepare(variant) or _works(variant)
        if reason is None:
            if name == "auto" and variant == "scalar_rgb":
                log.warning("only scalar_rgb runs here, which is many times slower: %s", "; ".join(reasons))
            return variant
        reasons.append(f"{variant}: {reason}")
    raise BackendError("; ".join(reasons) + " (`gibench doctor` shows what was found)")


def current_variant() -> str:
    """The variant that is set; empty where none is."""
    loaded = sys.modules.get("mitsuba")
    return "" if loaded is None else str(loaded.variant() or "")


def is_scalar() -> bool:
    """Whether the current variant traces one path at a time, without Dr.Jit's compiler."""
    import mitsuba as mi

    return str(mi.variant()).startswith("scalar")


def torch_device() -> str:
    """What torch calls the device that the current variant computes on: "cuda" or "cpu".

    A GPU that is there beside a variant of the processor stays unused, so that all methods run on one clock.
    """
    import mitsuba as mi

    return "cuda" if str(mi.variant()).startswith("cuda") else "cpu"


def registry_key(kind: str, plugin: Any) -> int:
    """Key of a plugin inside a kernel: its registry index, or the object itself in scalar mode.

    kind: name of its pointer type in Mitsuba, such as "BSDFPtr".
    """
    import drjit as dr
    import mitsuba as mi

    if is_scalar():
        return id(plugin)
    return int(dr.reinterpret_array(mi.UInt32, getattr(mi, kind)(plugin))[0])


def limit_threads(count: int) -> None:
    """Lets the renderer of this process use `count` (≥ 1) CPU threads. Pixels do not depend on it."""
    import drjit as dr

    dr.set_thread_count(count)


@contextlib.contextmanager
def tracing() -> Iterator[None]:
    """Nothing that others left in reference cycles dies in here: a scene that does while a kernel is traced, aborts."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


@contextlib.contextmanager
def threads_to_load() -> Iterator[None]:
    """Two threads at least while Mitsuba reads or writes files: with one alone it waits for ever at an OpenEXR."""
    import drjit as dr

    count = dr.thread_count()
    if count < 2:
        dr.set_thread_count(2)
    try:
        yield
    finally:
        if count < 2:
            dr.set_thread_count(count)


def versions() -> dict[str, str]:
    """Versions that decide what the pixels are: Mitsuba, Dr.Jit, the denoiser, LLVM."""
    found = {}
    for package in ("mitsuba", "drjit", "mitsuba-oidn"):
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    library = find_llvm()
    found["llvm"] = library.version if library and library.usable else "none"
    return found


def describe() -> dict[str, object]:
    """Backend, libraries and versions that rendering would use here, for `gibench doctor` and for a dataset's record.

    Keys: variant (str, or None with `problem`), llvm (path, version, origin, usable; or None), gpu (name or
    None), denoiser (version or None), versions, notes (list of str: what is missing and the command that mends it).
    """
    notes: list[str] = []
    variant, problem = None, None
    try:
        variant = select_variant("auto")
    except BackendError as error:
        problem = str(error)
    library = find_llvm()
    if library is None or not library.usable:
        notes.append(f"LLVM {MINIMUM_LLVM} or later is missing: pip install {LLVM_PACKAGE}")
    elif _major(library.version) < MINIMUM_LLVM:
        notes.append(
            f"{LLVM_VARIABLE} names LLVM {library.version}, which may abort the process: unset {LLVM_VARIABLE}"
        )
    from gibench.rendering.denoise import denoiser_version

    denoiser = denoiser_version()
    if denoiser is None:
        notes.append("the denoiser is missing: pip install mitsuba-oidn")
    return {
        "variant": variant,
        "problem": problem,
        "llvm": None if library is None else {**asdict(library), "usable": library.usable},
        "gpu": find_gpu(),
        "denoiser": denoiser,
        "versions": versions(),
        "notes": notes,
    }
