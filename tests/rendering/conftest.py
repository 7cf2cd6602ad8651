import pytest

from gibench.rendering.backend import select_variant


@pytest.fixture(scope="session", autouse=True)
def variant() -> str:
    return select_variant("auto")
