"""Allowances: what nothing tells apart is allowed for."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array

from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.observations.kinds import Linear
from catseye.reduction.epoch.air.field import AirField
from catseye.reduction.epoch.air.process import AirKnots
from catseye.reduction.epoch.air.stations import StationRecord
from catseye.reduction.epoch.allowance import (
    BEND_OF_GRADIENT,
    NOTHING,
    STEEPEST_DOWN,
    STEEPEST_UP,
    UNPLACED,
    Allowance,
    AllowanceReason,
    for_the_air,
)
from catseye.reduction.epoch.notes import doubts_of
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.self_check import HEIGHT, TIME
from catseye.reduction.live.thermometers import SuspectedBias, with_suspected_biases

HEIGHTS = np.array([-2.6, 47.4])  # m, 50 apart
SIGMA_C, SIGMA_BEND = 0.3, 0.03


def field(temperatures=(10.0, 10.0), *, placed=True, heights=HEIGHTS, profile="bend"):
    """Two stations that read constant temperatures for an hour."""
    seconds = np.arange(0.0, 3601.0, 60.0)
    records = tuple(StationRecord.of(seconds, np.tile([t, 900.0, 50.0], (len(seconds), 1))) for t in temperatures)
    return AirField(
        names=("WX1", "WX2", profile),
        sigmas=np.array([SIGMA_C, SIGMA_C, SIGMA_BEND]),
        heights=np.asarray(heights, dtype=float),
        places=np.zeros((2, 2)),
        placed=np.full(2, placed),
        records=records,
        knots=AirKnots.of((0.0, 3600.0), 100, [r.temperature_c for r in records], [], zeta=np.array([-1.0, 1.0])),
        sun=np.zeros((2, 0)),
        start_mjd=60000.0,
        wavelength_um=0.78,
        model="rueger1990",
    )


def thermometer(station):
    return Parameter(ParameterKind.THERMOMETER, station)


def known(air, values=(), u=()):
    """An adjustment that says the air's first parameters with their u; the others are zero and little known."""
    x, sigma = np.zeros(air.count), np.full(air.count, 1e-3)
    x[: len(values)], sigma[: len(u)] = values, u
    every = np.arange(air.count)
    return adjust(np.zeros(air.count), [Linear("all", x, sigma**2, every, np.eye(air.count))]), every


# -- gradients that few nights have -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("off_c", "loose"), [(0.7, False), (0.8, True), (-0.9, True)])
def test_a_thermometer_all_but_refuted_pulls_no_more_where_certified_paths_know_it(off_c, loose):
    """2.5 of its u are 0.75 °C; one whose air nothing certified crosses is held to its record and only told."""
    air = field((10.0 + off_c, 10.0))
    adjusted = known(air, values=(off_c, 0.0), u=(0.15, 0.05))
    found = for_the_air(NOTHING, air, *adjusted)
    assert ("WX1" in found.thermometers) == loose
    if loose:
        assert found.thermometers["WX1"] == pytest.approx(np.hypot(SIGMA_C, off_c))
        assert "WX1" in found.texts[0]
    held = Allowance(held=frozenset([thermometer("WX1")]))
    assert for_the_air(held, air, *adjusted).thermometers == {}


def test_an_ordinary_gradient_needs_no_allowance():
    for gradient in (0.9 * STEEPEST_DOWN, -0.0065, 0.0, 0.9 * STEEPEST_UP):
        air = field((10.0, 10.0 + 50.0 * gradient))
        found = for_the_air(NOTHING, air, *known(air, u=(SIGMA_C, SIGMA_C)))
        assert found.same(NOTHING)
        assert found.texts == ()
        assert found.profile == 0.0


def test_a_steep_inversion_widens_the_thermometer_undetermined_by_ranges():
    """By hand: 3 °C over 50 m are an inversion of 0.06 °C/m, or WX2, which nothing checks, is 3 °C off."""
    air = field((10.0, 13.0))
    found = for_the_air(NOTHING, air, *known(air, u=(0.05, 0.29)))
    assert set(found.thermometers) == {"WX2"}
    assert found.thermometers["WX2"] == pytest.approx(np.hypot(0.3, 3.0), rel=1e-6)
    assert found.profile == pytest.approx(np.hypot(SIGMA_BEND, BEND_OF_GRADIENT * 3.0), rel=1e-6)
    (text,) = found.texts
    assert text.startswith("the stations differ by +0.060 °C a metre of height")
    assert "a strong inversion" in text  # the one candidate
    assert "WX2's thermometer is off by some 3.0 °C" in text  # the other
    assert not found.same(NOTHING)
    np.testing.assert_allclose(found.sigmas(air), [0.3, np.hypot(0.3, 3.0), np.hypot(0.03, 0.3)], rtol=1e-6)


