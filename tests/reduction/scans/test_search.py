"""Searches: probability of finding against Rayleigh's law and against draws, results that a calibration takes."""

from pathlib import Path

import numpy as np
import pytest

import catseye
from catseye.errors import InputError, ValidityError
from catseye.geometry.mirror.search_pattern import offsets_of_counts
from catseye.reduction.scans.search import plan_search
from catseye.reduction.scans.searches import read_targets
from catseye.reduction.steering.finding import find
from catseye.reduction.steering.spot_fit import SearchHead
from catseye.simulator.laboratory.spots import SimulatedRanger, SpotLight
from draws import draws

ZEROS, LIMITS = (2691.0, 1434.0), (-21_309.0, 75_691.0)
SIDE = np.array([20_000.0, 1434.0 + 12_500.0])  # Phi = 90 degrees: a count of azimuth is largest
HEAD = np.array([20_000.3, 9_000.4])
RANGER = {"monument": "night-01/monuments/ZY103.toml", "mirror": "night-01/mirrors/ZP103.toml"}


def planned(at=SIDE, **how):
    usual = {"name": "spiral", "spot": 3.3e-4, "u": 5e-4, "radius": 1.0e-3, "look": 0.5, "limits": LIMITS}
    return plan_search(at, ZEROS, **{**usual, **how})


@pytest.mark.parametrize("radius", [0.5e-3, 1.0e-3, 1.5e-3])
def test_a_spiral_finds_what_rayleighs_law_says(radius):
    """At least the disc, at most one reach more: 1 - exp(-R^2 / 2 u^2) of both."""
    plan = planned(radius=radius)
    inner, outer = (1.0 - np.exp(-0.5 * (r / 5e-4) ** 2) for r in (radius, radius + 2.0 * plan.within))
    assert inner - 1e-3 < plan.total < outer
    assert np.all(np.diff(plan.probability) >= 0.0)
    assert plan.seconds[-1] == 0.5 * len(plan.pattern)
    assert plan.mean_seconds < 0.5 * plan.seconds[-1]  # likely places come first


def test_draws_of_the_target_are_found_as_often_and_as_early():
    plan, rng = planned(HEAD), np.random.default_rng(46)
    assert plan.u[0] == pytest.approx(5e-4 * np.sin((HEAD[1] - ZEROS[1]) * 4.0 * np.pi / 1e5), rel=1e-12)
    places = rng.normal(size=(4000, 2)) * plan.u
    near = np.hypot(*(places[:, None] - plan.pattern.offsets).transpose(2, 0, 1)) <= plan.within
    found = near.any(axis=1)
    assert np.mean(found) == pytest.approx(plan.total, abs=4.0 * np.sqrt(plan.total * (1.0 - plan.total) / 4000))
    first = near.argmax(axis=1)[found] + 1.0
    assert 0.5 * first.mean() == pytest.approx(plan.mean_seconds, abs=4.0 * 0.5 * first.std() / len(first) ** 0.5)


def test_a_raster_begins_at_a_corner_and_takes_longer():
    spiral, raster = planned(), planned(name="raster")
    assert raster.total >= spiral.total - 0.02
    half = int(np.searchsorted(spiral.probability, 0.5)), int(np.searchsorted(raster.probability, 0.5))
    assert half[1] > 1.3 * half[0]  # half of the targets are found much later
    assert np.hypot(*raster.pattern.offsets[0]) > np.hypot(*spiral.pattern.offsets[0]) + 1e-3


@draws(300, 60)
def test_a_simulated_search_finds_as_often_as_planned(runs):
    """A disc of one u: two of five targets lie beyond it. The light reaches as far as half of its peak, and a little
    farther to the threshold, so that a search may find somewhat more than is planned.
    """
    plan = planned(HEAD, radius=5e-4)
    head = SearchHead(ZEROS, LIMITS, 3.3e-4, threshold_volt=1.9, noise_volt=0.02)
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(runs):
        ranger = SimulatedRanger.drawn(np.array(ZEROS), 5e-4, rng, SpotLight(waist=0.012))
        spot = find(HEAD, head, lambda n, r=ranger: r.measure(n, HEAD, 120.0), search_radius=5e-4)
        hits += spot.found
        if spot.found:
            off = offsets_of_counts(HEAD, ZEROS, (HEAD + ranger.off)[None])[0]
            assert np.hypot(*off) < 5e-4 + 3.0 * plan.within
            assert np.all(np.abs(spot.counts - HEAD - ranger.off) < 5.0 * spot.u_counts + 0.05)
    assert abs(hits / runs - plan.total) < 4.0 * np.sqrt(plan.total * (1.0 - plan.total) / runs) + 0.05


def test_found_targets_go_into_the_calibration_which_finds_the_rangers_zeros(tmp_path):
    """Errors of the zeros drawn of 0.1 mrad: within 3 u of what the calibration says, in both."""
    found = catseye.search_scan("scans/targets.csv", **RANGER, u_mrad=0.1, seed=5)
    assert found.verdict.word == "good"
    found.save_pages(readings=tmp_path / "found.csv")
    made = catseye.calibrate("search-results", tmp_path / "found.csv", "calibrations/search-results.toml")
    off = np.random.default_rng(5).normal(0.0, 1e-4, 2) / (np.array([2.0, 4.0]) * np.pi / 1e5)
    values = made.to_object()["quantities"]
    for key, zero, true in zip(("na0", "ne0"), ZEROS, off, strict=True):
        assert abs(values[key]["value"] - zero - true) < 3.0 * values[key]["u"]


def test_an_absent_target_a_foreign_place_and_a_fine_spot_are_refused_or_said(tmp_path):
    lost = catseye.search_scan("scans/targets.csv", **RANGER, u_mrad=3.0, radius_mrad=0.3, seed=3)
    assert lost.verdict.word == "failed"
    assert "not found" in lost.verdict.why
    with pytest.raises(ValidityError, match="less than whole counts cover"):
        planned(spot=1e-4)
    for text, said in (
        ("T0,0,0,10\nT0,1,1,1\n", r"line 3, target = 'T0' \(expected a name that no other row has"),
        ("T0,0,0,1e6\n", "z_m = '1e6'"),
    ):
        (tmp_path / "t.csv").write_text("target,x_m,y_m,z_m\n" + text)
        with pytest.raises(InputError, match=said):
            read_targets(Path(tmp_path / "t.csv"))
