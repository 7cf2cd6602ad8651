"""Damaged inputs, and what may be answered to them: success, or a named error of one line, in time and in memory.

A seed and a number decide an input. ``python -m tests.robustness.fuzzing --seconds 3600`` tries for an hour; what it
finds it prints with the words that try that input again.
"""

from __future__ import annotations

import argparse
import copy
import faulthandler
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from gibench.errors import GibenchError

#: What an input may take: seconds, and bytes of address space beyond what the process has when it starts.
SECONDS, BYTES = 20, 4 * 2**30

INTERESTING = (
    *(None, True, False, 0, -1, 1, 2, 3, 9999, 2**31, 2**63, -(2**63), 10**30, 0.5, -0.0, 1e308, 1e-320),
    *(
        "",
        "x",
        "0",
        "nan",
        "../../../etc/hostname",
        "/dev/zero",
        "a\0b",
        "\x1b[2J",
        "=1+1",
        "$\\frac{",
        "é" * 300,
    ),
    *([], {}, [[]], {"": {}}, [0] * 100, {"a": [None]}),
)


@dataclass(frozen=True)
class Target:
    """A kind of files. prepare: makes an undamaged folder. files: which of it are damaged. read: what is then done with
    the folder. damage: other bytes for a file's; None for all the ways that suit its name."""

    prepare: Callable[[Path], None]
    files: Callable[[Path], list[str]]
    read: Callable[[Path], None]
    damage: Callable[[random.Random, bytes], bytes] | None = None


