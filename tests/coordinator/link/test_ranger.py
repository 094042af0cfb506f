"""A link to a real server with a scripted head, in virtual time; once over real sockets."""

import asyncio
import random
from dataclasses import replace

import numpy as np
import pytest

from catseye.coordinator.link.ranger import HOLDER
from catseye.coordinator.link.settings import Address, LinkSettings
from catseye.coordinator.parts import ticks_now
from catseye.ranger.client import SECOND_CLIENT_TID, ZyClient
from catseye.ranger.door import Door
from catseye.ranger.line import Request
from catseye.ranger.server import LOOPBACK
from catseye.ranger.status import StatusWord
from coordinator.link_scene import COMMANDS, LATENCY, Free, Linked, LoopClock, Served, network, planned, run, until


def test_cold_ranger_is_made_ready_and_its_shot_is_complete():
    async def story():
        async with Linked() as (served, link):
            assert served.ranger.initialised
            assert [served.head.homing(axis) for axis in (0, 1)] == ["home", "home"]
            assert served.kinds() == ["ready"]
            shot = await link.fire(planned("ZG11"))
            assert (shot.ranger, shot.target, shot.number) == ("ZY101", "ZG11", 0)
            assert np.array_equal(shot.samples, served.ranger.measured.buffer.samples)
            assert shot.amplitude == pytest.approx(2.67, abs=1e-3)
            assert (shot.cycles, shot.samples_per_cycle, shot.if_hz) == (128, 64, 1000)
            assert shot.volts_per_code == 10 / 32768
            assert shot.duration == 0.128
            reference = await link.fire(planned("ZRG"))
            assert reference.target == "ZRG"
            assert reference.phase == pytest.approx(0.7, abs=1e-3)
            assert served.kinds() == ["ready"]
            assert link.shots == 2

    run(story)


def test_only_failures_in_a_row_count():
    async def story():
        async with Linked() as (_, link):
            link.failures = 2
            await link.fire(planned("ZG11"))
            assert link.failures == 0

    run(story)


def test_link_works_over_real_sockets_in_real_time():
    async def story():
        async with Linked() as (served, link):
            assert network() is None
            shot = await link.fire(planned("ZRG", ahead=0.0))
            assert np.array_equal(shot.samples, served.ranger.measured.buffer.samples)

    asyncio.run(asyncio.wait_for(story(), 60.0))


def test_moving_target_is_tracked_and_shot_at_its_time():
    async def story():
        async with Linked() as (served, link):
            shot_at = planned("ZG11", fixed=False, rate=(0.5, 0.0, 0.0), ahead=0.4)
            shot = await link.fire(shot_at)
            assert 0 <= shot.ticks - shot_at.begin_ticks <= 15  # never early; a turn of 5 ms and the poll behind it
            x = float(link.counts[0])
            ends = [link.settings.slack + 0.128 + late for late in (-864e-6, 864e-6)]  # a stamp has steps
            there = [shot_at.at_begin + np.array([0.5, 0.0, 0.0]) * end for end in ends]
            high, low = (served.ranger.cubes.look(tuple(place * 1e3))[0] for place in there)
            assert low < x < high  # the line goes on behind the shot

    run(story)


def test_late_shot_moves_along_its_track_and_is_dropped_when_too_late():
    async def story():
        guard = Free()
        async with Linked(guard=guard) as (served, link):
            late = planned("ZG11", fixed=False, rate=(0.5, 0.0, 0.0), ahead=-2.0)
            assert (await link.fire(late)).ticks > late.begin_ticks + 2000
            track = next(r for r in reversed(guard.asked) if r.command == "TRK")
            assert float(track.parameters[2]) == pytest.approx(1e3 * (0.5 * (2.0 + link.settings.lead)), abs=1.0)
            assert await link.fire(planned("ZG11", fixed=False, ahead=-6.0)) is None
            assert served.kinds()[-1] == "late"

    run(story)


