"""Lines of the feed, its silences, and motion scripts."""

import asyncio
import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.coordinator.feed import FeedClient, FeedSettings, MotionScript, play, posture_of, weather_of
from catseye.coordinator.parts import Environment, ticks_now
from catseye.errors import InputError
from catseye.ranger.line import Reply, parse_reply, stamp_text
from catseye.ranger.server import LOOPBACK
from catseye.records.night.live import LivePosture
from coordinator.link_scene import LoopClock, network, run, until


class Site(asyncio.Protocol):
    """A feed that says what it is told to, to its one client."""

    transport = None

    def connection_made(self, transport):
        Site.transport = transport
        transport.write(b"0\t52889.0\tHELLO This is SITE gbt ver. 1\n0\t52889.0\tCONNECT 1, 5250\n")


def say(body, seconds=0.0):
    stamp = stamp_text(ticks_now(LoopClock()) + round(seconds / 864e-6))
    Site.transport.write(f"0\t{stamp}\t{body}\n".encode())


class Fed:
    def __init__(self, **options):
        self.weather, self.postures, self.happenings, self.options = [], [], [], options

    async def listen(self):
        Site.transport = None
        self.server = await network().serve(Site, LOOPBACK, self.options.pop("port", 0))
        self.port = self.server.port

    async def __aenter__(self):
        await self.listen()
        self.client = FeedClient(
            LOOPBACK,
            self.port,
            environment=Environment(LoopClock(), network()),
            tell=self.happenings.append,
            weather=self.weather.append,
            posture=self.postures.append,
            stations=("WX1", "WX2"),
            **self.options,
        )
        self.task = asyncio.ensure_future(self.client.run())
        await until(lambda: Site.transport is not None)
        return self

    async def __aexit__(self, *_):
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)
        await self.close()

    async def close(self):
        if Site.transport is not None:
            Site.transport.abort()
        await self.server.close()

    def kinds(self):
        return [h.kind for h in self.happenings]


def test_weather_and_posture_are_received():
    async def story():
        async with Fed() as fed:
            say("WX 1, WX1, 10.25, 930.1, none")
            say("TEL 1, 145.300000001, 30.0, 0.004, -0.002")
            await until(lambda: fed.postures and fed.weather)
            (read,), (pose,) = fed.weather, fed.postures
            assert (read.station, read.temperature_c, read.pressure_hpa) == ("WX1", 10.25, 930.1)
            assert math.isnan(read.humidity_percent)
            assert pose.azimuth == pytest.approx(math.radians(145.300000001), abs=1e-15)
            assert pose.elevation_rate == pytest.approx(math.radians(-0.002), abs=1e-18)
            assert fed.client.telescope_known

    run(story)


@pytest.mark.parametrize(
    "body",
    [
        "WX 1, WX1, 10, 930",
        "WX 1, WX1, 10, 930, 40, 1",
        "WX 1, 1WX, 10, 930, 40",
        "WX 1, WX1, nan, 930, 40",
        "WX 1, WX1, 1e9, 930, 40",
        "WX 1, WX1, 10, 93000, 40",
        "WX 0, no",
        "TEL 1, 10, 20, 0",
        "TEL 1, inf, 20, 0, 0",
        "TEL 1, 10, 200, 0, 0",
        "TEL 1, 10, 20, 11, 0",
        "TEL 1, 10, 20, x, 0",
    ],
)
def test_invalid_reading_is_refused_in_one_line(body):
    reply = parse_reply(f"0\t52889.0\t{body}")
    with pytest.raises(InputError) as refused:
        (weather_of if body.startswith("WX") else posture_of)(reply)
    assert "\n" not in str(refused.value)


@given(st.text(max_size=30), st.lists(st.text(max_size=12), max_size=6))
def test_any_values_are_read_or_refused(command, values):
    reply = Reply(command, True, tuple(values), 0, 5288900000000)
    for read in (weather_of, posture_of):
        try:
            found = read(reply)
        except InputError:
            continue
        assert found.ticks == 5288900000000


def test_invalid_lines_are_reported_and_valid_ones_used():
    async def story():
        async with Fed() as fed:
            Site.transport.write(b"\xff\xfe\n\n???\n")
            say("TEL 1, 10, 20, 0, west")
            say("TEL 1, 10, 20, 0, 0", 1.0)
            await until(lambda: fed.postures)
            assert "bad-reading" in fed.kinds()
            assert len(fed.postures) == 1

    run(story)


def test_old_or_wrong_stamps_are_rejected():
    async def story():
        async with Fed() as fed:
            for seconds in (0.0, -1.0, 0.0, 0.5, 60.0, -60.0):
                say("TEL 1, 10, 20, 0, 0", seconds)
            await asyncio.sleep(0.2)
            assert len(fed.postures) == 2
            assert "feed-clock-telescope" in fed.kinds()

    run(story)


def test_missing_telescope_is_no_alarm_in_the_first_half_minute():
    async def story():
        async with Fed() as fed:
            await asyncio.sleep(29.0)
            assert "telescope-silent" not in fed.kinds()
            assert not fed.client.telescope_known
            await until(lambda: "telescope-silent" in fed.kinds(), 3.0)

    run(story)


def test_delayed_loop_reads_pending_input_first():
    async def story():
        async with Fed() as fed:
            say("TEL 1, 10, 20, 0, 0")
            await until(lambda: fed.postures)
            heard = fed.client._heard[""]
            fed.client._heard[""], fed.client._looked = heard - 5.0, asyncio.get_running_loop().time() - 4.0
            fed.client.look()
            assert not fed.kinds()
            fed.client._looked = asyncio.get_running_loop().time() - 0.5
            fed.client.look()
            assert fed.kinds() == ["telescope-silent"]
            fed.client._looked = asyncio.get_running_loop().time() - 4.0
            fed.client.look()
            assert fed.kinds() == ["telescope-silent"], "one that lasts goes on"

    run(story)


