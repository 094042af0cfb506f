"""A stream of interleaved channels is the batch, however it is cut."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.signal.detection.channels import ChannelStream, interleaved_phasors, joined
from catseye.signal.detection.phase import detect, phasors

NAMES = ("phasor", "u_phasor", "offset", "overtones", "noise", "largest", "clipped", "u_phase", "u_amplitude")


def assert_same(one, other):
    for name in NAMES:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-9, err_msg=name)
    np.testing.assert_array_equal(one.scatter.dropped, other.scatter.dropped)


@given(
    st.integers(1, 5),
    st.integers(3, 12),
    st.integers(1, 20),
    st.lists(st.integers(0, 400), max_size=8),
    st.sampled_from([np.int16, np.int32, np.float64]),
)
def test_a_stream_equals_the_batch_for_any_chunks(channels, n, cycles, cuts, dtype):
    total = 400
    samples = np.random.default_rng(channels).integers(-30_000, 30_000, size=(total, channels)).astype(dtype)
    stream = ChannelStream(channels, n, cycles, 1e-3)
    parts = [stream.feed(chunk) for chunk in np.split(samples, sorted(cuts))]
    size = n * cycles
    whole = total // size
    batch = detect(samples[: whole * size].reshape(whole, size, channels).transpose(0, 2, 1), n, 1e-3)
    found = joined(parts)
    assert found.phasor.shape == (whole, channels)
    assert stream.waiting == total - whole * size
    assert_same(found, batch)


def test_channels_do_not_talk_to_each_other():
    j = np.arange(640)
    samples = np.stack([a * np.cos(2 * np.pi * j / 64 - p) for a, p in ((1.0, 0.1), (1e-6, 2.0), (300.0, 5.0))], axis=1)
    samples[3, 2] = np.nan
    found = ChannelStream(3, 64, 5).feed(samples)
    np.testing.assert_allclose(found.amplitude[:, :2], [[1.0, 1e-6]] * 2, rtol=1e-9)
    np.testing.assert_allclose(found.phase[:, :2], [[0.1, 2.0]] * 2, rtol=1e-9)
    assert np.isnan(found.phasor[:, 2]).tolist() == [True, False]


def test_a_long_chunk_needs_little_memory():
    samples = np.zeros((1_000_000, 4), dtype=np.int16)
    stream = ChannelStream(4, 64, 128)
    tracemalloc.start()
    try:
        found = stream.feed(samples)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.phasor.shape == (122, 4)
    assert stream.waiting == 1_000_000 - 122 * 8192
    assert peak < 20e6  # bytes: a million samples at a time; as floats the chunk would take 32e6


def test_the_ends_of_the_converter_reach_the_channels():
    samples = np.zeros((16, 2), dtype=np.int16)
    samples[3, 1] = 2047
    found = ChannelStream(2, 8, 2, converter_ends=(-2048, 2047)).feed(samples)
    assert found.clipped.tolist() == [[0, 1]]


@pytest.mark.parametrize(
    ("chunk", "text"),
    [
        (np.zeros((3, 3)), "a chunk of shape (3, 3) is not (time, 2 channels)"),
        (np.zeros(4), "a chunk of shape (4,) is not (time, 2 channels)"),
        (np.zeros((3, 2), dtype=complex), "samples are of type complex128"),
        (np.zeros((3, 2), dtype=np.int16), "a chunk of int16 follows float64: one stream has one type"),
    ],
)
def test_a_chunk_that_does_not_fit_is_refused_and_changes_nothing(chunk, text):
    stream = ChannelStream(2, 8, 1)
    wave = np.cos(2 * np.pi * np.arange(8) / 8)[:, None] * np.ones(2)
    stream.feed(wave[:5])
    with pytest.raises(ValidityError) as caught:
        stream.feed(chunk)
    assert text in str(caught.value)
    np.testing.assert_allclose(stream.feed(wave[5:]).amplitude, [[1.0, 1.0]], rtol=1e-12)


@pytest.mark.parametrize("arguments", [(0, 8, 1), (2, 2, 1), (2, 8, 0), (2, 8, 1, -1.0)])
def test_a_stream_without_buffers_is_refused(arguments):
    with pytest.raises(ValidityError):
        ChannelStream(*arguments)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize(("channels", "n", "cycles"), [(1, 64, 4), (2, 16, 33), (3, 5, 7), (5, 64, 1)])
def test_channels_folded_where_they_lie_are_those_taken_apart(compiled, channels, n, cycles):
    rng = np.random.default_rng(channels)
    samples = rng.integers(-32768, 32768, (2, 3, cycles * n, channels)).astype(np.int16)
    apart = phasors(np.ascontiguousarray(np.moveaxis(samples, -1, 2)), n, 0.001)
    assert interleaved_phasors(samples, n, 0.001, compiled=compiled) == pytest.approx(apart, abs=1e-11)


def test_interleaved_samples_that_do_not_fit_are_refused():
    with pytest.raises(ValidityError, match="not a whole number of cycles"):
        interleaved_phasors(np.zeros((63, 2)), 64)
    with pytest.raises(ValidityError, match=r"not \(\.\.\., time, channels\)"):
        interleaved_phasors(np.zeros(64), 64)
    with pytest.raises(ValidityError, match="native int16"):
        interleaved_phasors(np.zeros((64, 2)), 64, compiled=True)
