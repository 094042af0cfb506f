"""The coordinator's port for people, displays and M&C, and cost of bad clients."""

import asyncio
import random

import numpy as np
import pytest

from catseye.coordinator.clients.board import HELP
from catseye.coordinator.clients.server import KINDS, MOST_CLIENTS, MOST_UNSENT, ZiyServer
from catseye.coordinator.journal.entries import AnsweredShot, EpochSolution
from catseye.coordinator.parts import ticks_now
from catseye.coordinator.samplers.rings import COLUMNS, RING_LENGTH, Samplers
from catseye.errors import InputError
from catseye.ranger.client import ZyClient
from catseye.ranger.door import Door
from catseye.ranger.line import LONGEST_REQUEST, parse_reply, parse_stamp
from catseye.ranger.server import LOOPBACK
from catseye.records.night.live import Happening, LivePosture, LiveShot
from coordinator.link_scene import network, run, until
from coordinator.ziy_scene import Answer, Site


class Served(Site):
    """A coordinator with its own server."""

    async def __aenter__(self):
        await super().__aenter__()
        self.server = ZiyServer(self.ziy, port=0, network=network())
        await self.server.start()
        return self

    async def __aexit__(self, *given):
        await self.server.stop()
        await super().__aexit__(*given)

    async def client(self, **options):
        made = await ZyClient.connect(
            LOOPBACK, self.server.port, clock=asyncio.get_running_loop().time, network=network(), **options
        )
        await asyncio.sleep(0.01)
        return made

    async def raw(self):
        return await network().connect(Raw, LOOPBACK, self.server.port)


class Raw(asyncio.Protocol):
    """Bytes as they are."""

    def __init__(self):
        self.got, self.gone = b"", False

    def connection_made(self, transport):
        self.transport = transport

    def data_received(self, data):
        self.got += data

    def connection_lost(self, exc):
        self.gone = True


def shot(number, ranger="ZY101", status="used"):
    return AnsweredShot(
        LiveShot(ranger, "ZG11", 5288900000000 + number, 1, 64, 1000, 1e-4, None, 1.0, 2.0, number), status
    )


def test_port_can_be_used_from_nc():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            nc = await site.raw()
            nc.transport.write(b"status\r\n\nHLP\nhlp sampler\nhelp sampler\nwhat\nbye\n")
            await until(lambda: nc.gone)
            bodies = [line.split("\t")[2] for line in nc.got.decode().splitlines()]
            assert bodies[0] == "HELLO This is ZIY gbt ver. 1"
            assert bodies[1] == f"CONNECT 1, {site.server.port}"
            assert bodies[2] == (
                "STATUS 1, hold, 0 of 2, 0, 0, 0, known, well, stopped, none, well, none, nobody, "
                "mode hold: no shots are taken"
            )
            assert bodies[3].removeprefix("HLP 1, ").split() == list(HELP)
            assert bodies[4].startswith("HLP 1, SAMPLER name | SAMPLER name; n, ")
            assert bodies[5].startswith("HELP 1, SAMPLER name | SAMPLER name; n, ")
            assert bodies[6] == "UNKNOWN command WHAT"
            assert bodies[7] == f"BYE 1, {site.server.port}, Closing Connection"
            for line in nc.got.decode().splitlines():
                assert parse_reply(line) is not None

    run(story)


def test_rangers_and_status_report_the_condition():
    async def story():
        async with Served() as site:
            await until(lambda: site.live.epochs >= 2)
            client = await site.client()
            rows = {reply.values[0]: reply.values for reply in await client.ask_all("RANGERS")}
            assert set(rows) == set(site.names)
            link = site.ziy.links["ZY101"]
            link_status = site.ziy.firing.last_status["ZY101"]
            assert rows["ZY101"] == ("ZY101", "ready", str(link.shots), "0", "none", link_status, "none", "measures")
            status = (await client.ask("STATUS")).values
            assert status[:2] == ("active", "2 of 2")
            assert int(status[2]) == site.ziy.intake.numbered
            await site.served["ZY102"].stop()
            await until(lambda: site.ziy.links["ZY102"].state == "down")
            rows = {reply.values[0]: reply.values for reply in await client.ask_all("RANGERS")}
            assert (rows["ZY102"][1], *rows["ZY102"][-2:]) == ("down", "lost", "not connected")
            assert (await client.ask("STATUS")).values[1] == "1 of 2"

    run(story)


