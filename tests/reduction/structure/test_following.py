"""Vibration followed: a known truth within its u, in scatter; lost samples, buffers, noise alone."""

import importlib.util

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.vibration_series import VibrationSeries
from catseye.records.site.structural_model import read_structural_model
from catseye.reduction.structure.following import (
    VibrationSamples,
    follow_vibration,
    modes_of_model,
    samples_of,
)
from catseye.signal.vibration.filter import Mode
from repository import ROOT

EXAMPLE = ROOT / "examples/vibration/make_example.py"
MODES = (
    Mode(0.80, 0.005, np.diag([1.5e-3**2, 1e-12]), 0.03),
    Mode(1.02, 0.006, np.diag([1e-12, 1.0e-3**2]), 0.03),
)


@pytest.fixture(scope="module")
def example():
    """Simulation of the example: oscillators by Euler's steps, which share no formula with the filter."""
    spec = importlib.util.spec_from_file_location("make_example", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def simulated(example, seed):
    """Samples of the quadrant detector, and the displacement without rest and noise (n, 2), m."""
    times, place, signals = example.signals(seed)
    series = VibrationSeries("simulated", "quadrant", ("q1", "q2", "q3", "q4"), times, signals)
    samples = samples_of(series, slope=example.SLOPE, u_signal=example.NOISE, u=None, window=0.0)
    return samples, place - [example.REST[axis] for axis in "xy"]


def test_quadrants_give_the_place_of_the_spot_with_its_noise(example):
    samples, place = simulated(example, 1)
    off = samples.values - place - [example.REST[axis] for axis in "xy"]
    # 2400 values show a standard deviation to 1.4 %: four of these
    assert off.std() == pytest.approx(np.sqrt(samples.noise[0, 0, 0]), rel=0.06)


def test_frequency_amplitude_phase_and_prediction_scatter_as_claimed(example):
    """Eight winds: the truth lies within its u, and predictions of half a second are off as they claim."""
    frequency, place, prediction = [], [], []
    cut = 700  # samples: the seconds after are the truth of the predictions
    for seed in range(8):
        samples, truth = simulated(example, seed)
        part = VibrationSamples(samples.axes, samples.seconds[:cut], samples.values[:cut], samples.noise[:cut])
        found = follow_vibration(part, modes=MODES, leads=(0.05, 0.5), ahead=0.15)
        assert found.ratio == pytest.approx(1.0, abs=0.15)  # 350 samples, three of which share a force
        value, u = found.state.frequencies_hz()
        frequency.append((value - [0.80, 1.02]) / u)
        z, q = found.state.quadratures()
        now = np.array([z[0, 0, 0] + z[1, 0, 0], z[0, 1, 0] + z[1, 1, 0]])
        place.append((now - truth[cut - 1]) / np.sqrt(q[0, [0, 1], 0, 0] + q[1, [0, 1], 0, 0]))
        off = found.predicted - truth[[cut, cut + 9]]
        prediction.append(off / np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2)))
    for values in (frequency, place, prediction):
        scores = np.array(values)
        count = scores.size
        # a mean square of n independent unit normals scatters by sqrt(2/n); phases of one run are dependent: n/2
        assert np.mean(scores**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (0.5 * count)))


def test_modes_are_found_and_following_leaves_the_noise(example):
    samples, _ = simulated(example, 3)
    found = follow_vibration(samples, count=2, near_hz=(0.8, 1.0), ahead=0.0)
    value, u = found.state.frequencies_hz()
    np.testing.assert_array_less(np.abs(value - [0.80, 1.02]), 4.0 * u)
    assert found.ahead == pytest.approx(0.05)
    np.testing.assert_allclose(found.after, found.expected, rtol=0.1)
    assert np.all(found.after < 0.15 * found.before)
    assert found.residual.shape == (len(found.checked), 2)


def test_the_longer_ahead_the_more_is_missed_and_claimed(example):
    samples, _ = simulated(example, 5)
    near, far = (follow_vibration(samples, modes=MODES, ahead=ahead) for ahead in (0.0, 0.6))
    assert (near.ahead, far.ahead) == pytest.approx((0.05, 0.6))
    np.testing.assert_array_less(2.0 * near.after, far.after)
    np.testing.assert_allclose(far.after, far.expected, rtol=0.3)  # 30 s of two oscillators: few independent kicks


def test_lost_samples_are_bridged_and_take_no_part(example):
    samples, _ = simulated(example, 4)
    values = samples.values.copy()
    values[700:720] = np.nan
    holed = VibrationSamples(samples.axes, samples.seconds, values, samples.noise)
    found = follow_vibration(holed, modes=MODES, ahead=0.15)
    assert int(np.isnan(found.residual).all(axis=1).sum()) == 20
    assert found.verdict.word == "good"