@pytest.mark.parametrize(("knows_streams", "longest_gap"), [(True, 0.004), (False, 0.004)])
def test_stream_points_once_with_short_gaps(knows_streams, longest_gap):
    async def story():
        guard, shots = Free(), []
        async with Linked(guard=guard) as (served, link):
            if not knows_streams:  # a ZY of 2002
                receive = served.ranger.receive
                served.ranger.receive = lambda client, line: receive(client, line.replace("STM", "XYZ"))
            assert await link.stream(planned("ZG12", ahead=0.0), shots.append, count=20) == 20
            assert sum(r.command == "CIL" for r in guard.asked) == 1
            gaps = np.diff([s.ticks for s in shots]) * 864e-6 - 0.128
            assert gaps.min() > -1e-3  # half a stamp's step at each end
            assert gaps.max() < longest_gap
            assert all(s.samples is not None and s.target == "ZG12" for s in shots)
            moving = []
            follow = planned("ZG11", fixed=False, rate=(0.01, 0, 0))
            assert await link.stream(follow, moving.append, count=5) == 5
            assert moving[0].ticks >= follow.begin_ticks
            track = [r for r in guard.asked if r.command == "TRK"]
            assert len(track) == 1
            end = float(track[0].parameters[5]) * 1e8 - moving[-1].ticks
            assert end * 864e-6 > 0.128  # the track is longer than all five
            assert served.ranger.stream is None
            assert served.kinds() == ["ready"]

    run(story)


def test_cancelled_stream_is_stopped_at_the_ranger():
    async def story():
        async with Linked() as (served, link):
            shots = []
            task = asyncio.ensure_future(link.stream(planned("ZG11", ahead=0.0), shots.append, count=1000))
            await until(lambda: len(shots) > 3)
            assert served.ranger.stream is not None
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            await until(lambda: served.ranger.stream is None, 1.0)
            assert not link.busy
            assert await link.fire(planned("ZG12")) is not None

    run(story)


def test_silent_or_invalid_stream_ends_and_is_reported(monkeypatch):
    async def story():
        async with Linked() as (served, link):
            shots = []

            def take(shot):
                shots.append(shot)
                if len(shots) == 3:
                    served.ranger.receive(0, "0\tPS 0")  # the laser goes off: CMEAS 0, text

            assert await link.stream(planned("ZG11", ahead=0.0), take, count=50) < 8
            assert "laser" in served.happenings[-1].text
            served.ranger.receive(0, "PS 1")
            await asyncio.sleep(0.1)
            send = served.server.send
            served.server.send = lambda told: send([o for o in told if o.reply.command != "BUF"])
            assert await link.stream(planned("ZG12", ahead=0.0), shots.append, count=50) == 0
            assert served.kinds()[-1] == "bad-shot"
            assert "expected BUF" in served.happenings[-1].text

    run(story)


def test_refused_command_is_never_sent_and_the_next_shot_works():
    async def story():
        guard = Free()
        async with Linked(guard=guard) as (served, link):
            before = served.head.actual(0)
            guard.refused = ("CIL",)
            assert await link.fire(planned("ZG11")) is None
            assert served.head.actual(0) == before
            assert served.kinds()[-1] == "refused"
            guard.refused = ()
            assert await link.fire(planned("ZG12")) is not None
            seen = [(r.command, r.parameters[0]) for r in guard.asked if r.command in ("COO", "AXIS", "FHM", "CMEAS")]
            assert ("COO", "1") in seen
            assert ("FHM", "0") in seen
            assert ("CMEAS", "2") in seen

    run(story)


def test_quick_reconnection_needs_no_initialisation():
    async def story():
        guard = Free()
        async with Linked(guard=guard) as (served, link):
            await served.stop()
            await until(lambda: link.state == "down")
            assert served.kinds() == ["ready", "lost"]
            assert await link.fire(planned("ZG11")) is None
            await served.start()
            began = asyncio.get_running_loop().time()
            guard.asked.clear()
            await until(lambda: link.ready)
            assert asyncio.get_running_loop().time() - began < 2.0
            assert not {"FHM", "AXIS"} & {r.command for r in guard.asked}
            assert "was still ready" in served.happenings[-1].text
            assert "lost-over" in served.kinds()
            assert await link.fire(planned("ZG11")) is not None

    run(story)


