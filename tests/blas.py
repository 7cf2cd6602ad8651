"""Which tests are worth running under a second BLAS kernel: processors round products of matrices differently.

Tests mirror the package, so the module that a test is about is known by its place. Where that multiplies matrices or
solves equations with NumPy or SciPy, its tests carry the marker `blas`; nobody has to keep a list.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent / "gibench"

PRODUCTS = {"dot", "einsum", "inner", "linalg", "matmul", "tensordot"}
"""Names after a dot that stand for what BLAS and LAPACK do; of Dr.Jit, which uses neither, `dr.dot` does not count."""


@cache
def multiplies(source: Path) -> bool:
    """Whether a file of Python multiplies matrices."""
    for node in ast.walk(ast.parse(source.read_bytes())):
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            return True
        if isinstance(node, ast.Attribute) and node.attr in PRODUCTS and ast.unparse(node.value) != "dr":
            return True
    return False


@cache
def subject(test: Path) -> tuple[Path, ...]:
    """Files that a test file is about: the module or the folder of its name; without either the folder it mirrors."""
    folder = PACKAGE / test.parent.relative_to(TESTS)
    name = test.stem.removeprefix("test_")
    if (folder / f"{name}.py").is_file():
        return (folder / f"{name}.py",)
    if (folder / name).is_dir():
        return tuple(sorted((folder / name).rglob("*.py")))
    return tuple(sorted(folder.glob("*.py")))


@cache
def is_numerical(test: Path) -> bool:
    """Whether what a test file is about multiplies matrices."""
    return any(multiplies(source) for source in subject(test))
