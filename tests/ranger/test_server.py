"""Server and client on real loopback sockets; clocks are injected, and nothing sleeps."""

import asyncio
import contextlib
import random
import socket

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.ranger.client import SECOND_CLIENT_TID, ZyClient
from catseye.ranger.commands import COMMANDS
from catseye.ranger.door import Door, answer_to
from catseye.ranger.entrance import COUNTED, MOST_PENDING, PATIENCE, SLOWED
from catseye.ranger.line import LAST_TID, LONGEST_REPLY, LONGEST_REQUEST, parse_reply
from catseye.ranger.network import TlsFiles
from catseye.ranger.ranger import Ranger
from catseye.ranger.server import (
    LINE_BURST,
    LOOPBACK,
    MOST_UNSENT,
    MOST_WAITING,
    MUTE,
    SILENT,
    ClientConnection,
    ZyServer,
)
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock, VirtualLoop
from ranger.clocked_head import ClockedHead
from ranger.ranger_scene import READY, REFERENCE_PHASE, ready

OPEN = Door(lease=False)


class Site:
    """A served ranger, its head's time and the server's clock."""

    def __init__(self, door=OPEN, **options):
        self.told = ready(**options)
        self.head, self.ranger = self.told.head, self.told.ranger
        self.now = 0.0
        self.server = ZyServer(self.ranger, ports=(0, 0), door=door, clock=lambda: self.now)

    async def __aenter__(self):
        await self.server.start()
        return self

    async def __aexit__(self, *_):
        await self.server.stop()
        await asyncio.sleep(0)

    async def turns(self, count, stride=0.02):
        for _ in range(count):
            self.server.turn()
            self.head.advance(stride)
            await asyncio.sleep(0)

    async def until(self, done, stride=0.02):
        for _ in range(20_000):
            if done():
                return
            await self.turns(1, stride)
        raise AssertionError("it never came")

    async def answered(self, waiting):
        task = asyncio.ensure_future(waiting)
        await self.until(task.done)
        return task.result()

    async def client(self, number=0, **options):
        return await self.answered(
            ZyClient.connect(LOOPBACK, self.server.ports[number], clock=lambda: self.now, **options)
        )

    async def typed(self, number=0):
        return await self.answered(asyncio.open_connection(LOOPBACK, self.server.ports[number]))


def run(story):
    asyncio.run(story())


def test_ranger_can_be_driven_from_nc():
    async def story():
        async with Site() as site:
            site.ranger.name = "ZY11"
            reader, writer = await site.typed()
            port = site.server.ports[0]
            greeting = [(await site.answered(reader.readline())).decode().split("\t") for _ in range(3)]
            assert [g[0] for g in greeting] == ["0"] * 3
            assert [g[2] for g in greeting] == [
                "HELLO This is ZY11 ver. 2.20\n",
                f"CONNECT 1, {port}\n",
                "STW 1, 0x00013007\n",
            ]
            writer.write(b"\r\ncmeas 1, zrg\r\nxyz\nbye\n")
            said = [(await site.answered(reader.readline())).decode() for _ in range(3)]
            assert said[0].split("\t")[2].startswith("CMEAS 1, 1, 0, ZRG, ")
            assert said[1].endswith("UNKNOWN command XYZ\n")
            assert said[2].startswith("0\t52889.")
            assert said[2].endswith(f"\tBYE 1, {port}, Closing Connection\n")
            assert await site.answered(reader.read()) == b""
            writer.close()

    run(story)


def test_two_clients_share_state_changes_and_a_third_is_refused():
    async def story():
        async with Site() as site:
            heard = []
            one = await site.client(0)
            two = await site.client(1, first_tid=SECOND_CLIENT_TID, heard=heard.append)
            await site.until(lambda: len(heard) >= 3)
            reply = await site.answered(one.ask("CMEAS", 1, "ZG11"))
            await site.until(lambda: any(r.command == "CMEAS" for r in heard))
            assert reply in heard
            buffer = await site.answered(one.ask("BUF"))
            assert len(buffer.values[-1]) == 21_848  # 16 384 bytes in base64
            assert (await site.answered(two.ask("D0"))).text == "181.2000"
            await site.turns(5)
            assert not any(r.command == "BUF" for r in heard)
            reader, writer = await site.typed(0)
            line = (await site.answered(reader.readline())).decode()
            assert f"CONNECT 0, port {site.server.ports[0]} is taken" in line
            assert await site.answered(reader.read()) == b""
            writer.close()
            one.close()
            two.close()

    run(story)


