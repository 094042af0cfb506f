"""State of a site from its coordinator's port: polls, pushes, points, lost and silent coordinators."""

import asyncio
import json

import pytest

from catseye.coordinator.clients.server import ZiyServer
from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.parts import ticks_now
from catseye.errors import InputError
from catseye.ranger.server import LOOPBACK
from catseye.records.night.live import TICKS_PER_DAY
from catseye.service.watch.recent import MOST_SHOTS, RecentPast, Ring, Words
from catseye.service.watch.watch import SiteWatch
from coordinator.link_scene import LoopClock, network, run, until
from coordinator.ziy_scene import gbt, weather
from service.watch.watch_scene import Watched


def test_state_is_the_coordinators():
    async def story():
        async with Watched() as site:
            await until(lambda: site.live.epochs >= 3)
            site.ziy.intake.take(weather())
            await asyncio.sleep(2.5)
            state, z = site.watch.state(), site.ziy
            assert (state["source"], state["connected"], state["mode"]) == ("live", True, "active")
            assert abs(state["mjd"] - ticks_now(z.clock) / TICKS_PER_DAY) < 2.0 / 86_400
            assert state["word"] == z.condition.now().word
            assert state["shots"]["numbered"] <= z.intake.numbered
            assert state["lease"] is None
            assert state["sun"] == {"azimuth": 1.0, "elevation": 0.5, "cone": 0.1, "avoided": True}
            assert state["posture"]["elevation"] == pytest.approx(z.posture.elevation)
            assert [row["station"] for row in state["weather"]] == ["WX1"]
            rows = {row["name"]: row for row in state["rangers"]}
            assert set(rows) == set(site.names)
            last = [e for e in site.published if isinstance(e, AnsweredShot) and e.shot.ranger == "ZY101"]
            assert rows["ZY101"]["last"]["number"] in [s.shot.number for s in last[-4:]]
            assert (rows["ZY101"]["word"], rows["ZY101"]["sign"]) == ("measures", "+")
            assert rows["ZY101"]["next"] in ("ZRG", "ZG11", "ZG12", None)
            assert state["epoch"]["number"] >= 3
            assert state["epoch"]["variance_factor"] == 1.1
            assert state["verdict"] == "good"
            json.dumps(state, allow_nan=False)

    run(story)


def test_listeners_are_told_each_entry_once_and_the_state_each_second():
    async def story():
        async with Watched() as site:
            await until(lambda: site.live.epochs >= 2)
            site.items.clear()
            begin, at = len(site.published), asyncio.get_running_loop().time()
            await until(lambda: site.live.epochs >= 4)
            await asyncio.sleep(0.1)
            numbers = [e.shot.number for e in site.published[begin:] if isinstance(e, AnsweredShot)]
            assert [shot["number"] for shot in site.of("shot")] == numbers
            assert len(site.of("epoch")) >= 2
            assert len(site.of("posture")) > 20
            seconds = asyncio.get_running_loop().time() - at
            assert abs(len(site.of("state")) - seconds) <= 1.5
            site.ziy.drop("ZY102")
            await asyncio.sleep(0.1)
            event = site.of("event")[-1]
            assert (event["kind"], event["who"], event["severity"]) == ("dropped", "coordinator", "note")

    run(story)


def test_problems_are_alarms_with_their_treatment():
    async def story():
        async with Watched(mode="hold", ready=False) as site:
            await asyncio.sleep(2.0)
            await site.watch.acknowledge("mode", "anna")
            await site.watch.shelve("mode", "anna", 5.0)
            await asyncio.sleep(1.5)
            (mode,) = [p for p in site.watch.state()["problems"] if p["id"] == "mode"]
            assert (mode["severity"], mode["acknowledged_by"], mode["shelved_by"]) == ("warning", "anna", "anna")
            now = ticks_now(site.ziy.clock) / TICKS_PER_DAY
            assert 4.5 / 1440 < mode["shelved_until"] - now < 5.0 / 1440
            assert mode["since"] < mode["acknowledged_at"] <= now
            await site.watch.unshelve("mode", "ben")
            await asyncio.sleep(1.5)
            (mode,) = [p for p in site.watch.state()["problems"] if p["id"] == "mode"]
            assert mode["shelved_by"] is None
            with pytest.raises(InputError, match="is not an alarm here now"):
                await site.watch.acknowledge("nothing", "anna")

    run(story)


