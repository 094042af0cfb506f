"""Light through an analyser: traced fields, sums of two analysers, a crossed analyser behind perfect mirrors."""

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.records.laboratory.angle_table import AngleReadings
from catseye.reduction.scans.analyser import PolarizedShare, plane_azimuth
from catseye.reduction.scans.angles import compare_angles, drawn_kinds, sizes_of
from catseye.simulator.laboratory.spots import TrueCorner

SIZES = sizes_of(aperture_mm=25.4, height_mm=38.1, reflectance=0.97)
CORNERS = {
    "bare prism": TrueCorner(index=SIZES.phase),
    "prism with silvered faces": TrueCorner(index=SIZES.phase, mirror=0.97),
    "hollow cube": TrueCorner(height=0.0254 * 2.0**0.5, index=1.0, mirror=0.97),
}
NONE = float("nan")
PLACES = [
    (0.0, 0.3),
    (5.0, 1.0),
    (14.0, 2.0),
    (17.0, 4.4),
    (26.0, 0.9),
]  # degrees, rad: off the end of total reflection


@pytest.fixture(scope="module", params=CORNERS)
def kind(request):
    retro = drawn_kinds(SIZES)[request.param]
    return retro, CORNERS[request.param], PolarizedShare(retro, 0.7, 30.0 * DEGREE)


def ratio(share, incidence, azimuth, analyser):
    return float(share(np.array([incidence]), np.array([azimuth]), np.array([analyser]))[0])


@pytest.mark.parametrize("analyser", [NONE, 0.0, 0.5 * np.pi, 0.4])
def test_a_traced_field_passes_as_the_sectors_say(kind, analyser):
    """Every ray's field followed with Fresnel's phases; 2e-3: the face of the trace is a grid of rays."""
    retro, corner, share = kind
    for degrees, azimuth in PLACES:
        i = degrees * DEGREE
        traced = corner.polarized(i, azimuth, field=0.7, analyser=None if np.isnan(analyser) else analyser)
        found = float(retro.return_share(i, azimuth)) * ratio(share, i, azimuth, analyser)
        assert found == pytest.approx(traced, abs=2e-3)


def test_two_analysers_across_each_other_pass_all_of_the_light(kind):
    _, _, share = kind
    for degrees, azimuth in PLACES:
        both = [ratio(share, degrees * DEGREE, azimuth, angle) for angle in (0.3, 0.3 + 0.5 * np.pi)]
        assert sum(both) == pytest.approx(ratio(share, degrees * DEGREE, azimuth, NONE), abs=1e-6)


def test_perfect_mirrors_pass_nothing_through_a_crossed_analyser():
    share = PolarizedShare(drawn_kinds(SIZES)["hollow cube"], 0.2, 20.0 * DEGREE)
    turns = np.linspace(0.0, 6.0, 9)
    assert share(np.full(9, 0.2), turns, np.full(9, 0.5 * np.pi)) == pytest.approx(0.0, abs=1e-12)
    assert share(np.full(9, 0.2), turns, np.full(9, 0.25 * np.pi)) == pytest.approx(0.5)  # Malus


def test_the_plane_of_incidence_is_the_azimuth_near_the_axis_only():
    """At 90 degrees of incidence towards y the plane's direction is -z, which is v: a right angle of azimuth."""
    assert plane_azimuth(np.array(1e-9), np.array(2.0)) == pytest.approx(2.0)
    assert plane_azimuth(np.array(1.5), np.array(0.5 * np.pi)) == pytest.approx(0.5 * np.pi)
    assert plane_azimuth(np.array(0.5), np.array(0.7)) != pytest.approx(0.7, abs=1e-3)


def readings(kind, seed, field=30.0 * DEGREE):
    rng = np.random.default_rng(seed)
    stage = [(15.0, t) for t in np.arange(0.0, 120.0, 10.0)] + [(i, 20.0) for i in np.arange(-18.0, 19.0, 4.0)]
    corner, rows = CORNERS[kind], []
    normal = corner.share(0.0, 0.0)
    for analyser in (0.0, 90.0):
        for i, turn in stage:
            off, azimuth = (i - 0.8) * DEGREE, (turn - 17.0) * DEGREE
            share = corner.polarized(
                abs(off), azimuth + (np.pi if off < 0.0 else 0.0), field=field, analyser=analyser * DEGREE
            )
            bright = 4.0 * share / normal * np.exp(rng.normal(0.0, 0.02))
            value = abs(bright + 0.02 * complex(*rng.normal(size=2)))
            rows.append((i * DEGREE, turn * DEGREE, value, analyser * DEGREE))
    incidence, rotation, value, analyser = np.array(rows).T
    return AngleReadings(
        ("a.csv",), incidence, rotation, value=value, unit="V", table=np.zeros(len(rows), int), analyser=analyser
    )


def compared(found, polarization):
    return compare_angles(found, SIZES, noise=0.02, relative=0.02, polarization=polarization)


def test_a_prism_behind_an_analyser_is_recognised_with_its_zeros():
    """Gain and both zeros within four u; another polarization of the light, or a hollow cube, does not fit."""
    found = readings("bare prism", 3)
    result = compared(found, 30.0 * DEGREE)
    fit = result.fit
    assert (fit.kind, result.verdict.word) == ("bare prism", "good")
    off = (fit.values - np.array([4.0, 0.0, 0.8 * DEGREE, 17.0 * DEGREE])) / fit.u
    assert np.abs(off[[0, 2, 3]]).max() < 4.0
    assert compared(found, -30.0 * DEGREE).verdict.word == "doubtful"  # p below 1e-50
    assert result.fits[1].chi2 > 10.0 * fit.chi2


def test_a_dark_crossed_analyser_says_mirrors():
    result = compared(readings("hollow cube", 4), 30.0 * DEGREE)
    assert result.verdict.word in ("good", "doubtful")
    assert result.fits[-1].kind == "bare prism"
    assert result.fit.kind == "hollow cube"
