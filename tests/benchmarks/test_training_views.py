"""Training views are charged when they are handed out, whatever process reads them."""

import pytest
from torch.utils.data import DataLoader, Dataset

from gibench.benchmarks.scenes import training_views


@pytest.fixture
def views(made):
    found = training_views(made[0] / "scenes" / "training", 0)
    assert len(found) == 2
    assert found.handed_out == []
    assert found.seconds == 0
    return found


def test_a_view_is_charged_when_it_is_taken(views):
    seconds = [frame.row["seconds"] for frame in views._dataset]
    assert min(seconds) > 0
    assert views[-1].room == 0
    assert views.handed_out == [1]
    assert views.seconds == pytest.approx(seconds[1])
    assert [frame["color"].shape for frame in views] == [(14, 20, 3)] * 2
    assert views.seconds == pytest.approx(sum(seconds))
    with pytest.raises(IndexError):
        views[2]


def test_some_of_them(views):
    assert len(views[1:]) == 1
    assert views.handed_out == [1]


class Mine(Dataset):
    """What a method may write."""

    def __init__(self, views):
        self.views = views

    def __len__(self):
        return len(self.views)

    def __getitem__(self, index):
        return self.views[index]["color"]


@pytest.mark.parametrize("start", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_workers_of_a_data_loader_are_charged(views, start):
    read = list(DataLoader(Mine(views), num_workers=1, multiprocessing_context=start, batch_size=None))
    assert len(read) == 2
    assert views.handed_out == [0, 1]


@pytest.mark.parametrize("workers", [0, 2])
def test_tensors_are_charged(views, workers):
    read = list(DataLoader(views.torch(["color"]), num_workers=workers, batch_size=None))
    assert [item["color"].shape for item in read] == [(3, 14, 20)] * 2
    assert views.handed_out == [0, 1]


def test_a_run_without_views():
    nothing = training_views(None, 0)
    assert list(nothing) == []
    assert nothing.seconds == 0
    with pytest.raises(IndexError):
        nothing[0]