def test_silence_is_reported_after_its_limit_and_at_its_end():
    async def story():
        async with Fed() as fed:
            loop = asyncio.get_running_loop()
            for k in range(30):  # 3 s of postures; WX1 speaks, WX2 never
                say("TEL 1, 10, 20, 0, 0")
                if k % 10 == 0:
                    say("WX 1, WX1, 10, 930, 40")
                await asyncio.sleep(0.1)
            assert fed.client.telescope_known
            assert not fed.happenings
            last = loop.time()
            await until(lambda: "telescope-silent" in fed.kinds(), 10.0)
            assert 1.8 <= loop.time() - last <= 2.8
            assert not fed.client.telescope_known
            await until(lambda: "weather-silent" in fed.kinds())
            assert 59.0 <= loop.time() <= 61.5
            assert fed.happenings[-1].who == "WX2"
            await until(lambda: fed.kinds().count("weather-silent") == 2)
            assert fed.happenings[-1].who == "WX1"
            say("TEL 1, 10, 20, 0, 0")
            say("WX 1, WX2, 10, 930, none")  # a silent sensor does not end a silence
            await until(lambda: "telescope-silent-over" in fed.kinds())
            assert "weather-silent-over" not in fed.kinds()
            say("WX 1, WX2, 10, 930, 40")
            await until(lambda: "weather-silent-over" in fed.kinds())

    run(story)


def test_lost_feed_is_reconnected():
    async def story():
        async with Fed() as fed:
            await fed.close()
            await until(lambda: "feed-lost" in fed.kinds())
            fed.options["port"] = fed.port
            await fed.listen()
            await until(lambda: "feed-lost-over" in fed.kinds())
            say("TEL 1, 10, 20, 0, 0")
            await until(lambda: fed.postures)
            assert fed.kinds().count("feed-lost") == 1

    run(story)


def test_silent_feed_is_given_up():
    async def story():
        quick = FeedSettings(weather_silent=6.0, telescope_silent=2.0)
        async with Fed(settings=quick) as fed:
            await until(lambda: "feed-lost" in fed.kinds(), 30.0)
            assert any("no reading received" in h.text for h in fed.happenings)

    run(story)


def test_random_bytes_from_a_feed_do_no_harm():
    async def story():
        rng = random.Random(5)
        async with Fed() as fed:
            for k in range(400):
                body = rng.choice([b"WX 1, ", b"TEL 1, ", b"", b"0\t52889.0\tWX 1, S%d, 1, 900, 1" % k])
                Site.transport.write(body + rng.randbytes(rng.randrange(60)) + b"\n")
                await asyncio.sleep(0.01)
            assert not fed.task.done()
            assert not fed.postures
            assert len(fed.client._stations) <= 64

    run(story)


def test_fixed_motion_is_constant_and_a_table_is_interpolated_linearly():
    still = MotionScript.parse("fixed 145.3 30").at(123)
    assert (still.azimuth, still.azimuth_rate) == (math.radians(145.3), 0.0)
    table = MotionScript.of_table("mjd,azimuth_deg,elevation_deg\n52889,10,20\n52889.01,12,19\n52889.02,12,19\n", "t")
    pose = table.at(5288900500000)
    assert math.degrees(pose.azimuth) == pytest.approx(11.0, abs=1e-6)  # an MJD as a float has steps of 0.6 us
    assert math.degrees(pose.azimuth_rate) == pytest.approx(2.0 / 864.0, rel=1e-6)
    assert math.degrees(pose.elevation_rate) == pytest.approx(-1.0 / 864.0, rel=1e-6)
    for day, azimuth in ((52888, 10.0), (52890, 12.0)):
        held = table.at(day * 10**8)
        assert math.degrees(held.azimuth) == pytest.approx(azimuth)
        assert held.azimuth_rate == 0.0


@given(st.floats(0.0, 1.0), st.floats(-3.0, 3.0), st.floats(0.001, 0.1))
def test_rate_of_a_script_is_the_slope_of_its_angle(share, change, span):
    script = MotionScript(np.array([52889.0, 52889.0 + span]), np.array([1.0, 1.0 + change]), np.zeros(2))
    ticks = round((52889.0 + span * (0.05 + 0.9 * share)) * 1e8)
    step = 1000
    slope = (script.at(ticks + step).azimuth - script.at(ticks - step).azimuth) / (2 * step * 864e-6)
    assert script.at(ticks).azimuth_rate == pytest.approx(slope, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "line 1"),
        ("mjd,az,el\n", "line 1"),
        ("mjd,azimuth_deg,elevation_deg\n", "contains no motion"),
        ("mjd,azimuth_deg,elevation_deg\n1,2\n", "line 2"),
        ("mjd,azimuth_deg,elevation_deg\n1,2,x\n", "line 2"),
        ("mjd,azimuth_deg,elevation_deg\n1,2,3\n1,2,3\n", "line 3"),
    ],
)
def test_invalid_table_is_refused_with_its_line(text, word):
    with pytest.raises(InputError, match=word):
        MotionScript.of_table(text, "motion.csv")


def test_other_motion_texts_are_refused():
    for text in ("fixed 1", "fixed a b", "no such file.csv"):
        with pytest.raises(InputError, match="motion"):
            MotionScript.parse(text)


def test_script_is_played_ten_times_a_second():
    async def story():
        got = []
        task = asyncio.ensure_future(play(MotionScript.parse("fixed 10 20"), LoopClock(), got.append))
        await asyncio.sleep(2.05)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert len(got) == 21
        assert all(isinstance(read, LivePosture) for read in got)

    run(story)
