"""The phasor of a running return: exact where the run is even, `detect` where there is none, honest where noise is."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.signal.detection.phase import detect
from catseye.signal.detection.running import running_phasor

runs = st.floats(-2.5, 2.5)
phases = st.floats(-np.pi, np.pi)


def moving(n, m, *, amplitude=1.0, phase=0.0, run=0.0, leak=0j):
    """Codes by the definition: a phase that grows by `run` a cycle and is `phase` at the middle, and a leak."""
    j = np.arange(m * n)
    now = phase + run * (j - 0.5 * (m * n - 1)) / n
    still = abs(leak) * np.cos(2.0 * np.pi * j / n - np.angle(leak))
    return amplitude * np.cos(2.0 * np.pi * j / n - now) + still


@settings(max_examples=120)
@given(
    n=st.integers(3, 70),
    m=st.integers(1, 40),
    run=runs,
    amplitude=st.floats(1.0, 3e4),
    phase=phases,
    leak=st.floats(0.0, 1e4),
    turn=phases,
)
def test_an_even_run_leaves_amplitude_and_phase_of_the_middle(n, m, run, amplitude, phase, leak, turn):
    assume(not (n == 3 and abs(run) > 1.5))  # three samples that move by half a turn hardly tell signal from image
    leaked = leak * np.exp(1j * turn)
    codes = moving(n, m, amplitude=amplitude, phase=phase, run=run, leak=leaked)
    found = running_phasor(codes, n, 1e-3, run=run, leaked=1e-3 * leaked)
    # rounding of sums of m n terms, with the division that undoes the image at most tenfold
    scale = 1e-3 * (amplitude + leak)
    np.testing.assert_allclose(found.phasor, 1e-3 * amplitude * np.exp(1j * phase), rtol=0, atol=1e-11 * scale)
    if m > 1:
        assert found.u_phasor < 1e-11 * scale


@given(n=st.integers(3, 70), m=st.integers(2, 40), seed=st.integers(0, 10**6))
def test_without_a_run_it_is_the_plain_detection(n, m, seed):
    codes = np.random.default_rng(seed).integers(-20_000, 20_000, m * n)
    found, plain = running_phasor(codes, n, 2e-4, run=0.0), detect(codes[None], n, 2e-4)
    np.testing.assert_allclose(found.phasor, plain.phasor[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.u_phasor, plain.u_phasor[0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.total, plain.scatter.total[0], rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(found.between, plain.scatter.between[0], rtol=1e-9, atol=1e-10)


def test_the_sign_of_the_run_is_that_of_a_growing_phase():
    codes = moving(64, 128, run=0.03)
    right, wrong = (abs(running_phasor(codes, 64, 1.0, run=run).phasor) for run in (0.03, -0.03))
    x = 0.5 * 2 * 0.03 * 128  # half of what the wrong sign leaves
    assert right == pytest.approx(1.0, abs=1e-12)
    # the module's sin(x)/x, and the image of a run, run/4 pi of the return, twice: there, and put in by the wrong sign
    assert wrong == pytest.approx(abs(np.sin(x) / x), abs=1.05 * 2 * 0.03 / (4 * np.pi))


def test_leakage_biases_the_phase_of_a_running_return_unless_subtracted():
    leak = 0.05 * np.exp(0.7j)
    codes = moving(64, 128, phase=1.0, run=0.02, leak=leak)
    with_leak, without = (running_phasor(codes, 64, 1.0, run=0.02, leaked=each).phasor for each in (0.0, leak))
    assert np.angle(without) == pytest.approx(1.0, abs=1e-12)
    # the leak is smeared over the 2.56 rad by which the return runs: sin(1.28)/1.28 of it stays
    rest = leak * np.sin(1.28) / 1.28
    np.testing.assert_allclose(with_leak - without, rest, rtol=0, atol=2e-4)


def test_a_slightly_wrong_run_costs_no_phase_and_second_order_amplitude():
    found = running_phasor(moving(64, 128, phase=-2.0, run=0.02), 64, 1.0, run=0.02 * 1.05)
    x = 0.5 * 0.001 * 128
    assert np.angle(found.phasor) == pytest.approx(
        -2.0, abs=2e-5
    )  # the image of a wrong run, 0.001/4 pi, smeared over 128 cycles
    assert abs(found.phasor) == pytest.approx(np.sin(x) / x, abs=2e-5)


def test_its_uncertainty_is_the_scatter_of_many_buffers():
    rng, n, m = np.random.default_rng(5), 16, 32
    clean = moving(n, m, amplitude=100.0, phase=0.4, run=0.3)
    seen = [running_phasor(clean + rng.normal(0.0, 5.0, m * n), n, 1.0, run=0.3) for _ in range(600)]
    phasors = np.array([s.phasor for s in seen])
    white = 5.0 * np.sqrt(2.0 / (m * n))  # the bound: the run takes nothing of it but 1/kept, 0.4 % here
    claimed = np.sqrt(np.mean([s.u_phasor**2 for s in seen]))
    assert claimed == pytest.approx(white, rel=0.02)
    for part in (phasors.real, phasors.imag):
        assert part.std() == pytest.approx(white, rel=0.09)  # 3 sigma of the scatter of 600


@pytest.mark.parametrize("run", [np.pi, -3.2, np.nan, np.inf])
def test_a_run_that_cycles_do_not_resolve_is_refused(run):
    with pytest.raises(ValidityError, match="below pi"):
        running_phasor(np.zeros(64), 32, 1.0, run=run)


def test_one_cycle_has_no_scatter():
    assert np.isnan(running_phasor(moving(32, 1, run=0.1), 32, 1.0, run=0.1).u_phasor)