def test_subscriber_receives_only_its_kinds():
    async def story():
        async with Served() as site:
            shots, events, nothing = [], [], []
            one = await site.client(heard=shots.append)
            two = await site.client(heard=events.append)
            await site.client(heard=nothing.append)
            assert (await one.ask("SUBSCRIBE", "shot", "epoch")).text == "EPOCH SHOT"
            assert (await two.ask("SUBSCRIBE")).text == "EPOCH EVENT SHOT"
            assert (await one.ask("SUBSCRIBE", "GOSSIP")).ok is False
            shots.clear()
            events.clear()
            begin = len(site.published)
            await until(lambda: site.live.epochs >= 3)
            site.ziy.drop("ZY102")
            await asyncio.sleep(0.1)
            durable = [e for e in site.published[begin:] if isinstance(e, AnsweredShot)]
            pushed = [r for r in shots if r.command == "SHOT"]
            assert [int(r.values[0]) for r in pushed] == [s.shot.number for s in durable]
            assert [r.ticks for r in pushed] == [s.shot.ticks for s in durable]
            assert pushed[0].values[1:3] == (durable[0].shot.ranger, durable[0].shot.target)
            assert float(pushed[0].values[4]) == durable[0].range_
            assert {r.command for r in shots} == {"SHOT", "EPOCH"}
            assert any(r.command == "EVENT" and r.values[2] == "dropped" for r in events)
            assert {r.command for r in nothing} == {"HELLO", "CONNECT"}
            assert (await two.ask("SUBSCRIBE", "NONE")).text == "NONE"
            events.clear()
            await asyncio.sleep(10.0)
            assert not events

    run(story)


def test_kinds_may_be_separated_by_blanks_or_commas():
    async def story():
        async with Served() as site:
            one = await site.client()
            assert (await one.ask("SUBSCRIBE", "weather posture")).text == "POSTURE WEATHER"
            assert (await one.ask("SUBSCRIBE", "SHOT  EPOCH", "EVENT")).text == "EPOCH EVENT POSTURE SHOT WEATHER"
            strange = await one.ask("SUBSCRIBE", "SHOT GOSSIP")
            assert strange.ok is False
            assert "'GOSSIP' cannot be subscribed" in strange.text

    run(story)


def test_only_durable_entries_are_pushed():
    async def story():
        async with Served() as site:
            heard = []
            client = await site.client(heard=heard.append)
            await client.ask("SUBSCRIBE", "SHOT")
            await until(lambda: heard)
            site.journal.broken = "disk full"
            await asyncio.sleep(0.1)
            heard.clear()
            await asyncio.sleep(10.0)
            assert not heard
            site.journal.mend()
            await until(lambda: heard)

    run(story)


def test_parameters_are_checked_then_prepared_then_started():
    async def story():
        async with Served() as site:
            client = await site.client()
            assert (await client.ask("LEASE", "anna")).ok
            assert (await client.ask("START")).ok is False
            for name, value in (("mode", "lazy"), ("nothing", "1"), ("dropped", "ZY999")):
                assert (await client.ask("SET", name, value)).ok is False
            assert (await client.ask("SET", "mode", "HOLD")).text == "mode, hold"
            assert (await client.ask("SET", "dropped", "zy102")).ok
            assert site.ziy.mode == "active"
            assert (await client.ask("START")).ok is False  # not prepared
            assert (await client.ask("PREPARE")).text == "2"
            rows = {r.values[0]: r.values for r in await client.ask_all("PARAMETERS")}
            assert rows["mode"][1:3] == ("active", "hold")
            assert (await client.ask("START")).text == "2"
            assert (site.ziy.mode, site.ziy.firing.dropped) == ("hold", {"ZY102"})
            assert (await client.ask("SET", "dropped", "none")).ok
            assert (await client.ask("PREPARE")).ok
            assert (await client.ask("SET", "mode", "active")).ok
            assert (await client.ask("START")).ok is False  # changed since it was prepared
            assert site.ziy.firing.dropped == {"ZY102"}

    run(story)