def test_keep_alives_are_sent_every_60_s():
    async def story():
        async with Site() as site:
            reader, writer = await site.typed()
            for _ in range(3):
                await site.answered(reader.readline())
            for site.now, due in ((59.9, False), (60.0, True), (119.0, False), (120.0, True)):
                line = asyncio.ensure_future(reader.readline())
                await site.turns(20)
                assert line.done() == due
                if due:
                    assert line.result() == b"\n"
                else:
                    line.cancel()
                    await site.turns(1)
            writer.close()

    run(story)


def test_client_sends_keep_alives_and_gives_up_a_silent_ranger():
    async def story():
        async with Site() as site:
            client = await site.client()
            await site.turns(10)
            sent = []
            client._write = sent.append
            for site.now in (59.0, 60.0):
                client.check()
            assert sent == [""]
            site.now = 151.0
            client.check()
            assert client.closed.result() == "nothing heard for 150 s"
            assert (await site.answered(client.ask("VER"))).ok is False

    run(story)


def test_each_of_many_outstanding_requests_gets_its_answer():
    async def story():
        async with Site() as site:
            client = await site.client(first_tid=LAST_TID - 1)
            called = []
            asked = [client.request("COO", 1 + k % 2) for k in range(150)]
            tid, future = client.request("SEQ", then=called.append)
            assert [t for t, _ in asked[:4]] == [LAST_TID - 1, LAST_TID, 1000, 1001]
            assert client.outstanding == 151
            await site.until(lambda: all(f.done() for _, f in asked) and future.done(), 0.001)
            assert [f.result().values[0] for _, f in asked] == ["1", "2"] * 75
            assert all(f.result().tid == t for t, f in asked)
            assert called[0].ok is False  # no buffer yet
            client.forget(tid)
            assert client.outstanding == 0
            assert [r.values[1] for r in await site.answered(client.ask_all("COO"))] == ["ZRG", "ZG11", "ZG12"]
            assert (await site.answered(client.ask("XYZ"))).command == "UNKNOWN"
            client.close()

    run(story)


def test_lost_connection_fails_outstanding_requests_and_frees_port_and_schedule():
    async def story():
        async with Site() as site:
            client = await site.client()
            assert (await site.answered(client.ask("AT", "60000", 5, 1, "TRG"))).ok
            _, waiting = client.request("CMEAS", 1, 1)
            next(iter(site.server.connections.values())).transport.abort()
            reply = await site.answered(waiting)
            assert reply.ok is False
            assert reply.text.startswith("connection lost")
            assert site.ranger.scheduler.entries == []
            again = await site.client()
            assert (await site.answered(again.ask("VER"))).values == ("ZY101", "2.20")
            again.close()

    run(story)


def test_flood_is_rate_limited_without_loss_and_memory_is_bounded():
    async def story():
        async with Site() as site:
            flood = socket.create_connection((LOOPBACK, site.server.ports[0]))
            flood.setblocking(False)
            other = await site.client(1, first_tid=SECOND_CLIENT_TID)
            await site.until(lambda: 0 in site.server.connections)
            sent = flood.send(b"D0\n" * 2000)
            assert sent == 6000
            await site.turns(int(LINE_BURST) + 50)
            connection = site.server.connections[0]
            assert not connection.paused  # what came is looked through for what makes dark
            assert len(connection.unread) == 3 * (2000 - int(LINE_BURST))
            assert site.ranger.waiting(0) <= MOST_WAITING
            assert (await site.answered(other.ask("VER"))).ok
            heard = 0
            for _ in range(400):
                site.now += 0.05
                await site.turns(10)
                try:
                    heard += flood.recv(2**20).count(b"D0 1, ")
                except BlockingIOError:
                    continue
                if heard == 2000:
                    break
            assert heard == 2000
            flood.close()
            other.close()

    run(story)