def test_for_air_too_cold_above_the_excess_over_the_usual_lapse_is_doubtful():
    """By hand: -2.5 °C over 50 m, of which the standard atmosphere has -0.325: 2.175 °C are left."""
    air = field((10.0, 7.5))
    found = for_the_air(NOTHING, air, *known(air, u=(0.28, 0.29)))
    assert set(found.thermometers) == {"WX1", "WX2"}
    for u in found.thermometers.values():
        assert u == pytest.approx(np.hypot(0.3, 2.175), rel=1e-6)
    (text,) = found.texts
    assert text.startswith("the stations differ by -0.050 °C a metre of height")
    assert "WX1's thermometer or WX2's thermometer is off by some 2.2 °C" in text


def test_a_biased_thermometer_makes_no_gradient():
    air = field((10.0, 13.0))
    adjusted = known(air, values=(0.0, 2.9), u=(0.05, 0.05))
    found = for_the_air(NOTHING, air, *adjusted, dropped=[thermometer("WX2")])
    assert found.same(NOTHING)
    assert found.texts == ()


def test_stations_at_one_height_show_no_gradient_to_judge():
    air = field((10.0, 13.0), heights=(10.0, 10.0), profile="gradient")
    found = for_the_air(NOTHING, air, *known(air, u=(SIGMA_C, SIGMA_C)))
    assert found.same(NOTHING)


def test_a_steep_gradient_with_determined_thermometers_still_bends_and_is_noted():
    """Nobody doubts the thermometers, so it is an inversion; and an inversion's profile is no straight line."""
    air = field((10.0, 13.0))
    found = for_the_air(NOTHING, air, *known(air, u=(0.05, 0.05)))
    assert found.thermometers == {}
    assert found.profile == pytest.approx(np.hypot(SIGMA_BEND, BEND_OF_GRADIENT * 3.0), rel=1e-6)
    assert found.texts
    assert found.same(NOTHING)  # the answer keeps to the records, its covariance takes the doubt in


def test_judged_again_the_text_is_the_newer_and_no_uncertainty_shrinks():
    air = field((10.0, 13.0))
    first = for_the_air(NOTHING, air, *known(air, u=(0.05, 0.29)))
    again = for_the_air(first, air, *known(air, values=(0.0, 0.5), u=(0.05, 0.29)))
    assert len(again.texts) == 1
    assert again.texts[0].startswith("the stations differ by +0.050 °C")
    assert again.thermometers["WX2"] == first.thermometers["WX2"]
    assert again.profile == first.profile
    assert again.same(first)


# -- stations that stand nobody knows where ---------------------------------------------------------------------------


def sloping(air, east, north=0.0):
    """The solution of a site whose air is warmer by so much, °C/m, all the time."""
    values = np.zeros(air.count)
    j = len(air.knots.across)
    values[air.count - 2 * j : air.count - j], values[air.count - j :] = east, north
    return known(air, values=values)


def test_a_station_without_a_place_is_uncertain_by_the_gradient_over_the_site():
    air = field(placed=False)
    found = for_the_air(NOTHING, air, *sloping(air, 0.003, -0.004))
    expected = np.hypot(SIGMA_C, 0.005 * UNPLACED)
    assert found.thermometers == pytest.approx({"WX1": expected, "WX2": expected})
    assert not found.same(NOTHING)
    assert for_the_air(found, air, *sloping(air, 0.003, -0.004)).same(found)


def test_a_placed_station_or_even_air_needs_no_allowance():
    air = field()
    assert for_the_air(NOTHING, air, *sloping(air, 0.005)).same(NOTHING)
    air = field(placed=False)
    assert for_the_air(NOTHING, air, *sloping(air, 0.0005)).same(NOTHING)  # 0.04 °C beside 0.3: 1 % more


# -- the same allowance -----------------------------------------------------------------------------------------------


def test_only_changed_priors_and_families_require_another_adjustment():
    one = Allowance(
        held=frozenset([thermometer("WX1")]), thermometers={"WX2": 1.0}, profile=0.3, families={HEIGHT: 0.5}
    )
    assert one.same(one)
    assert dataclasses.replace(one, thermometers={"WX2": 1.09}).same(one)  # to a tenth
    assert dataclasses.replace(one, thermometers={"WX2": 0.5}).same(one)
    assert not dataclasses.replace(one, thermometers={"WX2": 1.2}).same(one)
    assert dataclasses.replace(one, thermometers={"WX2": 1.0, "WX1": 4.0}).same(one)  # held: its record stays
    assert dataclasses.replace(one, profile=0.6).same(one)
    assert not dataclasses.replace(one, held=frozenset()).same(one)
    assert not dataclasses.replace(one, families={HEIGHT: 0.5, TIME: 0.1}).same(one)