def test_reference_and_moves_are_journalled():
    async def story():
        async with Served() as site:
            heard = []
            anna, ben = await site.client(heard=heard.append), await site.client()
            assert (await anna.ask("LEASE", "anna")).ok
            assert (await ben.ask("REFERENCE", "NOW")).text.startswith("REFERENCE needs the lease")
            early = await anna.ask("REFERENCE", "NOW")
            assert (early.ok, early.text[:26]) == (False, "no epoch was solved yet (e")
            await until(lambda: site.ziy.answer is not None)
            assert (await ben.ask("REFERENCE")).values[:5] == ("none", "none", "none", "none", "0")
            assert (await anna.ask("REFERENCE", "NOW")).ok
            assert [change.reference for change in site.live.changes] == [True]
            await until(lambda: "reference" in site.kinds())
            documents = [row for row in site.journal.rows if getattr(row, "name", "") == "live-changed"]
            assert [row.text for row in documents] == ['{"reference": true}']
            assert (await ben.ask("MOVED", "subreflector_y", "2.5", "mm", "ben")).ok  # no beam: no lease
            for words in (
                ("x", "nan", "mm", "b"),
                ("x", "1", "furlong", "b"),
                ("1x", "1", "mm", "b"),
                ("x", "1", "mm"),
            ):
                assert (await ben.ask("MOVED", *words)).ok is False
            await until(lambda: "actuator-moved" in site.kinds())
            row = next(row for row in site.journal.rows if getattr(row, "kind", "") == "actuator-moved")
            assert (row.text, row.details["value"]) == ("subreflector_y was moved to 2.5 mm, says ben", "2.5")
            moves = await ben.ask("SAMPLER", "MOVES")
            assert moves.values[2:] == ("subreflector_y", "2.5", "mm", "ben", "0")

    run(story)


def test_journal_that_fails_takes_no_reference():
    async def story():
        async with Served() as site:
            anna = await site.client()
            await anna.ask("LEASE", "anna")
            await until(lambda: site.ziy.answer is not None)
            site.journal.broken = "disk full"
            refused = await anna.ask("REFERENCE", "NOW")
            assert (refused.ok, refused.text) == (False, "a reference cannot be journalled: disk full")
            assert site.live.changes == []

    run(story)


def test_corrections_are_pushed_and_started_off():
    async def story():
        async with Served() as site:
            heard = []
            client = await site.client(heard=heard.append)
            assert (await client.ask("SUBSCRIBE", "CORRECTION")).ok
            await until(lambda: [r for r in heard if r.command == "CORRECTION"])
            pushed = next(r for r in heard if r.command == "CORRECTION")
            assert pushed.values[:5] == ("1", "unknown", "none", "none", "none")  # the scene's answers have no pose
            site.ziy.gives_corrections = False
            heard.clear()
            await until(lambda: [r for r in heard if r.command == "CORRECTION"])
            assert heard[-1].values[1] == "off"

    run(story)


def test_commands_of_the_coordinator_itself():
    async def story():
        async with Served() as site:
            client = await site.client()
            assert (await client.ask("LEASE", "anna")).ok
            assert (await client.ask("MODE")).text == "active"
            assert (await client.ask("MODE", "hold")).text == "hold"
            assert site.ziy.mode == "hold"
            assert (await client.ask("MODE", "x")).ok is False
            assert (await client.ask("DROP", "zy101")).text == "ZY101"
            assert site.ziy.firing.dropped == {"ZY101"}
            assert (await client.ask("TAKE", "ZY101")).ok
            assert not site.ziy.firing.dropped
            assert (await client.ask("DROP", "ZY777")).ok is False
            assert (await client.ask("STREAM", "ZY101", "ZG11")).ok
            assert site.ziy.firing.streams == {"ZY101": "ZG11"}
            assert (await client.ask("STREAM", "ZY101")).ok
            assert not site.ziy.firing.streams
            assert (await client.ask("STATUS", 1)).ok is False
            assert (await client.ask("STATUS", ticks=5288900000000)).ok is False

    run(story)


