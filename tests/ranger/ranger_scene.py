"""A ranger on a scripted head, driven by lines, with stepped time."""

import numpy as np

from catseye.ranger.line import format_reply, parse_reply
from catseye.ranger.ranger import Ranger
from ranger.scripted_head import ScriptedHead

INDEX, D0 = 1.000253247, 181.2
PLACES = {1: ("ZG11", (0.0, 80_000.0, 12_000.0)), 2: ("ZG12", (30_000.0, 70_000.0, 9_000.0))}
GEOMETRY = ["BP 0, 0, 0", "ALPHA 0, 0, 0", "BETA 0, 0", "MO 0, 250, 0", "EZ 0, 0", f"D0 {D0}"]
CUBES = ["INI 4", *(f"COO {n}, {x}, {y}, {z}, {name}" for n, (name, (x, y, z)) in PLACES.items())]
ZRG = ["AZM 0, -900", "ELV 0, 400"]
HOME = ["AXIS 0,1", "AXIS 1,1", "ABV 0, 400000000", "ABV 1, 400000000", "FHM 0", "FHM 1", "PS 1"]
READY = [*GEOMETRY, *CUBES, *ZRG, *HOME]
REFERENCE_PHASE = 0.7


class Told:
    """A ranger whose time passes as it is asked."""

    def __init__(self, head=None, **options):
        self.head = head or ScriptedHead()
        self.ranger = Ranger("ZY101", self.head, limits=(-30_000, 80_000), **options)
        self.heard = []

    def turns(self, count=1, stride=0.05):
        heard = []
        for _ in range(count):
            for out in self.ranger.turn():
                assert parse_reply(format_reply(out.reply)) == out.reply
                heard.append(out)
            self.head.advance(stride)
        self.heard += heard
        return heard

    def say(self, *lines, client=1):
        """The replies to lines, without status words."""
        replies = []
        for line in lines:
            replies += [o.reply for o in self.ranger.receive(client, line)]
            for _ in range(2000):
                replies += [o.reply for o in self.turns()]
                if not self.ranger.busy:
                    break
        command = {"RAD", "STW"} if any("STW" in line.upper() for line in lines) else set()
        return [r for r in replies if r.command != "STW" or "STW" in command]

    def one(self, line):
        replies = self.say(line)
        assert len(replies) == 1, replies
        return replies[0]


def phase_of(distance_mm, index=INDEX, d0_mm=D0):
    """[PARKER04] eq. 5.12 and 5.15, forward: the phase falls by 4 pi n f/c for each metre."""
    return REFERENCE_PHASE - 4 * np.pi * index * 1.5e9 / 299_792_458.0 * (distance_mm - d0_mm) * 1e-3


def ready(**options):
    """A ranger that is initialised, homed, and sees ZRG and both cubes."""
    told = Told(**options)
    for reply in told.say(*READY):
        assert reply.ok, reply
    signals = {-900: (3.0, REFERENCE_PHASE)}
    for number, (_, place) in PLACES.items():
        azimuth = round(float(told.one(f"AZM {number}").values[1]))
        signals[azimuth] = (2.67, phase_of(np.linalg.norm(np.array(place) - [0.0, 0.0, 250.0]) + 1.234))
    told.head.signals = signals
    return told
