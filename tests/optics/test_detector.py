"""The photodiode's model against the diffusion equation solved another way, and drawn light."""

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.optics.detector import (
    Photodiode,
    image_lead,
    place_response,
    quadrant_position,
    quadrant_signals,
    spot_range,
    spot_range_uncertainty,
    spot_response,
)

DIODE = Photodiode(radius=0.25e-3, sheet_resistance=100.0, capacitance=1e-12)
SLOW = Photodiode(radius=0.25e-3, sheet_resistance=2000.0, capacitance=3e-12)  # phases of more than a radian


@pytest.mark.parametrize("diode", [DIODE, SLOW])
def test_rings_of_resistors_and_capacitors_give_the_same_share(diode):
    """Current put in at a place, the rim held at ground: a ladder of rings, and the current into the rim."""
    rings, w = 2000, TWO_PI * 1500e6
    edges = np.linspace(0.0, diode.radius, rings + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    capacity = diode.capacitance * (edges[1:] ** 2 - edges[:-1] ** 2) / diode.radius**2
    between = TWO_PI / diode.sheet_resistance / np.log(middle[1:] / middle[:-1])
    rim = TWO_PI / diode.sheet_resistance / np.log(diode.radius / middle[-1])
    diagonal = 1j * w * capacity
    diagonal[:-1] += between
    diagonal[1:] += between
    diagonal[-1] += rim
    from scipy.linalg import solve_banded

    bands = np.zeros((3, rings), dtype=complex)
    bands[0, 1:], bands[1], bands[2, :-1] = -between, diagonal, -between
    for k in (0, 700, 1500):
        current = np.zeros(rings)
        current[k] = 1.0
        reached = solve_banded((1, 1), bands, current)[-1] * rim
        assert place_response(middle[k], diode) == pytest.approx(reached, abs=1e-4)  # rings of finite width


def test_a_small_delay_is_that_of_the_closed_form():
    quick = Photodiode(radius=0.25e-3, sheet_resistance=1.0, capacitance=1e-12)
    for offset, spot in ((0.0, 20e-6), (60e-6, 20e-6), (100e-6, 30e-6)):
        short = quick.radius**2 - offset**2 - 0.5 * spot**2
        expected = 0.5 * SPEED_OF_LIGHT * quick.delay_per_area * short
        assert spot_range(offset, spot, quick) == pytest.approx(expected, rel=1e-4)


def test_a_spot_is_the_mean_of_drawn_light():
    drawn = np.random.default_rng(3).normal(scale=0.5 * 40e-6, size=(200_000, 2)) + np.array([90e-6, 0.0])
    mean = np.mean(place_response(np.hypot(*drawn.T), SLOW))
    assert spot_response(90e-6, 40e-6, SLOW) == pytest.approx(mean, abs=2e-3)


@pytest.mark.parametrize(("offset", "spot"), [(0.0, 0.2e-3), (0.1e-3, 0.3e-3), (0.0, 1e-3), (0.2e-3, 20e-3)])
def test_light_that_the_rim_cuts_is_summed_over_the_disc(offset, spot):
    node, weight = np.polynomial.legendre.leggauss(80)
    r, turn = 0.5 * SLOW.radius * (node + 1.0)[:, None], (np.arange(128) + 0.5) * TWO_PI / 128
    square = r**2 + offset**2 - 2.0 * r * offset * np.cos(turn)
    light = 2.0 / np.pi / spot**2 * np.exp(-2.0 * square / spot**2) * r * place_response(r, SLOW)
    summed = np.sum(0.5 * SLOW.radius * weight[:, None] * light) * TWO_PI / 128
    assert spot_response(offset, spot, SLOW) == pytest.approx(summed, rel=1e-8)


def test_even_light_on_the_whole_disc_is_late_by_half_of_what_the_middle_is():
    quick = Photodiode(radius=0.25e-3, sheet_resistance=1.0, capacitance=1e-12)
    assert spot_range(0.0, 1.0, quick) == pytest.approx(0.5 * spot_range(0.0, 1e-6, quick), rel=1e-3)


def test_a_spot_beside_the_disc_has_no_range_and_a_phase_that_goes_round_is_refused():
    assert np.isnan(spot_range(1e-3, 10e-6, DIODE))
    with pytest.raises(ValidityError, match="more than half a turn"):
        spot_range(0.0, 10e-6, Photodiode(radius=0.25e-3, sheet_resistance=1e4, capacitance=1e-11))


def test_light_in_the_middle_comes_later_and_light_beside_the_disc_does_not_count():
    ranges = spot_range(np.array([0.0, 50e-6, 100e-6, 150e-6]), 10e-6, DIODE)
    assert np.all(np.diff(ranges) < 0.0)
    assert np.all(ranges > 0.0)
    assert abs(spot_response(0.25e-3, 20e-6, DIODE)) == pytest.approx(0.5, abs=0.03)
    assert abs(spot_response(0.5e-3, 20e-6, DIODE)) < 1e-12


def test_the_claimed_uncertainty_is_the_scatter():
    places = np.random.default_rng(4).normal(scale=5e-6, size=(200_000, 2))
    for offset in (0.0, 8e-6, 50e-6):
        seen = -0.5 * SPEED_OF_LIGHT * np.angle(place_response(np.hypot(*(places + np.array([offset, 0.0])).T), DIODE))
        scatter = np.std(seen / (TWO_PI * 1500e6))
        assert spot_range_uncertainty(offset, 5e-6, DIODE) == pytest.approx(scatter, rel=0.02)


@pytest.mark.parametrize(("offset", "u"), [(0.0, 10e-6), (10e-6, 10e-6), (60e-6, 10e-6), (30e-6, 2e-6)])
def test_images_that_wander_are_early_by_their_mean_and_scatter_as_claimed(offset, u):
    """Places drawn on the disc of the exact model, against one image at rest."""
    lag = DIODE.lag()
    places = np.random.default_rng(6).normal(scale=u, size=(400_000, 2)) + np.array([offset, 0.0])
    early = np.angle(place_response(np.hypot(*places.T), DIODE) / place_response(offset, DIODE))
    lead = image_lead(offset, u, lag=lag, radius=DIODE.radius)
    assert lead.u == pytest.approx(np.std(early), rel=0.01)
    assert lead.mean == pytest.approx(np.mean(early), rel=0.02, abs=4.0 * np.std(early) / np.sqrt(len(early)))
    assert lead.mean > 0.0


def test_the_lag_of_a_disc_is_r_c_over_4_pi_of_the_period():
    """100 ohm and 1 pF at 1.5 GHz: 2 pi 1.5e9 1e-10/(4 pi) = 0.075 rad by hand; 1.19 mm in 15.9 mm a radian."""
    assert DIODE.lag() == pytest.approx(0.075, rel=2e-3)
    assert DIODE.lag() * SPEED_OF_LIGHT / (2.0 * TWO_PI * 1.5e9) == pytest.approx(
        spot_range(0.0, 1e-7, DIODE), rel=1e-6
    )
    assert DIODE.lag(3e9) == pytest.approx(2.0 * DIODE.lag(), rel=0.01)


def test_an_image_servo_sees_the_spot_where_it_is_and_what_is_left_of_it_moves_no_range():
    spot = 100e-6
    slope = spot * np.sqrt(np.pi / 8.0)
    start = np.array([12e-6, -7e-6])
    at = start.copy()
    for _ in range(8):  # a servo that trusts the slope at the middle: it converges from a tenth of the spot
        seen, _ = quadrant_position(quadrant_signals(*at, spot), slope=slope)
        at = at - seen
    assert np.hypot(*at) < 1e-9
    assert quadrant_position(quadrant_signals(*start, spot), slope=slope)[0] == pytest.approx(start, rel=0.02)
    # with a gap the same light moves the ratio more: by the light that fell into it
    gapped = quadrant_position(quadrant_signals(*start, spot, 20e-6), slope=slope)[0]
    assert np.all(np.abs(gapped) > np.abs(start))
    before, after = spot_range(np.array([np.hypot(*start), 0.0]), 10e-6, DIODE)
    assert after - before == pytest.approx(3.7e-6, abs=0.2e-6)  # what the servo takes away


def test_quadrants_share_the_light_as_drawn_photons_do():
    x, y = 0.5 * 100e-6 * np.random.default_rng(5).normal(size=(2, 400_000)) + [[30e-6], [-20e-6]]
    drawn = [np.mean((x > 5e-6) & (y > 5e-6)), np.mean((x < -5e-6) & (y > 5e-6))]
    assert quadrant_signals(30e-6, -20e-6, 100e-6, 10e-6)[:2] == pytest.approx(drawn, abs=0.003)
    assert quadrant_signals(30e-6, -20e-6, 100e-6).sum() == pytest.approx(1.0)


def test_invalid_diodes_are_refused():
    with pytest.raises(ValidityError, match="sheet_resistance 0"):
        Photodiode(radius=1e-4, sheet_resistance=0.0, capacitance=1e-12)
    with pytest.raises(ValidityError, match="is not on a disc"):
        place_response(1e-3, DIODE)
    with pytest.raises(ValidityError, match=r"spot 0\.0 m"):
        spot_response(0.0, 0.0, DIODE)
