"""Laser, motors, mirror and lease after each event, as docs/formats/zy.md states."""

import asyncio

import pytest

from catseye.ranger.client import SECOND_CLIENT_TID
from catseye.ranger.door import Door
from catseye.ranger.ranger import Ranger
from catseye.ranger.server import ZyServer
from ranger.test_server import Site, run
from repository import ROOT

AFTER = "| after | laser | motors | mirror | lease |"
DEAD_MAN = 30.0


def table():
    """Rows of the table: what each event is followed by."""
    lines = (ROOT / "docs" / "formats" / "zy.md").read_text("utf-8").partition(AFTER)[2].splitlines()[2:]
    rows = {}
    for line in lines:
        if not line.startswith("|"):
            return rows
        event, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        rows[event] = tuple(cells)
    return rows


class Scene(Site):
    """A lit ranger that scans for the holder of its lease, with another who listens."""

    def __init__(self):
        super().__init__(door=Door(dead_man=DEAD_MAN))
        self.renews = True

    async def prepare(self):
        self.holder = await self.client(0)
        self.other = await self.client(1, first_tid=SECOND_CLIENT_TID)
        self.commander = self.holder
        self.token = (await self.answered(self.holder.ask("LEASE", "anna"))).values[-1]
        for command in ("PS 1", "NUM 2", "ORD 1, 1", "ORD 2, 2", "ABV 0, 4000000", "ABV 1, 4000000", "SCN 1"):
            word, _, rest = command.partition(" ")
            assert (await self.answered(self.holder.ask(word, *rest.split(", ")))).ok

    async def say(self, client, line):
        word, _, rest = line.partition(" ")
        return await self.answered(client.ask(word, *rest.split(", ") if rest else ()))

    async def pass_time(self, seconds):
        for _ in range(round(seconds)):
            self.now += 1.0
            if self.renews and not self.commander.closed.done() and self.ranger.lease is not None:
                await self.say(self.commander, f"LEASE {self.ranger.lease.name}, {self.token}")
            await self.turns(5, 0.2)

    def laser(self):
        return self.ranger.head.laser_on()

    def motors(self):
        return self.ranger.head.enabled(0) or self.ranger.head.enabled(1)

    async def moves(self):
        """Whether the mirror goes anywhere by itself for a while."""
        seen = set()
        for _ in range(400):
            await self.turns(1, 0.02)
            seen.add((self.ranger.head.actual(0), self.ranger.head.actual(1)))
        return len(seen) > 2

    async def is_held(self, word):
        """Whether who has the lease cannot switch it on again."""
        reply = await self.say(self.commander, word)
        return reply.ok is False and "by order" in reply.text

    async def stand(self):
        """Laser, motors, mirror, lease now."""
        lease = self.ranger.lease
        return self.laser(), self.motors(), await self.moves(), None if lease is None else lease.name


async def power_up(scene):
    await restarted(scene)


async def reset(scene):
    await scene.say(scene.holder, "SCN 0")
    assert (await scene.say(scene.holder, "RST")).ok


async def lost_power(scene):
    scene.head.reset()
    scene.head.laser = True  # as the hardware has it
    scene.ranger.end_scan()


async def taken(scene):
    scene.token = (await scene.say(scene.other, "LEASE ben")).values[-1]
    scene.commander = scene.other


async def given_back(scene):
    assert (await scene.say(scene.holder, "LEASE none")).ok


async def lost(scene):
    scene.holder.close()
    await scene.until(lambda: 0 not in scene.server.connections)


async def ended(scene):
    assert (await scene.say(scene.holder, "PS 0")).ok  # `RangerLink.leave`
    await lost(scene)


async def silent(scene):
    scene.renews = False


async def asking(scene):
    scene.renews = False

    async def pass_time(seconds):
        for _ in range(round(seconds)):
            scene.now += 1.0
            for word in ("VER", "STW", "COO 1", "LEASE"):
                await scene.say(scene.holder, word)
            await scene.turns(5, 0.2)

    scene.pass_time = pass_time