@pytest.mark.parametrize("junk", [b"A" * (LONGEST_REQUEST + 10), b"A" * 3000 + b"\n"])
def test_overlong_line_is_refused_and_only_its_connection_closed(junk):
    async def story():
        async with Site() as site:
            reader, writer = await site.typed(0)
            other = await site.client(1)
            writer.write(junk)
            rest = (await site.answered(reader.read())).decode()
            assert "LINE 0, line is longer than 1024 bytes" in rest
            assert (await site.answered(other.ask("VER"))).ok
            writer.close()
            other.close()

    run(story)


class FullTransport(asyncio.Transport):
    """A peer that takes nothing: how much a kernel takes on its behalf differs from machine to machine."""

    def __init__(self):
        super().__init__()
        self.kept, self.cut = 0, False

    def write(self, data):
        self.kept += len(data)

    def get_write_buffer_size(self):
        return self.kept

    def is_closing(self):
        return self.cut

    def close(self):
        self.cut = True

    abort = close


def test_client_that_does_not_read_is_cut_off_without_cost_to_others():
    async def story():
        async with Site() as site:
            other = await site.client(1)
            slow, full = ClientConnection(site.server, 0), FullTransport()
            slow.connection_made(full)
            assert (await site.answered(other.ask("CYC", 1024))).ok
            assert (await site.answered(other.ask("TRG"))).ok
            asked = 0
            while not full.cut and asked < 100:
                slow.data_received(b"BUF\n")
                await site.turns(2)
                asked += 1
            assert full.cut
            assert full.kept <= MOST_UNSENT + LONGEST_REPLY
            slow.connection_lost(None)
            assert (await site.answered(other.ask("VER"))).ok
            other.close()

    run(story)


def fuzzed(rng):
    """A line: bytes, a mangled command, or a command with odd values."""
    kind = rng.random()
    if kind < 0.3:
        return bytes(rng.randrange(256) for _ in range(rng.randrange(60))).replace(b"\n", b" ") + b"\n"
    name = rng.choice([n for n in COMMANDS if n not in ("BYE", "SCN")])
    values = [
        rng.choice(["0", "1", "2", "-1", "1e300", "nan", "ZG11", "", "65536", "0.5", "x" * 40, "52889.5", "1\t2", ";"])
        for _ in range(rng.randrange(6))
    ]
    line = f"{rng.choice(['', '7	', '1000	52889.0	', 'x	'])}{name} {', '.join(values)}".encode()
    if kind < 0.5:
        at = rng.randrange(len(line) + 1)
        line = line[:at] + bytes([rng.randrange(256)]).replace(b"\n", b"?") + line[at + 1 :]
    return line + b"\n"


def fuzz(lines, seed):
    async def story():
        async with Site() as site:
            rng = random.Random(seed)
            reader, writer = await site.typed(0)
            other = await site.client(1, first_tid=SECOND_CLIENT_TID)
            heard = bytearray()

            async def listen():
                while data := await reader.read(2**16):
                    heard.extend(data)

            task = asyncio.ensure_future(listen())
            writer.write(b"VER\n")  # a first line that cannot be read would end the connection
            for k in range(lines):
                writer.write(fuzzed(rng))
                site.now += 0.02
                if k % 20 == 0:
                    await site.turns(30, 0.5)
            await site.until(lambda: site.ranger.idle and not site.server.connections[0].unread, 0.5)
            assert (await site.answered(other.ask("VER"))).values == ("ZY101", "2.20")
            assert other.bad_lines == 0, other.last_bad
            await site.turns(20)
            for line in heard.decode("ascii").splitlines():
                parse_reply(line)
            assert heard.count(b"\n") > lines // 4
            writer.close()
            other.close()
            task.cancel()
            await site.turns(2)

    asyncio.run(story())