def test_prepared_ranger_is_taken_over_only_with_the_same_records():
    async def story():
        async with Linked() as (served, first):
            first.wanted = "hold"
            for commands, text in (
                (COMMANDS, "was still ready"),
                ([*COMMANDS, Request("KND", ("1", "S", "-30"))], "made"),
            ):
                other = served.link(commands=commands)
                task = asyncio.ensure_future(other.run())
                await until(lambda other=other: other.ready)
                assert text in served.happenings[-1].text
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)
            assert first.connected

    run(story)


@pytest.mark.parametrize("changed", ["BP 0, 0, 1", "AZM 0, -901", "INI 4"])
def test_ranger_changed_by_hand_is_initialised_again(changed):
    async def story():
        async with Linked() as (served, link):
            served.by_hand(changed)
            await asyncio.sleep(0.1)
            await served.stop()
            await until(lambda: link.state == "down")
            await served.start()
            await until(lambda: link.ready)
            assert sum("made ready" in h.text for h in served.happenings) == 2
            served.light()
            assert (await link.fire(planned("ZRG"))).amplitude == pytest.approx(3.0, abs=0.01)

    run(story)


def test_ranger_restarted_behind_a_connection_is_made_ready_again():
    async def story():
        async with Linked() as (served, link):
            served.by_hand("RST")
            await until(lambda: not link.ready)
            await until(lambda: link.ready)
            assert served.kinds() == ["ready", "restarted", "ready"]
            served.light()
            assert await link.fire(planned("ZG11")) is not None

    run(story)


def test_unresponsive_ranger_is_detected_within_seconds_and_reconnected():
    async def story():
        async with Linked() as (served, link):
            send, served.server.send = served.server.send, lambda told: None
            began = asyncio.get_running_loop().time()
            assert await link.fire(planned("ZG11", ahead=0.0)) is None
            await until(lambda: link.state == "down")
            assert asyncio.get_running_loop().time() - began < link.settings.move_timeout + 5.0
            assert "no-reply" in served.kinds()
            assert "hung" in served.happenings[-1].text
            served.server.send = send
            await until(lambda: link.ready)
            await until(lambda: link.state == "ready", 1.0)
            assert await link.fire(planned("ZG11")) is not None

    run(story)


def test_hung_idle_ranger_is_detected_by_the_probe():
    async def story():
        async with Linked() as (served, link):
            served.server.send = lambda told: None
            began = asyncio.get_running_loop().time()
            await until(lambda: link.state == "down")
            assert asyncio.get_running_loop().time() - began < 5.0

    run(story)


