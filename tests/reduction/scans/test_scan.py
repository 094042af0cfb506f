"""Fits of measured scans: known spots come back within their u, and what determines nothing is refused.

The spots are traced by rays (`simulator.laboratory.spots`); the fit knows Gaussians and flatter ones.
"""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from catseye.errors import EstimationError
from catseye.records.laboratory.scan_table import ScanReadings
from catseye.reduction.scans.scan import fit_scan_readings, pointing_of, pointing_verdict, scanned_axes
from catseye.reduction.steering.spot_fit import SearchHead
from catseye.simulator.laboratory.spots import SpotLight, scan_amplitudes
from draws import draws

ZEROS = np.array([2691.0, 1434.0])
HEAD = SearchHead(tuple(ZEROS), (-21_309.0, 75_691.0), radius=1e-4, threshold_volt=0.5, noise_volt=0.02)
LIGHT = SpotLight()
AXIS = {"azimuth": 0, "elevation": 1}


def places(axes, centre, wide=14, shift=0):
    steps = np.arange(-wide, wide + 1.0) + shift
    if axes == "both":
        across, along = (each.ravel() for each in np.meshgrid(np.arange(-9.0, 10.0), np.arange(-5.0, 6.0)))
        return centre + np.column_stack([across, along])
    counts = np.tile(centre, (len(steps), 1))
    counts[:, AXIS[axes]] += steps
    return counts


def readings(counts, volts):
    return ScanReadings("scan.csv", counts, volts, tuple(f"line {k + 2}" for k in range(len(counts))), "")


def simulated(axes, rng, true=None, light=LIGHT, **where):
    true = np.array([20_000.0, 9_000.0]) + rng.uniform(-0.5, 0.5, 2) if true is None else true
    counts = places(axes, np.rint(true), **where)
    volts = scan_amplitudes(counts, true, ZEROS, distance=120.0, light=light, rng=rng)
    return readings(counts, volts), true


@draws(400, 120)
@pytest.mark.parametrize("axes", ["azimuth", "elevation", "both"])
def test_centres_of_traced_spots_scatter_as_u_says(axes, runs):
    """Over u, the standard deviation is 1 within the scatter of it: 0.07 for 120, and tails of the steep sides."""
    rng, ratios, factors = np.random.default_rng(46), [], []
    for _ in range(runs):
        scan, true = simulated(axes, rng)
        fit = fit_scan_readings(scan, HEAD)
        scanned = [k for k in range(2) if axes in ("both", list(AXIS)[k])]
        ratios += [(fit.values[k] - true[k]) / fit.u[k] for k in scanned]
        factors.append(fit.variance_factor)
    assert 0.8 < np.std(ratios) < 1.3
    assert abs(np.mean(ratios)) < 4.0 * np.std(ratios) / len(ratios) ** 0.5
    assert np.mean(np.array(factors) > 8.0) < 0.04  # few true spots are called doubtful


def test_a_gaussian_is_what_scipys_fit_finds():
    """Without looseness, scintillation or misfit, and for a true Gaussian: centre, radius, peak, background and u."""
    rng = np.random.default_rng(2)
    counts = places("azimuth", np.array([20_000.0, 9_000.0]), wide=20)
    sky = np.sin((9_000.0 - ZEROS[1]) * 4.0 * np.pi / 1e5) * 2.0 * np.pi / 1e5  # rad a count of azimuth

    def model(n, centre, radius, peak, background):
        return background + peak * np.exp(-2.0 * ((n - centre) * sky / radius) ** 2)

    truth = (20_000.3, 4e-4, 3.0, 0.2)
    volts = model(counts[:, 0], *truth) + rng.normal(0.0, 0.02, len(counts))
    head = SearchHead(HEAD.zeros, HEAD.azimuth_limits, 1e-4, 0.5, 0.02, scintillation=0.0, u_counts=1e-6, misfit=0.0)
    fit = fit_scan_readings(readings(counts, volts), head)
    best, q = curve_fit(model, counts[:, 0], volts, p0=(20_000.0, 3e-4, 2.5, 0.1), sigma=np.full(41, 0.02))
    u = np.sqrt(np.diag(q))
    np.testing.assert_allclose(fit.values[[0, 2, 3, 4]], best, atol=0.0, rtol=0.02)
    assert fit.values[0] == pytest.approx(best[0], abs=0.1 * u[0])
    assert fit.u[0] == pytest.approx(u[0], rel=0.35)  # curve_fit takes u from the scatter
    assert fit.width == pytest.approx(np.sqrt(2.0 * np.log(2.0)) * fit.values[2], rel=0.03)
    at_half = fit.at(np.array([[fit.values[0] + 0.5 * fit.width / sky, 9_000.0]]))[0]
    assert at_half == pytest.approx(fit.values[4] + 0.5 * fit.values[3], rel=1e-3)


