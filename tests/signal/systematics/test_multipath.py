"""Further paths against waveforms added up sample by sample, and against bounds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.signal.detection.phase import detect
from catseye.signal.systematics.multipath import (
    cats_eye_error,
    largest_share,
    multipath_error,
    returned_share_of_pass,
    second_pass_slopes,
    second_pass_turn,
    two_retroreflectors,
)

WAVELENGTH = 0.199811  # m, 1500 MHz in air
HALF = WAVELENGTH / 2
SPEED, FREQUENCY = WAVELENGTH * 1.5e9, 1.5e9


def measured(path, shares, excess):
    """Range that the converter's samples of all returns together give, less path.

    An oscillator above the carrier mixes them down to an intermediate frequency: the phase then falls with the delay.
    """
    n, m = 64, 2
    t = np.arange(n * m) / n  # in cycles of the intermediate frequency
    samples = np.zeros(n * m)
    for share, detour in zip([1.0, *shares], [0.0, *excess], strict=True):
        delay = (2 * path + detour) / SPEED
        samples += share * np.cos(2 * np.pi * (t + FREQUENCY * delay))  # of (f + IF) - f, delayed at f
    phase = float(detect(samples, n).phase)
    cycles = np.round(path / HALF + phase / (2 * np.pi))
    return (cycles - phase / (2 * np.pi)) * HALF - path


@pytest.mark.parametrize("path", [0.18, 10.013, 100.0, 100.03])
@pytest.mark.parametrize(
    ("shares", "excess"), [([0.01], [0.05]), ([0.01], [0.31]), ([0.2, 0.1, 0.05], [0.02, 0.13, 7.7])]
)
def test_error_equals_that_of_summed_return_samples(path, shares, excess):
    # rounding of 1e9 cycles a second times microseconds: 1e-13 cycles of 0.1 m, and 100 m of path
    assert float(multipath_error(shares, excess, WAVELENGTH)) == pytest.approx(
        measured(path, shares, excess), abs=1e-12
    )


@pytest.mark.parametrize("path", [0.18, 60.02, 100.045])
def test_the_cats_eye_is_a_series_of_rounds(path):
    q = 0.1
    shares, excess = q ** np.arange(1, 17), 2 * path * np.arange(1, 17)
    expected = measured(path, shares, excess)
    assert float(cats_eye_error(path, q, WAVELENGTH)) == pytest.approx(expected, abs=1e-12)
    assert float(multipath_error(shares, excess, WAVELENGTH)) == pytest.approx(expected, abs=1e-12)


def test_slightly_delayed_light_lengthens_the_range_by_its_mean_delay():
    # shares 0.1 and 0.2, detours 10 and 40 um: (1 + 8) um/1.3, halved; the next term has the detour's cube
    assert float(multipath_error([0.1, 0.2], [10e-6, 40e-6], WAVELENGTH)) == pytest.approx(9e-6 / 2.6, rel=1e-6)


@given(st.floats(0.0, 0.3), st.floats(-50.0, 50.0))
def test_a_second_retroreflector_pulls_towards_itself_and_never_beyond_the_bound(share, separation):
    got = float(two_retroreflectors(share, separation, WAVELENGTH))
    assert abs(got) <= np.arcsin(share) * WAVELENGTH / (4 * np.pi) + 1e-15
    away = np.sin(4 * np.pi * separation / WAVELENGTH)
    assert got * away >= -1e-14  # the sign of the detour's sine: too long where it stands a little further
    assert float(two_retroreflectors(share, -separation, WAVELENGTH)) == pytest.approx(-got, abs=1e-15)


@given(st.floats(0.0, 0.9), st.floats(0.1, 200.0))
def test_the_cats_eyes_error_repeats_with_half_a_wavelength_and_keeps_its_bound(q, path):
    got = float(cats_eye_error(path, q, WAVELENGTH))
    assert abs(got) <= np.arcsin(q) * WAVELENGTH / (4 * np.pi) + 1e-12
    assert got == pytest.approx(float(cats_eye_error(path + HALF, q, WAVELENGTH)), abs=1e-9 * HALF)


def test_the_bound_is_met():
    path = np.linspace(0.0, HALF, 100_001)
    worst = np.abs(cats_eye_error(path, 0.3, WAVELENGTH)).max()
    assert worst == pytest.approx(np.arcsin(0.3) * WAVELENGTH / (4 * np.pi), rel=1e-8)


def test_a_share_within_the_limit_keeps_ten_micrometres_and_ten_percent_more_does_not():
    share = float(largest_share(10e-6, WAVELENGTH))
    assert share == pytest.approx(4 * np.pi * 10e-6 / WAVELENGTH, rel=1e-6)
    path = np.linspace(0.0, HALF, 10_001)
    assert np.abs(cats_eye_error(path, share, WAVELENGTH)).max() <= 10e-6 * (1 + 1e-12)
    assert np.abs(cats_eye_error(path, 1.1 * share, WAVELENGTH)).max() > 10e-6


def test_the_detector_may_reflect_the_limit_over_the_rest_of_the_way():
    reflectance = float(largest_share(10e-6, WAVELENGTH)) / (0.25 * 0.6 * 0.9)
    assert float(returned_share_of_pass(reflectance, 0.25, 0.6, mirrors=0.9)) == pytest.approx(6.289e-4, rel=1e-3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: multipath_error([0.6, 0.5], [0.1, 0.2], 0.2), "sum to 1 or more"),
        (lambda: multipath_error([-0.1], [0.1], 0.2), "below 0"),
        (lambda: cats_eye_error(1.0, 1.0, 0.2), "sum to 1 or more"),
        (lambda: returned_share_of_pass(0.1, 1.2, 0.5), r"recollected part 1\.2 is not within 0 to 1"),
        (lambda: largest_share(0.0, 0.2), "not within 0 to an eighth of a wavelength"),
    ],
)
def test_bad_input_is_refused_in_one_line(call, message):
    with pytest.raises(ValidityError, match=message):
        call()


def test_the_second_pass_of_a_head_is_a_cats_eye_whose_share_grows_with_the_return():
    """Angle of the pass at phase 0, share a volt; the light's phase falls by 4 pi over the wavelength a metre."""
    wavelength, share, angle = 0.2, 8e-4, 0.9
    path, volts = np.linspace(100.0, 100.2, 41), np.linspace(0.5, 9.0, 41)
    light = angle - 4 * np.pi * path / wavelength
    turn, _ = second_pass_turn(light, volts, share * np.sin(angle), -share * np.cos(angle))
    np.testing.assert_allclose(
        turn * wavelength / (4 * np.pi), cats_eye_error(path, share * volts, wavelength), atol=1e-15, rtol=1e-9
    )


def test_slopes_of_the_second_pass_are_finite_differences():
    at, step = np.array([0.7, 3.0, 4e-3, -3e-3]), np.array([1e-6, 1e-6, 1e-9, 1e-9])
    by_phase, by_amplitude = second_pass_slopes(*at)
    slopes = [by_phase, by_amplitude, *second_pass_turn(*at)[1]]
    for k, slope in enumerate(slopes):
        high, low = (second_pass_turn(*(at + sign * step[k] * (np.arange(4) == k)))[0] for sign in (1, -1))
        assert (high - low) / (2 * step[k]) == pytest.approx(slope, rel=1e-6)


def test_a_second_pass_as_strong_as_the_first_is_refused():
    with pytest.raises(ValidityError, match="the direct light is not the strongest"):
        second_pass_turn(0.0, 10.0, 0.1, 0.0)