def test_coordinator_that_ends_is_noticed_and_found_again():
    async def story():
        async with Watched() as site:
            await until(lambda: site.live.epochs >= 2)
            await asyncio.sleep(2.0)
            before = site.watch.state()
            await site.server.stop()
            await until(lambda: not site.watch.state()["connected"], 2.0)
            lost = site.watch.state()
            assert lost["trouble"]
            assert (lost["received"], lost["epoch"]) == (before["received"], before["epoch"])  # the last, and its age
            with pytest.raises(InputError, match="not connected"):
                await site.watch.command("MODE", ["hold"], "anna")
            site.items.clear()
            await asyncio.sleep(20.0)
            assert len(site.of("state")) >= 19  # also while nothing answers
            site.server = ZiyServer(site.ziy, port=site.port, network=network())
            await site.server.start()
            await until(lambda: site.watch.state()["connected"], 5.0)
            site.items.clear()
            await asyncio.sleep(10.0)
            assert site.of("shot")  # subscribed again

    run(story)


def test_frozen_coordinator_is_lost_within_two_polls_and_comes_back():
    """Silence of a stopped process: the connection stands, nothing answers."""

    async def story():
        async with Watched() as site:
            await until(lambda: site.live.epochs >= 2)
            transports = [client.transport for client in site.server.clients]
            for transport in transports:
                transport.pause_reading()
            await until(lambda: not site.watch.state()["connected"], 3.0)
            assert "no answer to" in site.watch.state()["trouble"]
            for transport in transports:
                transport.resume_reading()
            await until(lambda: site.watch.state()["connected"], 5.0)

    run(story)


def test_watch_begins_before_its_coordinator():
    async def story():
        watch = SiteWatch(gbt(), coordinator=(LOOPBACK, 4711), network=network(), clock=LoopClock())
        states = []
        watch.listeners.append(lambda kind, item: states.append((kind, item)))
        watching = asyncio.ensure_future(watch.run())
        await asyncio.sleep(30.0)
        assert len(states) >= 29
        state = watch.state()
        assert (state["connected"], state["received"], len(state["rangers"])) == (False, None, 18)
        assert "4711" in state["trouble"]
        assert not watching.done()
        json.dumps(watch.site(), allow_nan=False)
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)

    run(story)


class Babbler(asyncio.Protocol):
    """A port that answers every line with a line of the grammar that says nothing sensible, pushes among them."""

    BODIES = (
        "STATUS 1, a, b, c, d, e, f, g, h, i, j, k, l",
        "SHOT 1, x, y",
        "EPOCH 1, 1e999",
        "RANGERS 1",
        "VER 1, X, 1",
    )

    def connection_made(self, transport):
        self.transport = transport
        transport.write(b"0\t52889.1\tHELLO This is something\n\x00\xff\n")

    def data_received(self, data):
        for line in data.decode("ascii").splitlines():
            tid, _, body = line.partition("\t")
            own = body.split()[0]
            for words in (*self.BODIES, f"{own} 1, rubbish", f"{own} 0, no"):
                self.transport.write(f"{tid}\t52889.12500000\t{words}\n".encode())
                self.transport.write(f"0\t52889.12500000\t{words}\n".encode())


def test_nonsense_from_a_port_ends_no_watch():
    async def story():
        listener = await network().serve(Babbler, LOOPBACK, 0)
        watch = SiteWatch(gbt(), coordinator=(LOOPBACK, listener.port), network=network(), clock=LoopClock())
        states = []
        watch.listeners.append(lambda kind, item: states.append(kind))
        watching = asyncio.ensure_future(watch.run())
        await asyncio.sleep(60.0)
        assert not watching.done()
        assert watch.state()["connected"] is False
        assert states.count("state") >= 59
        json.dumps([watch.state(), watch.shots(), watch.events(), watch.epochs()], allow_nan=False)
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
        await listener.close()

    run(story)


