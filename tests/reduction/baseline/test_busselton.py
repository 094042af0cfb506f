"""Real distances: the Busselton baseline from a TS30, then a TS16 against it; checked by least squares in plain numpy.

No certificate of the pillars is in the data: the numbers kept here are what this reduction and the independent one
below agree on, not a truth from elsewhere.
"""

import numpy as np
import pytest
from scipy.stats import f

from catseye.records.laboratory.baseline import (
    FORMAT,
    Baseline,
    baseline_text,
    read_baseline,
    read_heights,
    read_observations,
)
from catseye.reduction.baseline.instrument import calibrate_baseline, record_values
from catseye.reduction.baseline.settings import BaselineSettings
from evidence.baselines import DATA, TS30, solved_by_hand

TS16 = "ts16-calibration-observations.csv"


@pytest.fixture(scope="module")
def heights():
    return read_heights(DATA / "pillar-heights.csv")


@pytest.fixture(scope="module")
def ts30(heights):
    return calibrate_baseline(read_observations(DATA / TS30), heights)


@pytest.fixture(scope="module")
def known(ts30, tmp_path_factory):
    path = tmp_path_factory.mktemp("known") / "BASELINE.toml"
    path.write_text(baseline_text(Baseline(format=FORMAT, name="Busselton", **record_values(ts30))))
    return read_baseline(path)


@pytest.fixture(scope="module")
def ts16(known, heights):
    return calibrate_baseline(read_observations(DATA / TS16), heights, known)


def test_the_reference_index_is_the_closed_formula_at_the_makers_standard_air():
    """286.338 at 12 °C, 1013.25 hPa, 60 %: the closed formula; Ciddor and Hill give 286.296, 0.042 ppm less."""
    from catseye.atmosphere.index.air import group_refractivity

    lam, vapour = 0.658, 8.41486
    closed = 273.15 / 1013.25 * (287.6155 + 4.88660 / lam**2 + 0.068 / lam**4) * 1013.25 / 285.15
    closed -= 11.27 * vapour / 285.15
    assert closed == pytest.approx(286.338, abs=5e-4)
    today = group_refractivity(12.0, 1013.25, 60.0, wavelength_um=lam, co2_ppm=420.0) * 1e6
    assert today - closed == pytest.approx(-0.042, abs=0.005)


def test_all_shots_agree_with_least_squares_by_hand(ts30):
    x, zero, s = solved_by_hand(ts30.solution.y)
    assert ts30.all_shots.zero == pytest.approx(zero, abs=2e-6)
    assert ts30.all_shots.s == pytest.approx(s, abs=4e-6)  # 0.5 %: how the formulas grow with temperature
    assert ts30.all_shots.x[1:] == pytest.approx(x, abs=5e-5)  # the two formulas of the index


def test_the_ts30_calibrates_the_baseline_and_itself(ts30):
    zero, u = ts30.solution.of("zero")
    assert zero * 1e3 == pytest.approx(-0.267, abs=0.01)
    assert u * 1e3 == pytest.approx(0.19, abs=0.02)
    assert ts30.test.s * 1e3 == pytest.approx(0.778, abs=0.003)
    assert ts30.test.degrees_of_freedom == 24
    assert ts30.all_shots.s * 1e3 == pytest.approx(0.717, abs=0.003)
    assert ts30.solution.noise.shot**0.5 * 1e3 == pytest.approx(0.111, abs=0.005)
    assert ts30.solution.x[5] == pytest.approx(509.9748, abs=2e-4)
    assert ts30.solution.of("x 5")[1] > 0.5e-3  # the instrument's scale alone is 1 ppm
    outcome = {d.name: d.passed for d in ts30.decisions}
    assert outcome["ISO 17123-4 a: s within the claim"] is True
    assert outcome["sets agree as their shots do"] is False
    assert outcome["the light follows the weather as read"] is False


def test_directions_from_both_ends_put_pillars_at_one_place(ts30):
    """The bend at pillar 5, 0.1596 degrees by its own readings, and what pillars 1 and 6 say of its offset."""
    y = ts30.solution.y
    bend = np.radians(180.0005 - (359.8409 - 180.0))
    assert y[4] == pytest.approx(-bend * 448.79 * 61.18 / 509.97, abs=1e-3)
    assert y[1] == pytest.approx(-np.radians(0.3136 - 0.0003) * 20.4, abs=1e-3)


def test_ignoring_the_offsets_from_the_line_would_bend_the_short_distances(ts30):
    """0.11 m off the line makes 0.3 mm in 20.4 m; this is why the directions are there."""
    s = ts30.solution
    d = np.hypot(s.x[1] - s.x[0], s.y[1] - s.y[0])
    assert d - (s.x[1] - s.x[0]) == pytest.approx(0.307e-3, abs=0.01e-3)


def test_distances_between_pillars_carry_the_covariance_of_both_ends(ts30):
    """By 20 000 draws of the pillars from their covariance: 0.5 %, three of these."""
    s = ts30.solution
    rows, covariance = s.places
    draws = np.random.default_rng(9).multivariate_normal(np.concatenate([s.x, s.y])[rows], covariance, 20_000)
    both = np.zeros((20_000, 12))
    both[:, rows] = draws
    for span in ts30.spans:
        i, j = ts30.names.index(span.start), ts30.names.index(span.end)
        length = np.hypot(both[:, j] - both[:, i], both[:, 6 + j] - both[:, 6 + i])
        assert span.u == pytest.approx(length.std(), rel=0.016)


def test_the_ts16_against_the_ts30(ts16):
    zero, u_zero = ts16.solution.of("zero")
    scale, u_scale = ts16.solution.of("scale")
    assert zero * 1e3 == pytest.approx(0.42, abs=0.02)
    assert u_zero * 1e3 == pytest.approx(0.185, abs=0.03)
    assert scale * 1e6 == pytest.approx(-3.1, abs=0.2)
    assert u_scale * 1e6 == pytest.approx(1.57, abs=0.2)
    assert ts16.test.degrees_of_freedom == 4


def test_the_standards_second_question_compares_with_the_known_baseline(ts16, known):
    """ISO 17123-4 b: the ratio of both variances against F of their degrees of freedom, by scipy."""
    asked = next(d for d in ts16.decisions if d.name.startswith("ISO 17123-4 b"))
    ratio = (ts16.test.s * 1e3 / known.s_mm) ** 2
    low, high = f.ppf([0.025, 0.975], 4, known.degrees_of_freedom)
    assert asked.statistic == pytest.approx(ratio, rel=1e-9)
    assert asked.limit == pytest.approx(high, rel=1e-6)
    assert asked.passed == (low <= ratio <= high)


def test_taken_as_corrected_in_the_field_both_instruments_agree_twice_as_well(heights, ts30, ts16):
    """What the weather test suspects: s falls to a half, and the scale between the instruments to within 1 ppm."""
    settings = BaselineSettings(corrected=True)
    first = calibrate_baseline(read_observations(DATA / TS30), heights, settings=settings)
    record = Baseline(format=FORMAT, name="b", **record_values(first))
    second = calibrate_baseline(read_observations(DATA / TS16), heights, record, settings=settings)
    assert first.test.s < 0.5 * ts30.test.s
    assert abs(second.solution.of("scale")[0]) < 1e-6 < abs(ts16.solution.of("scale")[0])
