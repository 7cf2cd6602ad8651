"""The channel contract."""

import pytest

from gibench.rendering import channels


def test_sets_hold_what_the_contract_says():
    assert channels.SETS["radiance"] == ("color", *channels.PARTS, "color_se")
    assert set(channels.SETS) == {
        "radiance",
        "samples",
        "surface",
        "reflection",
        "curvature",
        "motion",
        "lighting",
    }
    assert sum(len(names) for names in channels.SETS.values()) == len(channels.CHANNELS)


def test_resolve_keeps_the_order_of_the_contract():
    assert channels.resolve(["depth", "color", "depth"]) == ("color", "depth")
    assert channels.resolve(["motion", "albedo"]) == ("albedo", "motion", "motion_valid")


def test_unknown_names_get_the_nearest():
    with pytest.raises(channels.UnknownChannelError, match="albedo") as error:
        channels.resolve(["albdo"])
    assert str(error.value).startswith("unknown channel or set 'albdo'")
