"""Networks of the track learn to the bit the same again, also where their training was cut off."""

from __future__ import annotations

import pytest

from gibench.baselines.training.batches import batches
from tests.baselines.compositional_scene_representations import test_training as cnnr
from tests.baselines.neural_global_illumination import test_training as ngi
from tests.baselines.radiance_regression import test_training as rrf
from tests.baselines.training.cut_off import repeats_also_where_it_was_cut_off


def crops(learner):
    return batches(learner.examples, 2, 3, draw=learner._crop)


LEARNERS = {
    "ngi": (lambda: ngi.learner(lpips=False), crops),
    "rrf": (rrf.learner, lambda learner: learner.batches),
    "cnnr": (cnnr.learner, crops),
}


@pytest.mark.parametrize(("make", "drawn"), LEARNERS.values(), ids=LEARNERS)
def test_it_repeats_to_the_bit_also_where_it_was_cut_off(make, drawn, tmp_path):
    repeats_also_where_it_was_cut_off(make, drawn, tmp_path)
