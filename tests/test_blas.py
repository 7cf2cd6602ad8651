"""The choice of tests that run under a second BLAS kernel."""

from tests.blas import PACKAGE, TESTS, is_numerical, multiplies, subject


def test_a_test_is_about_what_it_mirrors():
    probes = TESTS / "baselines" / "probes"
    assert subject(probes / "test_placement.py") == (PACKAGE / "baselines/probes/placement.py",)
    assert PACKAGE / "baselines/probes/adaptive/resolution.py" in subject(probes / "test_adaptive.py")
    assert PACKAGE / "metrics/tone_map.py" in subject(TESTS / "metrics" / "test_of_no_module.py")


def test_what_multiplies_matrices(tmp_path):
    for text, expected in (
        ("a @ b", True),
        ("a @= b", True),
        ("import numpy as np\nnp.linalg.norm(a)", True),
        ("import drjit as dr\ndr.dot(a, b)", False),
        ("a * b", False),
    ):
        file = tmp_path / f"{abs(hash(text))}.py"
        file.write_text(text)
        assert multiplies(file) == expected, text


def test_the_numerical_tests_are_found():
    chosen = {str(test.relative_to(TESTS)) for test in TESTS.rglob("test_*.py") if is_numerical(test)}
    assert {"baselines/probes/test_adaptive.py", "metrics/test_flip.py", "rendering/test_camera.py"} <= chosen
    assert "test_docs.py" not in chosen
    assert len(chosen) < 0.5 * sum(1 for _ in TESTS.rglob("test_*.py"))