def test_ranges_of_buffers_show_the_motion_of_an_instant(example):
    """A mean over 128 ms weakens 1.02 Hz by 2.8 %; the filter gives that back."""
    rng = np.random.default_rng(7)
    w, size, window = 2.0 * np.pi * 1.02, 1e-3, 0.128
    times = 0.064 + window * np.arange(400)
    sinc = np.sin(0.5 * w * window) / (0.5 * w * window)
    values = 120.0 + sinc * size * np.cos(w * times) + 20e-6 * rng.standard_normal(400)
    series = VibrationSeries("ranges", "range", ("range_m",), times, values[:, None])
    samples = samples_of(series, slope=None, u_signal=None, u=20e-6, window=window)
    found = follow_vibration(samples, modes=(Mode(1.0, 1e-6, np.eye(1) * 5e-7, 0.05),), ahead=window, leads=(0.0, 0.3))
    end = times[-1] + 0.064 + np.array([0.0, 0.3])  # a window ends half its length after its middle
    value, covariance = found.predicted, found.covariance
    np.testing.assert_array_less(np.abs(value[:, 0] - size * np.cos(w * end)), 4.0 * np.sqrt(covariance[:, 0, 0]))
    amplitude, u = found.state.amplitudes()
    assert abs(amplitude[0, 0] - size) < 4.0 * u[0, 0]
    assert 4.0 * u[0, 0] < (1.0 - sinc) * size  # fine enough to see the window


def test_noise_alone_locks_nothing():
    rng = np.random.default_rng(5)
    times = np.arange(400) / 20.0
    noise = np.tile(1e-8 * np.eye(2), (400, 1, 1))
    samples = VibrationSamples(("x", "y"), times, 1e-4 * rng.standard_normal((400, 2)), noise)
    found = follow_vibration(samples, modes=tuple(Mode(f, 0.05, np.eye(2) * 1e-10, 0.03) for f in (0.8, 1.02)))
    assert not found.locked.any()
    assert found.verdict.word == "failed"


def test_times_in_milliseconds_are_doubted(example):
    """Modes of a thousandth of a hertz, of which the filter is as sure as of the true ones."""
    samples, _ = simulated(example, 6)
    slow = VibrationSamples(samples.axes, 1e3 * samples.seconds, samples.values, samples.noise)
    modes = tuple(Mode(1e-3 * m.frequency_hz, m.damping_ratio, m.covariance, 1e-3 * m.u_frequency_hz) for m in MODES)
    found = follow_vibration(slow, modes=modes, ahead=0.0)
    assert found.verdict.word == "doubtful"
    assert "Hz is outside 0.05 to 100 Hz" in found.verdict.why


def test_a_wrong_noise_is_doubted(example):
    samples, _ = simulated(example, 6)
    found = follow_vibration(
        VibrationSamples(samples.axes, samples.seconds, samples.values, 0.01 * samples.noise), modes=MODES, ahead=0.0
    )
    assert found.verdict.word == "doubtful"
    assert "of what the filter claims" in found.verdict.why


def test_the_model_s_modes_are_large_where_they_move_something(example):
    record = read_structural_model(ROOT / "examples/structural-model/telescope.toml")
    samples, _ = simulated(example, 8)
    sway, nod = modes_of_model(record, samples)
    variance = samples.values.var(axis=0)
    np.testing.assert_allclose(np.diag(sway.covariance) + np.diag(nod.covariance), variance, rtol=1e-9)
    assert sway.covariance[1, 1] < 0.01 * nod.covariance[1, 1]
    with pytest.raises(InputError, match="has no vibration"):
        modes_of_model(record.model_copy(update={"vibration": ()}), samples)


@pytest.mark.parametrize("kind", ["quadrant", "range", "displacement"])
def test_what_a_kind_needs_is_named(kind):
    series = VibrationSeries("arm.csv", kind, ("x_mm", "y_mm"), np.arange(64.0), np.ones((64, 4)))
    with pytest.raises(InputError, match=r"arm\.csv: .* need"):
        samples_of(series, slope=None, u_signal=None, u=None, window=0.0)


@pytest.mark.parametrize("frequency", [0.8, 1.3])
def test_a_swing_without_wind_along_a_slanted_line_keeps_its_amplitude_and_phase_on_both_axes(frequency):
    """A line of slope 0.3, no damping: both axes are one mode, and the filter must not turn its line."""
    t, u = np.arange(1600) / 20.0, 1e-5
    turns = 2.0 * np.pi * frequency * t + 0.7
    truth = np.array([1.5e-3, 0.45e-3])
    noise = u * np.random.default_rng(9).standard_normal((len(t), 2))
    samples = VibrationSamples(
        ("x", "y"), t, np.cos(turns)[:, None] * truth + noise, np.tile(u**2 * np.eye(2), (1600, 1, 1))
    )
    found = follow_vibration(samples, ahead=0.15)
    amplitude, u_amplitude = found.state.amplitudes()
    phase, u_phase = found.state.phases()
    assert np.all(np.abs(amplitude[0] - truth) < 3.5 * u_amplitude[0])
    off = (phase[0] - turns[-1] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.all(np.abs(off) < 3.5 * u_phase[0])
    assert found.verdict.word == "good"
    assert found.ratio == pytest.approx(1.0, abs=0.1)