async def other_lost(scene):
    scene.other.close()
    await scene.until(lambda: 1 not in scene.server.connections)


def order(who, line):
    async def event(scene):
        assert (await scene.say(getattr(scene, who), line)).ok

    return event


async def opened(scene):
    scene.pulled = ["a door"]
    scene.ranger._head_interlock = lambda: scene.pulled[0] if scene.pulled else ""
    await scene.turns(1)


async def closed_again(scene):
    await opened(scene)
    scene.pulled.clear()


async def unhomed(scene):
    scene.head.homes[0] = "never"


async def hour_ahead(scene):
    scene.head.advance(3600.0)


async def restarted(scene):
    """The process is gone with its connections; its hardware has the laser on."""
    await scene.server.stop()
    scene.head.reset()
    scene.head.laser = True
    scene.ranger = Ranger("ZY101", scene.head, limits=(-30_000, 80_000))
    scene.server = ZyServer(scene.ranger, ports=(0, 0), door=scene.server.door, clock=lambda: scene.now)
    await scene.server.start()
    scene.commander = await scene.client(0)


EVENTS = {
    "power-up": power_up,
    "RST": reset,
    "loss of the head's power": lost_power,
    "the lease taken by another": taken,
    "the lease given back": given_back,
    "its connection lost, or its program killed": lost,
    "the coordinator ended": ended,
    "its holder silent for 30 s": silent,
    "its holder reading but sending no command": asking,
    "another connection lost": other_lost,
    "PS 0": order("holder", "PS 0"),
    "PS 0 from outside the lease": order("other", "PS 0"),
    "STOP": order("holder", "STOP"),
    "STOP from outside the lease": order("other", "STOP"),
    "the interlock open": opened,
    "the interlock closed again": closed_again,
    "an axis not homed any more": unhomed,
    "the ranger's clock an hour ahead": hour_ahead,
    "the server process killed and started again": restarted,
}
ON_AT_BOTH, OFF_LATER, OFF = (True, True), (True, False), (False, False)
LASER = {"as it was": ON_AT_BOTH, "off in 30 s": OFF_LATER, "off": OFF, "off, held": OFF}
MOTORS = {"as they were": ON_AT_BOTH, "off in 30 s": OFF_LATER, "off": OFF, "off, held": OFF}
MIRROR = {"goes on": ON_AT_BOTH, "stands in 30 s": OFF_LATER, "stands": OFF}
LEASE = {
    "as before": ("anna", "anna"),
    "none": (None, None),
    "none in 30 s": ("anna", None),
    "the taker's": ("ben", "ben"),
}


def test_table_and_events_correspond():
    assert list(table()) == list(EVENTS)


@pytest.mark.parametrize("event", EVENTS)
def test_state_after_an_event_agrees_with_the_table(event):
    laser, motors, mirror, lease = table()[event]

    async def story():
        async with Scene() as scene:
            await scene.prepare()
            assert await scene.stand() == (True, True, True, "anna")
            await EVENTS[event](scene)
            await scene.turns(1)
            at_once = (scene.laser(), scene.motors())
            stands = await scene.stand()
            assert stands[:2] == at_once  # and not only after a while
            await scene.pass_time(DEAD_MAN + 2.0)
            later = await scene.stand()
            assert (stands[0], later[0]) == LASER[laser]
            assert (stands[1], later[1]) == MOTORS[motors]
            assert (stands[2], later[2]) == MIRROR[mirror]
            assert (stands[3], later[3]) == LEASE[lease]
            if scene.ranger.lease is not None and laser.startswith("off"):
                assert await scene.is_held("PS 1") == laser.endswith("held")
                assert await scene.is_held("AXIS 0, 1") == motors.endswith("held")
            for client in (scene.holder, scene.other, scene.commander):
                client.close()
            await asyncio.sleep(0)

    run(story)
