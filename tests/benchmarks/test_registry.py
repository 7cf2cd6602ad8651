import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from gibench.baselines.method import Variant
from gibench.benchmarks.errors import RegistryError
from gibench.benchmarks.registry import GROUP, registry_of
from gibench.benchmarks.settings import choices
from gibench.benchmarks.track import MethodPlan
from tests.benchmarks import toys

METHOD = toys.card("Constant")
ALIAS = toys.card("Plain", id="constant")
NO_CARD = "a string"


def point(name: str, value: str, package: str = "", version: str = "1.0") -> EntryPoint:
    found = EntryPoint(name, value, GROUP)
    if package:
        distribution = type("Distribution", (), {"name": package, "version": version})()
        vars(found)["dist"] = distribution
    return found


HERE = "tests.benchmarks.test_registry"


def test_a_method_is_found_with_its_package():
    registry = registry_of([point("constant", f"{HERE}:METHOD", "mine", "2.1")])
    found = registry.get("constant")
    assert found.method is METHOD
    assert (found.package, found.version) == ("mine", "2.1")
    assert registry.on_track("walkthrough") == [found]
    assert registry.on_track("relight") == []


def test_an_unknown_method_is_answered_with_the_nearest():
    registry = registry_of([point("constant", f"{HERE}:METHOD")])
    with pytest.raises(RegistryError, match=r"no method 'constnat'; did you mean 'constant'\?"):
        registry.get("constnat")
    with pytest.raises(RegistryError, match="no method 'xyz'; known are constant"):
        registry.get("xyz")
    with pytest.raises(RegistryError, match="known are none: is gibench installed"):
        registry_of([]).get("constant")


def test_two_packages_that_claim_one_id_are_both_named():
    registry = registry_of(
        [point("constant", f"{HERE}:METHOD", "mine"), point("another", f"{HERE}:ALIAS", "yours", "3")]
    )
    for ask in (lambda: registry.get("constant"), lambda: registry.on_track("walkthrough")):
        with pytest.raises(
            RegistryError, match=r"'constant' is claimed by mine 1.0 and yours 3: uninstall one"
        ):
            ask()


def test_what_does_not_load_is_named_and_breaks_nothing():
    registry = registry_of(
        [
            point("constant", f"{HERE}:METHOD"),
            point("gone", "no.such.module:METHOD", "broken"),
            point("lacking", f"{HERE}:NOTHING", "broken"),
            point("text", f"{HERE}:NO_CARD", "broken"),
        ]
    )
    assert set(registry.methods) == {"constant"}
    said = [str(broken) for broken in registry.broken]
    assert (
        "entry point 'gone' of package broken cannot be used: no.such.module:METHOD raises Module" in said[0]
    )
    assert "AttributeError" in said[1]
    assert "is no gibench.baselines.method.Method" in said[2]
    with pytest.raises(RegistryError, match=r"entry point 'gone'.*mend or uninstall that package"):
        registry.get("gone")


def test_listing_loads_neither_torch_nor_mitsuba():
    code = (
        "import sys; from gibench.cli import run; from gibench.cli.app import app; run(app, ['bench', 'list']);"
        "print('heavy:', sorted({'mitsuba', 'drjit', 'torch', 'lpips', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.splitlines()[-1] == "heavy: []", done.stdout + done.stderr
    assert "track walkthrough" in done.stdout


WITH_VARIANTS = toys.card(
    "Styled", knobs=(toys.STYLE, toys.SHADE), variants=(Variant("fancy", {"style": "fancy"}),)
)
WRONG_VARIANT = toys.card(
    "Constant", id="wrong", knobs=(toys.STYLE,), variants=(Variant("x", {"style": "odd"}),)
)


def test_variants_are_methods_with_other_defaults():
    registry = registry_of([point("styled", f"{HERE}:WITH_VARIANTS", "mine")])
    assert [found.method.id for found in registry.on_track("walkthrough")] == ["styled", "styled:fancy"]
    variant = registry.get("styled:fancy").method
    assert variant.settings() == {"style": "fancy", "shade": 1.0}
    assert variant.title == f"{WITH_VARIANTS.title} (fancy)"
    assert variant.implementation == WITH_VARIANTS.implementation
    assert registry.get("styled:fancy").package == "mine"
    assert choices(variant, MethodPlan(), {})[0].label == "styled:fancy"


def test_a_variant_of_no_setting_is_named():
    registry = registry_of([point("wrong", f"{HERE}:WRONG_VARIANT", "mine")])
    assert "wrong" not in registry.methods
    with pytest.raises(RegistryError, match="style = 'odd' is not allowed"):
        registry.get("wrong")