def test_back_off_grows_by_a_third_to_thirty_seconds():
    async def story():
        served = await Served().start()
        await served.stop()
        link = served.link()
        attempts, connect = [], link._session

        async def session():
            attempts.append(asyncio.get_running_loop().time())
            return await connect()

        link._session = session
        task = asyncio.ensure_future(link.run())
        await asyncio.sleep(200.0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        gaps = np.diff(attempts)
        assert np.all(np.abs(gaps[:20] / (0.2 * 1.33 ** np.arange(20)).clip(max=30.0) - 1.0) <= 0.21)  # jitter of 20 %
        assert gaps[-1] > 23.0
        assert served.kinds() == ["lost"]  # told once

    run(story)


def test_wrong_clock_is_set_and_drift_is_reported():
    async def story():
        async with Linked() as (served, link):
            served.head.offset = 0.5
            await until(lambda: "clock-off" in served.kinds())
            assert served.happenings[-1].details["offset_s"] == pytest.approx(0.5, abs=0.01)
            await asyncio.sleep(3.0)
            assert abs(served.head.offset) < 5e-3
            served.head.rate = 1e-3
            await until(lambda: "clock-drift" in served.kinds())
            told = next(h for h in served.happenings if h.kind == "clock-drift")
            assert 2e-4 < told.details["rate"] < 1.2e-3
            assert link.ready

    run(story)


def test_correct_clock_is_left_alone():
    async def story():
        guard = Free()
        async with Linked(guard=guard):
            await asyncio.sleep(60.0)
            assert "STI" not in {r.command for r in guard.asked}

    run(story)


def test_slow_link_is_reported_at_start_and_end():
    async def story():
        async with Linked() as (served, link):
            send = served.server.send

            def late(told):
                asyncio.get_running_loop().call_later(0.4, send, told) if told else None

            served.server.send = late
            await until(lambda: "slow" in served.kinds())
            assert await link.fire(planned("ZG11")) is not None
            served.server.send = send
            await until(lambda: "slow-over" in served.kinds())
            assert served.kinds().count("slow") == 1

    run(story)


def test_stuck_axis_and_missing_index_are_reported():
    async def story():
        async with Linked() as (served, link):
            served.head.inner.stuck = True
            assert await link.fire(planned("ZG11")) is None
            assert served.kinds()[-1] in ("stuck-axis", "no-reply")
            served.head.inner.stuck = False
            served.head.inner.off[1] = True
            await until(lambda: "motor-off-1" in served.kinds())

        lost = Linked(wait=False)
        async with lost as (served, link):
            served.head.inner.find_home = lambda axis: served.head.inner.homes.__setitem__(axis, "failed")
            await until(lambda: "lost-index" in served.kinds())
            assert not link.ready
            del served.head.inner.find_home
            await until(lambda: link.ready, 300.0)

    run(story)


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (lambda v: (*v[:6], v[6][:-8] + "AAAAAA=="), "CRC"),
        (lambda v: (*v[:6], v[6][:-8]), "bytes"),
        (lambda v: (*v[:6], "!" + v[6][1:]), "base64"),
        (lambda v: ("2", *v[1:]), "cube 2"),
        (lambda v: (v[0], "127", *v[2:]), "bytes"),
        (lambda v: (*v[:4], "nan", *v[5:]), "number"),
        (lambda v: v[:6], "values"),
    ],
)
def test_damaged_buffer_is_reported_and_not_used(damage, word, monkeypatch):
    async def story():
        async with Linked() as (served, link):
            whole = served.ranger._handlers["BUF"]
            monkeypatch.setitem(served.ranger._handlers, "BUF", lambda z, client: damage(whole(z, client)))
            assert await link.fire(planned("ZG11")) is None
            assert served.kinds()[-1] == "bad-shot"
            assert word in served.happenings[-1].text
            monkeypatch.setitem(served.ranger._handlers, "BUF", whole)
            assert await link.fire(planned("ZG11")) is not None

    run(story)


def test_buffer_of_another_client_is_rejected():
    async def story():
        async with Linked() as (served, link):
            send = served.server.send

            def mixed(told):
                send(
                    [replace(o, reply=replace(o.reply, ticks=o.reply.ticks + (o.reply.command == "BUF"))) for o in told]
                )

            served.server.send = mixed
            assert await link.fire(planned("ZG11")) is None
            assert "BUF is of cube 1 at" in served.happenings[-1].text

    run(story)


def test_laser_is_off_during_homing():
    async def story():
        guard = Free()
        async with Linked(guard=guard) as (served, _):
            lines = [(r.command, r.parameters) for r in guard.asked if r.command in ("PS", "FHM")]
            assert lines == [("FHM", ("0",)), ("FHM", ("1",)), ("PS", ("1",))]  # off since it was switched on
            assert served.head.laser_on()
            served.by_hand("FHM 0")  # a search of a lit ranger
            await until(lambda: served.head.homing(0) == "searching", 1.0)
            assert not served.head.laser_on()

    run(story)


def test_refused_buffer_falls_back_to_amplitude_and_phase(monkeypatch):
    async def story():
        async with Linked() as (served, link):

            def refuse(z, client):
                from catseye.errors import InputError

                raise InputError("out of memory")

            monkeypatch.setitem(served.ranger._handlers, "BUF", refuse)
            shot = await link.fire(planned("ZG11"))
            assert shot.samples is None
            assert shot.amplitude == pytest.approx(2.67, abs=1e-3)
            assert shot.cycles == 128
            assert served.kinds()[-1] == "no-buffer"

    run(story)


def test_wrong_ranger_is_an_alarm_and_an_occupied_port_is_skipped():
    async def story():
        served = await Served("ZY102").start()
        link = served.link()
        link.ranger = "ZY101"
        task = asyncio.ensure_future(link.run())
        await until(lambda: "wrong-ranger" in served.kinds())
        assert not link.connected
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        one, two = served.link(), served.link()
        tasks = [asyncio.ensure_future(link.run()) for link in (one, two)]
        await until(lambda: one.connected and two.connected)
        assert sorted(c.number for c in served.server.connections.values()) == [0, 1]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await served.stop()

    run(story)


