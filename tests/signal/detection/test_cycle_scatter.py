"""Cycle by cycle: their phasors, the colour of their noise, and which of them drop out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import f as fisher
from scipy.stats import f_oneway

from catseye.errors import ValidityError
from catseye.signal.detection.cycle_scatter import BATCHES, CycleScatter, cycle_phasors, moments, variance_across
from catseye.signal.detection.phase import detect


def made(single, n):
    """Samples (..., m n) whose cycles have the phasors single (..., m)."""
    wave = (np.asarray(single)[..., None] * np.exp(-2j * np.pi * np.arange(n) / n)).real
    return wave.reshape(*wave.shape[:-2], -1)


def test_each_cycle_has_its_own_amplitude_and_phase():
    single = np.geomspace(1, 3, 10) * np.exp(1j * np.linspace(-3, 3, 10))
    np.testing.assert_allclose(cycle_phasors(made(single, 7), 7, 2.0), 2.0 * single, rtol=0, atol=1e-14)
    codes = np.rint(1000 * made([single, single], 7)).astype(np.int16)
    assert cycle_phasors(codes, 7).shape == (2, 10)
    np.testing.assert_allclose(cycle_phasors(codes, 7).mean(axis=-1), detect(codes, 7).phasor, rtol=1e-13)


def test_half_a_cycle_too_much_is_refused():
    with pytest.raises(ValidityError, match="a buffer of 12 samples is not a whole number of cycles of 8 samples"):
        cycle_phasors(np.zeros(12), 8)
    with pytest.raises(ValidityError, match=r"volts per code -1\.0 V is not above 0"):
        cycle_phasors(np.zeros(16), 8, -1.0)


@pytest.mark.parametrize("m", [16, 29, 128])
def test_the_colour_is_the_f_ratio_of_an_analysis_of_variance(m):
    """scipy's f_oneway on the batches, along and across."""
    rng = np.random.default_rng(m)
    single = 5.0 * np.exp(1.2j) + rng.normal(size=m) + 1j * rng.normal(size=m)
    shot = detect(made(single, 8), 8)
    turned = single * np.exp(-1j * float(shot.phase))
    edges = np.arange(BATCHES + 1) * m // BATCHES
    for i, part in enumerate((turned.real, turned.imag)):
        expected = f_oneway(*np.split(part, edges[1:-1])).statistic
        assert shot.scatter.colour(shot.phasor)[i] == pytest.approx(expected, rel=1e-9)


def test_white_noise_is_called_coloured_once_in_a_hundred():
    rng = np.random.default_rng(5)
    single = 5.0 + rng.normal(size=(20_000, 32)) + 1j * rng.normal(size=(20_000, 32))
    shots = detect(made(single, 4), 4)
    alarms = np.mean(shots.degrees == BATCHES - 1, axis=0)
    np.testing.assert_allclose(alarms, 0.01, rtol=0, atol=4 * np.sqrt(0.01 / 20_000))
    limit = fisher.ppf(0.99, BATCHES - 1, 32 - BATCHES)
    np.testing.assert_array_equal(shots.scatter.colour(shots.phasor) > limit, shots.degrees == BATCHES - 1)


def test_too_few_cycles_have_no_colour():
    shot = detect(made(np.ones(15) + 0.1 * np.arange(15), 8), 8)
    assert np.isnan(shot.scatter.colour(shot.phasor)).all()
    assert shot.degrees.tolist() == [14, 14]


def test_a_slow_wander_of_the_phase_is_claimed_from_the_batches():
    rng = np.random.default_rng(6)
    walk = np.cumsum(0.001 * rng.normal(size=128))
    shot = detect(made(np.exp(1j * walk) * (1 + 0.01 * rng.normal(size=128)), 64), 64)
    batches = walk.reshape(BATCHES, 16).mean(axis=1)
    assert shot.degrees.tolist() == [127, BATCHES - 1]
    assert float(shot.u_phase) == pytest.approx(np.std(batches, ddof=1) / np.sqrt(BATCHES), rel=1e-2)
    assert shot.u_phase > 2 * shot.u_phasor / shot.amplitude


@pytest.mark.parametrize("dark", [[3], [0, 1, 2, 3, 4], list(range(40, 110))])
def test_cycles_without_light_are_counted(dark):
    rng = np.random.default_rng(9)
    single = 2.0 * np.exp(2.0j) * np.ones(128)
    single[dark] = 0.01j
    samples = made(single, 16) + 0.05 * rng.normal(size=2048)
    assert int(detect(samples, 16).scatter.dropped) == len(dark)
    codes = np.rint(3000 * samples).astype(np.int16)
    assert detect(codes[None], 16, compiled=True).scatter.dropped.tolist() == [len(dark)]


@pytest.mark.parametrize(("left", "dropped"), [(0.47, 1), (0.52, 0)])
def test_half_the_amplitude_is_where_a_dropout_begins(left, dropped):
    single = np.full(128, 9000.0 * np.exp(4.0j))
    single[77] *= left  # the mean is then 0.996 of 9000
    codes = np.rint(made(single, 16)).astype(np.int16)[None]
    assert [int(detect(codes, 16, compiled=choice).scatter.dropped[0]) for choice in (False, True)] == [dropped] * 2


def test_a_weak_beam_is_not_taken_for_dropouts():
    """Amplitude as large as a cycle's noise: many cycles fall below half of it, by chance."""
    rng = np.random.default_rng(10)
    shots = detect(made(np.full((2000, 64), 0.35), 16) + rng.normal(size=(2000, 1024)), 16)
    assert np.count_nonzero(shots.scatter.dropped) == 0


def test_with_few_cycles_no_dropout_is_reported():
    single = np.ones(7, dtype=complex)
    single[2] = 0.0
    assert int(detect(made(single, 16), 16).scatter.dropped) == 0
    assert int(detect(made(np.append(single, 1.0), 16), 16).scatter.dropped) == 1


@settings(max_examples=60)
@given(m=st.integers(2, 60), seed=st.integers(0, 10**6), slow=st.booleans(), lit=st.booleans())
def test_one_buffer_without_arrays_is_the_same(m, seed, slow, lit):
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(1, m)) + 1j * rng.normal(size=(1, m))
    noise = noise + 3.0 * np.repeat(rng.normal(size=(1, 8)), -(-m // 8), axis=1)[:, :m] if slow else noise
    total, between = moments(noise - noise.mean())
    phasor = complex(*rng.normal(size=2)) if lit else 0j
    found = CycleScatter(np.array([m]), total, between, np.zeros(1, dtype=int)).variance(np.array([phasor]))[0][0, 1]
    assert variance_across(total[0], between[0], m, phasor=phasor) == pytest.approx(found, rel=1e-12, abs=1e-15)
