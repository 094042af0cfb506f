"""A channel removed never moves the answer by more than the uncertainties allow, nor makes it more certain."""

import dataclasses

import numpy as np
import pytest

from catseye.records.night.campaign import REFERENCE
from catseye.reduction.epoch.air.process import AirKnots
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.strengths import Processes
from few_scene import with_shots


def removals(campaign):
    ranger, target = np.array(campaign.shots.ranger), np.array(campaign.shots.target)
    reference = np.flatnonzero((ranger == "ZY115") & (target == REFERENCE))
    one_left = np.ones(len(ranger), dtype=bool)
    one_left[reference[1:]] = False
    return {
        "a feed-arm ranger's shots": with_shots(campaign, ranger != "ZY117"),
        "a ground ranger's shots": with_shots(campaign, ranger != "ZY104"),
        "all references of a ranger but one": with_shots(campaign, one_left),
        "the benchmarks": dataclasses.replace(with_shots(campaign, ~np.char.startswith(target, "ZBM")), benchmarks=()),
        "a triplet's prism": with_shots(campaign, target != "TR05-R"),
        "a ball": with_shots(campaign, target != "TR02-B"),
        "the last third of the night": with_shots(campaign, np.arange(len(ranger)) < 2 * len(ranger) // 3),
    }


NAMES = (
    "a feed-arm ranger's shots",
    "a ground ranger's shots",
    "all references of a ranger but one",
    "the benchmarks",
    "a triplet's prism",
    "a ball",
    "the last third of the night",
)


@pytest.mark.parametrize("channel", NAMES)
def test_a_channel_removed_moves_nothing_beyond_the_uncertainties(few_clear, channel, monkeypatch):
    """The variance of such a difference is u_without^2 - u_with^2; five of its roots, 3 um for linearisation."""
    campaign, reduction = few_clear
    whole = reduction.coordinates
    # fewer shots estimate strengths of processes anew and have fewer knots: another model, not less knowledge
    monkeypatch.setattr(Processes, "estimated", lambda *_: whole.strength)
    knots, count = AirKnots.of, len(campaign.shots.mjd_utc)
    monkeypatch.setattr(AirKnots, "of", lambda span, _, *rest, **named: knots(span, count, *rest, **named))
    rest = reduce_epoch(removals(campaign)[channel]).coordinates
    names = [n for n in rest.places if n in whole.places]
    assert len(names) > 55
    more, less = whole.block(names), rest.block(names)
    gained = np.diag(less) - np.diag(more)
    assert np.all(gained > -2e-4 * np.diag(more))  # a share of rejected good shots aside, never more certain
    difference = np.concatenate([rest.x[rest.index(n)] - whole.x[whole.index(n)] for n in names])
    limit = 5.0 * np.sqrt(np.maximum(gained, 0.0) + (3e-6) ** 2)
    worst = int(np.argmax(np.abs(difference) / limit))
    assert abs(difference[worst]) < limit[worst], (names[worst // 3], difference[worst], limit[worst])


def test_the_upper_weather_station_removed_costs_certainty_and_not_more(few_clear, clear_night):
    campaign, reduction = few_clear
    w = campaign.weather
    mine = np.array(w.station) == "WX1"
    weather = dataclasses.replace(
        w,
        mjd_utc=w.mjd_utc[mine],
        station=tuple(np.array(w.station)[mine].tolist()),
        temperature_c=w.temperature_c[mine],
        pressure_hpa=w.pressure_hpa[mine],
        humidity_percent=w.humidity_percent[mine],
    )
    site = campaign.site.model_copy(update={"weather_station": campaign.site.weather_station[:1]})
    rest = reduce_epoch(dataclasses.replace(campaign, site=site, weather=weather)).coordinates
    whole = reduction.coordinates
    for name in whole.places:
        more, less = np.diag(whole.block([name])), np.diag(rest.block([name]))
        difference = np.abs(rest.x[rest.index(name)] - whole.x[whole.index(name)])
        assert np.all(difference < 4 * np.sqrt(more + less)), name
        assert np.all(np.abs(rest.x[rest.index(name)] - clear_night.truth.points[name]) < 5 * np.sqrt(less)), name


@pytest.mark.parametrize("shots", [1, 2])
def test_a_point_with_one_or_two_good_ranges_keeps_a_large_covariance(few_clear, clear_night, shots):
    campaign, _ = few_clear
    target = np.array(campaign.shots.target)
    on_it = np.flatnonzero(target == "DP021")
    keep = np.ones(len(target), dtype=bool)
    keep[on_it[shots:]] = False
    c = reduce_epoch(with_shots(campaign, keep)).coordinates
    values, vectors = np.linalg.eigh(c.block(["DP021"]))
    u = np.sqrt(values)
    assert np.all(u[shots:] > 4e-3)  # the typing is all that is known there
    assert np.all(u[:shots] < 1e-3)
    error = vectors.T @ (c.x[c.index("DP021")] - clear_night.truth.points["DP021"])
    assert np.all(np.abs(error) < 4 * u)


def test_the_same_shots_in_another_order_give_the_same_answer(few_clear):
    campaign, reduction = few_clear
    order = np.random.default_rng(3).permutation(len(campaign.shots))
    again = reduce_epoch(with_shots(campaign, order)).coordinates
    np.testing.assert_allclose(again.x, reduction.coordinates.x, atol=1e-7)  # rounding, and where the passes end
    np.testing.assert_allclose(again.covariance, reduction.coordinates.covariance, rtol=1e-4, atol=1e-14)


def test_a_shot_taken_twice_is_not_two_paths(few_clear):
    """Noise halves its variance, the air of the path does not: u of the point falls by less than a root of two."""
    campaign, reduction = few_clear
    target = np.array(campaign.shots.target)
    rows = np.sort(np.concatenate([np.arange(len(target)), np.flatnonzero(target == "TR05-L")]))
    twice = with_shots(campaign, rows)
    c, whole = reduce_epoch(twice).coordinates, reduction.coordinates
    u2, was2 = np.diag(c.block(["TR05-L"])), np.diag(whole.block(["TR05-L"]))
    assert np.all(u2 > 0.5 * was2)
    moved = c.x[c.index("TR05-L")] - whole.x[whole.index("TR05-L")]
    assert np.all(np.abs(moved) < np.sqrt(was2))


def test_a_reference_with_a_foreign_reflection_is_rejected_with_its_reason_and_the_coordinates_hold(few_clear):
    campaign, reduction = few_clear
    ranger, target = np.array(campaign.shots.ranger), np.array(campaign.shots.target)
    rows = np.flatnonzero((ranger == "ZY113") & (target == REFERENCE))
    frames = np.array(campaign.frames)
    j = 2 * np.pi * np.arange(frames.shape[1]) / 64
    for k in (rows[0], rows[5]):  # the first of the block, and one inside
        codes = frames[campaign.shots.frame[k]].astype(float)
        phasor = 2 / len(codes) * (codes @ np.cos(j) + 1j * (codes @ np.sin(j)))
        foreign = 0.2j * phasor
        frames[campaign.shots.frame[k]] = np.rint(codes + np.real(foreign * np.exp(-1j * j)))
    spoilt = reduce_epoch(dataclasses.replace(campaign, frames=frames))
    ids = {int(campaign.shots.shot[k]) for k in (rows[0], rows[5])}
    assert {i for i, reason in spoilt.rejected.items() if reason.startswith("bad reference: ")} == ids
    assert len(spoilt.rejected) <= len(reduction.rejected) + 3
    a, b = reduction.coordinates, spoilt.coordinates
    for name in a.places:
        limit = 5 * np.sqrt(np.maximum(np.diag(b.block([name])) - np.diag(a.block([name])), 0) + (3e-6) ** 2)
        assert np.all(np.abs(b.x[b.index(name)] - a.x[a.index(name)]) < limit), name
