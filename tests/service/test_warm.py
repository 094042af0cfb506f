"""Start at any hour: mirrors that look at the Sun, missing indices."""

import asyncio
from functools import cache

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.coordinator.link.preparation import Preparation
from catseye.coordinator.visibility.vantage import reflector_at, vantages_of
from catseye.errors import InputError
from catseye.geometry.mirror.pointing import beam
from catseye.ranger.initialisation import SiteCommands
from catseye.ranger.line import Request
from catseye.ranger.ranger import Ranger
from catseye.ranger.sun_watch import HALF_ANGLE, PARKED, SET, nearest_sun, sun_departure_mjd, sun_of_site, way_out
from catseye.records.files.examples import located
from catseye.records.night.live import LivePosture
from catseye.records.site.folder import read_site
from catseye.reduction.site.earth_rotation import place_of, sun_at
from catseye.service.rangers import RangersServed
from catseye.service.running import FastLoop
from catseye.service.warm import WarmingClock, _Loader
from catseye.service.world import TwinWords, twin_heads
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock
from ranger.scripted_head import ScriptedHead

YEAR, HOURS = 61041.0, 8760  # MJD of 2026-01-01
INDEX = (0.0, 0.0)  # counts


@cache
def gbt():
    return read_site(located("gbt"))


@cache
def suns():
    """(8760, 3) directions to the Sun at the hours of a year, ground frame; NaN while it is set."""
    found = sun_at(YEAR + np.arange(HOURS) / 24.0, place_of(gbt().site.site)).direction
    return np.where((np.arcsin(found[:, 2]) > SET)[:, None], found, np.nan)


@cache
def looks(name):
    """rad between a ranger's beam at its index and the Sun, at each hour; inf while it is set.

    The telescope stands where `catseye serve gbt --twin` begins.
    """
    vantage = vantages_of(gbt())[name]
    seen = suns()
    if vantage.frame == "reflector":
        seen = seen @ reflector_at(gbt(), LivePosture(0, 145.3 * DEGREE, 45.0 * DEGREE), 0.0).rotation
    look = beam(vantage.station, np.array([INDEX]))[0] @ vantage.station.mirror_from_ground
    return np.nan_to_num(np.arccos(np.clip(seen @ look, -1.0, 1.0)), nan=np.inf), seen


def worst(count):
    """The hours at which some mirror's index looks nearest to the Sun, and whose."""
    ground = [name for name, vantage in vantages_of(gbt()).items() if vantage.frame == "ground"]
    pairs = sorted((float(looks(name)[0][hour]), hour, name) for name in ground for hour in range(HOURS))
    return [(hour, name) for _, hour, name in pairs[:count]]


def test_sun_at_an_index_agrees_with_the_ranger():
    hour, name = worst(1)[0]
    vantage = vantages_of(gbt())[name]
    own = sun_of_site(gbt().site.site)(YEAR + hour / 24.0)
    assert nearest_sun(vantage.station, INDEX, INDEX, suns=[own], exact=True) == pytest.approx(
        looks(name)[0][hour], abs=1e-4
    )


def test_mirror_behaviour_at_each_hour_of_a_year():
    """It is lit, or it leaves by a move on which it never comes nearer, or it waits for a time that is known."""
    lit = left = waiting = 0
    for name, vantage in vantages_of(gbt()).items():
        angles, seen = looks(name)
        lit += int(np.sum(angles >= HALF_ANGLE))
        for hour in np.flatnonzero(angles < HALF_ANGLE):
            end = way_out(vantage.station, INDEX, [seen[hour]], limits=vantage.stops)
            if end is None:
                waiting += 1
                assert (
                    sun_departure_mjd(vantage.station, INDEX, sun_of_site(gbt().site.site), YEAR + hour / 24.0)
                    is not None
                )
                continue
            left += 1
            assert 0.0 in end  # one axis alone
            way = np.linspace(INDEX, end, 400) + 0.0
            off = np.arccos(
                np.clip(beam(vantage.station, way) @ vantage.station.mirror_from_ground.T @ seen[hour], -1.0, 1.0)
            )
            assert off.min() >= angles[hour] - 0.05 * DEGREE
            assert off[-1] >= PARKED
            assert vantage.stops[0] <= end[0] <= vantage.stops[1]
    assert lit + left + waiting == 18 * HOURS
    assert left > 100
    assert waiting < left