def test_client_without_the_lease_may_only_query():
    async def story():
        async with Served() as site:
            heard = []
            anna, ben = await site.client(heard=heard.append), await site.client()
            for command, *rest in (("MODE", "hold"), ("DROP", "ZY101"), ("SET", "mode", "hold"), ("START",)):
                refused = await anna.ask(command, *rest)
                assert refused.ok is False
                assert refused.text == f"{command} needs the lease: nobody has it (expected LEASE and a name first)"
            for command in ("MODE", "STATUS", "RANGERS", "PARAMETERS", "LEASE", "VER"):
                assert (await ben.ask(command)).ok
            assert site.ziy.mode == "active"
            name, peer, token = (await ben.ask("LEASE", "ben")).values
            assert (name, peer, len(token)) == ("ben", "memory port 0", 32)
            assert (await anna.ask("LEASE", "none")).ok is False
            assert (await ben.ask("MODE", "hold")).ok
            assert (await anna.ask("LEASE", "anna")).values[0] == "anna"  # told to all, and journalled
            assert (
                await ben.ask("MODE", "active")
            ).text == "MODE needs the lease: anna has it (expected LEASE and a name first)"
            assert [r.values for r in heard if r.command == "LEASE" and r.tid == 0] == [("ben", peer)]  # no token
            await until(lambda: site.kinds().count("lease") == 2)
            journalled = [row.text for row in site.journal.rows if getattr(row, "kind", "") == "lease"]
            assert "to ben (memory port 0)" in journalled[0]  # with its address
            anna.close()
            await asyncio.sleep(0.1)
            assert (await ben.ask("LEASE")).text == "none"
            await until(lambda: site.kinds().count("lease") == 3)
            for name in ("a b", "1", "x" * 20):
                assert (await ben.ask("LEASE", name)).ok is False

    run(story)


def test_key_is_required_first():
    async def story():
        async with Served() as site:
            await site.server.stop()
            key = "a-key-of-the-site"
            site.server = ZiyServer(site.ziy, port=0, network=network(), door=Door(key=key))
            await site.server.start()
            stranger = await site.raw()
            await asyncio.sleep(0.05)
            assert stranger.got.count(b"\n") == 1
            assert b"NONCE 1, " in stranger.got
            stranger.transport.write(b"STATUS\nMODE hold\n")
            await until(lambda: stranger.gone)
            assert stranger.got.count(b"\n") == 2
            assert b"LINE 0, the site's key is expected first" in stranger.got
            client = await site.client(key=key)
            assert (await client.ask("STATUS")).ok
            with pytest.raises(InputError, match="can be reached by other machines"):
                await ZiyServer(site.ziy, "0.0.0.0", 0, network=network()).start()

    run(story)


def test_samplers_keep_the_last_values_with_their_times():
    samplers = Samplers(length=5)
    for number in range(12):
        samplers.add(shot(number))
    assert [row[1] for row in samplers.last("RANGES", 3)] == ["9", "10", "11"]
    assert len(samplers.last("RANGES", 100)) == 5
    assert samplers.last("RANGES", 1)[0][0] == "52889.00000011"
    samplers.add(LivePosture(5288900000000, 1.5, 0.5))
    assert samplers.last("POSTURE", 9) == [("52889.00000000", "1.5", "0.5", "0.0", "0.0")]
    samplers.add(Happening(1, "ZY101", "lost", "gone, for good\n", "alarm"))
    assert samplers.last("EVENTS", 1)[0][1:] == ("alarm", "ZY101", "lost", "gone; for good?")
    samplers.add(EpochSolution.of(7, Answer(3, 7, used=(1, 2))))
    assert samplers.last("EPOCHS", 1)[0][1:] == ("3", "1", "2", "0", "1.1", *["none"] * 4, "good")
    assert samplers.last("POINTS", 1)[0][1:] == ("3", "ZG11", "1.0", "2.0", "3.0", *["none"] * 7)
    for name, columns in COLUMNS.items():
        for row in samplers.last(name, 1):
            assert len(row) == len(columns) + 1


