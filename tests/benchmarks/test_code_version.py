from gibench.baselines.sources import digest
from gibench.benchmarks.code_version import code_version
from gibench.benchmarks.registry import Found
from tests.benchmarks.toys import card


def test_what_names_the_code_of_a_method():
    found = Found(card("Plain", implementation="gibench.baselines.rtrt.implementation:Rtrt"), "kiln", "1.2")
    version = code_version(found)
    assert version["package"] == "kiln 1.2"
    assert version["sources"] == digest("gibench.baselines.rtrt.implementation")
    other = Found(card("Plain", implementation="gibench.baselines.lightmap.implementation:X"), "kiln", "1.2")
    assert code_version(other)["sources"] != version["sources"]
