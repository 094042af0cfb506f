"""The feed of a site: lines, stamps, silences, many clients."""

import asyncio

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND
from catseye.ranger.door import Door, answer_to
from catseye.ranger.entrance import MOST_PENDING, PATIENCE
from catseye.ranger.line import TICK_NS, parse_reply
from catseye.ranger.server import LOOPBACK
from catseye.records.night.live import LiveWeather
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualClock, VirtualLoop
from catseye.simulator.twin import feed as site_feed
from catseye.simulator.twin.faults import Fault, FaultBoard
from catseye.simulator.twin.feed import MOST_CLIENTS, SiteFeed

START = 52_889.125


class World:
    """Turns at a degree a second, and its air warms by a degree a minute."""

    def __init__(self):
        self.faults = FaultBoard()
        self.sensors = {"WX1": (0.0, 0.0, 0.0), "WX2": (5.0, np.nan, 0.0)}

    def seconds(self, ns):
        return (ns - round(START * PER_DAY)) / PER_SECOND

    def posture(self, seconds):
        turned = np.radians(np.atleast_1d(seconds))
        return 0.5 + turned, 1.0 - 0.5 * turned, np.radians([1.0]), np.radians([-0.5])

    def weather(self, station, seconds):
        if self.faults.active("silent-station", station, at=seconds):
            return LiveWeather(station, 0, np.nan, np.nan, np.nan)
        add = self.sensors[station]
        return LiveWeather(station, 0, 10.0 + add[0] + seconds / 60.0, 930.0 + add[1], 55.123 + add[2])


class Listening(asyncio.Protocol):
    def __init__(self):
        self.heard, self.lost = b"", False

    def connection_made(self, transport):
        self.transport = transport

    def data_received(self, data):
        self.heard += data

    def connection_lost(self, exc):
        self.lost = True

    def lines(self, command):
        return [r for r in map(parse_reply, self.heard.decode().splitlines()) if r.command == command]


def run(story, **options):
    """A story about a feed that serves in virtual time; it is given feed, world, network."""
    loop = VirtualLoop()
    network, world = MemoryNetwork(), World()

    async def whole():
        feed = SiteFeed("gbt", ["WX1", "WX2"], world, VirtualClock(loop, START), network=network, **options)
        await feed.start(LOOPBACK, 5250)
        serving = asyncio.create_task(feed.serve())
        await story(feed, world, network)
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        await feed.stop()
        with pytest.raises(ConnectionRefusedError):
            await network.connect(Listening, LOOPBACK, 5250)

    try:
        loop.run_until_complete(whole())
    finally:
        loop.close()


def test_each_line_is_the_truth_of_its_stamp():
    async def story(feed, world, network):
        await asyncio.sleep(0.01)
        client = await network.connect(Listening, LOOPBACK, 5250)
        await asyncio.sleep(60.0)
        hello, connected = client.lines("HELLO"), client.lines("CONNECT")
        assert [r.text for r in hello] == ["This is SITE gbt ver. 1"]
        assert [(r.ok, r.text) for r in connected] == [(True, "5250")]
        told = client.lines("TEL")
        assert len(told) == 600
        for reply in told:
            seconds = world.seconds(reply.ticks * TICK_NS)
            azimuth, elevation, azimuth_rate, elevation_rate = map(float, reply.values)
            assert azimuth == pytest.approx(np.degrees(0.5) + seconds, abs=6e-10)  # nine decimals
            assert elevation == pytest.approx(np.degrees(1.0) - 0.5 * seconds, abs=6e-10)
            assert (azimuth_rate, elevation_rate) == (1.0, -0.5)
        steps = np.diff([r.ticks for r in told]) * TICK_NS * 1e-9
        assert np.all(np.abs(steps - 0.1) < 1e-3)
        weather = client.lines("WX")
        assert [r.values[0] for r in weather] == ["WX1", "WX2"] * 7
        for reply in weather:
            warm = 10.0 + world.seconds(reply.ticks * TICK_NS) / 60.0 + (5.0 if reply.values[0] == "WX2" else 0.0)
            assert float(reply.values[1]) == pytest.approx(warm, abs=6e-4)
            assert reply.values[2] == ("930.000" if reply.values[0] == "WX1" else "none")
            assert reply.values[3] == "55.12"
        assert all(r.tid == 0 for r in told + weather)

    run(story)


def test_who_comes_later_hears_the_weather_of_that_moment():
    async def story(feed, world, network):
        await asyncio.sleep(13.0)
        client = await network.connect(Listening, LOOPBACK, 5250)
        await asyncio.sleep(0.0)
        assert [r.values[0] for r in client.lines("WX")] == ["WX1", "WX2"]
        assert world.seconds(client.lines("WX")[0].ticks * TICK_NS) == pytest.approx(13.0, abs=1e-3)

    run(story)


@pytest.mark.parametrize("word", ["HLP", "help"])
def test_a_person_who_asks_is_told_what_comes_and_how_to_leave(word):
    async def story(feed, world, network):
        client = await network.connect(Listening, LOOPBACK, 5250)
        client.transport.write(f"{word}\r\n".encode())
        await asyncio.sleep(0.1)
        (told,) = client.lines(word.upper())
        assert told.ok
        assert "BYE closes the connection" in told.values[0]
        assert not client.lost
        client.transport.write(b"bye\n")
        await asyncio.sleep(0.1)
        assert client.lost

    run(story)


