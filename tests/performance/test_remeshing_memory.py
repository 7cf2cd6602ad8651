"""An even mesh of a part of two million triangles: how long it takes, and what memory beside the part itself."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.performance

BOUND = 250.0
"""10⁶ bytes beside a part, however many triangles it has."""

SCRIPT = """
import sys, time
import numpy as np
import pymeshlab, trimesh
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.vertex_features.remeshing import even_mesh
from gibench.benchmarks.memory import peak_mb, reset_peak

side = int(sys.argv[1])
along = np.linspace(-5, 5, side + 1)
x, y = np.meshgrid(along, along, indexing="ij")
vertices = np.stack([x.ravel(), y.ravel(), 0.02 * np.sin(3 * x.ravel())], axis=1)
corner = np.arange(side * (side + 1)).reshape(side, side + 1)[:, :-1].ravel()
quads = np.stack([corner, corner + side + 1, corner + side + 2, corner + 1], axis=1)
part = trimesh.Trimesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), process=False)
del x, y, vertices, corner, quads
even_mesh([trimesh.creation.box()], Box((-6, -6, -1), (12, 12, 2)), 0.1)  # the tool has loaded what it needs
reset_peak()
before, began = peak_mb(), time.process_time()
mesh = even_mesh([part], Box((-6, -6, -1), (float(sys.argv[2]), 12, 2)), 0.1)
seconds, peak = time.process_time() - began, peak_mb() - before
a, b, c = np.moveaxis(mesh.vertices[mesh.triangles].astype(np.float64), 1, 0)
print("FOUND", seconds, peak, len(mesh.vertices), np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
"""


@pytest.mark.parametrize("across", [12, 6.3], ids=["all in the box", "cut in two"])
def test_two_million_triangles_take_bounded_memory(across):
    for side in (300, 1000):
        asked = [sys.executable, "-c", SCRIPT, str(side), str(across)]
        done = subprocess.run(asked, capture_output=True, text=True, check=True, timeout=3000)
        seconds, peak, vertices, area = (float(word) for word in done.stdout.split("FOUND")[1].split())
        print(
            f"\n{2e-6 * side**2:.2f} million triangles: {seconds:.1f} s of processor time, {peak:.0f} MB at the peak "
            f"beside the part, {vertices:.0f} vertices"
        )
        assert peak < BOUND
        # Waves of a slope of .06 are .09 % larger than what they lie on.
        assert area == pytest.approx(min(10.0, across - 1.0) * 10.0, rel=0.02)
