"""The fuzzers for a minute; see `fuzzing` for as long as one likes."""

from __future__ import annotations

import copy
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from tests.robustness import fuzzing
from tests.robustness.targets import TARGETS

SEED = int(os.environ.get("GIBENCH_FUZZ_SEED", random.SystemRandom().randrange(2**32)))
SECONDS = float(os.environ.get("GIBENCH_FUZZ_SECONDS", "60"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that fork")
def test_damaged_inputs_are_read_or_named():
    """In a process of its own, without the libraries and threads of other tests."""
    words = ["--seed", str(SEED), "--seconds", str(SECONDS)]
    result = subprocess.run(
        [sys.executable, "-m", "tests.robustness.fuzzing", *words],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
        timeout=SECONDS * 2 + 200,
        check=False,
    )
    print(result.stdout)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_same_seed_gives_the_same_input():
    content = b'{"a": [1, 2, 3], "b": {"c": "d"}}'
    first, again = (fuzzing.damaged(random.Random("x-1-2"), content, "a.json") for _ in range(2))
    assert first == again
    others = {fuzzing.damaged(random.Random(f"x-1-{number}"), content, "a.json") for number in range(50)}
    assert len(others) > 25


def test_damage_leaves_the_interesting_values_alone():
    """One that is put in and then changed in turn once held itself, and every input after it."""
    content, before = b'{"a": [1, 2, 3], "b": {"c": "d"}}', copy.deepcopy(fuzzing.INTERESTING)
    for number in range(2000):
        fuzzing.rewritten(random.Random(number), content)
    assert before == fuzzing.INTERESTING


def _write(root: Path) -> None:
    (root / "a.txt").write_text("a" * 20)


def _read(root: Path) -> None:
    """Fails in every way there is, by what the file has become."""
    text = (root / "a.txt").read_bytes()
    if text == b"a" * 20:
        return
    how = sum(text) % 6
    if how == 0:
        raise fuzzing.GibenchError("one line")
    if how == 1:
        raise fuzzing.GibenchError("two\nlines")
    if how == 2:
        raise KeyError("x")
    if how == 3:
        os.abort()
    if how == 4:
        bytearray(20 * 2**30)
    if how == 5:
        (root.parent / "outside").write_text("x")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that fork")
def test_a_fuzzer_finds_what_is_there():
    outcomes, found = fuzzing.fuzz(
        {"toy": fuzzing.Target(_write, lambda root: ["a.txt"], _read)}, seed=3, seconds=60, count=60
    )
    assert sum(outcomes.values()) == 60
    assert outcomes["named"] > 0
    text = "\n".join(map(str, found))
    for says in ("is not one line", "KeyError", "SIGABRT", "MemoryError", "written outside"):
        assert says in text
    assert set(TARGETS) >= {"dataset", "run", "frames", "bakes", "recipes", "scenes", "panoramas"}
