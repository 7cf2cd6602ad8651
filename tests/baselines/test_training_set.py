"""Training views are charged when they are handed out, whatever process reads them."""

from pathlib import Path

import pytest
from torch.utils.data import DataLoader, Dataset

from gibench.baselines.bakes import BakeCache
from gibench.baselines.training_set import training_set
from gibench.datasets.making import make
from gibench.datasets.recipes import check_recipe


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    """A dataset of two frames."""
    root = tmp_path_factory.mktemp("training") / "views"
    recipe = check_recipe(
        {"rooms": 1, "seed": 4, "kinds": ["living"], "views": 2, "resolution": [20, 14], "spp": 2}
    )
    make(root, recipe)
    return root


@pytest.fixture
def views(dataset):
    found = training_set(dataset, 0)
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
    nothing = training_set(None, 0)
    assert list(nothing) == []
    assert nothing.seconds == 0
    with pytest.raises(IndexError):
        nothing[0]


def test_asking_for_the_hash_costs_nothing_and_tells_sets_apart(dataset, views):
    assert views.sha256 == training_set(dataset).sha256
    assert views.sha256 != training_set(dataset, 1).sha256
    assert views.rooms == (0,)
    assert len(views.frames) == 2
    assert views.handed_out == []


def test_some_frames_as_tensors(views):
    items = views.torch(["albedo"], [1])
    assert len(items) == 1
    assert views.handed_out == []
    assert items[0]["albedo"].shape == (3, 14, 20)
    assert views.handed_out == [1]


def test_who_finds_weights_pays_for_the_views_that_they_were_trained_on(dataset, views, tmp_path):
    def learn(folder):
        views[1]
        (folder / "weights").write_text("1")

    views[0]
    BakeCache(tmp_path, "scene", {}, views).get("training", {}, learn)
    assert views.handed_out == [0, 1]

    later = training_set(dataset, 0)
    BakeCache(tmp_path, "scene", {}, later).get("training", {}, learn)
    assert later.handed_out == [1]
