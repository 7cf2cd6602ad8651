"""A training whose process is killed goes on from its checkpoint, and is charged for what it took before."""

import pytest

from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.running import run
from tests.benchmarks.conftest import order
from tests.benchmarks.mortal import KILLED_AT, MORTAL, PAUSE, STEPS


def test_it_goes_on_and_pays_for_all_of_it(scenes_only):
    torch = pytest.importorskip("torch")
    from gibench.baselines.training import artifacts
    from gibench.baselines.training.budget import Budget
    from gibench.baselines.training.loop import train
    from tests.baselines.training.toys import Fit, points

    folder = RunFolder(scenes_only)
    report = run(scenes_only, order(MORTAL))
    (killed,) = (folder.read_result(id) for id in report.failed)
    assert "its process was killed by SIGKILL" in killed["reason"]
    (checkpoint,) = folder.bakes("room-000000").glob("*.checkpoint")
    assert checkpoint.is_file()

    report = run(scenes_only, order(MORTAL, retry_failed=True))
    assert (report.made, report.failed) == (1, ())
    (result,) = (folder.read_result(id) for id in report.ids)
    assert not checkpoint.exists()
    (weights,) = folder.bakes("room-000000").glob("training-*")
    trained, facts = artifacts.kept(weights)
    assert facts["steps_before"] == KILLED_AT
    # Nothing that was learned before is lost: the weights are those of a training that ran through.
    whole = train(Fit(), points(), Budget(steps=STEPS, look_every=4), seed=3)
    assert all(torch.equal(tensor, trained["fit"][name]) for name, tensor in whole.weights["fit"].items())
    # All steps are charged for, though the process that made the last ones took those alone.
    paid = result["prepare"]
    assert paid["training"] >= STEPS * PAUSE
    assert paid["seconds"] - paid["references"] - paid["wall_seconds"] >= KILLED_AT * PAUSE - 1e-6
    assert [look[0]["step"] for look in result["prepare"]["curves"]] == [0]
