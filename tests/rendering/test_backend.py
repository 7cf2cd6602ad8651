"""Choice of variant and LLVM library, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from gibench.rendering import backend


def run(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**{k: v for k, v in os.environ.items() if k != backend.LLVM_VARIABLE}, **environment},
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_importing_the_package_loads_no_renderer():
    code = "import sys, gibench, gibench.rendering.render; print({'mitsuba', 'drjit', 'torch'} & set(sys.modules))"
    assert run(code).stdout.strip() == "set()"


def test_the_packaged_llvm_is_taken():
    library = json.loads(
        run(
            "import json; from gibench.rendering.backend import *; from dataclasses import asdict;"
            "print(json.dumps(asdict(find_llvm())))"
        ).stdout
    )
    assert library["origin"] == "package"
    assert backend._major(library["version"]) >= backend.MINIMUM_LLVM


def test_the_users_choice_wins(tmp_path):
    chosen = str(tmp_path / "libLLVM-21.so")
    code = "from gibench.rendering.backend import *; print(find_llvm().path, find_llvm().origin, find_llvm().version)"
    assert run(code, **{backend.LLVM_VARIABLE: chosen}).stdout.split() == [chosen, "environment", "21"]


def test_an_old_system_library_is_reported_and_never_loaded(monkeypatch):
    monkeypatch.delenv(backend.LLVM_VARIABLE, raising=False)
    monkeypatch.setattr(backend, "packaged_llvm", lambda: None)
    monkeypatch.setattr(backend, "_system_llvm", lambda: ["/usr/lib/x86_64-linux-gnu/libLLVM-14.so.1"])
    monkeypatch.setattr(backend, "find_llvm", backend.find_llvm.__wrapped__)
    assert backend.find_llvm().version == "14"
    assert not backend.find_llvm().usable
    reason = backend._prepare("llvm_ad_rgb")
    assert "version 14" in reason
    assert "pip install karellen-llvm-core" in reason
    assert backend.LLVM_VARIABLE not in os.environ


def test_importing_gibench_names_the_llvm_that_dr_jit_will_load():
    """So modules that import Mitsuba at their top may be imported before a variant is selected."""
    result = run(
        "import gibench, drjit as dr, mitsuba as mi\n"
        "from gibench.rendering.integrator import trace_paths\n"
        "from gibench.rendering.backend import select_variant; select_variant('llvm_ad_rgb')\n"
        "print(dr.sum(dr.maximum(dr.arange(mi.Float, 10), 5))[0])"
    )
    assert result.stdout.split() == ["60.0"], result.stderr


def test_unknown_variant_names_the_choices():
    with pytest.raises(backend.BackendError, match="llvm_ad_rgb"):
        backend.select_variant("llvm_spectral")


def test_a_variant_that_cannot_run_says_why():
    if backend.find_gpu() is not None:
        pytest.skip("there is a GPU")
    result = run("from gibench.rendering.backend import *; select_variant('cuda_ad_rgb')")
    assert "BackendError: cuda_ad_rgb: no CUDA device was found" in result.stderr


def test_scalar_is_taken_with_a_warning_where_nothing_else_runs():
    result = run(
        "import logging, os; logging.basicConfig(); from gibench.rendering import backend as b;"
        "del os.environ[b.LLVM_VARIABLE]; b.packaged_llvm = lambda: None;"
        "b._system_llvm = lambda: []; print(b.select_variant())"
    )
    assert result.stdout.strip() == "scalar_rgb" or backend.find_gpu()
    assert "pip install karellen-llvm-core" in result.stderr or backend.find_gpu()


def test_scalar_renders_the_same_radiance():
    """The fallback is slow but right: same means, same surfaces."""
    code = """
import numpy as np
from gibench.rendering.backend import select_variant
select_variant("{variant}")
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.rendering import scenes
frame = render_frame(load_dict(scenes.box("coat")), scenes.CAMERA, resolution=(8, 8), spp={spp}, max_depth=3,
                     channels=["radiance", "surface", "reflection"], denoise={denoise})
a = frame.arrays
sums = [float(a[n].astype(float).mean()) for n in ("direct_diffuse", "indirect_diffuse", "direct_specular")]
error = float(np.sqrt(np.square(a["color_se"].astype(float)).sum()) / a["color"].size)
print(*sums, error, float(a["position"].sum()), float(a["reflected_distance"].sum()), a["shape_id"].sum())
"""
    scalar = run(code.format(variant="scalar_rgb", spp=16, denoise=True))
    wide = run(code.format(variant="llvm_ad_rgb", spp=256, denoise=False))
    assert not scalar.returncode, scalar.stderr
    a, b = (list(map(float, r.stdout.split())) for r in (scalar, wide))
    assert a[:2] == pytest.approx(b[:2], rel=0.1)
    assert a[4:] == pytest.approx(b[4:], rel=1e-3)


def test_describe_says_what_there_is():
    found = backend.describe()
    assert found["variant"] in backend.VARIANTS
    assert found["denoiser"] == found["versions"]["mitsuba-oidn"]
    assert json.loads(json.dumps(found)) == found


def test_an_old_llvm_that_mitsuba_loaded_first_is_named_before_it_aborts():
    """Whatever this machine has: the right answer, or an error that names the way out; never a signal."""
    result = run(
        "import mitsuba as mi; mi.set_variant('llvm_ad_rgb')\n"
        "from gibench.rendering.backend import select_variant; select_variant()\n"
        "import drjit as dr; print(dr.sum(dr.maximum(dr.arange(mi.Float, 10), 5))[0])"
    )
    if result.returncode == 0:
        assert result.stdout.split() == ["60.0"]
    else:
        assert result.returncode == 1
        assert "select_variant() instead of" in result.stderr or "LLVM" in result.stderr
