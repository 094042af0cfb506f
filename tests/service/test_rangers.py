"""Rangers served by this process, ready before anybody can connect."""

import asyncio
import socket

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.ranger.status import StatusWord
from catseye.service.rangers import DeferredSockets, ListenAddresses, RangersServed
from catseye.service.warm import WarmingClock
from catseye.service.world import TwinWords, twin_heads
from catseye.simulator.clock.virtual_time import MemoryNetwork
from catseye.simulator.clock.world_clock import ManualClock
from simulator.living_scene import site


def test_ports_are_bound_at_once_and_answer_after_open():
    async def story():
        sockets = DeferredSockets()
        listener = await sockets.serve(asyncio.Protocol, "127.0.0.1", 0)
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection("127.0.0.1", listener.port)
        await sockets.open()
        _, writer = await asyncio.open_connection("127.0.0.1", listener.port)
        writer.close()
        later = await sockets.serve(asyncio.Protocol, "127.0.0.1", 0)
        _, writer = await asyncio.open_connection("127.0.0.1", later.port)
        writer.close()
        await listener.close()
        await later.close()

    asyncio.run(story())


def test_port_taken_meanwhile_is_named():
    async def story():
        sockets = DeferredSockets()
        listener = await sockets.serve(asyncio.Protocol, "127.0.0.1", 0)
        taken, said = socket.create_server(("127.0.0.1", listener.port)), f"port {listener.port} is not available"
        with taken, pytest.raises(InputError, match=said):
            await sockets.open()
        await listener.close()

    asyncio.run(story())


def test_warmed_rangers_are_initialised_homed_and_have_sun_and_time():
    names = ("ZY102", "ZY113")
    world = TwinWords(60635.125)
    twin, clock = world.twin(site()), ManualClock(60635.125)
    warming = WarmingClock(clock)
    heads = twin_heads(twin, names, warming)

    async def story():
        served = RangersServed(
            site(), heads, clock=clock, twin=twin, network=MemoryNetwork(), warming=warming, at=ListenAddresses(24_100)
        )
        heard = asyncio.Queue()
        task = asyncio.create_task(served.serve(heard.put_nowait))
        at = await heard.get()
        rangers = served._served.rangers
        for ranger in rangers.values():
            word = ranger.status()
            assert StatusWord.INITIALISED | StatusWord.AZIMUTH_HOMED | StatusWord.ELEVATION_HOMED in word
            assert StatusWord.LASER_OFF in word  # until who has the lease lights it
            assert abs(ranger.now_ns() - clock.now_ns()) < 10**6  # a head's clock is off by half a millisecond at most
        assert rangers["ZY113"].sun_vector is not None
        assert np.linalg.norm(rangers["ZY113"].sun_vector) == pytest.approx(1.0, abs=1e-6)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return at

    at = asyncio.run(story())
    assert set(at.rangers) == set(names)
    assert at.feed == ("127.0.0.1", 24_100)


def test_warming_clock_never_passes_the_other_clock():
    clock = ManualClock(60635.125)
    warming = WarmingClock(clock, before=10.0)
    assert clock.now_ns() - warming.now_ns() == 10 * 10**9
    warming.advance(4.0)
    assert clock.now_ns() - warming.now_ns() == 6 * 10**9
    warming.advance(60.0)
    assert warming.now_ns() == clock.now_ns()
    clock.advance(1.0)
    assert warming.now_ns() < clock.now_ns()
    warming.release()
    assert warming.now_ns() == clock.now_ns()
