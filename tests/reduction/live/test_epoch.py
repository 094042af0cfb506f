"""One epoch: its campaign, the parameters in the state, information only added."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.reduction.epoch.parameter import ParameterKind, point_parameters
from catseye.reduction.live.epoch import _persists, observed_site
from catseye.reduction.site.motion import ground_from
from live_scene import START, begun, site
from parameter_scene import parameter, parameters

POSTURE = {"azimuth": np.radians(370.0), "elevation": np.radians(45.0), "mjd": START}
RANGERS = ("ZY102", "ZY105", "ZY108", "ZY110", "ZY113", "ZY116")


def weather(station, seconds=0.0):
    return LiveWeather(station, round((START + seconds / 86400.0) * TICKS_PER_DAY), 10.0, 930.0, 70.0)


@pytest.fixture(scope="module")
def second_epoch():
    """A Live after one epoch of six rangers, with the next round's shots in it, and the tick to solve for."""
    night, live = begun(seed=3)
    night.round(0, rangers=RANGERS).into(live)
    assert live.solve(night.ticks(0)) is not None, live.failed
    night.round(1, rangers=RANGERS).into(live)
    return live, night.ticks(1)


def test_without_weather_there_is_no_campaign():
    with pytest.raises(InputError, match="no weather reading received"):
        observed_site(site(), [], [], **POSTURE)


def test_silent_stations_are_left_out():
    campaign = observed_site(site(), [], [weather("WX2"), weather("WX2", 10.0)], **POSTURE)
    assert [s.name for s in campaign.site.weather_station] == ["WX2"]
    assert campaign.weather.station == ("WX2", "WX2")
    assert campaign.site.campaign.azimuth_deg == pytest.approx(10.0)
    assert campaign.site.campaign.elevation_deg == pytest.approx(45.0)
    assert [s.name for s in site().site.weather_station] == ["WX1", "WX2"], "the site's own record stays"


@pytest.mark.parametrize(
    ("name", "stays"),
    [
        ("ZY101 x", True),
        ("ZY101-F z", True),
        ("zero ZY113", True),
        ("leakage ZY113 real", True),
        ("the air WX1", True),
        ("the air bend", True),
        ("TR01-L y", True),
        ("normal TR01 1", True),
        ("glass TR01-B", True),
        ("DP01C x", False),
        ("normal DP01C 2", False),
        ("glass DP01C", False),
        ("electronics ZY113 4", False),
        ("body dish x", False),
    ],
)
def test_persistent_parameters_are_recognised_by_name(name, stays):
    assert _persists(parameter(name), ("ZY101", "ZY113", "TR01-L", "TR01-R", "TR01-B"), site().triplets) is stays


def test_shots_only_reduce_uncertainty(second_epoch):
    live = copy.deepcopy(second_epoch[0])
    live.set_reference()
    job = live.begin(second_epoch[1])
    epoch = job.solve()
    before, after = job.state, epoch.state
    shared = [p for p in before.parameters if p in set(after.parameters)]
    p, q = (s.covariance[np.ix_(s.columns(shared), s.columns(shared))] for s in (before, after))
    size = np.sqrt(np.diag(p))
    gained = np.linalg.eigvalsh((p - q) / np.outer(size, size))
    # information adds, so that p - q is positive; prisms' normals and cycles are renewed at where points now are
    assert gained[0] > -1e-3
    assert gained[-1] > 0.5, "and here it adds much"
    assert set(before.names) <= set(after.names), "nothing is lost on the way"
    assert "ZY113@0 x" in after.names


def test_record_priors_are_used_once(second_epoch):
    """A ranger without shots is held by survey and sheet; the second epoch must not hear them a second time."""
    live = copy.deepcopy(second_epoch[0])
    job = live.begin(second_epoch[1])
    before, after = job.state, job.solve().state
    mirror = np.zeros((3, len(before.names)))  # scan point less fixed point: the sheet's mirror offset
    for i, axis in enumerate("xyz"):
        mirror[i, before.columns(parameters([f"ZY101 {axis}", f"ZY101-F {axis}"]))] = 1.0, -1.0
    order = after.columns(before.parameters)
    now = after.covariance[np.ix_(order, order)]
    u, v = (np.sqrt(np.diag(mirror @ p @ mirror.T)) for p in (before.covariance, now))
    np.testing.assert_allclose(v, u, rtol=1e-3)  # heard twice it would be 0.7 of it
    zero = before.columns([parameter("zero ZY101")])[0]
    assert now[zero, zero] == pytest.approx(before.covariance[zero, zero], rel=1e-3)


def test_state_is_in_the_frames_of_its_points(second_epoch):
    live = copy.deepcopy(second_epoch[0])
    found = live.solve(second_epoch[1])
    assert live.state.ticks == found.ticks == second_epoch[1]
    for name in ("ZY102", "ZY113", "TR05-B", "ZEG41040L"):
        ground, covariance = found.point(name)
        np.testing.assert_allclose(live.place(name, found.ticks / TICKS_PER_DAY), ground, rtol=0, atol=1e-9)
        at = live.state.columns(point_parameters(ParameterKind.POINT, [name]))
        own, own_covariance = live.state.x[at], live.state.covariance[np.ix_(at, at)]
        # what is considered (`epoch.common_errors`) stays in every epoch's own answer, and not in the state
        assert 0.99 * np.trace(covariance) < np.trace(own_covariance) < np.trace(covariance)
        moves = live.frames[name] != "ground"
        assert (np.linalg.norm(own - ground) > 1.0) == moves
        latest = live.track.latest
        axes = ground_from(site(), live.frames[name], latest.azimuth, latest.elevation).single.rotation
        turned = axes @ own_covariance @ axes.T
        np.testing.assert_allclose(live.uncertainty()[name], turned, rtol=1e-9, atol=1e-18)


def test_rangers_without_shots_stay_in_the_state(second_epoch):
    live = copy.deepcopy(second_epoch[0])
    found = live.solve(second_epoch[1])
    assert found.shots[found.names.index("ZY101")] == 0
    sheet = live.site.mirror_of("ZY101")
    u = np.sqrt(np.diag(found.point("ZY101")[1]))
    assert 0.0 < u.max() < 1e-3 * (sheet.u_offset_mm + 1.0)  # its survey holds it


def test_epoch_solved_on_a_copy_is_the_same(second_epoch):
    here, there = (copy.deepcopy(second_epoch[0]) for _ in range(2))
    first = here.solve(second_epoch[1])
    job = there.begin(second_epoch[1])
    again = there.accept(job, copy.deepcopy(job).solve())
    np.testing.assert_array_equal(first.x, again.x)
    np.testing.assert_array_equal(first.covariance, again.covariance)
    assert first.used == again.used


def test_epoch_with_states_agrees_with_a_dense_one_and_keeps_no_states(second_epoch):
    """The next one has other states: their numbers are its own."""
    live = copy.deepcopy(second_epoch[0])
    job = live.begin(second_epoch[1])
    dense = job.solve()
    states = replace(job, rules=replace(job.rules, dense_shots=0)).solve()
    u = np.where(dense.coordinates.u > 0.0, dense.coordinates.u, 1.0)
    assert np.abs((states.coordinates.x - dense.coordinates.x) / u).max() < 1e-3
    np.testing.assert_allclose(states.coordinates.u, dense.coordinates.u, rtol=5e-3, atol=1e-12)
    assert states.state.parameters == dense.state.parameters
    own = np.sqrt(np.diag(dense.state.covariance))
    gap = (states.state.covariance - dense.state.covariance) / np.outer(own, own)
    assert np.abs(gap).max() < 2e-2
