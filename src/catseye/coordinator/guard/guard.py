"""Safety checks on every command to a ranger, and of parked beams.

It trusts no input it can compute itself: the Sun is its own, and a command's destination follows from what the ranger
was sent. A move is checked for the whole rectangle of counts between where the mirror may be and where it goes
(`coordinator.visibility.sweep`), so it does not matter how the axes run. It needs the rangers' replies (`heard`) and
the telescope's posture (`telescope`).
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE, SECONDS_PER_DAY, TWO_PI
from catseye.coordinator.guard.memory import Memory
from catseye.coordinator.guard.parked import AHEAD, Alarm, in_words, parked_alarms
from catseye.coordinator.parts import SunZone
from catseye.coordinator.plan.candidates import leaves
from catseye.coordinator.visibility.surroundings import PERHAPS, SUN, KeepClear, Surroundings, instants, later
from catseye.coordinator.visibility.vantage import Vantage, reflector_at, seconds_between, vantages_of
from catseye.errors import CatseyeError, InputError
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT, within
from catseye.geometry.mirror.slew import trapezoid
from catseye.geometry.sky.time_tag import utc_text
from catseye.ranger.commands import COMMANDS, schedule_of
from catseye.ranger.line import Reply, Request, stamp_text
from catseye.ranger.values import Value
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.records.site.interlock import Act, Interlock, Interlocks
from catseye.records.site.keep_out import KeepOut
from catseye.reduction.steering.tracking import AZIMUTH_SLEW, ELEVATION_SLEW, SLEW_ACCELERATION

MOVES = frozenset(["STT", "CIL", "CMEAS", "TRK", "SCN", "FHM"])  # CMEAS 1 only
SHINES = frozenset(["PS", "TRG", "CMEAS", "SCN", "STM"])  # PS 1, SCN 1 only
HARMLESS = frozenset(
    [
        *("AXIS", "ERL", "FKP", "FKI", "FKD", "FIL", "FSI", "FLT", "WCNT", "WTOL", "WTMO", "WMD", "ACU", "CYC", "SFQ"),
        *("IFF", "D0", "NG", "KND", "MOD", "MPC", "WAI", "CWT", "CLR", "BYE", "RST", "STI"),
        *("ABP", "ABV", "ABA", "COO", "INI", "BP", "ALPHA", "BETA", "MO", "EZ", "AZM", "ELV", "ORD", "NUM"),
    ]
)
BLOCK_TICKS = round(10.0 / TICK_SECONDS)  # for which the surroundings of a ranger on the ground are cached
LOOK = 2.0  # s: a short move, its settling and its shot
SHOT = 1.0  # s: settling and a shot, after a long move
ACTS: tuple[Act, ...] = ("shine", "move")
ARRIVED = 1.0  # s after its profile's end, when a mirror is assumed to be at its goal
OLD_POSTURE = 10.0  # s
FARTHEST_STAMP = 5.0  # s: later moves must be requested when due
SUN_TOLERANCE = 1.0 * DEGREE  # tolerance of a vector to the Sun
WRONG_CLOCK = 1.0  # s
LONGEST_SCAN = 600.0  # s
A_SHOT = 2.0  # s of a scan
DOWN = (0.0, 0.0, -1.0)
ALONG_THE_BEAM = (0.0, 0.0, 1.0)


class SafetyGuard:
    """Safety guard of all rangers of a site.

    site         its records
    keep_clear   Sun and boxes; the site's Sun without boxes if None
    interlocks   times and contacts that forbid; none if None

    Raises InputError: an interlock for a ranger that the site does not have.
    """

    def __init__(self, site: SiteFolder, *, keep_clear: KeepClear | None = None, interlocks: Interlocks | None = None):
        self.site, self.keep_clear = site, keep_clear or KeepClear(site)
        self.interlocks = (interlocks or Interlocks()).interlock
        self.vantages = vantages_of(site)
        for interlock in self.interlocks:
            for name in interlock.rangers:
                if name not in self.vantages:
                    raise InputError(f"interlock {interlock.name!r}: ranger {name!r} is not in the site")
        self.opened = {interlock.name for interlock in self.interlocks if interlock.switch}
        self._memory = {name: Memory(v) for name, v in self.vantages.items()}
        self._posture: LivePosture | None = None
        self._surroundings: dict[str, tuple[int, Surroundings]] = {}
        self._suns: tuple[int, int, Array] | None = None

    # Input --------------------------------------------------------------------------------------------

    def telescope(self, posture: LivePosture) -> None:
        """Set the telescope's posture; rangers on its arm move with it."""
        self._posture = posture

    def heard(self, ranger: str, reply: Reply) -> None:
        """Take in a reply of a ranger.

        ACP, CIL, CMEAS, FHM, TRK, WAI and STW state the mirror's position; others nothing.
        """
        if ranger in self._memory:
            self._memory[ranger].hear(reply.command, reply.ok, reply.values)

    def adopt(self, keep_out: KeepOut) -> None:
        """Check against other boxes and another cone from now on, and so does who shares them."""
        self.keep_clear.adopt(keep_out)
        self._surroundings.clear()

    def stands(self, ranger: str, counts: tuple[float, float]) -> None:
        """Set the position of a parked mirror, counts."""
        for axis in (0, 1):
            self._memory[ranger].stand.rest(axis, counts[axis])

    def switch(self, name: str, *, is_open: bool) -> None:
        """Set a contact of the interlocks: open forbids.

        Raises InputError: no such switch.
        """
        if name not in {interlock.name for interlock in self.interlocks if interlock.switch}:
            raise InputError(f"{name!r} is not a switch of the interlocks")
        (self.opened.add if is_open else self.opened.discard)(name)

    # Checks ----------------------------------------------------------------------------------------------------

    def refusal(self, ranger: str, request: Request, now_ticks: int) -> str | None:
        """Reason why a request must not be sent; None if it may, and is sent."""
        if ranger not in self._memory:
            return f"ranger {ranger!r} is not in the site (expected one of {len(self._memory)} of its records)"
        memory = self._memory[ranger]
        memory.stand.settle(now_ticks)
        try:
            if request.command == "COO" and len(request.parameters) >= 4:  # thousands of these
                memory.take(request, ())
                return None
            reason, values = self._judged(memory, request, now_ticks)
            if reason is None:
                memory.take(request, values)
        except (CatseyeError, ValueError) as problem:
            return str(problem)
        return reason

    def sun_vector(self, ranger: str, now_ticks: int) -> tuple[float, float, float]:
        """Unit vector to the Sun in a ranger's frame, for SUN.

        While it is set, a direction where no beam goes: straight down, and for the feed arm, which looks down at the
        dish, backwards along the telescope's beam. A ranger knows no horizon, and a vector cannot be withdrawn.

        Raises InputError: a ranger on the feed arm without a recent posture.
        """
        vantage = self.vantages[ranger]
        sun = self._suns_between(now_ticks, now_ticks)[0]
        if not self.keep_clear.counts_at(sun):
            return DOWN if vantage.frame == "ground" else ALONG_THE_BEAM
        if vantage.frame == "reflector":
            posture = self._fresh_posture(vantage, now_ticks)
            since = seconds_between(posture.ticks, now_ticks)
            sun = reflector_at(self.site, posture, since).rotation.T @ sun
        return float(sun[0]), float(sun[1]), float(sun[2])

    def sun_zone(self, now_ticks: int) -> SunZone:
        """The Sun over the site, and its cone without a ranger's margins."""
        east, north, up = self._suns_between(now_ticks, now_ticks)[0].tolist()
        return SunZone(
            azimuth=math.atan2(east, north) % TWO_PI,
            elevation=math.asin(max(-1.0, min(1.0, up))),
            cone=self.keep_clear.keep_out.sun.half_angle_deg * DEGREE,
            avoided=self.keep_clear.counts_at(np.array([east, north, up])),
        )

    def watch(self, now_ticks: int, counts: Mapping[str, tuple[float, float]]) -> list[Alarm]:
        """Hazards of beams parked at counts within ten minutes, soonest first.

        They are the Sun, a box or an interlock. For a beam on the feed arm the Sun and boxes are predicted for one
        minute.

        A ranger on the arm without a known posture is left out: nothing may move it either.
        """
        alarms: list[Alarm] = []
        for name in sorted(counts):
            alarms += parked_alarms(
                self.keep_clear, self.vantages[name], counts[name], now_ticks=now_ticks, posture=self._posture
            )
            for interlock in self.interlocks:
                within = self._opens(interlock, name, now_ticks, AHEAD)
                if within is not None and "shine" in interlock.forbids and self._memory[name].shining:
                    text = (
                        f"{name}: interlock {interlock.name} ({interlock.why}) {in_words(within)}: switch its laser off"
                    )
                    alarms.append(Alarm(name, within, "interlock", "dark", text))
        return sorted(alarms, key=lambda alarm: (alarm.within, alarm.ranger))

    # Inside ----------------------------------------------------------------------------------------------------------

    def _judged(self, memory: Memory, request: Request, now_ticks: int) -> tuple[str | None, tuple[Value, ...]]:
        name = request.command
        if name == "AT":
            return self._scheduled(memory, request, now_ticks), ()
        if name not in COMMANDS:
            return f"{name} is not a command of a ranger", ()
        values = COMMANDS[name].read(request)
        if COMMANDS[name].only_asks(request):
            return None, values
        if name == "INITZY":
            return "files cannot be checked from here (expected their commands instead)", values
        if name == "SUN":
            return self._wrong_sun(memory.vantage, values, now_ticks), values
        if name == "STI" and abs(seconds_between(now_ticks, int(values[0]))) > WRONG_CLOCK:
            return (
                f"clock {stamp_text(int(values[0]))} is more than {WRONG_CLOCK:g} s off: its Sun would be wrong",
                values,
            )
        moves = name in MOVES and not (name == "CMEAS" and values[0] == 2) and not (name == "SCN" and values[0] == 0)
        shines = name in SHINES and values[:1] != (0,)
        if not moves and not shines and name not in HARMLESS and name not in ("PS", "SCN"):
            return f"{name} is unknown to the safety guard (expected another command)", values
        since = max(now_ticks, request.ticks or now_ticks)
        until = later(since, LOOK) if name != "TRK" else max(later(since, LOOK), int(values[5]))
        reason = self._interlocked(memory.vantage.name, since, until, moves=moves, shines=shines)
        if reason is None and name == "PS" and shines:
            reason = self._lights(memory, since, until)
        if reason is None and moves:
            if since > later(now_ticks, FARTHEST_STAMP):
                return (
                    f"its start is {seconds_between(now_ticks, since):.0f} s away (limit {FARTHEST_STAMP:g} s)",
                    values,
                )
            reason = (
                self._homing(memory, since, until) if name == "FHM" else self._move(memory, name, values, since, until)
            )
            if reason is None and name == "FHM":
                memory.stand.lose(int(values[0]))
        return reason, values

    def _scheduled(self, memory: Memory, request: Request, now_ticks: int) -> str | None:
        start, repeats, interval, inner = schedule_of(request.parameters)
        if COMMANDS[inner.command].only_asks(inner):
            return None
        firing = inner.command in ("TRG", "MPC") or (inner.command == "CMEAS" and inner.parameters[:1] == ("2",))
        if not firing:
            return f"{inner.command} cannot be checked in advance (expected it when it is due)"
        since = max(now_ticks, start)
        last = later(since, LOOK + (repeats - 1) * interval)
        return self._interlocked(memory.vantage.name, since, last, moves=False, shines=True)

    def _interlocked(self, ranger: str, since: int, until: int, *, moves: bool, shines: bool) -> str | None:
        """First interlock that forbids it, in words; else None."""
        acts_checked: list[Act] = [act for act, on in zip(ACTS, (shines, moves), strict=True) if on]
        for interlock in self.interlocks:
            acts = [act for act in acts_checked if act in interlock.forbids]
            if not acts or self._opens(interlock, ranger, since, seconds_between(since, until)) is None:
                continue
            ends = "until its switch closes"
            if not interlock.switch:
                begin = since / TICKS_PER_DAY
                last = interlock.spans(begin, begin + 1.0)[0][1]
                ends = f"until {utc_text(last)}" if last < begin + 1.0 else "for a day and more"
            return f"interlock {interlock.name} ({interlock.why}) forbids to {' and '.join(acts)} {ends}"
        return None

    def _opens(self, interlock: Interlock, ranger: str, since: int, seconds: float) -> float | None:
        """Time until an interlock applies, s; None if not within `seconds`."""
        if not interlock.concerns(ranger):
            return None
        if interlock.switch:
            return 0.0 if interlock.name in self.opened else None
        begin = since / TICKS_PER_DAY
        spans = interlock.spans(begin, begin + seconds / SECONDS_PER_DAY)
        return None if not spans else max(0.0, (spans[0][0] - begin) * SECONDS_PER_DAY)

    def _wrong_sun(self, vantage: Vantage, values: tuple[Value, ...], now_ticks: int) -> str | None:
        """Reason why a given Sun vector is wrong; else None."""
        if not self.keep_clear.counts_at(self.keep_clear.sun(now_ticks)):
            return None
        vector = np.array([float(v) for v in values])
        size = float(np.linalg.norm(vector))
        true = np.array(self.sun_vector(vantage.name, now_ticks))
        off = float(np.arctan2(np.linalg.norm(np.cross(vector, true)), vector @ true)) if size > 0.0 else np.pi
        if off <= SUN_TOLERANCE:
            return None
        return f"the vector is {off / DEGREE:.1f} deg from the Sun (limit {SUN_TOLERANCE / DEGREE:g}): use the guard's"

    def _lights(self, memory: Memory, since: int, until: int) -> str | None:
        """Reason why a laser may not be switched on; else None."""
        if not self.keep_clear.boxes:
            return None
        if not memory.stand.known:
            return "the mirror's position is unknown (expected ACP 0 and ACP 1 first)"
        around = self._around(memory, since, until)
        low, high = memory.stand.low, memory.stand.high
        box = around.box_in(low, high) if bool(around.near_boxes(low, high)) else None
        return None if box is None else f"the beam may be on {box} (expected a move away first)"

    def _homing(self, memory: Memory, since: int, until: int) -> str | None:
        """Reason why the index search is not allowed; else None.

        It sweeps the beam anywhere.
        """
        if memory.laser_off:
            return None
        up = self.keep_clear.counts_at(self.keep_clear.sun(instants(since, until)))
        if not up and not self.keep_clear.boxes:
            return None
        return "the search for an index sweeps the beam anywhere (expected PS 0 first)"

    def _move(self, memory: Memory, name: str, values: tuple[Value, ...], since: int, until: int) -> str | None:
        """Reason why a move is not allowed; None if it is, and under way."""
        if not memory.stand.known:
            return "the mirror's position is unknown (expected ACP 0 and ACP 1 first)"
        goals = self._goals(memory, name, values)
        low, high = goals.min(axis=0), goals.max(axis=0)
        stops = memory.vantage.stops
        if not np.all(within([low[0], high[0]], *stops)):
            return f"azimuth {low[0]:.0f} to {high[0]:.0f} counts is outside the stops {stops[0]:g} to {stops[1]:g}"
        if name == "SCN":
            rounds = int(values[2]) if len(values) > 2 else 0
            takes = rounds * len(memory.order) * A_SHOT
            start = max(since, int(values[1]) if len(values) > 1 else 0)
            if not 0.0 < takes <= LONGEST_SCAN or start > later(since, FARTHEST_STAMP):
                return f"a scan needs its number of rounds, and must end within {LONGEST_SCAN:g} s (SCN 1, 0, rounds)"
            until = later(start, takes)
        longest = trapezoid(np.stack([memory.stand.low, memory.stand.high]), np.stack([high, low]), memory.pace)
        seconds = float(np.max(longest.total)) + ARRIVED
        until = max(until, later(since, seconds + SHOT - ARRIVED))
        reason = self._swept(memory, name, (low, high), since, until)
        if reason is None:
            at = later(max(since, int(values[1]) if name == "TRK" else since), seconds)
            memory.stand.go(low, high, at if name != "SCN" else max(at, until), name)
        return reason

    def _goals(self, memory: Memory, name: str, values: tuple[Value, ...]) -> Array:
        """Destinations of a command, counts (k, 2).

        Raises InputError if unknown.
        """
        if name == "STT":
            axis = int(values[0])
            low, high = memory.stand.low.copy(), memory.stand.high.copy()
            if memory.stand.goal is not None:  # the other axis may be under way
                low[1 - axis], high[1 - axis] = (side[1 - axis] for side in memory.stand.goal)
            low[axis] = high[axis] = memory.axes[axis].position
            return np.stack([low, high])
        if name == "SCN":
            if not memory.order:
                raise InputError("the scan list is empty (expected NUM and ORD first)")
            return np.stack([memory.counts(number) for number in memory.order])
        if name == "TRK":
            memory.number(values[0])
            numbers = [float(v) for v in values]
            return np.stack([memory.look(tuple(numbers[2:5])), memory.look(tuple(numbers[6:9]))])
        if name == "CIL" and len(values) == 3:
            return np.array([[float(values[1]), float(values[2])]])
        if name == "CIL" and len(values) == 4:
            return memory.look(tuple(float(v) for v in values[1:]))[None]
        return memory.counts(values[1] if name == "CMEAS" else values[0])[None]

    def _swept(self, memory: Memory, name: str, goal: tuple[Array, Array], since: int, until: int) -> str | None:
        """Sun or box between the mirror and a rectangle of counts."""
        stand = memory.stand
        low, high = np.minimum(stand.low, goal[0]), np.maximum(stand.high, goal[1])
        around = self._around(memory, since, until)
        code = int(around.codes(low, high))
        if code == SUN:
            if np.array_equal(stand.low, stand.high) and bool(leaves(around, stand.low, *(g[None] for g in goal))[0]):
                return None
            nearest = float(around.from_sun(low, high)) + around.sun_limit
            return (
                f"the beam could come within {max(nearest, 0.0) / DEGREE:.1f} deg of the Sun "
                f"(expected at least {around.sun_limit / DEGREE:.1f}): choose another path, or wait"
            )
        if code != PERHAPS:
            return None
        box = self._box(memory, name, goal, around, (low, high))
        return None if box is None else f"the beam could come to {box}: choose another path or target"

    def _box(
        self, memory: Memory, name: str, goal: tuple[Array, Array], around: Surroundings, swept: tuple[Array, Array]
    ) -> str | None:
        """Box that a move may come to; else None.

        Along the axes' profiles if start, end and simultaneous start are known.
        """
        together = name in ("CIL", "CMEAS", "TRK") and np.array_equal(memory.stand.low, memory.stand.high)
        spread = float(np.hypot(*((goal[1] - goal[0]) * BEAM_PER_COUNT)))
        if not together or spread > DEGREE:
            return around.box_in(*swept)
        paced = replace(around, vantage=replace(around.vantage, pace=memory.pace))
        if spread > 0.0:
            paced = replace(paced, guards=tuple(replace(g, off_beam=g.off_beam + spread) for g in paced.guards))
        return paced.box_entered(memory.stand.low, goal[0])

    def _around(self, memory: Memory, since: int, until: int) -> Surroundings:
        """Zones of a ranger; on the ground cached for ten seconds."""
        vantage = memory.vantage
        if vantage.frame == "reflector":
            posture = self._fresh_posture(vantage, since)
            wider = _unforeseen(seconds_between(posture.ticks, until))
            suns = self._suns_between(since, until)
            return self.keep_clear.around(vantage, since, until, posture=posture, suns=suns, wider=wider)
        block = since // BLOCK_TICKS
        end = (block + 2) * BLOCK_TICKS
        if until > end:
            return self.keep_clear.around(vantage, since, until, posture=None)
        cached = self._surroundings.get(vantage.name)
        if cached is None or cached[0] != block:
            cached = block, self.keep_clear.around(vantage, block * BLOCK_TICKS, end, posture=None)
            self._surroundings[vantage.name] = cached
        return cached[1]

    def _suns_between(self, since: int, until: int) -> Array:
        """Directions (NODES, 3) of the Sun at `instants`, interpolated linearly.

        Between two 40 s apart: 1e-6 rad off, 4e-5 where refraction bends most.
        """
        if self._suns is None or not self._suns[0] <= since <= until <= self._suns[1]:
            first, last = since, max(until, since + 4 * BLOCK_TICKS)
            self._suns = first, last, self.keep_clear.sun([first, last])
        first, last, suns = self._suns
        share = ((instants(since, until) - first) / (last - first))[:, None]
        directions = suns[0] + share * (suns[1] - suns[0])
        return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True))

    def _fresh_posture(self, vantage: Vantage, ticks: int) -> LivePosture:
        posture = self._posture
        if posture is None:
            raise InputError(f"{vantage.name} is on the telescope, whose posture is unknown (expected one first)")
        age = seconds_between(posture.ticks, ticks)
        if not -1.0 <= age <= OLD_POSTURE:
            raise InputError(f"{vantage.name}: the telescope's posture is {age:.1f} s old (limit {OLD_POSTURE:g} s)")
        return posture


def _unforeseen(seconds: float) -> float:
    """Possible deviation of the telescope from its rates after a time, rad."""
    ramp = 0.5 * SLEW_ACCELERATION * seconds**2
    return float(np.hypot(min(ramp, 2.0 * AZIMUTH_SLEW * seconds), min(ramp, 2.0 * ELEVATION_SLEW * seconds)))