def test_residuals_are_the_readings_minus_the_prediction():
    scan, _ = simulated("azimuth", np.random.default_rng(1))
    fit = fit_scan_readings(scan, HEAD)
    np.testing.assert_allclose(fit.predicted + fit.residual, scan.amplitude)
    assert fit.verdict.word == "good"
    assert fit.covariance[1, 1] == 0.0
    assert fit.values[1] == 9000.0


@pytest.mark.parametrize(
    ("spoilt", "text"),
    [
        (
            {"light": SpotLight(peak_volt=12.0)},
            r"scan.csv: (line 1\d, ){2}line 1\d and \d+ more: amplitude at",
        ),
        ({"light": SpotLight(peak_volt=0.0)}, "are more than 5 x 0.02 V above the background"),
        ({"shift": 15}, "lies at the lower edge of the scan, azimuth 20001 to 20029 counts"),
        ({"shift": -13}, "lies at the upper edge of the scan"),
        ({"wide": 3}, "7 readings are too few for a spot"),
    ],
)
def test_a_scan_that_determines_no_spot_is_refused(spoilt, text):
    scan, _ = simulated("azimuth", np.random.default_rng(3), np.array([20_000.0, 9_000.0]), **spoilt)
    with pytest.raises(EstimationError, match=text):
        fit_scan_readings(scan, HEAD)


def test_a_mirror_that_stood_still_is_refused():
    with pytest.raises(EstimationError, match=r"scan.csv: the mirror stood still"):
        fit_scan_readings(readings(np.full((9, 2), 100.0), np.linspace(0.0, 3.0, 9)), HEAD)
    assert scanned_axes(np.array([[0.0, 1.0], [0.0, 2.0]])) == "elevation"


def test_two_spots_in_a_scan_are_doubtful():
    rng = np.random.default_rng(4)
    scan, true = simulated("azimuth", rng, np.array([20_000.0, 9_000.0]), wide=40)
    other = scan_amplitudes(scan.counts, true + np.array([11.0, 0.0]), ZEROS, distance=120.0, light=LIGHT, rng=rng)
    fit = fit_scan_readings(readings(scan.counts, scan.amplitude + 0.6 * other), HEAD)
    assert fit.verdict.word == "doubtful"


def test_scans_of_both_axes_make_a_pointing_and_a_moved_target_a_doubt():
    rng = np.random.default_rng(5)
    true = np.array([20_000.2, 9_000.4])
    fits = [fit_scan_readings(simulated(axes, rng, true)[0], HEAD) for axes in ("azimuth", "elevation", "both")]
    pointing = pointing_of(fits)
    assert np.all(np.abs(pointing.counts - true) < 3.0 * pointing.u)
    assert np.all(pointing.u < np.min([fit.u[:2] for fit in fits[2:]], axis=0))
    assert pointing_verdict(fits, pointing).word == "good"
    alone = pointing_of(fits[:1])
    assert np.isnan(alone.counts[1])
    assert alone.counts[0] == pytest.approx(fits[0].values[0])
    moved = [*fits, fit_scan_readings(simulated("azimuth", rng, true + np.array([3.0, 0.0]))[0], HEAD)]
    verdict = pointing_verdict(moved, pointing_of(moved))
    assert verdict.word == "doubtful"
    assert "moved" in verdict.why