def test_a_considered_doubt_widens_by_the_priors_effect():
    """Against adjusting again with the prior's value moved by one standard uncertainty of the doubt."""
    air = field()
    every, rng = np.arange(air.count), np.random.default_rng(4)
    ranges = Linear(
        "ranges", rng.normal(size=40), np.full(40, 0.04), every, rng.normal(size=(40, air.count)) / np.sqrt(air.count)
    )

    def adjusted(offset_c):
        values, sigma = np.zeros(air.count), np.full(air.count, 0.5)
        values[1], sigma[:3] = offset_c, air.sigmas
        return adjust(np.zeros(air.count), [ranges, Linear("all", values, sigma**2, every, np.eye(air.count))])

    doubted = Allowance(held=frozenset([thermometer("WX2")]), thermometers={"WX2": 1.5})
    np.testing.assert_array_equal(doubted.priors(air), air.sigmas)
    plain, moved = adjusted(0.0), adjusted(np.sqrt(1.5**2 - SIGMA_C**2))
    shift = moved.x - plain.x
    found = doubted.considered(air, plain, every)
    whole = plain.q.matrix() + np.outer(shift, shift)
    np.testing.assert_allclose(found.q.matrix(), whole, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.q.diagonal(), np.diag(whole), rtol=1e-9)
    some = np.array([0, 1, 5])
    np.testing.assert_allclose(found.q.within(some), whole[np.ix_(some, some)], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.q.across(some), whole[:, some], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.q.blocks(np.array([2]))[0], whole[2:5, 2:5], rtol=1e-9, atol=1e-12)
    rows, a = np.array([[1, 4, -1]]), np.array([[0.5, -2.0, 7.0]])
    np.testing.assert_allclose(found.q.products(rows, a)[0, :2], whole[[1, 4]][:, [1, 4]] @ a[0, :2], rtol=1e-9)
    np.testing.assert_allclose(found.q.solve(np.ones(air.count)), whole @ np.ones(air.count), rtol=1e-9)
    sparse = csr_array(np.eye(air.count)[some])
    np.testing.assert_allclose(found.q.carried(sparse), whole[np.ix_(some, some)], rtol=1e-9, atol=1e-12)
    assert NOTHING.considered(air, plain, every) is plain


def test_an_allowance_never_claims_less_than_the_records():
    air = field()
    small = Allowance(thermometers={"WX1": 0.1, "elsewhere": 9.0}, profile=0.001)
    np.testing.assert_array_equal(small.sigmas(air), air.sigmas)
    assert air.sigmas[0] == SIGMA_C
    large = Allowance(thermometers={"WX1": 2.0}, profile=0.2)
    np.testing.assert_array_equal(large.sigmas(air), [2.0, SIGMA_C, 0.2])
    np.testing.assert_array_equal(air.sigmas, [SIGMA_C, SIGMA_C, SIGMA_BEND])  # its own are not changed


# -- a thermometer is judged once -------------------------------------------------------------------------------------


def test_a_later_judgement_of_a_thermometer_replaces_the_earlier():
    before = Allowance(
        reasons=(
            AllowanceReason("WX1 of an epoch before", thermometer("WX1")),
            AllowanceReason("WX2 of an epoch before", thermometer("WX2")),
            AllowanceReason("of no parameter"),
        )
    )
    found = with_suspected_biases(before, {"WX1": SuspectedBias("biased", 1.65, 0.13)}, field())
    assert found.texts[:2] == ("WX2 of an epoch before", "of no parameter")
    assert found.reasons[2:] == (AllowanceReason(SuspectedBias("biased", 1.65, 0.13).text("WX1"), thermometer("WX1")),)
    refuted = with_suspected_biases(before, {"WX1": SuspectedBias("biased", 1.65, 0.13)}, field(), refuted=("WX1",))
    assert refuted.reasons == found.reasons[:2]  # its adjustment says so itself


@pytest.mark.parametrize("named", ["by nothing", "as refuted", "by an allowance"])
def test_a_thermometer_at_the_end_of_its_prior_is_doubted_unless_it_is_named_already(named):
    air, off = field(), 3.0 * SIGMA_C
    solution, columns = known(air, [off, 0.0], [0.05, 0.05])
    reasons = (AllowanceReason("named", thermometer("WX1")),) if named == "by an allowance" else ()
    layout, allowance = SimpleNamespace(air=columns), Allowance(reasons=reasons)
    network = SimpleNamespace(field=air, layout=layout, allowance=allowance, motion=None)
    doubts = doubts_of(network, solution, [], {thermometer("WX1"): off} if named == "as refuted" else {})
    text = "WX1's thermometer is biased by +0.90 °C, 3.0 of its u"
    assert doubts == {"by nothing": (text,), "as refuted": (), "by an allowance": ("named",)}[named]
