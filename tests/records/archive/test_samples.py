"""Frames of samples: exact, by single rows too, and damage is named."""

import numpy as np
import pytest

from archive_scene import flip
from catseye.errors import InputError
from catseye.gateways.archive.samples import write_samples
from catseye.records.archive.samples import SHOTS, SampleFrame

ROWS, WIDTH = 2 * SHOTS + 20, 600


def noisy(seed=1):
    """Rows of two settings: 50 samples a cycle, and 7, of which 85 cycles do not fill the row."""
    rng = np.random.default_rng(seed)
    periods = np.where(np.arange(ROWS) % 3 == 0, 7, 50)
    phase = np.arange(WIDTH) / periods[:, None]
    samples = np.rint(15000 * np.sin(2 * np.pi * phase) + rng.normal(0, 50, (ROWS, WIDTH))).astype(np.int16)
    return samples, periods, WIDTH // periods


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    path = tmp_path_factory.mktemp("samples") / "x.b2frame"
    write_samples(path, *noisy())
    return path


def test_all_rows_come_back(frame):
    assert np.array_equal(np.concatenate(list(SampleFrame.open(frame).blocks())), noisy()[0])


def test_single_rows_come_back_in_the_order_asked_for(frame):
    wanted = [ROWS - 1, 0, SHOTS, SHOTS - 1, 0]
    assert np.array_equal(SampleFrame.open(frame).rows(wanted), noisy()[0][wanted])
    assert SampleFrame.open(frame).rows([]).shape == (0, WIDTH)


@pytest.mark.parametrize("row", [-1, ROWS])
def test_a_row_that_is_not_there_is_refused(frame, row):
    with pytest.raises(InputError, match=rf"row {row} is unknown \(expected 0 to {ROWS - 1}\)"):
        SampleFrame.open(frame).rows([0, row])


def test_a_frame_is_smaller_than_its_samples_by_what_noise_allows(frame):
    """Noise of 50 codes has 7.7 bits of 16: 0.48; means and packing add to it."""
    assert 0.48 < frame.stat().st_size / noisy()[0].nbytes < 0.60


def test_equal_samples_give_equal_bytes(frame, tmp_path):
    write_samples(tmp_path / "again", *noisy())
    assert (tmp_path / "again").read_bytes() == frame.read_bytes()


def test_samples_that_no_cycle_explains_come_back(tmp_path):
    samples = np.random.default_rng(2).integers(-32768, 32768, (3, 1000), dtype=np.int16)
    write_samples(tmp_path / "x", samples, np.full(3, 64), np.full(3, 15))
    assert np.array_equal(SampleFrame.open(tmp_path / "x").rows(range(3)), samples)


def test_a_flipped_bit_among_the_samples_is_named(tmp_path, frame):
    """Head and end of a frame have no checksum: the index has one of the whole file, see `sample_frame`."""
    path, good = tmp_path / "x.b2frame", frame.read_bytes()
    rng, wanted, named = np.random.default_rng(3), noisy()[0], 0
    for _ in range(60):
        path.write_bytes(good)
        flip(path, int(rng.integers(200, len(good) - 2000)), int(rng.integers(8)))
        samples, problem = samples_or_refusal(path)
        assert samples is None or np.array_equal(samples, wanted)
        assert samples is not None or str(path) in problem
        named += samples is None
    assert named > 50


def samples_or_refusal(path):
    try:
        return np.concatenate(list(SampleFrame.open(path).blocks())), ""
    except InputError as problem:
        return None, str(problem)
