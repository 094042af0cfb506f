"""The compiled form for one buffer: against the plain forms, and a running return against its definition."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from catseye.signal.detection import buffer_kernel as kernel
from catseye.signal.detection.buffers import has_long_run
from catseye.signal.detection.cycle_scatter import moments
from catseye.signal.detection.phase import detect

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


PHASES = st.floats(-np.pi, np.pi)
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
def test_a_run_is_turned_back_cycle_by_cycle(n, m, run, leak, seed):
    """Cosine and sine of each cycle by least squares of waves that run as the phase does."""
    samples = codes(np.random.default_rng(seed), n, m, "strong")
    _, still = found(samples, n, run=run, leaked=leak)
    cycles = detect(samples.reshape(m, n), n, 1.0, compiled=False).phasor - leak
    within = np.arange(n) / n
    turned = 2 * np.pi * within - run * (within - 0.5 * (n - 1) / n)
    waves = detect(np.stack([np.cos(turned), np.sin(turned)]), n, 1.0, compiled=False).phasor  # as a cycle shows them
    a, b = np.linalg.solve(np.stack([waves.real, waves.imag]), np.stack([cycles.real, cycles.imag]))
    stopped = (a + 1j * b) * np.exp(-1j * run * (np.arange(m) - 0.5 * (m - 1)))
    total, between = moments((stopped - stopped.mean())[None])
    np.testing.assert_allclose(complex(still[0], still[1]), stopped.mean(), rtol=0, atol=1e-7)
    np.testing.assert_allclose(still[2:5], total[0], rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(still[5:8], between[0], rtol=1e-9, atol=1e-3)


def moving(n, m, *, amplitude=1.0, phase=0.0, run=0.0, leak=0j):
    """Codes by the definition: a phase that grows by `run` a cycle and is `phase` at the middle, and a leak."""
    j = np.arange(m * n)
    now = phase + run * (j - 0.5 * (m * n - 1)) / n
    still = abs(leak) * np.cos(2.0 * np.pi * j / n - np.angle(leak))
    return amplitude * np.cos(2.0 * np.pi * j / n - now) + still


def running(samples, n, run, leaked=0j):
    """Phasor of a running return, and the largest of its sums of squares."""
    _, still = found(samples, n, run=run, leaked=leaked)
    return complex(still[0], still[1]), still[2:4].max()


@settings(max_examples=120)
@given(
    n=st.integers(3, 70),
    m=st.integers(1, 40),
    run=st.floats(-2.5, 2.5).filter(lambda v: v != 0.0),
    amplitude=st.floats(1.0, 3e4),
    phase=PHASES,
    leak=st.floats(0.0, 1e4),
    turn=PHASES,
)
def test_an_even_run_leaves_amplitude_and_phase_of_the_middle(n, m, run, amplitude, phase, leak, turn):
    assume(not (n == 3 and abs(run) > 1.5))  # three samples that move by half a turn hardly tell signal from image
    leaked = leak * np.exp(1j * turn)
    samples = moving(n, m, amplitude=amplitude, phase=phase, run=run, leak=leaked)
    phasor, squares = running(samples, n, run, leaked)
    # rounding of sums of m n terms, with the division that undoes the image at most tenfold
    size = 1e-11 * (amplitude + leak)
    assert abs(phasor - amplitude * np.exp(1j * phase)) < size
    assert squares < m * size**2


def test_the_sign_of_the_run_is_that_of_a_growing_phase():
    samples = moving(64, 128, run=0.03)
    right, wrong = (abs(running(samples, 64, run)[0]) for run in (0.03, -0.03))
    x = 0.5 * 2 * 0.03 * 128  # half of what the wrong sign leaves
    assert right == pytest.approx(1.0, abs=1e-12)
    # the module's sin(x)/x, and the image of a run, run/4 pi of the return, twice: there, and put in by the wrong sign
    assert wrong == pytest.approx(abs(np.sin(x) / x), abs=1.05 * 2 * 0.03 / (4 * np.pi))


def test_leakage_biases_the_phase_of_a_running_return_unless_subtracted():
    leak = 0.05 * np.exp(0.7j)
    samples = moving(64, 128, phase=1.0, run=0.02, leak=leak)
    with_leak, without = (running(samples, 64, 0.02, each)[0] for each in (0j, leak))
    assert np.angle(without) == pytest.approx(1.0, abs=1e-12)
    # the leak is smeared over the 2.56 rad by which the return runs: sin(1.28)/1.28 of it stays
    assert abs(with_leak - without - leak * np.sin(1.28) / 1.28) < 2e-4


def test_a_slightly_wrong_run_costs_no_phase_and_second_order_amplitude():
    phasor, _ = running(moving(64, 128, phase=-2.0, run=0.02), 64, 0.02 * 1.05)
    x = 0.5 * 0.001 * 128
    # the image of a wrong run, 0.001/4 pi, smeared over 128 cycles
    assert np.angle(phasor) == pytest.approx(-2.0, abs=2e-5)
    assert abs(phasor) == pytest.approx(np.sin(x) / x, abs=2e-5)


def test_the_scatter_of_a_running_return_is_that_of_many_buffers():
    rng, n, m = np.random.default_rng(5), 16, 32
    clean = moving(n, m, amplitude=100.0, phase=0.4, run=0.3)
    seen = [found(clean + rng.normal(0.0, 5.0, m * n), n, run=0.3)[1] for _ in range(600)]
    white = 5.0 * np.sqrt(2.0 / (m * n))  # the bound: the image of the run takes 0.4 % of it at most
    claimed = np.sqrt(np.mean([(still[2] + still[3]) / (2.0 * (m - 1) * m) for still in seen]))
    assert claimed == pytest.approx(white, rel=0.02)
    assert np.std(seen, axis=0)[:2] == pytest.approx(white, rel=0.09)  # 3 sigma of the scatter of 600


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
