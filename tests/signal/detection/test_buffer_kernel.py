"""The compiled form for one buffer against the plain forms, which other tests hold to the literal sums."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.signal.detection import buffer_kernel as kernel
from catseye.signal.detection.buffers import has_long_run
from catseye.signal.detection.phase import detect
from catseye.signal.detection.running import running_phasor

ENDS = (-(2**15), 2**15 - 1)


def found(samples, n, *, run=0.0, leaked=0j):
    out, still = np.full(16, np.nan), np.full(8, np.nan)
    kernel.one_buffer(np.ascontiguousarray(samples), n, ENDS, run, leaked, out, still)
    return out, still


def codes(rng, n, m, style):
    """16-bit buffers of every kind that a converter makes."""
    wave = np.cos(2 * np.pi * np.arange(m * n) / n - rng.uniform(0.0, 6.3))
    level = {"strong": 2e4, "weak": 5.0, "half dark": 1e4, "overdriven": 9e4, "dark": 0.0, "steps": 2.0}[style]
    samples = level * wave + (0.0 if style == "steps" else 3.0) * rng.normal(size=m * n)
    if style == "half dark":
        samples[: (m // 2) * n] = rng.normal(0.0, 3.0, (m // 2) * n)
    return np.clip(np.rint(samples), *ENDS).astype(np.int16)


def longest_run(samples):
    """By counting: the length of the longest stretch of equal neighbours."""
    longest = row = 1
    for a, b in pairwise(samples):
        row = row + 1 if a == b else 1
        longest = max(longest, row)
    return longest


STYLES = ("strong", "weak", "half dark", "overdriven", "dark", "steps")


@settings(max_examples=150)
@given(n=st.integers(3, 64), m=st.integers(2, 17), style=st.sampled_from(STYLES), seed=st.integers(0, 10**6))
def test_it_agrees_with_the_plain_form(n, m, style, seed):
    samples = codes(np.random.default_rng(seed), n, m, style)
    out, still = found(samples, n)
    plain = detect(samples[None], n, 1.0, converter_ends=ENDS, compiled=False)
    size = float(np.abs(samples.astype(float)).max()) + 1.0
    tight = {"rtol": 0, "atol": 1e-12 * size}  # sums of up to 1100 integers of that size, rounded in another order
    np.testing.assert_allclose(complex(out[0], out[1]), plain.phasor[0], **tight)
    np.testing.assert_allclose(out[kernel.OFFSET], plain.offset[0], **tight)
    np.testing.assert_allclose(out[kernel.SECOND : kernel.SECOND + 2], np.abs(plain.overtones[0]), **tight)
    squares = {"rtol": 1e-9, "atol": 1e-11 * size**2 * m}
    np.testing.assert_allclose(out[kernel.TOTAL : kernel.TOTAL + 3], plain.scatter.total[0], **squares)
    np.testing.assert_allclose(out[kernel.BETWEEN : kernel.BETWEEN + 3], plain.scatter.between[0], **squares)
    assert out[kernel.CLIPPED] == plain.clipped[0]
    assert max(-out[kernel.LOW], out[kernel.HIGH]) == plain.largest[0]
    assert out[kernel.LONGEST] == longest_run(samples.tolist())
    assert np.isnan(still).all(), "without a run nothing is turned back"


@settings(max_examples=60)
@given(n=st.integers(3, 64), m=st.integers(2, 40), style=st.sampled_from(STYLES), seed=st.integers(0, 10**6))
def test_cycles_that_collapse_are_counted_alike(n, m, style, seed):
    samples = codes(np.random.default_rng(seed), n, m, style)
    plain = detect(samples[None], n, 1.0, compiled=False)
    assert found(samples, n)[0][kernel.DROPPED] == plain.scatter.dropped[0]


@settings(max_examples=80)
@given(
    n=st.integers(3, 64),
    m=st.integers(2, 40),
    run=st.floats(-1.5, 1.5).filter(lambda v: v != 0.0),
    leak=st.complex_numbers(max_magnitude=2e3, allow_nan=False, allow_infinity=False),
    seed=st.integers(0, 10**6),
)
def test_a_run_is_turned_back_as_the_plain_form_does(n, m, run, leak, seed):
    samples = codes(np.random.default_rng(seed), n, m, "strong")
    _, still = found(samples, n, run=run, leaked=leak)
    plain = running_phasor(samples, n, 1.0, run=run, leaked=leak)
    np.testing.assert_allclose(complex(still[0], still[1]), plain.phasor, rtol=0, atol=1e-7)
    np.testing.assert_allclose(still[2:5], plain.total, rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(still[5:8], plain.between, rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize("n", [3, 8, 64])
def test_the_ends_of_sixteen_bits_do_not_overflow(n):
    top, bottom = np.full(4 * n, ENDS[1], dtype=np.int16), np.full(4 * n, ENDS[0], dtype=np.int16)
    square = np.where(np.arange(4 * n) % n < n / 2, ENDS[0], ENDS[1]).astype(np.int16)
    for samples in (top, bottom, square):
        out, _ = found(samples, n)
        plain = detect(samples[None], n, 1.0, converter_ends=ENDS, compiled=False)
        assert out[kernel.CLIPPED] == 4 * n
        assert max(-out[kernel.LOW], out[kernel.HIGH]) == plain.largest[0]
        np.testing.assert_allclose(complex(out[0], out[1]), plain.phasor[0], rtol=0, atol=1e-8)
        np.testing.assert_allclose(out[kernel.OFFSET], samples.astype(float).mean(), rtol=0, atol=1e-8)


@pytest.mark.parametrize("where", [0, 5, 95])
def test_one_sample_at_an_end_is_clipped_wherever_it_is(where):
    samples = codes(np.random.default_rng(3), 16, 6, "strong")
    samples[where] = ENDS[where % 2]
    assert found(samples, 16)[0][kernel.CLIPPED] == 1


@pytest.mark.parametrize(("first", "length"), [(0, 9), (40, 12), (87, 9), (0, 96)])
def test_a_stuck_converter_is_seen_wherever_it_sticks(first, length):
    samples = codes(np.random.default_rng(3), 16, 6, "strong")
    samples[first : first + length] = 1234
    longest = found(samples, 16)[0][kernel.LONGEST]
    assert longest >= length
    for run in (length, int(longest), int(longest) + 1):
        assert bool(has_long_run(samples[None], run)[0]) == (longest >= run)
