"""Time that jumps, and connections without sockets."""

import asyncio
import threading

import pytest

from catseye.errors import CatseyeError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock, VirtualLoop


@pytest.fixture
def loop():
    made = VirtualLoop()
    yield made
    made.close()


class End(asyncio.Protocol):
    """Keeps what it hears, with the times."""

    def __init__(self):
        self.heard, self.lost = [], []

    def connection_made(self, transport):
        self.transport = transport

    def data_received(self, data):
        self.heard.append((asyncio.get_running_loop().time(), data))

    def connection_lost(self, exc):
        self.lost.append(asyncio.get_running_loop().time())

    @property
    def text(self):
        return b"".join(data for _, data in self.heard)


async def pair(network):
    """Two connected ends."""
    far = End()
    listener = await network.serve(lambda: far, "h", 0)
    near = await network.connect(End, "h", listener.port)
    await listener.close()
    return near, far


def test_a_year_takes_no_time_and_sleeps_end_on_the_nanosecond(loop):
    clock = VirtualClock(loop, 52_889.125)

    async def story():
        begin = clock.now_ns()
        await asyncio.sleep(0.125)
        assert clock.now_ns() - begin == 125_000_000
        await asyncio.sleep(86_400.0)
        assert clock.now_ns() - begin == PER_DAY + 125_000_000
        await asyncio.sleep(364 * 86_400.0)
        assert 0 <= clock.now_ns() - begin - (365 * PER_DAY + 125_000_000) <= 4  # a double's step at a year, in ns
        for _ in range(100):
            before = clock.now_ns()
            await asyncio.sleep(1e-9)
            assert clock.now_ns() > before

    loop.run_until_complete(story())
    assert clock.now_ns() == round(52_889.125 * PER_DAY) + loop.now_ns
    assert loop.time() == loop.now_ns / PER_SECOND


def test_sleepers_wake_in_the_order_of_their_times_and_work_takes_none(loop):
    woke = []

    async def sleeper(name, seconds):
        await asyncio.sleep(seconds)
        sum(range(10_000))
        woke.append((name, round(loop.time(), 9)))

    async def story():
        await asyncio.gather(sleeper("c", 3.0), sleeper("a", 1.0), sleeper("b", 1.0 + 1e-6), sleeper("d", 7200.0))

    loop.run_until_complete(story())
    assert woke == [("a", 1.0), ("b", 1.000001), ("c", 3.0), ("d", 7200.0)]


def test_time_stands_still_while_something_outside_is_awaited(loop):
    async def story():
        ticking = asyncio.create_task(asyncio.sleep(1e6))
        done = threading.Event()
        job = loop.run_in_executor(None, done.wait, 10.0)
        loop.call_soon(done.set)
        assert await job
        assert loop.time() == 0.0
        outside = asyncio.get_running_loop().create_future()
        with loop.outside():
            threading.Thread(target=lambda: loop.call_soon_threadsafe(outside.set_result, 5)).start()
            assert await outside == 5
        assert loop.time() == 0.0
        await ticking
        assert loop.time() == 1e6

    loop.run_until_complete(story())


def test_a_deadlocked_loop_is_reported(loop):
    async def story():
        await loop.create_future()

    with pytest.raises(CatseyeError, match="no timer is set and nothing is ready"):
        loop.run_until_complete(story())
    for task in asyncio.all_tasks(loop):
        task.cancel()
    loop.call_later(0.0, loop.stop)
    loop.run_forever()


@pytest.mark.parametrize("latency", [0.0, 0.25])
def test_written_data_arrive_in_order_after_the_latency(loop, latency):
    async def story():
        near, far = await pair(MemoryNetwork(latency))
        for k in range(50):
            near.transport.write(b"%d," % k)
            if k == 24:
                await asyncio.sleep(1.0)
        far.transport.write(b"back")
        assert far.text != b"".join(b"%d," % k for k in range(50))
        await asyncio.sleep(1.0)
        assert far.text == b"".join(b"%d," % k for k in range(50))
        assert {at for at, _ in far.heard} == {latency, 1.0 + latency}
        assert near.heard == [(1.0 + latency, b"back")]

    loop.run_until_complete(story())


