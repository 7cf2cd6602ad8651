import numpy as np
import pytest

from gibench.generators.grid_solid import box
from gibench.generators.visibility import RayCaster


def test_distances_and_owners():
    caster = RayCaster([box((1, -1, -1), (2, 1, 1)), box((-9, -9, -9), (-8, 9, 9))], [4, 7])
    distance, owner = caster.cast(np.zeros((3, 3)), np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, 1]]))
    assert distance[0] == pytest.approx(1.0)
    assert distance[1] == pytest.approx(8.0)
    assert np.isinf(distance[2])
    assert owner.tolist() == [4, 7, -1]


def test_one_owner_may_have_many_meshes():
    meshes = [box((k, 0.1 * k, 0), (k + 0.5, 0.1 * k + 0.05, 1)) for k in range(5)]
    caster = RayCaster(meshes, [0, 1, 0, 1, 2])
    origins = np.array([[k + 0.25, -1.0, 0.5] for k in range(5)])
    distance, owner = caster.cast(origins, np.tile([0.0, 1.0, 0.0], (5, 1)))
    assert owner.tolist() == [0, 1, 0, 1, 2]
    np.testing.assert_allclose(distance, 1.0 + 0.1 * np.arange(5), atol=1e-5)
