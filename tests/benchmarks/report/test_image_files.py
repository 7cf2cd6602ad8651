import base64
import json
import zlib

import numpy as np
import pytest

from gibench.benchmarks.report.image_files import LARGEST, decode, encode, image_name, pack, write_images
from gibench.metrics import flip, tone_map


def unpack(text, height, width, channels):
    """The other direction, pixel by pixel and plane by plane, as the page does it."""
    content = zlib.decompress(base64.b64decode(text))
    total = height * width * channels
    large = iter(np.frombuffer(content[total:], "<u2"))
    planes = np.zeros((channels, height, width), int)
    stream = iter(content[:total])
    for plane in planes:
        for y in range(height):
            for x in range(width):
                coded = next(stream)
                if coded == 255:
                    coded = int(next(large))
                rest = -((coded + 1) // 2) if coded % 2 else coded // 2
                if x and y:
                    a, b, c = plane[y, x - 1], plane[y - 1, x], plane[y - 1, x - 1]
                    guess = min(a, b) if c >= max(a, b) else max(a, b) if c <= min(a, b) else a + b - c
                else:
                    guess = plane[y, x - 1] if x else plane[y - 1, x] if y else 0
                plane[y, x] = guess + rest
    assert next(large, None) is None
    if channels == 3:
        planes[[0, 2]] += planes[1]
    return np.moveaxis(planes, 0, 2)


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 7, 3), (7, 1, 3), (9, 13, 3), (9, 13, 1)])
@pytest.mark.parametrize("kind", ["noise", "smooth", "extremes"])
def test_what_is_packed_comes_back(shape, kind):
    rng = np.random.default_rng(3)
    codes = {
        "noise": rng.integers(0, LARGEST + 1, shape),
        "smooth": np.broadcast_to(np.arange(shape[1])[None, :, None] * 3, shape),
        "extremes": rng.choice([0, LARGEST], shape),
    }[kind]
    np.testing.assert_array_equal(unpack(pack(codes), *shape), codes)


def test_radiance_comes_back_as_fine_as_an_eye_sees():
    exposed = np.concatenate([[0.0], np.geomspace(1e-6, 4e4, 4001)])
    back = decode(encode(exposed))
    assert back[0] == 0
    seen = exposed >= 0.004
    assert (np.abs(back - exposed)[seen] <= 0.011 * exposed[seen]).all()
    # Below it steps stay under a tenth of an 8-bit display's darkest step at the exposure of the path.
    assert np.abs(back - exposed)[~seen].max() < 0.1 * 1 / 255 / 12.92 * 2
    assert encode(np.array([1e30, np.float32(3e38)])).tolist() == [LARGEST, LARGEST]


def test_smooth_images_are_much_smaller_than_noise():
    y, x = np.mgrid[0:90, 0:160] / 90
    smooth = encode((0.2 + 0.1 * x + 0.3 * y)[..., None] * np.array([1, 0.8, 0.6]))
    noise = np.random.default_rng(0).integers(0, LARGEST, smooth.shape)
    assert len(pack(smooth)) < 0.35 * len(pack(noise))


def test_files_hold_the_image_its_reference_and_the_flip_map(run, page_file):
    root = page_file.parent
    done = run.frames.iloc[-1]
    _, scene = run.of[done.result]
    exposure = run.exposure(scene, 0)
    reference = run.reference(scene, done.frame, done.part)
    image = run.prediction(done.result, done.frame, done.part)
    expected = {
        image_name("images", scene, done.frame, done.part): encode(reference * exposure),
        image_name("images", done.result, done.frame, done.part): encode(image * exposure),
        image_name("errors", done.result, done.frame, done.part): np.rint(
            255 * flip(tone_map(image, exposure), tone_map(reference, exposure), map=True)
        )[..., None],
    }
    for name, codes in expected.items():
        text = (root / name).read_text()
        assert text.startswith("gibenchImage(")
        assert text.endswith(");\n")
        called, width, height, channels, packed = json.loads(f"[{text[len('gibenchImage(') : -3]}]")
        assert called == name
        assert (height, width, channels) == codes.shape
        np.testing.assert_array_equal(unpack(packed, *codes.shape), codes)


def test_there_is_a_file_for_every_scored_frame_and_nothing_half_written(run, page_file):
    scored = run.frames[["result", "frame", "part"]].drop_duplicates()
    for row in scored.itertuples():
        for kind in ("images", "errors"):
            assert (page_file.parent / image_name(kind, row.result, row.frame, row.part)).is_file()
    assert not list(page_file.parent.rglob("*.partial"))


def test_a_prediction_that_cannot_be_read_ends_the_report(run, tmp_path, monkeypatch):
    def broken(*arguments):
        raise OSError("truncated")

    monkeypatch.setattr(run, "prediction", broken)
    with pytest.raises(OSError, match="truncated"):
        write_images(run, run.results[run.results["status"] == "ok"], tmp_path)