def flipped(rng: random.Random, content: bytes) -> bytes:
    """Change bytes: some bits, a piece that is cut out, repeated, or overwritten by small or large numbers."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        if not data:
            break
        # Headers are where the sense is.
        place = rng.randrange(min(len(data), rng.choice((64, 512, len(data)))))
        way = rng.randrange(5)
        if way == 0:
            data[place] ^= 1 << rng.randrange(8)
        elif way == 1:
            data[place : place + rng.choice((1, 4, 100, len(data)))] = b""
        elif way == 2:
            piece = bytes(data[place : place + rng.choice((1, 8, 64))])
            data[place:place] = piece * rng.choice((1, 2, 50))
        elif way == 3:
            number = rng.choice((0, 1, 255, 2**16 - 1, 2**31 - 1, 2**32 - 1, 2**63, 2**64 - 1))
            size = rng.choice((1, 2, 4, 8))
            data[place : place + size] = (number % 2 ** (8 * size)).to_bytes(
                size, rng.choice(("little", "big"))
            )
        else:
            data[place] = rng.randrange(256)
    return bytes(data)


def rewritten(rng: random.Random, content: bytes) -> bytes:
    """Change JSON as JSON: values of other types, keys that are missing, renamed or new, lists that are longer."""
    try:
        value = json.loads(content)
    except ValueError:
        return flipped(rng, content)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        holders = list(_holders(value))
        if not holders:
            break
        holder = rng.choice(holders)
        keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
        if not keys:
            continue
        key, way = rng.choice(keys), rng.randrange(6)
        if way == 0:
            del holder[key]
        elif way == 1 and isinstance(holder, dict):
            holder[str(rng.choice(INTERESTING))] = holder.pop(key)
        elif way == 2 and isinstance(holder, list):
            holder += holder[key : key + 1] * rng.choice((1, 100))
        else:
            holder[key] = copy.deepcopy(rng.choice(INTERESTING))  # it may be changed in turn
    text = json.dumps(value)
    return flipped(rng, text.encode()) if rng.random() < 0.1 else text.encode("utf-8", "surrogatepass")


def _holders(value: Any) -> Iterator[dict[str, Any] | list[Any]]:
    if isinstance(value, dict | list):
        yield value
        for inner in list(value.values() if isinstance(value, dict) else value[:20]):
            yield from _holders(inner)


WORDS = (
    *(
        b"nan",
        b"1e999",
        b"-1",
        b"0",
        b"99999999999999999999",
        b"4294967295",
        b"",
        b"\xff\xfe",
        b"../../x",
        b"$x",
        b"[",
        b"'",
    ),
    *(
        b"<",
        b">",
        b"/>",
        b"&x;",
        b"&#0;",
        b"\0",
        b"true",
        b"{}",
        b"[[[[",
        b"1, 2",
        b"0 0 0",
        b"1e-320",
        b"inf",
    ),
)


def reworded(rng: random.Random, content: bytes) -> bytes:
    """Change text by its words: exchanged, doubled, removed, or replaced by numbers and signs that trip parsers."""
    import re

    words = re.split(rb"(\s+|[\"=<>,\[\]]+)", content)
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(words))
        way = rng.randrange(5)
        if way == 0:
            words[at] = rng.choice(WORDS)
        elif way == 1:
            del words[at : at + rng.choice((1, 5, 40))]
        elif way == 2:
            words[at:at] = words[at : at + rng.choice((1, 9))] * rng.choice((1, 3, 30))
        elif way == 3:
            other = rng.randrange(len(words))
            words[at], words[other] = words[other], words[at]
        else:
            words[at] = flipped(rng, words[at])
        if not words:
            break
    return b"".join(words)


def damaged(rng: random.Random, content: bytes, name: str) -> bytes:
    """Damage a file in a way that suits it."""
    if name.endswith(".json") and rng.random() < 0.85:
        return rewritten(rng, content)
    if name.endswith((".xml", ".toml", ".obj", ".json", ".mtl", ".serialized.txt")) and rng.random() < 0.8:
        return reworded(rng, content)
    return flipped(rng, content)


@dataclass
class Found:
    """An input that was answered otherwise than it may."""

    target: str
    seed: int
    number: int
    file: str
    what: str

    def __str__(self) -> str:
        again = f"--target {self.target} --seed {self.seed} --first {self.number} --count 1"
        return f"{again} ({self.file}): {self.what}"


def judged(read: Callable[[Path], None], root: Path) -> tuple[str, str]:
    """What reading a folder came to, in this process: ("success" | "named" | "wrong", what is wrong)."""
    try:
        read(root)
    except GibenchError as problem:
        text = str(problem)
        if "\n" in text or not text:
            return "wrong", f"{type(problem).__name__} is not one line: {text!r}"
        return "named", ""
    except BaseException as problem:
        return "wrong", f"{type(problem).__name__}: {problem} {_where(problem)}"
    return "success", ""


def _where(problem: BaseException) -> str:
    frames = traceback.extract_tb(problem.__traceback__)
    return " < ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in reversed(frames[-4:]))


#: Inputs after which a fresh process takes over, and seconds until one that starts has read the undamaged folder.
SHARE, START_SECONDS = 1000, 120


def tried(
    name: str, target: Target, whole: Path, seed: int, numbers: range, seconds: float
) -> tuple[Counter[str], list[Found]]:
    """Try inputs in child processes, so that a crash costs one of them. seconds: without those of their starts."""
    outcomes: Counter[str] = Counter()
    found: list[Found] = []
    number = numbers.start
    while number < numbers.stop and seconds > 0:
        reader, writer = os.pipe()
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            os.close(reader)
            try:
                share = range(number, min(number + SHARE, numbers.stop))
                _work(name, target, whole, seed, share, writer, seconds)
            finally:
                os._exit(7)
        os.close(writer)
        begun: tuple[int, str] | None = None
        ready = time.monotonic()
        with os.fdopen(reader, encoding="utf-8", errors="replace") as stream:
            for line in stream:
                number, file, outcome, what = json.loads(line)
                if outcome == "ready":
                    ready = time.monotonic()
                    continue
                begun = (number, file) if outcome == "begun" else None
                if begun is None:
                    outcomes[outcome] += 1
                    number += 1
                if outcome == "wrong":
                    found.append(Found(name, seed, number - 1, file, what))
        _, status = os.waitpid(child, 0)
        seconds -= time.monotonic() - ready
        if begun is not None or status:
            killed = os.WIFSIGNALED(status)
            how = signal.Signals(os.WTERMSIG(status)).name if killed else f"code {os.WEXITSTATUS(status)}"
            outcomes["wrong"] += 1
            found.append(
                Found(name, seed, number, begun[1] if begun else "undamaged", f"the process ended with {how}")
            )
            if begun is None:  # it never began
                break
            number += 1
    return outcomes, found


def _work(
    name: str, target: Target, whole: Path, seed: int, numbers: range, writer: int, seconds: float
) -> None:
    """Body of the child: input after input, until it dies or the time is over."""
    faulthandler.disable()
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
        os.dup2(nothing.fileno(), 2)
    with os.fdopen(writer, "w") as stream, tempfile.TemporaryDirectory() as scratch:

        def tell(*content: Any) -> None:
            stream.write(json.dumps(content, ensure_ascii=True) + "\n")
            stream.flush()

        root = Path(scratch) / "folder"
        signal.alarm(START_SECONDS)
        shutil.copytree(whole, root, symlinks=True)
        if (outcome := judged(target.read, root))[0] != "success":  # loads what reading needs, too
            tell(numbers.start, "undamaged", "begun", "")
            tell(numbers.start, "undamaged", "wrong", f"the undamaged folder: {outcome}")
            os._exit(0)
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        files = target.files(whole)
        tell(numbers.start, "", "ready", "")
        end = time.monotonic() + seconds
        for number in numbers:
            if time.monotonic() > end:
                break
            rng = random.Random(f"{name}-{seed}-{number}")
            file = rng.choice(files)
            content = (whole / file).read_bytes()
            shutil.rmtree(root)
            shutil.copytree(whole, root, symlinks=True)
            tell(number, file, "begun", "")
            (root / file).write_bytes((target.damage or partial(damaged, name=file))(rng, content))
            # Of processor time, so that a machine with other things to do finds nothing; ten times that by the clock.
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            signal.alarm(10 * SECONDS)
            outcome = judged(target.read, root)
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.alarm(0)
            if outcome[0] != "wrong" and (others := set(os.listdir(scratch)) - {"folder"}):
                outcome = ("wrong", f"something was written outside: {others}")
            tell(number, file, *outcome)
    os._exit(0)


def _apart(prepare: Callable[[Path], None], whole: Path) -> None:
    """Prepare in a process of its own: libraries with threads do not survive a fork."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            prepare(whole)
            code = 0
        finally:
            traceback.print_exc() if code else None
            os._exit(code)
    if os.waitpid(child, 0)[1]:
        raise RuntimeError(f"{whole.name} cannot be prepared")


