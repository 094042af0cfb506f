"""Many rangers in a process, and what their network does to them."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.ranger.client import ZyClient
from catseye.ranger.door import Door
from catseye.ranger.line import format_request
from catseye.ranger.status import StatusWord
from catseye.records.site.folder import read_site
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock, VirtualLoop
from catseye.simulator.twin.faults import Fault, FaultBoard
from catseye.simulator.twin.servers import TwinSite
from ranger.clocked_head import ClockedHead
from repository import ROOT

GBT = ROOT / "examples" / "sites" / "gbt"
SUN = {"ZY113": ("SUN 0, 0, 1",)}  # along the dish's axis: away from ZRG
NIGHT = 52_889.125  # 22:00 at Green Bank


@pytest.fixture(scope="module")
def few():
    """gbt with a handful of targets, so that files are short."""
    site = read_site(GBT)
    names = [*list(site.targets)[:3], "ZEG41040L", "ZBM01"]
    return replace(site, targets={n: site.targets[n] for n in names if n in site.targets}, benchmarks=())


OPEN = Door(lease=False)


class Running:
    """A twin site in virtual time."""

    def __init__(self, site, names, *faults, start=NIGHT, **options):
        self.loop = VirtualLoop()
        self.clock = VirtualClock(self.loop, start)
        self.network = MemoryNetwork(1e-4)
        self.board = FaultBoard([Fault.parse(fault) for fault in faults])
        self.heads = {name: ClockedHead(self.clock) for name in names}
        self.site = TwinSite(
            site,
            self.heads,
            world_faults=self.board,
            seconds=self.loop.time,
            network=self.network,
            door=OPEN,
            **options,
        )

    def run(self, story):
        async def whole():
            await self.site.start()
            serving = asyncio.create_task(self.site.serve())
            try:
                await story(self)
            finally:
                serving.cancel()
                done = await asyncio.gather(serving, return_exceptions=True)
                await self.site.stop()
                assert isinstance(done[0], asyncio.CancelledError), done

        try:
            self.loop.run_until_complete(whole())
        finally:
            self.loop.close()

    async def client(self, name, number=0, **options):
        host, *ports = self.site.addresses[name]
        return await ZyClient.connect(host, ports[number], network=self.network, clock=self.loop.time, **options)

    async def at_work(self, name):
        """A client of a ranger that is initialised from its files and homed."""
        client = await self.client(name)
        for command in (
            "INITZY",
            "AXIS 0, 1",
            "AXIS 1, 1",
            "FHM 0",
            "FHM 1",
            "PS 1",
            "ABV 0, 400000000",
            *SUN.get(name, ()),
        ):
            word, _, rest = command.partition(" ")
            reply = await self.ask(client, word, *rest.split(", ") if rest else ())
            assert reply.ok, reply
        return client

    async def ask(self, client, *request, seconds=40.0):
        return await asyncio.wait_for(client.ask(*request), seconds)


def test_each_ranger_of_a_site_is_served_at_its_address_from_its_files(few):
    running = Running(few, few.rangers, addresses="loopback")

    async def story(world):
        assert world.site.addresses["ZY105"] == ("127.0.8.5", 5240, 5241)
        assert len(world.site.addresses) == 18
        for name in ("ZY101", "ZY113"):
            client = await world.at_work(name)
            assert (await world.ask(client, "VER")).values[0] == name
            told = await world.ask(client, "COO", "ZEG41040L")
            assert told.ok
            ranger = world.site.rangers[name]
            assert StatusWord.INITIALISED in ranger.status()
            mirror = few.mirror_of(name)
            assert ranger.limits == (mirror.az_low_limit, mirror.az_high_limit)
            assert (await world.ask(client, "CMEAS", 1, 0)).ok
            client.close()

    running.run(story)


def test_only_given_heads_are_served_and_an_unknown_one_is_refused(few):
    running = Running(few, ["ZY102", "ZY104"])
    running.run(lambda world: asyncio.sleep(0.1))
    assert running.site.addresses == {
        "ZY102": ("127.0.0.1", 24_120, 24_121),
        "ZY104": ("127.0.0.1", 24_140, 24_141),
    }
    with pytest.raises(InputError, match="ZY999 is not a ranger"):
        TwinSite(few, {"ZY999": None}, world_faults=FaultBoard(), seconds=lambda: 0.0)


def test_files_are_written_once_and_kept(few, tmp_path):
    running = Running(few, ["ZY102"], files=tmp_path)
    running.run(lambda world: asyncio.sleep(0.1))
    assert sorted(p.name for p in (tmp_path / "ZY102").iterdir()) == ["CUBES.INI", "ZY102.INI", "zp102.INI"]
    (tmp_path / "ZY102" / "zp102.INI").write_text("D0 99\n")
    (tmp_path / "ZY102" / "CUBES.INI").unlink()

    async def story(world):
        client = await world.client("ZY102")
        assert (await world.ask(client, "INITZY")).ok
        assert (await world.ask(client, "D0")).text == "99.0000"
        client.close()

    again = Running(few, ["ZY102"], files=tmp_path)
    again.run(story)
    assert (tmp_path / "ZY102" / "zp102.INI").read_text() == "D0 99\n"
    assert (tmp_path / "ZY102" / "CUBES.INI").exists()
    (tmp_path / "ZY103").write_text("no folder")
    with pytest.raises(InputError, match="ZY103 cannot be made"):
        Running(few, ["ZY103"], files=tmp_path).run(story)


def test_temporary_files_are_gone_after_stop(few):
    running = Running(few, ["ZY102"])
    folders = []

    async def story(world):
        folders.append(world.site.rangers["ZY102"].files)
        assert folders[0].is_dir()

    running.run(story)
    assert not folders[0].exists()


def test_a_dead_ranger_comes_back_cold(few):
    running = Running(few, ["ZY101", "ZY102"], "dead-ranger ZY101 100 150")

    async def story(world):
        client, other = await world.at_work("ZY101"), await world.at_work("ZY102")
        assert (await world.ask(client, "AT", 60_000, 1, 0, "VER")).ok
        _, waiting = client.request("WAI", 0, ticks=world.site.rangers["ZY101"].now_ticks() + 10**7)
        await asyncio.sleep(99.9 - world.loop.time())
        assert not client.closed.done()
        await asyncio.sleep(0.2)
        assert client.closed.done()
        assert not (await waiting).ok
        for _ in range(3):
            with pytest.raises(InputError, match="no ranger answers"):
                await world.client("ZY101")
            await asyncio.sleep(15.0)
        assert (await world.ask(other, "VER")).ok
        await asyncio.sleep(150.1 - world.loop.time())
        client = await world.client("ZY101")
        assert world.site.rangers["ZY101"].status() == StatusWord.AUTO | StatusWord.LASER_OFF
        assert (await world.ask(client, "LST")).values == ("0",)
        assert not (await world.ask(client, "CIL", 1)).ok
        client.close()
        await asyncio.sleep(0.01)
        assert (await (await world.at_work("ZY101")).ask("CMEAS", 1, 0)).ok
        other.close()

    running.run(story)


def test_a_hung_ranger_takes_lines_without_answer_and_drops_them(few):
    running = Running(few, ["ZY101"], "hung-ranger ZY101 100 150")

    async def story(world):
        client = await world.at_work("ZY101")
        await asyncio.sleep(95.0 - world.loop.time())
        for line in ("NUM 1", "ORD 1, 0", "SCN 1"):
            word, _, rest = line.partition(" ")
            assert (await world.ask(client, word, *rest.split(", "))).ok
        await asyncio.sleep(100.1 - world.loop.time())
        fired = world.heads["ZY101"].inner.fired
        assert fired > 3
        _, lost = client.request("D0", 55)
        fresh = await world.client("ZY101", 1, first_tid=10_000)
        heard = []
        fresh._heard = heard.append
        await asyncio.sleep(149.9 - world.loop.time())
        assert not lost.done()
        assert heard == []
        assert not client.closed.done()
        assert world.heads["ZY101"].inner.fired == fired
        await asyncio.sleep(5.0)
        assert not lost.done()
        assert float((await world.ask(client, "D0")).text) == few.mirror_of("ZY101").d0_mm
        assert StatusWord.INITIALISED in world.site.rangers["ZY101"].status()
        client.close()
        fresh.close()

    running.run(story)


def test_a_cut_network_breaks_connections_but_the_ranger_goes_on(few):
    running = Running(few, ["ZY101"], "network-cut ZY101 20 26")

    async def story(world):
        client = await world.at_work("ZY101")
        for line in ("NUM 1", "ORD 1, 0", "SCN 1"):
            word, _, rest = line.partition(" ")
            assert (await world.ask(client, word, *rest.split(", "))).ok
        head = world.heads["ZY101"]
        await asyncio.sleep(20.1 - world.loop.time())
        assert client.closed.done()
        fired = head.inner.fired
        with pytest.raises(InputError, match="no ranger answers"):
            await world.client("ZY101")
        await asyncio.sleep(5.0)
        assert head.inner.fired > fired + 15
        await asyncio.sleep(26.1 - world.loop.time())
        client = await world.client("ZY101")
        reply = await world.ask(client, "STW")
        assert {StatusWord.SCANNING, StatusWord.INITIALISED} <= set(StatusWord(int(reply.text, 16)))
        client.close()

    running.run(story)


def test_a_slow_network_delays_every_line_and_keeps_their_order(few):
    running = Running(few, ["ZY101"], "network-slow ZY101 10 30 0.7")

    async def story(world):
        client = await world.client("ZY101")
        await asyncio.sleep(5.0)

        async def took(command):
            begin = world.loop.time()
            assert (await world.ask(client, command)).ok
            return world.loop.time() - begin

        assert await took("VER") < 0.001
        await asyncio.sleep(10.0)
        assert await took("VER") == pytest.approx(0.7, abs=0.001)
        order = []

        def told(future):
            order.append(float(future.result().text))

        for k in range(40):
            client.request("D0", k)[1].add_done_callback(told)
        await asyncio.sleep(29.9 - world.loop.time())
        for k in range(40, 80):  # some late, some not any more
            client.request("D0", k)[1].add_done_callback(told)
            await asyncio.sleep(0.01)
        await asyncio.sleep(2.0)
        assert order == list(map(float, range(80)))
        assert await took("VER") < 0.001
        client.close()

    running.run(story)


def test_faults_can_be_added_and_taken_off_while_it_runs(few):
    running = Running(few, ["ZY101", "ZY102"])

    async def story(world):
        client = await world.client("ZY101")
        world.board.add(Fault.parse("network-cut *"))
        await asyncio.sleep(0.1)
        assert client.closed.done()
        assert world.board.clear("network-cut") == 1
        await asyncio.sleep(0.1)
        again = await world.client("ZY101")
        assert (await world.ask(again, "VER")).ok
        again.close()

    running.run(story)


def test_a_ground_ranger_has_its_own_sun_and_one_of_the_feed_arm_asks_for_it(few):
    noon = Running(few, ["ZY101", "ZY113"], start=52_889.708)  # 17:00 UTC, near local noon

    async def story(world):
        ground, arm = world.site.rangers["ZY101"], world.site.rangers["ZY113"]
        (sun,) = ground.suns()
        assert np.degrees(np.arcsin(sun[2])) == pytest.approx(56.0, abs=2.0)  # 90 - 38.4 + 4.4 of early September
        assert arm.suns() == []
        assert arm.turning
        assert not ground.turning
        client = await world.client("ZY113")
        for command in ("INITZY", "AXIS 0, 1", "AXIS 1, 1", "FHM 0", "FHM 1"):
            word, _, rest = command.partition(" ")
            assert (await world.ask(client, word, *rest.split(", ") if rest else ())).ok
        assert "no Sun vector received" in (await world.ask(client, "CIL", 0)).text
        assert (await world.ask(client, "SUN", 0, 0, 1)).ok
        assert (await world.ask(client, "CIL", 0)).ok
        client.close()

    noon.run(story)


def test_it_serves_on_real_sockets(few):
    from catseye.clock import SystemClock

    async def story():
        clock = SystemClock.starting_at(NIGHT)
        board, begin = FaultBoard(), clock.now_ns()
        site = TwinSite(
            few,
            {name: ClockedHead(clock) for name in few.rangers},
            world_faults=board,
            seconds=lambda: (clock.now_ns() - begin) * 1e-9,
            addresses=0,
            door=OPEN,
        )
        await site.start()
        serving = asyncio.create_task(site.serve())
        clients = {name: await ZyClient.connect(*at[:2]) for name, at in site.addresses.items()}
        replies = await asyncio.wait_for(asyncio.gather(*(c.ask("INITZY") for c in clients.values())), 30.0)
        assert [r.ok for r in replies] == [True] * 18
        board.add(Fault.parse("dead-ranger ZY101"))
        await asyncio.wait_for(clients["ZY101"].closed, 10.0)
        with pytest.raises(InputError, match="no ranger answers"):
            await ZyClient.connect(*site.addresses["ZY101"][:2])
        board.clear()
        again = None
        for _ in range(500):
            try:
                again = await ZyClient.connect(*site.addresses["ZY101"][:2])
                break
            except InputError:
                await asyncio.sleep(0.02)
        assert (await asyncio.wait_for(again.ask("VER"), 10.0)).values[0] == "ZY101"
        for client in (*clients.values(), again):
            client.close()
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        await site.stop()

    asyncio.run(story())


def test_a_command_of_the_records_is_a_line_a_client_can_send(few):
    from catseye.ranger.initialisation import commands_of_ranger

    for request in commands_of_ranger(few, "ZY101"):
        assert len(format_request(request)) < 100