@pytest.mark.parametrize(
    ("hour", "name"), [pytest.param(*pair, marks=[pytest.mark.slow] * (k >= 1)) for k, pair in enumerate(worst(20))]
)
def test_site_starts_with_a_mirror_looking_at_the_sun(hour, name):
    served, warned = started(YEAR + hour / 24.0 - 0.01)
    assert warned == []
    ranger = served[name]
    assert set(served) == set(gbt().rangers)
    for each in served.values():
        assert each.initialised
        assert each.homed
        assert not each.head.laser_on()  # until who has the lease lights it
        assert lightable(each) or each.in_sun or each is ranger
    seen = suns()[hour]
    assert nearest_sun(ranger.cubes.station, ranger.here, ranger.here, suns=[seen], exact=True) >= HALF_ANGLE or (
        not ranger.head.laser_on()
    )


def test_cubes_taken_over_from_another_ranger_are_those_of_its_own_commands():
    """All 18 by one loader, which gives each cube's commands once, against each by all of its lines."""
    commands, loader = SiteCommands(gbt()), _Loader()
    for name in gbt().rangers:
        requests = Preparation.of(commands.of_ranger(name)).requests
        quick, slow = (Ranger(name, ScriptedHead(), limits=(-1e9, 1e9)) for _ in range(2))
        loader.load(quick, requests)
        if name in ("ZY101", "ZY102", "ZY113", "ZY118"):
            for request in requests:
                slow.work_of(0, request)
            assert quick.cubes.by_number == slow.cubes.by_number
            assert quick.cubes.geometry == slow.cubes.geometry
            assert quick.given == slow.given
            assert quick.cubes.find("DP20C") == slow.cubes.find("dp20c")
            assert quick.cubes.counts(quick.cubes.find("ZEG41040L")) == slow.cubes.counts(slow.cubes.find("ZEG41040L"))
        assert name not in [cube.name for cube in quick.cubes.by_number.values()]


def test_ranger_without_index_stays_dark_and_others_serve():
    served, warned = started(61000.0, faults=("lost-index ZY105:0 0",))
    assert len(warned) == 1
    assert warned[0].startswith("ZY105 stays dark: FHM 0 was refused: ")
    assert [name for name, ranger in served.items() if not lightable(ranger)] == ["ZY105"]


def lightable(ranger):
    """Whether who has the lease can light a ranger."""
    try:
        return ranger.work_of(0, Request("PS", ("1",)))[0] == "1"
    except InputError:
        return False


def started(mjd, faults=()):
    """The rangers of a twin that has come up at a time, and what was said of those that have not."""
    with asyncio.Runner(loop_factory=FastLoop) as runner:
        return runner.run(_started(runner.get_loop(), TwinWords(mjd, faults=faults)))


async def _started(loop, words):
    clock = VirtualClock(loop, words.start_mjd + 0.01)
    warming, twin, heard = WarmingClock(clock), words.twin(gbt()), asyncio.Queue()
    heads = twin_heads(twin, gbt().rangers, warming)
    served = RangersServed(gbt(), heads, clock=clock, twin=twin, network=MemoryNetwork(), warming=warming)
    said = []
    served.warned = said.append
    task = asyncio.create_task(served.serve(heard.put_nowait))
    first = asyncio.create_task(heard.get())
    try:
        await asyncio.wait([task, first], return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        return dict(served.rangers), said
    finally:
        task.cancel()
        first.cancel()
        await asyncio.gather(task, first, return_exceptions=True)