def fuzz(
    targets: dict[str, Target], *, seed: int, seconds: float, first: int = 0, count: int | None = None
) -> tuple[Counter, list[Found]]:
    """Try inputs of every target, for so many seconds in all or so many of each."""
    outcomes: Counter[str] = Counter()
    found: list[Found] = []
    with tempfile.TemporaryDirectory() as scratch:
        for name, target in targets.items():
            whole = Path(scratch) / name
            whole.mkdir()
            _apart(target.prepare, whole)
            last = sys.maxsize if count is None else first + count
            share = seconds / len(targets)
            some, wrong = tried(name, target, whole, seed, range(first, last), share)
            print(f"{name:<12} seed {seed}: {dict(some)}", flush=True)
            outcomes.update(some)
            found += wrong
    return outcomes, found


def main() -> None:
    """Fuzz as the command line says; end with code 1 where anything was answered otherwise than it may."""
    from tests.robustness.targets import TARGETS

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--target", action="append", choices=list(TARGETS))
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(2**32))
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int)
    asked = parser.parse_args()
    chosen = {name: TARGETS[name] for name in asked.target or TARGETS}
    outcomes, found = fuzz(
        chosen, seed=asked.seed, seconds=asked.seconds, first=asked.first, count=asked.count
    )
    for one in found:
        print(one)
    print(f"{sum(outcomes.values())} inputs: {dict(outcomes)}")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