def test_without_a_journal_the_last_hour_is_in_memory():
    async def story():
        async with Watched() as site:
            await until(lambda: site.live.epochs >= 3)
            await asyncio.sleep(1.5)
            assert site.watch.history is False
            epochs = site.watch.epochs()["epochs"]
            assert [e["number"] for e in epochs] == list(range(1, len(epochs) + 1))
            last = epochs[-1]["number"]
            await until(lambda: site.watch.port.points and site.watch.port.points["number"] >= last)
            epoch = site.watch.epoch(site.watch.port.points["number"])
            assert epoch["points"]["name"] == ["ZG11"]
            assert [epoch["points"][axis] for axis in "xyz"] == [[1.0], [2.0], [3.0]]
            assert epoch["points"]["covariance"]["xx"] == [None]
            assert epoch["points"]["body"] == ["ground"]
            assert len(epoch["structure"]) >= 6
            assert set(epoch["beams"]["ranger"]) <= set(site.names)
            assert epoch["beams"]["shot"]
            shots = site.watch.shots(ranger="ZY101", limit=5)
            assert len(shots["number"]) == 5
            assert set(shots["ranger"]) == {"ZY101"}
            site.ziy.drop("ZY102")
            await asyncio.sleep(0.1)
            assert site.watch.events()["kind"][-1] == "dropped"
            site.ziy.intake.take(weather())
            await asyncio.sleep(0.1)
            names = [row["name"] for row in site.watch.series_names()["names"]]
            assert {name.partition(":")[0] for name in names} == {
                *("range", "correction", "temperature", "pressure", "humidity"),
                *("azimuth", "elevation", "refractivity", "variance_factor"),
            }
            series = {row["name"]: row for row in site.watch.series(names)["names"]}
            assert series["range:ZY101:ZG11"]["value"][0] == 80.0
            assert series["range:ZY101:ZG11"]["u"][0] == 3e-5
            assert series["temperature:WX1"]["value"] == [10.0]
            assert len(series["azimuth"]["mjd"]) > 5
            assert len(site.watch.series(["azimuth"], most=4)["names"][0]["mjd"]) == 4
            later = series["azimuth"]["mjd"][3]
            assert site.watch.series(["azimuth"], since=later)["names"][0]["mjd"] == series["azimuth"]["mjd"][3:]
            dropped = site.watch.dropped(bins=4)
            row = dropped["rangers"].index("ZY101")
            mine = [s for s in site.watch.port.past.shots() if s["ranger"] == "ZY101"]
            assert (sum(dropped["good"][row]), sum(dropped["failed"][row])) == (len(mine), 0)
            with pytest.raises(InputError, match="is not a series in memory"):
                site.watch.series(["amplitude:ZY101"])
            with pytest.raises(InputError, match="no history"):
                site.watch.residuals(1)
            with pytest.raises(InputError, match="not in memory"):
                site.watch.epoch(99)
            ranger = site.watch.ranger("ZY101")
            assert (ranger["kind"], ranger["station"]["mirror"]) == ("ground", "ZP101")
            json.dumps([epoch, shots, ranger, series, dropped], allow_nan=False)

    run(story)


def test_events_are_from_the_severity_asked_for():
    async def story():
        async with Watched(mode="hold", ready=False) as site:
            await asyncio.sleep(1.0)
            assert set(site.watch.events(severity="alarm")["severity"]) <= {"alarm"}
            with pytest.raises(InputError, match="expected debug, note, warning, alarm"):
                site.watch.events(severity="loud")
            with pytest.raises(InputError, match="limit = 0"):
                site.watch.shots(limit=0)

    run(story)


def test_memory_is_bounded():
    past = RecentPast()
    shot = {"ranger": "ZY101", "target": "A", "status": "used", "range": 1.0, "u_range": None, "misfit": 0.1}
    for k in range(MOST_SHOTS + 500):
        past.shot({"number": k, **shot}, 10**12 + k)
    rows = list(past.shots())
    assert (len(rows), rows[0]["number"], rows[-1]["number"]) == (MOST_SHOTS, 500, MOST_SHOTS + 499)
    assert rows[0]["u_range"] is None
    past.shot({"number": 1, **shot}, 10**12 + 10**8)
    assert len(list(past.shots())) == 1  # an hour later nothing else is recent
    words = Words()
    for k in range(9000):
        words.number(str(k))
    assert (words.word(words.number("8999")), words.word(words.number("17"))) == ("?", "17")


def test_ring_gives_its_rows_in_their_order():
    import numpy as np

    ring = Ring(4, np.dtype([("ticks", "i8"), ("value", "f8")]))
    for k in range(7):
        ring.add(k, 0.5 * k)
    assert ring.since(0)["ticks"].tolist() == [3, 4, 5, 6]
    assert ring.since(5)["value"].tolist() == [2.5, 3.0]
