import sys
from functools import partial

import pytest

from gibench.baselines import sources as module
from gibench.baselines.sources import digest, module_of, sources


def forget():
    """What was read of files that are about to change."""
    for cached in (module._top, module._read):
        cached.cache_clear()


@pytest.fixture
def package(tmp_path, monkeypatch):
    root = tmp_path / "kiln"
    (root / "parts").mkdir(parents=True)
    files = {
        "__init__.py": "from gibench.baselines.method import Method\nimport kiln.shown\n",
        "method.py": "from kiln.parts import lid\nfrom .parts.door import open_it\nimport numpy\n",
        "parts/__init__.py": "",
        "parts/lid.py": "def lid():\n    import kiln.hidden\n",
        "parts/door.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import kiln.types\n",
        "hidden.py": "from gibench.metrics.tone_map import reference_exposure\n",
        "types.py": "",
        "shown.py": "",
    }
    for name, text in files.items():
        (root / name).write_text(text)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    forget()
    yield root
    forget()


def test_what_a_module_imports_is_found_without_importing_it(package):
    names = set(sources("kiln.method"))
    own = {"kiln", "kiln.method", "kiln.parts", "kiln.parts.lid", "kiln.parts.door", "kiln.hidden"}
    assert {name for name in names if name.startswith("kiln")} == own
    assert names - own == {"gibench.metrics", "gibench.metrics.tone_map", "gibench.metrics.inputs"} | {
        "gibench.metrics.errors"
    } | ({"gibench.errors"} & names)
    assert "kiln.method" not in sys.modules


@pytest.mark.parametrize(
    ("file", "text", "counts"),
    [
        ("shown.py", "x = 1", False),  # nobody imports it but the package that the module lies in
        ("types.py", "x = 1", False),
        ("hidden.py", "x = 1", True),
        ("parts/__init__.py", "x = 1", True),
        ("parts/lid.py", '"""A lid."""\n\n# Well.\ndef lid():\n    "Off."\n    import kiln.hidden\n', False),
        ("parts/lid.py", "def lid():\n    import kiln.hidden, os\n", True),
        ("parts/lid.py", "def lid(size=2):\n    import kiln.hidden\n", True),
    ],
)
def test_an_edit_counts_where_it_can_matter(package, file, text, counts):
    before = digest("kiln.method")
    (package / file).write_text(text)
    forget()
    assert (digest("kiln.method") != before) == counts


def test_a_module_of_one_file_and_one_that_is_not_there(tmp_path, monkeypatch):
    (tmp_path / "lonely_method.py").write_text("import os\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    forget()
    assert set(sources("lonely_method")) == {"lonely_method"}
    assert sources("no_such_module_here") == {}


def test_where_a_function_is_written():
    assert module_of(digest) == "gibench.baselines.sources"
    assert module_of(partial(partial(digest, "x"))) == "gibench.baselines.sources"
    assert module_of({}.get) == ""


@pytest.mark.parametrize(
    ("maker", "decides", "does_not"),
    [
        (
            "gibench.baselines.lightmap.bake",
            ["gibench.rendering.integrator", "gibench.baselines.lightmap.texel_paths"],
            ["gibench.baselines.lightmap.deferred", "gibench.baselines.rtrt", "gibench.metrics"],
        ),
        (
            "gibench.baselines.probes.baking",
            ["gibench.datasets.exr", "gibench.baselines.probes.placement", "gibench.rendering.free_space"],
            ["gibench.baselines.probes.maps", "gibench.baselines.glossy_probe_reprojection"],
        ),
        (
            "gibench.baselines.efficient_light_probes.training",
            [
                "gibench.metrics.tone_map",
                "gibench.datasets.exr",
                "gibench.baselines.efficient_light_probes.losses",
            ],
            ["gibench.generators", "gibench.baselines.rtrt"],
        ),
    ],
)
def test_what_bakes_are_keyed_by(maker, decides, does_not):
    """The sources of their own making: what shows a lightmap may be edited without baking it again."""
    found = sources(maker)
    assert set(decides) <= set(found)
    assert not set(does_not) & set(found)
