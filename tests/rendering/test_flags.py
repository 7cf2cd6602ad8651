"""Masks of flags are those of Mitsuba, whichever variant is set."""

from __future__ import annotations

import subprocess
import sys

import mitsuba as mi
import pytest

from gibench.rendering import flags


def test_masks_are_mitsubas():
    lobes = mi.BSDFFlags
    assert lobes.DiffuseReflection == flags.DIFFUSE
    assert flags.DIFFUSE | flags.NOT_DIFFUSE == flags.ALL_LOBES == lobes.All
    assert flags.DIFFUSE & flags.NOT_DIFFUSE == 0
    for plugin, reflects, transmits, sharp in (
        ({"type": "diffuse"}, flags.DIFFUSE, False, False),
        ({"type": "roughconductor"}, flags.NOT_DIFFUSE, False, False),
        ({"type": "conductor"}, flags.NOT_DIFFUSE, False, True),
        ({"type": "dielectric"}, flags.NOT_DIFFUSE, True, True),
        ({"type": "roughdielectric"}, flags.NOT_DIFFUSE, True, False),
    ):
        found = int(mi.load_dict(plugin).flags())
        assert found & reflects
        assert bool(found & flags.TRANSMITS) == transmits
        assert bool(found & flags.SHARP) == sharp


def test_masks_are_the_same_in_every_variant():
    code = (
        "import importlib, sys, mitsuba as mi\n"
        "from gibench.rendering import flags\n"
        "mi.set_variant(sys.argv[1])\n"
        "print([getattr(flags, name) for name in sys.argv[2:]])"
    )
    names = sorted(flags.__annotations__)
    assert len(names) == 6
    found = {
        subprocess.run(
            [sys.executable, "-c", code, variant, *names], capture_output=True, text=True, timeout=120
        ).stdout
        for variant in ("scalar_rgb", "llvm_ad_rgb")
    }
    assert found == {f"{[getattr(flags, name) for name in names]}\n"}


def test_an_unknown_mask_is_an_attribute_error():
    with pytest.raises(AttributeError, match="NO_SUCH"):
        flags.NO_SUCH  # noqa: B018
