"""Finding targets by their return. The spots are real ones, by diffraction; the fit knows only Gaussians."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from catseye.errors import ValidityError
from catseye.geometry.mirror.pointing import MirrorStation, counts
from catseye.geometry.mirror.search_pattern import count_size, offsets_of_counts
from catseye.geometry.sky.time_tag import TimeTag
from catseye.optics.spot import gaussian_spot, offset_share
from catseye.reduction.steering.finding import SearchResult, adjustment_readings, find
from catseye.reduction.steering.spot_fit import SearchHead, Spot, fit_spot
from draws import draws
from optics.spot_scene import matched_radius

STATION = MirrorStation([112.99, 44.28, 0.0], [-1.1973, 1.6e-5, -4e-6], [0.0, 0.2475, 0.0], [-5e-4, 9e-5], [2691, 1434])
TARGET = np.array([20.0, -30.0, 75.0])
RANGE = float(np.linalg.norm(TARGET - STATION.scan_point))
TRUE = counts(STATION, TARGET)
LIGHT = {"aperture": 0.0254, "receiver": 0.05, "waist": 0.01, "wavelength": 0.78e-6}
RADIUS = matched_radius(RANGE, **LIGHT) / RANGE
OFFSETS = np.linspace(0.0, 0.06, 21)
HEAD = SearchHead((2691.0, 1434.0), (-21_309.0, 75_691.0), radius=RADIUS, threshold_volt=0.5, noise_volt=0.02)
PEAK = 6.0


@cache
def shares():
    """Function offset -> share of the power that comes back, good to 5e-4; nothing beyond the offsets."""
    between = CubicSpline(OFFSETS, offset_share(OFFSETS, RANGE, **LIGHT))
    return lambda off: np.where(off < OFFSETS[-1], np.maximum(between(off), 0.0), 0.0)


def returned(at, true, *, peak=PEAK, real=True, head=HEAD):
    """Amplitude at counts where the target is at `true`; the real spot, or the model's."""
    off = offsets_of_counts(true, head.zeros, np.atleast_2d(at))
    r = np.hypot(*off.T)
    if real:
        return peak * shares()(r * RANGE)
    return gaussian_spot(*off.T, peak=peak, radius=head.radius, background=0.0)


def ranger(rng, true, *, full=10.0, real=True, peak=PEAK, loose=0.5, missing=0.0, **_):
    """Something that measures: shafts stand anywhere within the count, the amplitude scatters and clips."""

    def measure(at):
        if rng.random() < missing:
            return np.nan
        stands = at + rng.uniform(-loose, loose, 2)
        clean = float(returned(stands, true, real=real, peak=peak)[0]) * (1.0 + 0.02 * rng.normal())
        return min(abs(clean + 0.02 * rng.normal()), full)

    return measure


@pytest.mark.parametrize("prime", [False, True])
def test_a_target_off_its_predicted_place_is_found(prime):
    rng = np.random.default_rng(4)
    true = TRUE if not prime else np.array([TRUE[0] + 50_000.0, 2 * 1434 - TRUE[1]])
    head = HEAD if not prime else SearchHead((2691.0, 1434.0), (2e4, 1.2e5), RADIUS, 0.5, 0.02)
    spot = find(np.add(true, [25.0, -14.0]), head, ranger(rng, true), search_radius=4e-3)
    assert spot.status == "found"
    assert np.all(np.abs(spot.counts - true) < 4.0 * spot.u_counts)
    assert np.all(spot.u_counts < 0.3)  # counts: finer than the encoders
    assert spot.amplitude == pytest.approx(PEAK, rel=0.06)
    assert len(spot.looked_at) == len(spot.seen) < 900
    assert len(np.unique(spot.looked_at, axis=0)) == len(spot.looked_at)  # no place twice


def test_an_absent_target_is_a_status_with_the_searched_area():
    rng = np.random.default_rng(1)
    dark = ranger(rng, TRUE, peak=0.0)
    spot = find(TRUE, HEAD, dark, search_radius=1e-3)
    assert not spot.found
    assert spot.status.startswith("not found: nothing above 0.5 V at ")
    assert "within 1 mrad" in spot.status
    assert "the largest was 0.0" in spot.status
    assert len(spot.looked_at) > 30
    assert np.isnan(spot.counts).all()
    half = find(TRUE, HEAD, dark, search_radius=1e-3, allowed=lambda _, n: n[0] > TRUE[0])
    assert "forbidden" in half.status
    assert np.all(half.looked_at[:, 0] > TRUE[0])
    gone = find(TRUE, HEAD, lambda at: np.nan, search_radius=5e-4)
    assert "without a reading" in gone.status
    fine = find(TRUE, SearchHead(HEAD.zeros, HEAD.azimuth_limits, 5e-5, 0.5, 0.02), dark, search_radius=5e-4)
    assert fine.status.endswith("the spot is narrower than the step of whole counts")
    narrow = SearchHead(HEAD.zeros, (TRUE[0] + 2, TRUE[0] + 500), RADIUS, 0.5, 0.02)
    assert "beyond the stops" in find(TRUE, narrow, dark, search_radius=1e-3).status