def test_a_silent_telescope_and_a_silent_station_have_no_lines():
    async def story(feed, world, network):
        world.faults.add(Fault("silent-telescope", "telescope", 2.0, 5.0))
        world.faults.add(Fault("silent-station", "WX1", 15.0, 35.0))
        client = await network.connect(Listening, LOOPBACK, 5250)
        await asyncio.sleep(45.0)
        times = [world.seconds(r.ticks * TICK_NS) for r in client.lines("TEL")]
        assert not [t for t in times if 2.0 <= t < 5.0]
        assert 419 <= len(times) <= 421  # a stamp at the fault's end may be rounded to before it
        heard = [(r.values[0], round(world.seconds(r.ticks * TICK_NS))) for r in client.lines("WX")][2:]  # greeted with
        assert [t for name, t in heard if name == "WX1"] == [0, 10, 40]
        assert [t for name, t in heard if name == "WX2"] == [0, 10, 20, 30, 40]

    run(story)


def test_who_does_not_read_is_cut_off_alone(monkeypatch):
    most = 2**17
    monkeypatch.setattr(site_feed, "MOST_UNSENT", most)

    async def story(feed, world, network):
        slow, quick, leaving = [await network.connect(Listening, LOOPBACK, 5250) for _ in range(3)]
        slow.transport.pause_reading()
        leaving.transport.write(b"what\r\n" * 100 + b"x" * 5000 + b"\nBye\r\n")
        await asyncio.sleep(1.0)
        assert leaving.lost
        seconds = 1
        while not slow.lost and seconds < 20_000:
            await asyncio.sleep(1.0)
            seconds += 1
        assert len(quick.heard) == pytest.approx(most, rel=0.02)
        assert not quick.lost
        assert len(feed.clients) == 1

    run(story)


def test_the_32_clients_hear_the_same_and_a_33rd_is_turned_away():
    async def story(feed, world, network):
        await asyncio.sleep(0.05)
        clients = [await network.connect(Listening, LOOPBACK, 5250) for _ in range(MOST_CLIENTS)]
        turned_away = await network.connect(Listening, LOOPBACK, 5250)
        await asyncio.sleep(30.0)
        assert "CONNECT 0, 32 clients" in turned_away.heard.decode()
        assert turned_away.lost
        assert len(clients[0].heard) > 20_000
        assert {c.heard for c in clients} == {clients[0].heard}

    run(story)


def test_a_port_that_is_taken_and_a_weather_without_pause_are_refused():
    async def story(feed, world, network):
        with pytest.raises(InputError, match=r"feed: 127\.0\.0\.1 port 5250 cannot be had"):
            await SiteFeed("gbt", [], world, feed.clock, network=network).start(LOOPBACK, 5250)

    run(story)
    with pytest.raises(InputError, match="weather every 0 s"):
        run(story, weather_every=0.0)


def test_it_serves_on_real_sockets_in_real_time():
    from catseye.clock import SystemClock

    async def story():
        feed = SiteFeed("gbt", ["WX1"], World(), SystemClock.starting_at(START))
        await feed.start("127.0.0.1", 0)
        serving = asyncio.create_task(feed.serve())
        reader, writer = await asyncio.open_connection("127.0.0.1", feed.port)
        commands = []
        while commands.count("TEL") < 3:
            line = await asyncio.wait_for(reader.readline(), 5.0)
            commands.append(parse_reply(line.decode().rstrip("\n")).command)
        assert commands[:2] == ["HELLO", "CONNECT"]
        assert "WX" in commands
        writer.write(b"bye\n")
        await asyncio.wait_for(reader.read(), 5.0)
        writer.close()
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        await feed.stop()

    asyncio.run(story())


KEY = "a-key-of-the-site"


def test_peers_without_the_key_take_no_place_and_hear_nothing():
    async def story(feed, world, network):
        strangers = [await network.connect(Listening, LOOPBACK, 5250) for _ in range(MOST_CLIENTS + 5)]
        await asyncio.sleep(0.5)
        assert sum(not each.lost for each in strangers) <= MOST_PENDING
        client = await network.connect(Listening, LOOPBACK, 5250)
        await asyncio.sleep(0.1)
        (nonce,) = client.lines("NONCE")
        client.transport.write(f"KEY {answer_to(nonce.text, KEY)}\n".encode())
        await asyncio.sleep(1.0)
        assert len(client.lines("TEL")) >= 9
        assert len(feed.clients) == 1
        await asyncio.sleep(PATIENCE)
        assert all(each.lost and b"TEL" not in each.heard for each in strangers)

    run(story, door=Door(key=KEY))


@pytest.mark.parametrize("first", [b"\x00\x01\x00\x08", b"EHLO mail\n", b"\xff\n", b"PS 0\n"])
def test_what_is_no_word_of_the_feed_is_closed(first, caplog):
    async def story(feed, world, network):
        client = await network.connect(Listening, LOOPBACK, 5250)
        client.transport.write(first)
        await asyncio.sleep(0.2)
        assert client.lost
        assert not feed.clients
        assert "feed: port 5250: " in caplog.text

    run(story)


def test_who_says_nothing_for_an_hour_is_closed_and_an_empty_line_is_enough():
    async def story(feed, world, network):
        mute, alive = [await network.connect(Listening, LOOPBACK, 5250) for _ in range(2)]
        for _ in range(4):
            await asyncio.sleep(25.0)
            alive.transport.write(b"\n")
        assert mute.lost
        assert b"LINE 0, nothing was said for 60 s" in mute.heard
        assert not alive.lost

    run(story, door=Door(idle=60.0))