def test_listening_link_receives_other_clients_shots_and_changes_nothing():
    async def story():
        async with Linked() as (served, link):
            heard, guard = [], Free()
            ear = served.link(wanted="listen", guard=guard, heard=lambda who, reply: heard.append(reply))
            task = asyncio.ensure_future(ear.run())
            await until(lambda: ear.connected)
            await asyncio.sleep(5.0)
            assert await link.fire(planned("ZG11")) is not None
            await until(lambda: heard)
            assert heard[0].values[2] == "ZG11"
            assert guard.asked == []
            assert await ear.fire(planned("ZG11")) is None
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    run(story)


def test_leaving_switches_off_only_lasers_switched_on_here():
    async def story(dark):
        served = await Served().start()
        if not dark:  # as another left it that was killed a moment ago
            other = served.link()
            lighting = asyncio.ensure_future(other.run())
            await until(lambda: other.ready)
            lighting.cancel()
            await asyncio.gather(lighting, return_exceptions=True)
            assert served.head.laser_on()
        link = served.link()
        task = asyncio.ensure_future(link.run())
        await until(lambda: link.ready)
        assert served.head.laser_on()
        await link.leave()
        await asyncio.sleep(0.1)
        assert served.head.laser_on() is not dark
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        await served.stop()

    run(lambda: story(True))
    run(lambda: story(False))


class Babbler(asyncio.Protocol):
    """A "ranger" that says anything."""

    def __init__(self, rng, lines):
        self.rng, self.lines = rng, lines

    def connection_made(self, transport):
        self.transport = transport
        transport.write(
            b"0\t52889.0\tHELLO This is ZY101 ver. 2.20\n0\t52889.0\tCONNECT 1, 1\n0\t52889.0\tSTW 1, 0x00013007\n"
        )

    def data_received(self, data):
        tids = [line.split(b"\t")[0] for line in data.split(b"\n") if b"\t" in line] or [b"0"]
        for _ in range(self.rng.randrange(1, 4)):
            self.lines[0] += 1
            self.transport.write(self.line(self.rng.choice(tids)))
        if self.rng.random() < 0.01:
            self.transport.abort()

    def line(self, tid):
        rng = self.rng
        word = rng.choice(
            [b"VER", b"CIL", b"CMEAS", b"BUF", b"STW", b"COO", b"CYC", b"SUN", b"UNKNOWN", b"ACP", b"AXIS"]
        )
        values = b", ".join(
            rng.choice([b"1", b"0", b"-1e999", b"nan", b"0x1", b"ZG11", b"", b"9" * 40])
            for _ in range(rng.randrange(9))
        )
        return rng.choice(
            [
                tid + b"\t52889.1\t" + word + b" 1, " + values + b"\n",
                tid + b"\t52889.1\t" + word + b" 0, no\n",
                rng.randbytes(rng.randrange(200)) + b"\n",
                rng.randbytes(rng.randrange(5000)),
                b"\n",
                tid + b"\t\t\t\n",
            ]
        )


def babble(lines, seed):
    """Random lines and bytes from a "ranger": the link neither ends nor hangs, nor keeps what it hears."""

    async def story():
        rng, count = random.Random(seed), [0]
        loop = asyncio.get_running_loop()
        server = await network().serve(lambda: Babbler(rng, count), LOOPBACK, 0)
        port = server.port
        happenings = []
        quick = LinkSettings(longest_wait=0.4, probe_every=0.2, probe_timeout=0.5, move_timeout=0.5, buffer_timeout=0.5)
        served = Served()
        link = served.link(address=Address(LOOPBACK, (port, port)), tell=happenings.append, settings=quick)
        task = asyncio.ensure_future(link.run())
        while count[0] < lines:
            assert not task.done()
            if link.connected:
                link.state = "ready"
                await link.fire(planned(rng.choice(["ZG11", "ZRG", "NONE"]), fixed=rng.random() < 0.5))
            await asyncio.sleep(0.05)
            if link._client is not None:
                assert link._client.outstanding < 200
        assert len(happenings) < 20 * loop.time()
        assert ticks_now(LoopClock()) > 0
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        await server.close()

    run(story, 1e7)