def test_a_spike_is_not_a_target():
    """Light at one place, and none about it."""
    rng = np.random.default_rng(1)
    spike = np.rint(TRUE)

    def measure(at):
        return 3.0 if np.array_equal(at, spike) else abs(0.02 * rng.normal())

    spot = find(TRUE, HEAD, measure, search_radius=1e-3)
    assert not spot.found
    assert "light of 3.00 V near" in spot.status


def errors(rng, n, true_of, **how):
    """(error / u) of centres fitted on scans of 2 spot radii about a rounded, wrong start."""
    from catseye.geometry.mirror.search_pattern import raster

    ratios, factors = [], []
    for _ in range(n):
        true = true_of(rng)
        start = true + rng.uniform(-1.5, 1.5, 2)
        scan = raster(start, HEAD.zeros, (1.6 * RADIUS, 1.6 * RADIUS), reach=0.25 * RADIUS, limits=HEAD.azimuth_limits)
        measure = ranger(rng, true, **how)
        spot = fit_spot(
            scan.counts,
            [measure(at) for at in scan.counts],
            SearchHead(
                HEAD.zeros,
                HEAD.azimuth_limits,
                RADIUS,
                0.5,
                0.02,
                full_scale_volt=how.get("full", 10.0),
                misfit=0.01 if how.get("real", True) else 0.0,
            ),
        )
        assert spot.found, spot.status
        ratios.append((spot.counts - true) @ np.linalg.inv(spot.covariance) @ (spot.counts - true))
        factors.append(spot.variance_factor)
    return np.array(ratios), np.array(factors)


def anywhere(rng):
    return TRUE + rng.uniform(-3, 3, 2)


@draws(40, name="n")
@pytest.mark.parametrize("how", [{}, {"missing": 0.2}, {"full": 4.0}])
def test_the_centres_scatter_matches_the_covariance_for_a_gaussian_spot(how, n):
    """The mean of e' C^-1 e is 2, that of n fits has u = 2/sqrt(n)."""
    ratios, factors = errors(np.random.default_rng(7), n, anywhere, real=False, **how)
    assert np.mean(ratios) == pytest.approx(2.0, abs=4 * 2 / np.sqrt(n))
    assert np.mean(factors) == pytest.approx(1.0, abs=0.3)  # shafts within a count are bounded, not normal


def test_a_real_spot_is_found_within_its_covariance():
    """Two apertures by diffraction, not the model: its misfit may widen the claim, which must not be too good."""
    n = 40
    ratios, factors = errors(np.random.default_rng(8), n, anywhere)
    assert np.mean(factors) < 1.5
    assert 1.0 < np.mean(ratios) < 2.0 + 4 * 2 / np.sqrt(n)


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"real": False}, {}, {"full": 4.0}])
def test_the_claims_hold_over_many_spots(how):
    """The mean, and few beyond the 99 % ellipse: a spot's sides make tails, clipped tops more."""
    n = 500
    ratios, _ = errors(np.random.default_rng(11), n, anywhere, **how)
    assert 1.6 < np.mean(ratios) < 2.7
    assert np.mean(ratios > 9.21) < 0.04


def test_the_derivatives_of_the_fit_are_finite_differences():
    from catseye.reduction.steering.spot_fit import SpotModel

    rng = np.random.default_rng(3)
    xy = rng.uniform(-2, 2, (30, 2))
    sheet = SpotModel(xy, rng.uniform(0, 5, 30), np.zeros(30, bool), HEAD, np.array([0.1, 0.2]))
    p = np.array([0.2, -0.3, 0.15, 4.0, 0.3, 0.6])
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6
        np.testing.assert_allclose(
            (sheet.model(p + step) - sheet.model(p - step)) / 2e-6, sheet.jacobian(p)[:, k], atol=1e-8
        )


def test_a_clipped_top_does_not_lower_the_peak():
    rng = np.random.default_rng(5)
    from catseye.geometry.mirror.search_pattern import raster

    scan = raster(TRUE, HEAD.zeros, (1.6 * RADIUS, 1.6 * RADIUS), reach=0.25 * RADIUS, limits=HEAD.azimuth_limits)
    clean = returned(scan.counts, TRUE, real=False)
    noisy = clean + 0.02 * rng.normal(size=len(clean))
    head = SearchHead(
        HEAD.zeros,
        HEAD.azimuth_limits,
        RADIUS,
        0.5,
        0.02,
        full_scale_volt=4.0,
        u_counts=0.0,
        scintillation=0.0,
        misfit=0.0,
    )
    spot = fit_spot(scan.counts, np.minimum(noisy, 4.0), head)
    assert spot.amplitude == pytest.approx(PEAK, abs=0.15)
    assert spot.radius == pytest.approx(RADIUS, rel=0.02)


