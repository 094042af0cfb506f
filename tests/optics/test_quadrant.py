"""Spot on a quadrant detector: against a Gaussian integrated over quadrants, and draws."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from catseye.errors import ValidityError
from catseye.optics.detector import quadrant_signals
from catseye.optics.quadrant import centre_slope, centred_places, place_of_ratio, place_uncertainty, settled_noise

SPOT = 100e-6


@pytest.mark.parametrize("place", [(0.0, 0.0), (30e-6, -20e-6), (-80e-6, 60e-6)])
@pytest.mark.parametrize("gap", [0.0, 20e-6])
def test_signals_are_a_gaussian_integrated_over_each_quadrant(place, gap):
    x, y = (each / SPOT for each in place)
    half, far = 0.5 * gap / SPOT, 4.0

    def light(v, u):
        return 2.0 / np.pi * np.exp(-2.0 * ((u - x) ** 2 + (v - y) ** 2))

    sides = [(half, far, half, far), (-far, -half, half, far), (-far, -half, -far, -half), (half, far, -far, -half)]
    integrals = [dblquad(light, a, b, c, d, epsabs=1e-9)[0] for a, b, c, d in sides]
    np.testing.assert_allclose(quadrant_signals(*place, SPOT, gap), integrals, atol=1e-7)


def test_the_inverse_gives_the_place_back_and_none_where_saturated():
    x = np.linspace(-150e-6, 150e-6, 31)
    q = quadrant_signals(x, 20e-6, SPOT)
    ratio = q @ [1.0, -1.0, -1.0, 1.0] / q.sum(axis=1)
    np.testing.assert_allclose(place_of_ratio(ratio, SPOT), x, atol=1e-10)
    assert np.isnan(place_of_ratio([1.0, -1.2], SPOT)).all()
    step = 1e-9
    slope = 2.0 * step / np.diff(quadrant_signals([-step, step], 0.0, SPOT) @ [1.0, -1.0, -1.0, 1.0])[0]
    assert centre_slope(SPOT) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("place", [0.0, 40e-6, 80e-6])
def test_u_of_a_place_is_its_scatter(place):
    rng = np.random.default_rng(46)
    q = quadrant_signals(place, 0.0, SPOT) + 1e-3 * rng.normal(size=(20_000, 4))
    read = place_of_ratio(q @ [1.0, -1.0, -1.0, 1.0] / q.sum(axis=1), SPOT)
    assert np.nanstd(read) == pytest.approx(float(place_uncertainty(place, SPOT, 1e-3)), rel=0.03)  # 6 of 0.5 %


@pytest.mark.parametrize("gain", [0.1, 0.5, 1.2])
def test_a_centred_spot_scatters_as_its_loop_says(gain):
    """4000 steps, correlated over 1/gain: a standard deviation to some per cent."""
    noise = {"gain": gain, "u_signal": 1e-3}
    places = centred_places([50e-6, -30e-6], SPOT, steps=4000, rng=np.random.default_rng(3), **noise)
    settled = places[200:]
    assert settled.std() == pytest.approx(settled_noise(SPOT, **noise), rel=0.15)
    assert np.abs(settled.mean(axis=0)).max() < 5.0 * settled_noise(SPOT, **noise) / np.sqrt(3800 * gain)


def test_a_far_spot_comes_back_at_the_pace_of_saturation_and_never_overshoots():
    places = centred_places([1e-3, 0.0], SPOT, gain=0.5, u_signal=0.0, steps=60, rng=np.random.default_rng(1))
    assert places[0, 0] - places[1, 0] == pytest.approx(0.5 * centre_slope(SPOT), rel=1e-6)
    assert places[:, 0].min() > -1e-9
    assert abs(places[-1, 0]) < 1e-9


def test_a_gain_that_is_not_stable_is_refused():
    for gain in (0.0, 2.0):
        with pytest.raises(ValidityError, match="gain"):
            centred_places([0.0, 0.0], SPOT, gain=gain, u_signal=0.0, steps=1, rng=np.random.default_rng(1))
    with pytest.raises(ValidityError, match="spot"):
        place_of_ratio(0.1, 0.0)