def test_samplers_answer_over_the_port():
    async def story():
        async with Served() as site:
            await until(lambda: site.live.epochs >= 2)
            client = await site.client()
            names = {r.values[0]: int(r.values[1]) for r in await client.ask_all("SAMPLERS")}
            assert set(names) == set(COLUMNS)
            assert names["RANGES"] > 3
            rows = await client.ask_all("SAMPLER", "ranges", 3)
            assert [r.values[0] for r in rows] == ["RANGES"] * 3
            numbers = [int(r.values[2]) for r in rows]
            assert numbers == sorted(numbers)
            for wrong in (("x",), ("RANGES", 0), ("RANGES", RING_LENGTH + 1), ("RANGES", "-1")):
                assert (await client.ask("SAMPLER", *wrong)).ok is False

    run(story)


def test_slow_client_is_cut_off_without_cost_to_others():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            slow, quick = await site.raw(), await site.raw()
            for each in (slow, quick):
                each.transport.write(b"SUBSCRIBE EVENT\n")
            await asyncio.sleep(0.1)
            slow.transport.pause_reading()
            told, before = MOST_UNSENT // 300 + 100, quick.got.count(b"\tEVENT 1")
            for number in range(told):
                site.server.publish(Happening(number, "ZY101", "long", "x" * 280))
                await asyncio.sleep(0.001)
            assert slow.gone
            assert not quick.gone
            assert quick.got.count(b"\tEVENT 1") - before == told
            assert len(site.server.clients) == 1

    run(story)


def test_line_length_line_rate_and_clients_are_limited():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            long = await site.raw()
            long.transport.write(b"A" * (LONGEST_REQUEST + 10))
            await until(lambda: long.gone)
            assert b"LINE 0, line is longer" in long.got
            flood = await site.raw()
            await asyncio.sleep(0.01)
            began = asyncio.get_running_loop().time()
            flood.transport.write(b"MODE\n" * 1000)
            await until(lambda: flood.got.count(b"MODE") == 1000)
            assert 2.5 < asyncio.get_running_loop().time() - began < 3.6  # 400 at once, then 200 a second
            others = [await site.raw() for _ in range(MOST_CLIENTS)]
            await asyncio.sleep(0.1)
            assert sum(other.gone for other in others) == 1
            assert b"CONNECT 0" in others[-1].got

    run(story)


def test_keep_alives_are_sent_every_minute():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            nc = await site.raw()
            await asyncio.sleep(0.1)
            greeting = len(nc.got)
            await asyncio.sleep(59.0)
            assert len(nc.got) == greeting
            await asyncio.sleep(2.0)
            assert nc.got[greeting:] == b"\n"

    run(story)


def babble(lines, seed):
    async def story():
        rng = random.Random(seed)
        words = [
            *(word.encode() for word in HELP),
            *(kind.encode() for kind in KINDS),
            b"RANGES",
            b"ZY101",
            b"mode",
            b"none",
        ]
        async with Served(mode="hold", ready=False) as site:
            client, sent = await site.raw(), 0
            while sent < lines:
                if client.gone:
                    client = await site.raw()
                sent += 1
                body = b" ".join([rng.choice(words), b", ".join(rng.choice(words) for _ in range(rng.randrange(4)))])
                client.transport.write(
                    rng.choice(
                        [body + b"\n", b"1000\t" + body + b"\n", rng.randbytes(rng.randrange(80)) + b"\n", b"\n"]
                    )
                )
                await asyncio.sleep(0.005)
                for line in client.got.split(b"\n")[:-1]:
                    parse_reply(line.decode("ascii"))  # whatever came: what is answered is a line of the grammar
                client.got = b""
            assert not site.task.done()
            last = await site.client()
            assert (await last.ask("STATUS")).ok

    run(story, 1e6)


def test_random_lines_from_clients_do_no_harm():
    babble(2000, 3)


@pytest.mark.slow
def test_100000_random_lines_from_clients_do_no_harm():
    babble(100_000, 4)


