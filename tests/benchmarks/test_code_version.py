import sys

import pytest

from gibench.benchmarks import code_version as module
from gibench.benchmarks.code_version import code_version, sources
from gibench.benchmarks.registry import Found
from tests.benchmarks.toys import card


@pytest.fixture
def package(tmp_path, monkeypatch):
    root = tmp_path / "kiln"
    (root / "parts").mkdir(parents=True)
    files = {
        "__init__.py": "from gibench.baselines.method import Method\n",
        "method.py": "from kiln.parts import lid\nfrom .parts.door import open_it\nimport numpy\n",
        "parts/__init__.py": "",
        "parts/lid.py": "def lid():\n    import kiln.hidden\n",
        "parts/door.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import kiln.types\n",
        "hidden.py": "",
        "types.py": "",
        "unused.py": "",
    }
    for name, text in files.items():
        (root / name).write_text(text)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    for cached in (module._top, module._imports):
        cached.cache_clear()
    yield root
    for cached in (module._top, module._imports):
        cached.cache_clear()


def test_what_a_method_imports_is_found_without_importing_it(package):
    names = set(sources("kiln.method"))
    own = {"kiln", "kiln.method", "kiln.parts", "kiln.parts.lid", "kiln.parts.door", "kiln.hidden"}
    assert {name for name in names if name.startswith("kiln")} == own
    assert "gibench.baselines.method" in names
    assert not {
        name for name in names if name.startswith(("gibench.benchmarks", "gibench.generators", "numpy"))
    }
    assert "kiln.method" not in sys.modules


def test_an_edit_counts_where_it_can_matter(package):
    found = Found(card("Plain", implementation="kiln.method:Kiln"), "kiln", "1.2")

    def version():
        for cached in (module._top, module._imports):
            cached.cache_clear()
        return code_version(found)

    before = version()
    assert before["package"] == "kiln 1.2"
    (package / "unused.py").write_text("x = 1")
    assert version() == before
    (package / "hidden.py").write_text("x = 1")
    assert version()["sources"] != before["sources"]


def test_a_module_of_one_file_and_one_that_is_not_there(tmp_path, monkeypatch):
    (tmp_path / "lonely_method.py").write_text("import os\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    module._top.cache_clear()
    assert set(sources("lonely_method")) == {"lonely_method"}
    assert sources("no_such_module_here") == {}