@pytest.mark.parametrize("latency", [0.0, 0.25])
def test_close_delivers_what_was_written_and_abort_does_not(loop, latency):
    async def story():
        near, far = await pair(MemoryNetwork(latency))
        near.transport.write(b"last words")
        near.transport.close()
        assert near.transport.is_closing()
        near.transport.write(b"too late")
        await asyncio.sleep(1.0)
        assert far.text == b"last words"
        assert near.lost == far.lost == [latency]
        near, far = await pair(MemoryNetwork(latency))
        near.transport.write(b"never heard")
        near.transport.abort()
        near.transport.abort()
        await asyncio.sleep(1.0)
        assert far.text == b""
        assert (len(near.lost), len(far.lost)) == (1, 1)
        near, far = await pair(MemoryNetwork(latency))
        near.transport.write(b"on the way")
        far.transport.close()
        await asyncio.sleep(1.0)
        assert (len(near.lost), len(far.lost), far.text) == (1, 1, b"")

    loop.run_until_complete(story())


def test_a_peer_that_does_not_read_is_seen_in_the_sender_s_buffer(loop):
    async def story():
        near, far = await pair(MemoryNetwork())
        far.transport.pause_reading()
        for _ in range(10):
            near.transport.write(b"x" * 100)
        await asyncio.sleep(1.0)
        assert far.text == b""
        assert near.transport.get_write_buffer_size() == 1000
        far.transport.resume_reading()
        await asyncio.sleep(1.0)
        assert far.text == b"x" * 1000
        assert near.transport.get_write_buffer_size() == 0
        far.transport.pause_reading()
        near.transport.write(b"end")
        near.transport.close()
        await asyncio.sleep(1.0)
        assert (far.lost, near.lost) == ([], [])
        far.transport.resume_reading()
        await asyncio.sleep(1.0)
        assert far.text == b"x" * 1000 + b"end"
        assert (len(far.lost), len(near.lost)) == (1, 1)

    loop.run_until_complete(story())


def test_a_port_is_one_listener_s_and_nobody_answers_where_none_is(loop):
    async def story():
        network = MemoryNetwork()
        listener = await network.serve(End, "h", 5240)
        with pytest.raises(OSError, match="already in use"):
            await network.serve(End, "h", 5240)
        await network.serve(End, "other", 5240)
        assert (await network.serve(End, "h", 0)).port != (await network.serve(End, "h", 0)).port
        with pytest.raises(ConnectionRefusedError):
            await network.connect(End, "h", 5241)
        await listener.close()
        with pytest.raises(ConnectionRefusedError):
            await network.connect(End, "h", 5240)

    loop.run_until_complete(story())


def test_streams_of_a_site_are_the_same_bytes_each_time():
    """Server, client and head in virtual time leave nothing to chance."""
    from catseye.ranger.client import ZyClient
    from catseye.ranger.door import Door
    from catseye.ranger.ranger import Ranger
    from catseye.ranger.server import LOOPBACK, ZyServer
    from ranger.clocked_head import ClockedHead

    def once():
        loop = VirtualLoop()
        clock, network = VirtualClock(loop, 52_889.0), MemoryNetwork(1e-3)
        heard = []

        async def story():
            servers, tasks = [], []
            for k in range(4):
                ranger = Ranger(f"ZY10{k}", ClockedHead(clock, seed=k), limits=(-30_000, 80_000))
                servers.append(
                    ZyServer(
                        ranger, LOOPBACK, (10 * k, 10 * k + 1), door=Door(lease=False), clock=loop.time, network=network
                    )
                )
                await servers[-1].start()
                tasks.append(asyncio.create_task(servers[-1].serve()))
            clients = []
            for k in (3, 1, 0, 2):
                port = servers[k].ports[0]
                clients.append(
                    await ZyClient.connect(LOOPBACK, port, heard=heard.append, clock=loop.time, network=network)
                )
                clients[-1].request("ACU", 1)
                clients[-1].request("AT", 0, 20, 0.07, "TRG", then=heard.append)
            await asyncio.sleep(5.0)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            for client in clients:
                client.close()

        loop.run_until_complete(story())
        loop.close()
        return heard

    first = once()
    assert len(first) > 4 * 20
    assert first == once()
