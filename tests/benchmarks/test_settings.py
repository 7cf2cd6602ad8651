import pytest

from gibench.baselines.method import Knob, MethodError
from gibench.benchmarks.errors import TrackError
from gibench.benchmarks.settings import choices, parse_overrides
from gibench.benchmarks.track import MethodPlan
from tests.benchmarks.toys import card

TRACED = card(
    "Plain",
    id="path-traced",
    knobs=(
        Knob("spp", 2, (1, 2, 4), "paths"),
        Knob("denoise", True, (False, True), "or not"),
        Knob("filter", "box", ("none", "box", "tent"), "of pixels"),
        Knob("radius", 0.5, (0.25, 0.5), "of it"),
    ),
    budget="spp",
)


def test_every_combination_is_run_and_labelled_by_what_sets_it_apart():
    plan = MethodPlan(base={"radius": 0.25}, vary={"spp": [1, 4], "denoise": [False, True]})
    made = choices(TRACED, plan, {})
    assert [choice.label for choice in made] == [
        "path-traced spp=1",
        "path-traced spp=1 denoise",
        "path-traced spp=4",
        "path-traced spp=4 denoise",
    ]
    assert made[3].settings == {"spp": 4, "denoise": True, "filter": "box", "radius": 0.25}


def test_a_method_without_a_plan_runs_at_its_defaults():
    (only,) = choices(TRACED, MethodPlan(), {})
    assert only.label == "path-traced"
    assert only.settings == TRACED.settings()


def test_overrides_win_and_show_in_the_label():
    overrides = parse_overrides(
        ["path-traced.filter=tent,none", "path-traced.denoise=FALSE", "path-traced.radius=0.25"],
        {"path-traced": TRACED},
    )
    made = choices(TRACED, MethodPlan(vary={"denoise": [True, False]}), overrides["path-traced"])
    assert [choice.label for choice in made] == [
        "path-traced no-denoise tent radius=0.25",
        "path-traced no-denoise filter=none radius=0.25",
    ]


@pytest.mark.parametrize("text", ["path-traced.radius=.5", "path-traced.radius=5e-1", "path-traced.spp=2.0"])
def test_a_number_may_be_written_in_any_way(text):
    (values,) = parse_overrides([text], {"path-traced": TRACED})["path-traced"].values()
    assert values in ((0.5,), (2,))
    assert type(values[0]) is (int if "spp" in text else float)  # as the method has it, for keys of results


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        ("spp=4", TrackError, "'spp=4' is no setting; write METHOD.KNOB=VALUE"),
        ("path-traced.spp", TrackError, "is no setting"),
        ("path-traced.spp=", TrackError, "is no setting"),
        ("path-trace.spp=4", TrackError, "no method 'path-trace' is run; known are path-traced"),
        ("path-traced.sp=4", MethodError, "path-traced has no knob 'sp'; known: spp"),
        ("path-traced.spp=3", MethodError, "path-traced: spp = 3 is not allowed; allowed are 1, 2, 4"),
        ("path-traced.spp=True", MethodError, "spp = True is not allowed"),
    ],
)
def test_what_is_no_setting(text, error, says):
    with pytest.raises(error, match=says):
        parse_overrides([text], {"path-traced": TRACED})


def test_a_plan_with_settings_that_do_not_exist():
    with pytest.raises(MethodError, match="no knob 'samples'"):
        choices(TRACED, MethodPlan(vary={"samples": [1]}), {})
    with pytest.raises(MethodError, match="spp = 64 is not allowed"):
        choices(TRACED, MethodPlan(base={"spp": 64}), {})