def test_random_bytes_from_a_ranger_do_no_harm():
    babble(1500, 8)


@pytest.mark.slow
def test_100000_random_lines_from_a_ranger_do_no_harm():
    babble(100_000, 9)


# Lease, dead man, interlock -------------------------------------------------------------------------------------------


async def person(served, **options):
    """Somebody on the ranger's second port."""
    return await ZyClient.connect(
        served.address.host,
        served.ports[1],
        first_tid=SECOND_CLIENT_TID,
        clock=asyncio.get_running_loop().time,
        network=network(),
        **options,
    )


def test_coordinator_holds_the_lease_of_its_rangers():
    async def story():
        async with Linked() as (served, link):
            assert served.ranger.lease[:2] == (0, HOLDER)
            anna = await person(served)
            assert (await anna.ask("PS", 1)).ok is False
            assert (await anna.ask("ACP", 0)).ok
            link.wanted = "hold"  # left out on purpose: it is nobody's
            await until(lambda: served.ranger.lease is None)
            assert link.state == "connected"
            assert not served.head.laser_on()  # who gives it back lit it
            assert served.ranger.latch is None

    run(story)


def test_same_name_does_not_make_a_holder():
    """Attack: both called themselves by the same process number, and both commanded."""

    async def story():
        async with Linked() as (served, link):
            other = served.link()
            task = asyncio.ensure_future(other.run())
            await until(lambda: "leased" in other.troubles)
            await asyncio.sleep(30.0)
            assert not other.ready
            assert link.ready
            assert served.ranger.lease[:2] == (0, HOLDER)
            assert any("memory port 0 holds the lease" in h.text for h in served.happenings)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    run(story)


def test_lease_survives_a_cut_unnoticed_by_the_ranger():
    async def story():
        async with Linked() as (served, link):
            token = served.ranger.lease.token
            old = served.server.connections[0]
            link._client.close("cut")  # of which nothing arrives
            old.connection_lost = lambda exc: None
            served.server.connections[0] = old
            await until(lambda: link.ready and served.ranger.lease is not None and served.ranger.lease.client == 1)
            assert served.ranger.lease.token == token

    run(story)


def test_waiting_coordinator_renews_the_lease():
    """Attack: a homing of 35 s, or a move that hangs, was longer than the dead man's time."""

    async def story():
        async with Linked() as (served, link):
            served.by_hand("WTMO 3600")
            served.by_hand("AXIS 0, 0")
            served.by_hand("CWT 1")
            link.settings = replace(link.settings, probe_timeout=3600.0)
            await asyncio.sleep(300.0)
            assert served.head.laser_on()
            assert "made-safe" not in served.kinds()

    run(story)


def test_latched_stop_is_journalled_with_its_peer_and_obeyed_until_cleared():
    async def story():
        async with Linked() as (served, link):
            anna = await person(served)
            assert (await anna.ask("PS", 0)).ok
            await until(lambda: not link.ready)
            alarm = next(h for h in served.happenings if h.kind == "darkened")
            assert alarm.severity == "alarm"
            assert "PS from memory port 0" in alarm.text
            await asyncio.sleep(120.0)
            assert not served.head.laser_on()
            assert not link.ready
            assert "darkened" in link.troubles
            assert (await anna.ask("UNLATCH", "anna")).ok
            await until(lambda: link.ready, 5.0)
            assert served.head.laser_on()
            assert "darkened" not in link.troubles
            assert any("cleared by anna at memory port 0" in h.text for h in served.happenings)

    run(story)


def test_leaving_link_lights_nothing_again():
    """Attack: the probe that saw the laser off, by the coordinator's own leaving, switched it on again."""

    async def story():
        guard = Free()
        async with Linked(guard=guard) as (served, link):
            link._left = True  # as `leave` does first; its PS 0 is answered:
            served.by_hand("PS 0")
            await until(lambda: link.status & StatusWord.LASER_OFF, step=LATENCY)
            asked = len(guard.asked)
            assert await link._lives()
            await asyncio.sleep(10.0)
            assert not served.head.laser_on()
            assert Request("PS", ("1",)) not in guard.asked[asked:]

    run(story)