def test_2000_fuzzed_lines_neither_crash_nor_hang_the_ranger():
    fuzz(2000, 8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_many_fuzzed_lines_neither_crash_nor_hang_the_ranger(seed):
    fuzz(10_000, seed)


def test_server_listens_locally_and_reports_an_occupied_port():
    async def story():
        async with Site() as site:
            assert ZyServer(site.ranger).host == "127.0.0.1"
            assert ZyServer(site.ranger).ports == (5240, 5241)
            twin = ZyServer(site.ranger, ports=site.server.ports)
            with pytest.raises(InputError, match="is not available"):
                await twin.start()
            with pytest.raises(InputError, match="no ranger answers at"):
                await ZyClient.connect(LOOPBACK, 1)

    run(story)


def test_client_counts_unreadable_lines_and_continues():
    async def story():
        async with Site() as site:
            client = await site.client()
            await site.turns(5)
            client.data_received(b"what\xff\n0\t52889.0\tSTW 1, 0x0")
            client.data_received(b"0000007\n")
            assert client.bad_lines == 1
            assert (await site.answered(client.ask("VER"))).ok
            client.data_received(b"1" * 300_000)
            assert "longer than" in client.closed.result()

    run(story)


def test_serve_runs_until_cancelled():
    async def story():
        async with Site() as site:
            task = asyncio.ensure_future(site.server.serve())
            client = await ZyClient.connect(LOOPBACK, site.server.ports[0])
            reply = asyncio.ensure_future(client.ask("CMEAS", 1, 1))
            while not reply.done():
                site.head.advance(0.01)
                await asyncio.sleep(0)
            assert np.isfinite(float(reply.result().values[3]))
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            client.close()

    run(story)


@pytest.mark.parametrize("first", [b"POST / HTTP/1.1\r\nHost: a\r\n\r\n", b"\x16\x03\x01\n", b"what? ever\n"])
def test_lines_after_an_invalid_first_one_are_ignored(first, caplog):
    async def story():
        async with Site() as site:
            reader, writer = await site.typed()
            for _ in range(3):
                await site.answered(reader.readline())
            writer.write(first + b"PS 0\nD0 999\n")
            try:
                rest = await site.answered(reader.read())
            except ConnectionResetError:
                rest = b""
            await site.turns(20)
            assert (b"LINE 0, " in rest) == first.startswith(b"what")
            assert b"D0" not in rest
            assert site.head.laser_on()
            assert site.ranger.d0_mm == 181.2
            assert "closed" in caplog.text
            writer.close()

    run(story)


def test_leading_empty_lines_cost_no_memory_and_later_invalid_lines_close_nothing():
    async def story():
        async with Site() as site:
            reader, writer = await site.typed()
            for _ in range(3):
                await site.answered(reader.readline())
            writer.write(b"\r\n" * 5000)
            await site.turns(20)
            assert len(site.server.connections[0].unread) == 0
            writer.write(b"VER\nwhat? ever\nVER\n")
            said = [(await site.answered(reader.readline())).decode() for _ in range(3)]
            assert sum("VER 1, ZY101" in line for line in said) == 2
            assert sum("LINE 0, " in line for line in said) == 1
            writer.close()

    run(story)


def test_silent_connections_give_their_ports_to_others():
    async def story():
        async with Site() as site:
            mute = [await site.typed(0), await site.typed(1)]
            await site.until(lambda: len(site.server.connections) == 2)
            site.now = MUTE - 0.1
            reader, writer = await site.typed(0)
            assert b"is taken" in await site.answered(reader.read())
            writer.close()
            site.now = MUTE
            clients = [await site.client(0), await site.client(1, first_tid=SECOND_CLIENT_TID)]
            for client, (reader, writer) in zip(clients, mute, strict=True):
                assert (await site.answered(client.ask("VER"))).ok
                assert b"LINE 0, no line received for 10 s" in await site.answered(reader.read())
                writer.close()
            site.now = MUTE + SILENT - 0.1
            reader, writer = await site.typed(0)
            assert b"is taken" in await site.answered(reader.read())  # who has spoken keeps its place for longer
            writer.close()
            site.now = MUTE + SILENT
            clients.append(await site.client(0))
            await site.until(clients[0].closed.done)
            assert (await site.answered(clients[2].ask("VER"))).ok
            for client in clients:
                client.close()

    run(story)


class VirtualSite:
    """A served ranger whose time jumps, with a head whose time passes by itself."""

    def __init__(self, latency=0.0):
        self.loop = VirtualLoop()
        self.clock = VirtualClock(self.loop, 52_889.0)
        self.network = MemoryNetwork(latency)
        self.turns = 0

    def run(self, story):
        async def whole():
            head = ClockedHead(self.clock)
            self.ranger = Ranger("ZY101", head, limits=(-30_000, 80_000))
            turn = self.ranger.turn

            def counted():
                self.turns += 1
                return turn()

            self.ranger.turn = counted
            self.server = ZyServer(self.ranger, door=OPEN, clock=self.loop.time, network=self.network)
            await self.server.start()
            serving = asyncio.create_task(self.server.serve())
            client = await ZyClient.connect(LOOPBACK, 5240, clock=self.loop.time, network=self.network)
            for line in READY:
                command, _, rest = line.partition(" ")
                assert (await client.ask(command, *rest.split(", ") if ", " in rest else rest.split(","))).ok
            azimuth = round(float((await client.ask("AZM", 1)).values[1]))
            head.inner.signals = {azimuth: (3.0, REFERENCE_PHASE)}
            assert (await client.ask("CIL", 1)).ok
            await story(client)
            client.close()
            serving.cancel()
            with pytest.raises(asyncio.CancelledError):
                await serving
            await self.server.stop()

        try:
            self.loop.run_until_complete(whole())
        finally:
            self.loop.close()


def test_idle_server_takes_ten_turns_a_second_and_one_without_clients():
    site = VirtualSite()

    async def story(client):
        await asyncio.sleep(1.0)
        for client_there, most in ((True, 101), (False, 11)):
            if not client_there:
                client.close()
                await asyncio.sleep(1.0)
            before = site.turns
            await asyncio.sleep(10.0)
            assert most - 2 <= site.turns - before <= most

    site.run(story)


def test_idle_ranger_answers_at_once():
    """No virtual time passes: the line itself wakes the server."""
    site = VirtualSite()

    async def story(client):
        for _ in range(20):
            await asyncio.sleep(0.0377)
            begin = site.loop.time()
            assert (await client.ask("VER")).ok
            assert site.loop.time() == begin

    site.run(story)


def test_served_ranger_keeps_scheduled_times():
    site = VirtualSite()

    async def story(client):
        due = site.ranger.now_ticks() + 10_007
        reply = await client.ask("VER", ticks=due)
        assert reply.ticks == due
        begin = site.loop.time()
        assert (await client.ask("CMEAS", 2, 1)).ok
        assert 0.128 <= site.loop.time() - begin < 0.1291  # 128 ms and a fine poll
        heard = []
        client._heard = heard.append
        silent = site.loop.time()
        while not heard:
            await asyncio.sleep(0.01)
            if client._last_heard > silent and not client.outstanding:
                break
        assert 0.0 < site.loop.time() - silent <= 60.1  # the keep-alive

    site.run(story)


def test_client_streams_buffers_without_gaps():
    """128 ms a buffer, a fine poll of 1 ms at most between them, on a network of 0.2 ms: 7.75 a second and more."""
    site = VirtualSite(2e-4)

    async def story(client):
        got = []
        begin = site.loop.time()
        tid, first = client.request("STM", 1, 100, then=got.append)
        assert (await first).values == ("1", "100")
        while len(got) < 201:
            await asyncio.sleep(0.01)
        assert [r.command for r in got] == ["STM"] + ["CMEAS", "BUF"] * 100
        assert all(r.ok and r.tid == tid for r in got)
        assert site.loop.time() - begin < 100 / 7.74
        assert float(got[1].values[3]) == pytest.approx(3.0, abs=2e-3)
        client.forget(tid)
        # the same by hand, two requests always waiting
        begin, asked = site.loop.time(), []
        for _ in range(20):
            asked += [client.request("CMEAS", 2, 1)[1], client.request("BUF")[1]]
        replies = [await each for each in asked]
        assert [r.command for r in replies] == ["CMEAS", "BUF"] * 20
        assert all(r.ok for r in replies)
        assert site.loop.time() - begin < 20 / 7.7

    site.run(story)


def test_excess_input_is_read_at_the_rate_limit_while_idle():
    site = VirtualSite()

    async def story(client):
        await asyncio.sleep(5.0)
        begin = site.loop.time()
        asked = [client.request("D0")[1] for _ in range(1000)]
        for each in asked:
            assert (await each).ok
        assert 3.0 <= site.loop.time() - begin + 0.02 < 3.1  # 400 at once, then 200 a second

    site.run(story)


# Lease, dead man, interlock, key --------------------------------------------------------------------------------------

COMMANDING = ("CIL 1", "PS 1", "AXIS 0, 1", "CYC 64", "COO 1, 0, 0, 9000", "AT 0, 1, 0, PS 0", "RST", "INITZY", "SCN 1")
ASKING = ("VER", "STW", "ACP 0", "COO 1", "PS", "LEASE", "HLP", "RAD")


def dark(head):
    return not head.laser_on() and not head.enabled(0) and not head.enabled(1)


async def heard(site, lines, words):
    """Until a client has heard a line with some words."""
    await site.until(lambda: any(words in reply.text or words in reply.command for reply in lines))
    return next(reply for reply in lines if words in reply.text or words in reply.command)


@pytest.mark.parametrize("command", COMMANDING)
def test_commands_need_the_lease_and_queries_do_not(command):
    async def story():
        async with Site(door=Door()) as site:
            client = await site.client()
            name, *parameters = command.replace(",", "").split()
            reply = await site.answered(client.ask(name, *parameters))
            assert (reply.ok, reply.text) == (
                False,
                f"{name} needs the lease: nobody has it (expected LEASE and a name first)",
            )
            for asked in ASKING:
                word, *rest = asked.split()
                assert "needs the lease" not in (await site.answered(client.ask(word, *rest))).text
            client.close()

    run(story)


def test_lease_is_taken_by_name_and_published():
    async def story():
        async with Site(door=Door()) as site:
            lines = []
            first = await site.client(0)
            second = await site.client(1, first_tid=SECOND_CLIENT_TID, heard=lines.append)
            name, place, peer, token = (await site.answered(first.ask("LEASE", "anna"))).values
            assert (name, place) == ("anna", "1")
            assert peer.startswith("127.0.0.1 port ")
            assert len(token) == 32
            assert (await heard(site, lines, "LEASE")).values == ("anna", "1", peer)  # the token is the taker's
            assert (await site.answered(first.ask("CYC", "64"))).ok
            refused = await site.answered(second.ask("CYC", "32"))
            assert refused.text == "CYC needs the lease: anna has it (expected LEASE and a name first)"
            assert (await site.answered(second.ask("LEASE", "none"))).text == "the lease is anna's (expected yours)"
            assert (await site.answered(second.ask("LEASE", "ben"))).values[:2] == ("ben", "2")  # a person may, by name
            assert not (await site.answered(first.ask("CYC", "16"))).ok
            assert (await site.answered(second.ask("CYC", "32"))).ok
            assert (await site.answered(second.ask("LEASE", "none"))).values == ("none",)
            assert (await site.answered(second.ask("LEASE", "ben"))).ok
            second.close()
            await site.until(lambda: len(site.server.connections) == 1)
            assert (await site.answered(first.ask("LEASE"))).values == ("none",)  # it went with its connection
            first.close()

    run(story)


@pytest.mark.parametrize("feeds", ["CYC 64", "renewal"])
def test_dead_man_switch_turns_laser_and_motors_off(feeds):
    """Attack: a holder whose VER came each second kept the laser on for ever."""

    async def story():
        async with Site(door=Door(dead_man=30.0)) as site:
            lines = []
            holder = await site.client(0)
            listener = await site.client(1, first_tid=SECOND_CLIENT_TID, heard=lines.append)
            token = (await site.answered(holder.ask("LEASE", "anna"))).values[-1]
            assert (await site.answered(holder.ask("PS", 1))).ok
            for _ in range(5):
                site.now += 29.0
                order = ("LEASE", "anna", token) if feeds == "renewal" else ("CYC", 64)
                assert (await site.answered(holder.ask(*order))).ok
            assert site.head.laser_on()
            for _ in range(4):  # questions are no orders, neither hers nor another's
                site.now += 7.4
                for client in (holder, listener):
                    for asked in ("VER", "STW", "LEASE"):
                        assert (await site.answered(client.ask(asked))).ok
            assert site.head.laser_on()
            site.now += 0.5
            said = await heard(site, lines, "SAFE")
            assert (said.ok, said.tid) == (False, 0)
            assert said.text == "nothing was ordered by anna for 30 s: laser and motors are off"
            assert dark(site.head)
            assert (await site.answered(listener.ask("LEASE"))).values == ("none",)
            assert len([line for line in lines if line.command == "SAFE"]) == 1
            holder.close()
            listener.close()

    run(story)


def test_open_interlock_makes_safe_at_once_and_refuses_light_and_moves():
    async def story():
        async with Site(door=Door()) as site:
            lines, pulled = [], []
            site.ranger._head_interlock = lambda: pulled[0] if pulled else ""
            client = await site.client(heard=lines.append)
            assert (await site.answered(client.ask("LEASE", "anna"))).ok
            pulled.append("the door of the hut")
            said = await heard(site, lines, "SAFE")
            assert said.text == "the interlock is open (the door of the hut): laser and motors are off"
            assert dark(site.head)
            for word, *rest in (("PS", 1), ("AXIS", 0, 1), ("CIL", 1), ("TRG",), ("FHM", 0)):
                reply = await site.answered(client.ask(word, *rest))
                assert not reply.ok
                assert "the interlock is open: the door of the hut" in reply.text
            assert (await site.answered(client.ask("PS", 0))).ok
            assert (await site.answered(client.ask("LEASE"))).values[:2] == ("anna", "1")
            pulled.clear()
            assert (await site.answered(client.ask("AXIS", 0, 1))).ok
            assert (await site.answered(client.ask("PS", 1))).ok
            client.close()

    run(story)


def test_connection_silent_for_an_hour_is_closed():
    async def story():
        async with Site(door=Door(lease=False, idle=3600.0)) as site:
            client = await site.client()
            assert (await site.answered(client.ask("VER"))).ok
            site.now += 3599.0
            await site.turns(3)
            assert not client.closed.done()
            site.now += 2.0
            await site.until(client.closed.done)

    run(story)


KEY = "a-key-of-the-site"
GUESSES = ("VER\n", "KEY wrong-key-of-a-site\n", "KEY\n", f"KEY {KEY}\n", f"KEY {'0' * 64}\nVER\n")


def typed_word(line):
    return line.decode().split("\t")[2].split()[0]


def test_port_with_a_key_sends_only_a_nonce_before_authentication():
    async def story():
        async with Site(door=Door(key=KEY, lease=False)) as site:
            with_key = await site.client(0, key=KEY)
            assert (await site.answered(with_key.ask("VER"))).ok
            for first in GUESSES:  # the key itself does not open, either: it never travels
                reader, writer = await site.typed(1)
                writer.write(first.encode())
                await site.turns(5)
                site.now += SLOWED
                said = (await site.answered(reader.read())).splitlines()
                assert [typed_word(line) for line in said] == ["NONCE", "LINE"]
                assert b"the site's key is expected first" in said[1]
                writer.close()
            reader, writer = await site.typed(1)
            nonce = (await site.answered(reader.readline())).decode().split()[-1]
            assert (await site.answered(with_key.ask("VER"))).ok  # which a stranger does not hear
            writer.write(f"KEY {answer_to(nonce, KEY)}\nVER\n".encode())
            words = [typed_word(await site.answered(reader.readline())) for _ in range(5)]
            assert words == ["KEY", "HELLO", "CONNECT", "STW", "VER"]
            writer.close()
            with_key.close()

    run(story)


def test_replayed_answer_does_not_authenticate():
    async def story():
        async with Site(door=Door(key=KEY, lease=False)) as site:
            said = []
            for _ in range(2):
                reader, writer = await site.typed(1)
                nonce = (await site.answered(reader.readline())).decode().split()[-1]
                said.append(answer_to(nonce, KEY))
                writer.write(f"KEY {said[0]}\n".encode())
                await site.turns(5)
                site.now += SLOWED
                word = typed_word(await site.answered(reader.readline()))
                assert word == ("KEY" if len(said) == 1 else "LINE")
                writer.close()
                await site.until(lambda: not site.server.connections)
            assert said[0] != said[1]

    run(story)


def test_unauthenticated_peers_occupy_no_port():
    """Attack: two sockets that never gave the key kept the coordinator out."""

    async def story():
        async with Site(door=Door(key=KEY, lease=False)) as site:
            strangers = [await site.typed(number) for number in (0, 1) for _ in range(MOST_PENDING + 4)]
            await site.turns(5)
            clients = [await site.client(number, key=KEY, first_tid=1000 + number * 2**31) for number in (0, 1)]
            for client in clients:
                assert (await site.answered(client.ask("VER"))).ok
            assert all(len(gate._pending) <= MOST_PENDING for gate in site.server.gates)
            site.now += PATIENCE
            await site.until(lambda: not any(gate._pending for gate in site.server.gates))
            for reader, writer in strangers:
                with contextlib.suppress(ConnectionResetError):
                    await site.answered(reader.read())
                writer.close()
            for client in clients:
                assert (await site.answered(client.ask("VER"))).ok
                client.close()

    run(story)


def test_wrong_keys_are_answered_late_and_counted_once_a_minute(caplog):
    async def story():
        async with Site(door=Door(key=KEY, lease=False)) as site:

            async def guess():
                reader, writer = await site.typed(1)
                await site.answered(reader.readline())
                writer.write(f"KEY {'0' * 64}\n".encode())
                await site.turns(5)
                late = asyncio.ensure_future(reader.read())
                site.now += SLOWED - 0.01
                await site.turns(5)
                assert not late.done()
                site.now += 0.02
                assert b"the site's key" in await site.answered(late)
                writer.close()

            for _ in range(7):
                await guess()
            site.now += COUNTED
            await site.turns(2)
            told = [record.getMessage() for record in caplog.records if "wrong keys" in record.getMessage()]
            assert [line.partition(": wrong keys: ")[2].split(",")[0] for line in told] == ["1", "6"]
            assert "the last of 127.0.0.1 port" in told[1]

    run(story)


def test_client_without_the_key_reports_what_is_expected():
    async def story():
        async with Site(door=Door(key=KEY, lease=False)) as site:
            client = await site.client(0)
            await site.until(client.closed.done)
            assert "expected CATSEYE_KEY" in client.closed.result()

    run(story)


def test_exposed_port_is_refused_without_key_or_tls():
    async def story():
        site = Site()
        for host in ("0.0.0.0", "::", "192.0.2.7", ""):
            with pytest.raises(InputError, match=r"can be reached by other machines \(expected the site's key"):
                await ZyServer(site.ranger, host, (0, 0)).start()
            with pytest.raises(InputError, match=r"can be reached by other machines \(expected CATSEYE_TLS_CERT"):
                await ZyServer(site.ranger, host, (0, 0), door=Door(key=KEY)).start()
        server = ZyServer(site.ranger, "0.0.0.0", (0, 0), door=Door(key=KEY, tls=TlsFiles(clear=True)))
        await server.start()
        await server.stop()

    run(story)
