"""A feed arm that sways between the shots, planted into night-01's phases: its shots are good, and count less."""

import dataclasses

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from catseye.constants import SPEED_OF_LIGHT
from catseye.records.night.jitter import JitterRow, jitter_table
from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.ranges import follow_electronics
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.site.motion import shaken

KAPPA = 4 * np.pi * 1.5e9 / SPEED_OF_LIGHT  # rad a metre of range, in vacuum
SWAY_MM = 0.25  # of each coordinate of the arm, as in a wind of 4 m/s and its two modes


def test_ranges_within_a_body_do_not_shake():
    """Worked by hand: 0.3 and 0.4 are 0.5; what shakes with the ranger's own body does nothing."""
    u = {"arm": np.array([0.3, 0.3, 0.3, 0.6]), "dish": 0.4}
    found = shaken("arm", ("dish", "arm", "", "alidade"), u)
    np.testing.assert_allclose(found, np.array([0.25, 0.0, 0.09, 0.36]) * 1e-6, rtol=1e-12)
    np.testing.assert_allclose(shaken("", ("dish", "arm", "", ""), u), np.array([0.16, 0.09, 0, 0]) * 1e-6, rtol=1e-12)
    assert shaken("dish", (), {"arm": 0.2}).shape == (0,)


def solved(campaign, phases):
    electronics, _ = follow_electronics(campaign, phases)
    with threadpool_limits(limits=1, user_api="blas"):
        return adjust_coordinates(campaign, phases, electronics, settings=ReductionSettings())


@pytest.fixture(scope="module")
def swayed(few_01, reduced_few_01):
    """Phases of the campaign whose arm is elsewhere at each shot: a range that grows is a phase that falls."""
    c, phases = reduced_few_01.coordinates, reduced_few_01.phases
    rng, turn = np.random.default_rng(39), np.zeros(len(phases.phasor))
    for k, (ranger, target) in enumerate(zip(few_01.shots.ranger, few_01.shots.target, strict=True)):
        if target not in c.points:
            continue
        away = rng.normal(0.0, 1e-3 * SWAY_MM, 3)
        sight = c.x[c.index(target)] - c.x[c.index(ranger)]
        moved = sum(sign * (c.places[n].body == "arm") for n, sign in ((target, 1), (ranger, -1))) * away
        longer = np.linalg.norm(sight + moved) - np.linalg.norm(sight)
        turn[k] = -KAPPA * (1.0 + c.refractivity_ppm * 1e-6) * longer
    return dataclasses.replace(phases, phasor=phases.phasor * np.exp(1j * turn))


def rejected(coordinates):
    return {int(k) for k, on in zip(coordinates.ranges.shot, coordinates.ranges.used, strict=True) if not on}


def sways_mm(coordinates):
    return {each.name: 1e3 * each.sway_m for each in coordinates.scatter if each.sway_m}


def test_swaying_shots_count_less_by_the_campaign_or_by_their_scatter(few_01, reduced_few_01, swayed):
    """The very shots that were wrong in the still night are rejected, and coordinates stay within what they claim.

    Where the campaign does not say how far, the shots do; where it does, they show no more.
    """
    still = reduced_few_01.coordinates
    start, end = few_01.shots.mjd_utc.min(), few_01.shots.mjd_utc.max()
    rows = [JitterRow(mjd_utc=float(t), body="arm", u_mm=SWAY_MM) for t in (start, end)]
    told = dataclasses.replace(few_01, jitter=jitter_table(rows))
    without, found = solved(few_01, swayed), solved(told, swayed)
    assert sways_mm(still) == {}
    assert sways_mm(found) == {}
    assert sways_mm(without) == pytest.approx({"feed arm": SWAY_MM}, rel=0.2)  # 140 shots
    assert rejected(without) == rejected(found) == rejected(still)
    assert found.variance_factor == pytest.approx(1.0, abs=4 * np.sqrt(2.0 / found.degrees_of_freedom))
    arm = [n for n, place in still.places.items() if place.body == "arm" and n in found.points]
    at, was = found.rows(arm), still.rows(arm)
    for each in (found, without):
        off = each.x[at] - still.x[was]
        grown = np.sqrt(each.u[at] ** 2 - still.u[was] ** 2)  # the night's own errors are in both
        assert np.sqrt(np.mean((off / grown) ** 2)) == pytest.approx(1.0, abs=0.5)  # few points, all of one arm


def test_no_jitter_changes_no_bit(few_01, reduced_few_01):
    rows = [JitterRow(mjd_utc=float(few_01.shots.mjd_utc[0]), body=body, u_mm=0.0) for body in ("arm", "dish")]
    quiet = solved(dataclasses.replace(few_01, jitter=jitter_table(rows)), reduced_few_01.phases)
    assert np.array_equal(quiet.x, reduced_few_01.coordinates.x)
    assert np.array_equal(quiet.covariance, reduced_few_01.coordinates.covariance)
