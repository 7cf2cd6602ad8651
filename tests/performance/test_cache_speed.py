"""How much faster frames are read from the cache than from OpenEXR files."""

import time

import pytest

from gibench.datasets import load_preset, open_dataset
from gibench.datasets.cache import cache_bytes, make_cache
from gibench.datasets.making import make
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance

NAMES = ("direct_diffuse", "indirect_diffuse", "albedo", "position", "normal", "depth")
"""What a network of `unseen-rooms` reads of a frame."""

WINDOW = (20, 30, 64, 64)


def test_reading(tmp_path):
    torch = pytest.importorskip("torch")
    torch.set_num_threads(1)  # as in the workers of a DataLoader
    root = tmp_path / "d"
    make(root, load_preset("small", {"rooms": 1, "views": 6, "resolution": (192, 128), "spp": 16}))
    dataset = open_dataset(root)
    files = dataset.torch(NAMES)
    make_cache(root, NAMES)
    cached = dataset.torch(NAMES)

    def reader(items, window=None):
        def read():
            # Each frame is dropped, as a training drops it: new pages for all of them take longer than the reading.
            for number in range(len(items)):
                items.read(number, window)

        return read

    readers = [reader(files), reader(cached), reader(cached, WINDOW)]
    each = [1000 * taken / len(dataset) for taken in seconds(*readers)]
    processor = [1000 * taken / len(dataset) for taken in seconds(*readers, clock=time.process_time)]
    print(
        f"\n192x128, {len(NAMES)} of {len(dataset[0].channels)} channels: OpenEXR {each[0]:.2f} ms a frame, cache "
        f"{each[1]:.2f} ms: {each[0] / each[1]:.0f} x (reach 20); a window of 64x64 {each[2]:.2f} ms; "
        f"{cache_bytes(dataset, NAMES) / len(dataset) / 1e6:.2f} MB a frame; processor time "
        + ", ".join(f"{one:.2f}" for one in processor)
        + f" ms: {processor[0] / processor[1]:.0f} x"
    )
    assert processor[0] > 20 * processor[1]