def test_link_without_the_lease_sends_no_stop():
    async def story():
        async with Linked() as (served, link):
            anna = await person(served)
            assert (await anna.ask("LEASE", "anna")).ok
            await until(lambda: not link.ready)
            await link.leave()
            await asyncio.sleep(0.1)
            assert served.ranger.latch is None
            assert served.head.laser_on()

    run(story)


def test_new_holder_keeps_the_ranger_until_the_lease_is_free():
    async def story():
        async with Linked() as (served, link):
            anna = await person(served)
            token = (await anna.ask("LEASE", "anna")).values[-1]
            await until(lambda: not link.ready)
            assert "leased" in link.troubles
            said = "ZY101: anna at memory port 0 holds the lease; commands are paused"  # with her address
            assert said in [h.text for h in served.happenings]
            for _ in range(20):  # a person who goes on keeps it
                await asyncio.sleep(5.0)
                assert (await anna.ask("LEASE", "anna", token)).ok
            assert served.ranger.lease[:2] == (1, "anna")
            assert (await anna.ask("LEASE", "none")).ok
            await until(lambda: link.ready, 5.0)
            assert served.ranger.lease[:2] == (0, HOLDER)
            assert "leased" not in link.troubles
            served.light()
            assert await link.fire(planned("ZG11")) is not None

    run(story)


def test_disconnected_or_silent_holder_loses_the_lease():
    async def story():
        async with Linked() as (served, link):
            for leaves in (True, False):
                anna = await person(served)
                assert (await anna.ask("LEASE", "anna")).ok
                await until(lambda: not link.ready)
                if leaves:
                    anna.close()
                await until(lambda: link.ready, 100.0)
            kinds = served.kinds()
            assert kinds.count("leased") == 2
            assert kinds.count("made-safe") == 1  # of the one who said nothing any more

    run(story)


def test_ranger_without_leases_is_commanded_directly():
    async def story():
        served = await Served().start()
        served.server.door = Door(lease=False)
        served.server.ranger = served.ranger
        receive = served.ranger.receive

        def old(client, line):
            if "LEASE" in line:
                line = line.replace("LEASE", "LEISE")
            return receive(client, line)

        served.ranger.receive = old
        link = served.link()
        task = asyncio.ensure_future(link.run())
        await until(lambda: link.ready)
        served.light()
        assert await link.fire(planned("ZG11")) is not None
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        await served.stop()

    run(story)


def test_open_interlock_stops_a_ranger_until_it_closes():
    async def story():
        async with Linked() as (served, link):
            pulled = ["the door"]
            served.ranger._head_interlock = lambda: pulled[0] if pulled else ""
            await until(lambda: not link.ready, 5.0)
            assert not served.head.laser_on()
            assert not served.head.enabled(0)
            alarms = [h for h in served.happenings if h.kind == "made-safe"]
            assert [h.severity for h in alarms] == ["alarm"]
            assert "the interlock is open (the door)" in alarms[0].text
            await asyncio.sleep(100.0)
            assert not link.ready
            assert not served.head.laser_on()
            pulled.clear()
            await until(lambda: link.ready, 130.0)
            await until(served.head.laser_on, 5.0)

    run(story)


def test_coordinator_cut_off_for_an_hour_leaves_no_laser_on():
    """Nobody tells the ranger that the lines are cut: its own clock does."""

    async def story():
        async with Linked() as (served, link):
            assert served.head.laser_on()
            began = asyncio.get_running_loop().time()
            served.server.connections[0].data_received = lambda data: None  # nothing arrives any more
            took = served.server.joined
            served.server.joined = lambda connection: connection.transport.abort()
            await until(lambda: not served.head.laser_on(), 60.0)
            assert asyncio.get_running_loop().time() - began < served.server.door.dead_man + 2.0
            assert not served.head.enabled(0)
            assert not served.head.enabled(1)
            await asyncio.sleep(3600.0)
            assert not served.head.laser_on()
            served.server.joined = took
            await until(lambda: link.ready, 60.0)
            await until(served.head.laser_on, 5.0)

    run(story, 4000.0)