def test_real_socket_works_and_an_occupied_port_is_refused_in_one_line():
    from catseye.errors import InputError

    async def story():
        async with Site(mode="hold", ready=False) as site:
            server = ZiyServer(site.ziy, port=0)
            await server.start()
            with pytest.raises(InputError, match="is not available"):
                await ZiyServer(site.ziy, port=server.port).start()
            client = await ZyClient.connect(LOOPBACK, server.port)
            assert (await client.ask("MODE")).text == "hold"
            client.close()
            await server.stop()

    asyncio.run(asyncio.wait_for(story(), 30.0))


def test_points_have_their_covariance_and_shots():
    samplers = Samplers()
    matrix = np.arange(36.0).reshape(6, 6) + np.arange(36.0).reshape(6, 6).T
    answer = {"number": 4, "names": ["A", "B"], "x": [[1.0, 2.0, 3.0], [4.0, 5.0, None]], "shots": [7, 0]}
    samplers.add(EpochSolution(7, answer, matrix))
    one, two = samplers.last("POINTS", 9)
    assert dict(zip(COLUMNS["POINTS"], one[1:], strict=True)) == {
        "epoch": "4",
        "point": "A",
        "x_m": "1.0",
        "y_m": "2.0",
        "z_m": "3.0",
        "used": "7",
        "xx_m2": "0.0",
        "xy_m2": "7.0",
        "xz_m2": "14.0",
        "yy_m2": "14.0",
        "yz_m2": "21.0",
        "zz_m2": "28.0",
    }
    assert (two[5], two[6], two[-1]) == ("none", repr(float(matrix[3, 3])), "0")
    samplers.add(EpochSolution(8, {"number": 5, "names": ["A"], "x": [[1.0, 2.0, 3.0]]}))
    assert samplers.last("POINTS", 1)[0][6:] == ("none",) * 7


def test_plan_names_the_next_shots_of_each_ranger():
    async def story():
        async with Served() as site:
            client = await site.client()
            await until(lambda: list(site.ziy.next_shots(1)))
            rows = [reply.values for reply in await client.ask_all("PLAN", "2")]
            assert {row[0] for row in rows} <= set(site.names)
            assert all(parse_stamp(row[1]) > ticks_now(site.ziy.clock) - 200 for row in rows)
            assert {row[2] for row in rows} <= {"ZRG", "ZG11", "ZG12"}
            assert rows[0][3:] == ("0.128", "a test")
            assert (await client.ask("PLAN", "0")).ok is False
            site.ziy.set_mode("hold")
            assert not list(site.ziy.next_shots(1))

    run(story)


def test_sun_and_its_cone_are_named():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            client = await site.client()
            assert (await client.ask("SUN")).values == ("1.0", "0.5", "0.1", "avoided")

    run(story)


def test_alarms_are_acknowledged_and_shelved_by_name_without_the_lease():
    async def story():
        async with Served(mode="hold", ready=False) as site:
            client, other = await site.client(), await site.client()
            assert (await other.ask("LEASE", "ben")).ok
            await asyncio.sleep(1.5)

            async def alarm():
                rows = {r.values[0]: r.values for r in await client.ask_all("ALARMS")}
                return rows["mode"]

            first = await alarm()
            assert first[1] == "warning"
            assert first[3:] == ("none", "none", "none", "none", "mode hold: no shots are taken")
            assert (await client.ask("ACK", "mode", "anna")).values == ("mode", "anna")
            assert (await client.ask("SHELVE", "mode", "2", "anna")).ok
            now = await alarm()
            assert (now[3], now[5]) == ("anna", "anna")
            minutes = (parse_stamp(now[6]) - ticks_now(site.ziy.clock)) * 864e-6 / 60.0
            assert minutes == pytest.approx(2.0, abs=0.01)
            assert (await client.ask("UNSHELVE", "mode", "anna")).ok
            for wrong in (("ACK", "nothing", "anna"), ("ACK", "mode", "1"), ("SHELVE", "mode", "soon", "anna")):
                assert (await client.ask(*wrong)).ok is False
            assert (await client.ask("LEASE")).values[0] == "ben"
            events = [(e.kind, e.details.get("by")) for e in site.published if getattr(e, "who", "") == "alarms"]
            assert events == [("acknowledged", "anna"), ("shelved", "anna"), ("unshelved", "anna")]
            assert site.kinds().count("shelved") == 1

    run(story)