def test_too_little_light_or_too_few_readings_or_an_edge_is_a_status():
    n = TRUE + np.array([[i, j] for i in range(-4, 5) for j in range(-3, 4)])
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert not fit_spot(n, 0.02 * rng.normal(size=len(n)), HEAD).found
    assert "too few" in fit_spot(n[:5], np.ones(5), HEAD).status
    assert "too few" in fit_spot(n, np.full(len(n), 11.0), HEAD).status
    aside = fit_spot(n, returned(n, np.add(TRUE, [9.0, 0.0]), real=False) + 0.001 * rng.normal(size=len(n)), HEAD)
    assert "outside the scan" in aside.status
    with pytest.raises(ValidityError, match="amplitude has shape"):
        fit_spot(n, np.ones(3), HEAD)


def test_the_table_for_the_adjustment_has_the_columns_that_its_calibration_reads():
    from catseye.reduction.calibrations.mirror.search_results import LAYOUT

    when = TimeTag.parse("52889.25000000001")
    direct = Spot("found", np.array([9000.1234, 5000.0]), np.diag([0.04, 0.09]))
    prime = Spot("found", np.array([59000.1234, -5000.0]), np.diag([0.04, 0.09]))
    results = [SearchResult("A", direct, when), SearchResult("B", prime, when), SearchResult("C", Spot("no"), when)]
    header, *rows = adjustment_readings(results, {"A": [1, 2, 3], "B": [4, 5, 6.00001]}, 1434.0).splitlines()
    assert set(LAYOUT.required) <= set(header.split(",")) <= {*LAYOUT.required, *LAYOUT.optional, "mjd_utc"}
    assert rows == [
        "A,1.00000,2.00000,3.00000,9000.123,5000.000,0.2,0.3,direct,52889.25000000001",
        "B,4.00000,5.00000,6.00001,59000.123,-5000.000,0.2,0.3,prime,52889.25000000001",
    ]
    with pytest.raises(ValidityError, match="B was found but has no place"):
        adjustment_readings(results, {"A": [1, 2, 3]}, 0.0)
    with pytest.raises(ValidityError, match="none of 1 targets"):
        adjustment_readings(results[2:], {}, 0.0)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("radius", 0.0, "radius = 0.0"),
        ("threshold_volt", 11.0, "threshold 11.0 V is not below"),
        ("u_counts", -1.0, "-1"),
    ],
)
def test_a_head_that_cannot_be_is_refused(key, value, message):
    known = {
        "zeros": (0.0, 0.0),
        "azimuth_limits": (-1.0, 1.0),
        "radius": 1e-4,
        "threshold_volt": 1.0,
        "noise_volt": 0.1,
    }
    with pytest.raises(ValidityError, match=message):
        SearchHead(**{**known, key: value})


def test_counts_on_the_sky_are_small_near_the_azimuth_axis():
    assert count_size([0.0, 100.0], [0.0, 0.0])[0] < count_size([0.0, 5000.0], [0.0, 0.0])[0]


def test_a_spike_on_the_way_does_not_end_the_search():
    """A bird at the predicted place; the target 20 counts from it."""
    rng = np.random.default_rng(3)
    true = np.add(TRUE, [18.0, 9.0])
    measure, spike = ranger(rng, true), np.rint(TRUE)
    spot = find(TRUE, HEAD, lambda at: 3.0 if np.array_equal(at, spike) else measure(at), search_radius=4e-3)
    assert spot.status == "found"
    assert np.all(np.abs(spot.counts - true) < 4.0 * spot.u_counts)
    assert len(np.unique(spot.looked_at, axis=0)) == len(spot.looked_at)


def test_a_name_that_would_break_the_table_is_refused():
    result = SearchResult("A,B", Spot("found", np.array([1.0, 2.0]), np.eye(2)), TimeTag(1, 0))
    with pytest.raises(ValidityError, match="'A,B' is not a valid name for a table"):
        adjustment_readings([result], {"A,B": [1, 2, 3]}, 0.0)


def test_every_move_of_a_search_is_checked_from_the_mirrors_position():
    asked, at = [], np.add(np.rint(TRUE), [40.0, 10.0])

    def allowed(start, end):
        asked.append((*start, *end))
        return len(asked) < 60  # then the Sun has come

    stopped = find(at, HEAD, lambda n: 0.0, search_radius=2e-3, allowed=allowed, standing=np.add(at, [500.0, 0.0]))
    assert asked[0][:2] == (at[0] + 500.0, at[1])
    assert all(before[2:] == after[:2] for before, after in pairwise(asked[:59]))
    assert len(stopped.looked_at) == 59
    assert "forbidden" in stopped.status
