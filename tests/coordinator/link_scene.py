"""Rangers on scripted heads behind their servers, in virtual time without sockets."""

import asyncio
from concurrent.futures import Future

import numpy as np

from catseye.coordinator.link.preparation import Preparation
from catseye.coordinator.link.ranger import LinkListeners, RangerLink
from catseye.coordinator.link.settings import Address
from catseye.coordinator.parts import Environment, PlannedShot, SunZone, ticks_now
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND, TimeTag
from catseye.ranger.line import Request
from catseye.ranger.ranger import Ranger
from catseye.ranger.server import LOOPBACK, ZyServer
from catseye.simulator.clock.virtual_time import MemoryNetwork, VirtualLoop
from ranger.ranger_scene import CUBES, GEOMETRY, PLACES, ZRG, phase_of
from ranger.scripted_head import ScriptedHead

DAY = 52889
COMMANDS = [
    Request(line.split()[0], tuple(p.strip() for p in line.partition(" ")[2].split(",")))
    for line in [*GEOMETRY, *ZRG, *CUBES]
]
LATENCY = 1e-4  # s one way, as on a local network


class SceneLoop(VirtualLoop):
    async def shutdown_default_executor(self, *given):
        with self.outside():  # its threads end outside virtual time
            await super().shutdown_default_executor(*given)


def run(story, limit=400.0):
    """Run a coroutine function to its end; `limit` s of its own time, in which nobody waits."""
    with asyncio.Runner(loop_factory=SceneLoop) as runner:
        runner.get_loop().network = MemoryNetwork(LATENCY)
        return runner.run(asyncio.wait_for(story(), limit))


def network():
    """Of the running loop; sockets where it has none of its own."""
    return getattr(asyncio.get_running_loop(), "network", None)


class LoopClock:
    """UTC that goes with the loop; any thread may ask."""

    def __init__(self):
        self.loop = asyncio.get_running_loop()

    def now_ns(self):
        return DAY * PER_DAY + round(self.loop.time() * PER_SECOND)


class LoopHead:
    """A scripted head whose time is the loop's; `offset` s is its clock's, which gains `rate` s a second."""

    def __init__(self, **options):
        self.inner = ScriptedHead(**options)
        self.loop = asyncio.get_running_loop()
        self.last, self.offset, self.rate = self.loop.time(), 0.0, 0.0
        self.inner.clock = TimeTag(DAY, round(self.last * PER_SECOND))

    def __getattr__(self, name):
        passed, self.last = self.loop.time() - self.last, self.loop.time()
        if passed > 0.0:
            self.inner.advance(passed)
            self.offset += self.rate * passed
        return getattr(self.inner, name)

    def now(self):
        self.desired(0)
        return self.inner.clock.after(self.offset) if self.offset else self.inner.clock

    def set_clock(self, tag):
        self.offset = (tag - self.inner.clock).item() / PER_SECOND


class Served:
    """One ranger, served; and what a link to it says."""

    def __init__(self, name="ZY101", **options):
        self.name = name
        self.head = LoopHead(**options)
        self.happenings, self.said = [], []
        self.ports = (0, 0)
        self.task = None
        self.boot()

    def boot(self):
        self.ranger = Ranger(self.name, self.head, limits=(-30_000, 80_000))

    async def start(self):
        self.server = ZyServer(self.ranger, ports=self.ports, clock=asyncio.get_running_loop().time, network=network())
        await self.server.start()
        self.ports = self.server.ports
        self.task = asyncio.ensure_future(self.server.serve())
        return self

    async def stop(self):
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)
        await self.server.stop()

    def by_hand(self, line):
        """What somebody does who sits at the ranger, behind the back of who has the lease."""
        self.ranger.receive(1 if self.ranger.lease is None else self.ranger.lease[0], line)

    def light(self):
        """What comes back from where: ZRG, and the cubes that the ranger knows."""
        self.head.inner.signals = signals = {-900: (3.0, 0.7)}
        for number, (_, place) in PLACES.items():
            azimuth = round(self.ranger.cubes.counts(self.ranger.cubes.find(number))[0])
            signals[azimuth] = (2.67, phase_of(np.linalg.norm(np.array(place) - [0.0, 0.0, 250.0]) + 1.234))

    @property
    def address(self):
        return Address(LOOPBACK, self.ports)

    def link(self, *, address=None, commands=COMMANDS, tell=None, heard=None, **options):
        return RangerLink(
            self.name,
            address or self.address,
            preparation=Preparation.of(commands),
            environment=Environment(LoopClock(), network()),
            listeners=LinkListeners(tell or self.happenings.append, heard),
            **{"guard": Free()} | options,
        )

    def kinds(self):
        return [h.kind for h in self.happenings]


class Linked:
    """A served ranger and a running link that is ready."""

    def __init__(self, *, wait=True, head=None, **options):
        self.options, self.wait, self.head_options = options, wait, head or {}

    async def __aenter__(self):
        self.served = await Served(**self.head_options).start()
        self.link = self.served.link(**self.options)
        self.task = asyncio.ensure_future(self.link.run())
        if self.wait:
            await until(lambda: self.link.ready)
            self.served.light()
        return self.served, self.link

    async def __aexit__(self, *_):
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)
        await self.served.stop()


async def until(done, seconds=120.0, step=0.02):
    """Let the loop's time pass until something is so."""
    for _ in range(round(seconds / step)):
        if done():
            return
        await asyncio.sleep(step)
    raise AssertionError("it never came")


class Free:
    """A guard that lets everything pass but what it is told to refuse, and writes down what it was asked."""

    def __init__(self, *refused):
        self.refused, self.asked = refused, []
        self.replies, self.posture, self.alarms = [], None, []

    def heard(self, ranger, reply):
        self.replies.append((ranger, reply))

    def telescope(self, posture):
        self.posture = posture

    def sun_vector(self, ranger, now_ticks):
        return 0.0, 0.0, 1.0

    def sun_zone(self, now_ticks):
        return SunZone(1.0, 0.5, 0.1, True)

    def watch(self, now_ticks, counts):
        return [alarm for alarm in self.alarms if alarm.ranger in counts]

    def refusal(self, ranger, request, now_ticks):
        self.asked.append(request)
        return "the Sun is there" if request.command in self.refused else None


def planned(target, *, ranger="ZY101", ahead=0.3, duration=0.128, fixed=True, rate=(0.0, 0.0, 0.0)):
    """A shot on a cube of the scene, where it stands, moving at a rate (m/s) from there."""
    now = ticks_now(LoopClock())
    place = np.array(dict(PLACES.values()).get(target, (0.0, 0.0, 0.0))) * 1e-3
    begin = now + round(ahead / 864e-6)
    return PlannedShot(ranger, target, begin, duration, place, place + duration * np.array(rate), fixed, "a test")


class MemoryJournal:
    """A journal in a list; `broken` refuses to make anything durable."""

    def __init__(self):
        self.rows, self.waiting, self.broken, self.closed = [], [], None, False

    @property
    def trouble(self):
        return self.broken

    def append(self, *items):
        if self.closed:
            raise InputError("journal is closed")
        future = Future()
        self.waiting.append((items, future))
        if self.broken is None:
            self.mend()
        else:
            future.set_exception(InputError(self.broken))
        return future

    def mend(self):
        self.broken = None
        for items, future in self.waiting:
            self.rows += items
            if not future.done():
                future.set_result(len(self.rows))
        self.waiting.clear()

    def close(self):
        self.closed = True
