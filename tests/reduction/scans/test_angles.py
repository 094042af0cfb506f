"""Returns by angle: the kind of a traced corner is recognised, its stage's zeros come back within their u."""

from functools import cache

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.errors import EstimationError, InputError
from catseye.records.laboratory.angle_table import AngleReadings
from catseye.reduction.scans.angles import compare_angles, drawn_kinds, sizes_of
from catseye.simulator.laboratory.spots import TrueCorner
from draws import draws

SIZES = sizes_of(aperture_mm=25.4, height_mm=38.1, reflectance=0.97)
CORNERS = {
    "bare prism": TrueCorner(),
    "prism with silvered faces": TrueCorner(mirror=0.97),
    "hollow cube": TrueCorner(height=0.0254 * 2.0**0.5, index=1.0, mirror=0.97),
}
GAIN, ZERO, EDGE = 4.0, 0.8 * DEGREE, 17.0 * DEGREE
TURNS = np.arange(0.0, 360.0, 10.0) * DEGREE
INCIDENCE = np.append(np.arange(-45.0, 45.1, 3.0) * DEGREE, np.full(len(TURNS), 30.0 * DEGREE))
ROTATION = np.append(np.full(31, 20.0 * DEGREE), TURNS)


@cache
def shares(kind):
    """Traced returns at the stage's angles, over that at normal incidence."""
    corner, off = CORNERS[kind], INCIDENCE - ZERO
    traced = [
        corner.share(abs(o), turn - EDGE + (np.pi if o < 0.0 else 0.0)) for o, turn in zip(off, ROTATION, strict=True)
    ]
    return np.array(traced) / corner.share(0.0, 0.0)


def measured(kind, rng, unit="V"):
    bright = GAIN * shares(kind) * np.exp(rng.normal(0.0, 0.02, len(INCIDENCE)))
    noise = 0.02 * rng.normal(size=(2, len(bright)))
    value = np.abs(bright + noise[0] + 1j * noise[1]) if unit == "V" else np.abs(bright + 0.1 + noise[0])
    return readings(value, unit)


def readings(value, unit="V", use=slice(None)):
    return AngleReadings(
        ("a.csv",), INCIDENCE[use], ROTATION[use], value=value[use], unit=unit, table=np.zeros(len(value[use]), int)
    )


def compared(found, **how):
    return compare_angles(found, SIZES, **{"noise": 0.02, "relative": 0.02, **how})


@pytest.mark.parametrize("kind", CORNERS)
def test_a_traced_corner_is_recognised_among_the_kinds(kind):
    found = compared(measured(kind, np.random.default_rng(3)))
    assert found.fit.kind == kind
    assert found.verdict.word == "good"
    assert found.fits[1].chi2 > 5.0 * found.fit.chi2
    assert found.fit.determined.tolist() == [True, True, True, kind == "bare prism"]


@draws(60, 15)
def test_gain_and_zeros_scatter_as_u_says(runs):
    """Mean square over u: 1 within 4 sigma of 3 x 15 values; the background is bounded by 0 and left out."""
    truth, ratios = np.array([GAIN, 0.0, ZERO, EDGE]), []
    for seed in range(runs):
        fit = compared(measured("bare prism", np.random.default_rng(seed))).fit
        ratios.append(((fit.values - truth) / fit.u)[[0, 2, 3]])
    assert abs(np.mean(np.square(ratios)) - 1.0) < 4.0 * np.sqrt(2.0 / np.size(ratios))


def test_a_power_has_its_background_added():
    fit = compared(measured("prism with silvered faces", np.random.default_rng(5), "mW")).fit
    assert abs(fit.values[1] - 0.1) < 4.0 * fit.u[1] + 0.01
    assert not fit.quadrature


def test_half_of_the_return_is_where_the_figure_of_the_kinds_has_it():
    from catseye.gateways.optics.retroreflector_figures import return_plot

    drawn = return_plot()[1]["half_of_normal_at_deg"]
    fits = {fit.kind: fit for fit in compared(measured("bare prism", np.random.default_rng(1))).fits}
    for kind, name in (("hollow cube", "hollow_cube"), ("prism with silvered faces", "prism_with_silvered_faces")):
        assert fits[kind].half / DEGREE == pytest.approx(drawn[name], abs=0.1)


def test_a_stated_kind_that_does_not_fit_is_doubtful_and_the_better_one_named():
    found = compared(measured("bare prism", np.random.default_rng(2)), kind="hollow-cube")
    assert found.verdict.word == "doubtful"
    assert "bare prism fits better" in found.verdict.why


def test_a_table_that_cannot_tell_kinds_apart_says_so():
    """At one small incidence every kind returns the same."""
    flat = AngleReadings(
        ("a.csv",), np.zeros(9), TURNS[:9], value=np.full(9, 2.0), unit="V", table=np.zeros(9, dtype=int)
    )
    found = compared(flat)
    assert found.verdict.word == "doubtful"
    assert "alike" in found.verdict.why


def test_too_few_readings_darkness_and_an_unknown_kind_are_refused():
    value = np.full(len(INCIDENCE), 0.01)
    with pytest.raises(EstimationError, match=r"a.csv: no reading is above 5 x 0.02 V"):
        compared(readings(value))
    with pytest.raises(EstimationError, match="4 readings are too few"):
        compared(readings(value + 1.0, use=slice(4)))
    with pytest.raises(InputError, match=r"kind 'cube' is unknown \(expected one of ball, bare-prism"):
        compared(readings(value + 1.0), kind="cube")
    assert list(drawn_kinds(SIZES)) == ["ball", "hollow cube", "prism with silvered faces", "bare prism"]


def test_chi_square_counts_the_background_s_prior_as_its_degrees_of_freedom_do():
    """A background of 0.1 mW is 5 times the noise, 2.5 u of its prior."""
    value = measured("prism with silvered faces", np.random.default_rng(5), "mW").value
    fit = compared(readings(value, "mW")).fit
    of_readings = np.sum(((value - fit.predicted) / fit.sigma) ** 2)
    assert fit.chi2 - of_readings == pytest.approx((fit.values[1] / 0.04) ** 2, rel=1e-9)
    assert fit.degrees_of_freedom == len(value) + 1 - 3
