"""Many rangers that fire fast: a site of any size, heads that cost next to nothing, a planner with an even beat.

Served by `faults/load_child.py`, a process of its own: what the coordinator costs is told apart from what they cost.
"""

import json
import math
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np

from catseye.clock import SystemClock
from catseye.constants import TWO_PI
from catseye.coordinator.link.settings import Address
from catseye.coordinator.parts import TICKS_PER_SECOND, PlannedShot, Round
from catseye.coordinator.visibility.vantage import vantages_of
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND, TimeTag
from catseye.ranger.head import Buffer
from catseye.ranger.line import nanoseconds_to_ticks
from catseye.records.night.live import TICKS_PER_DAY
from catseye.records.site.folder import REFERENCE, SiteFolder, read_site
from catseye.records.site.target import TargetRow
from process_scene import ends_with_us
from repository import ROOT

VOLTS_PER_CODE = 10.0 / 32768
NOISE = 0.2  # V, of a sample
VARIANTS = 4  # buffers of one place, each with its own noise
START_MJD = 52889.125  # a night at Green Bank: the Sun stops nobody
MOTION = "fixed 145.3 30"
LONGEST_START = 120.0  # s


def load_site(rangers=18, targets=None):
    """Green Bank with so many rangers: its own up to 18, beyond that copies of ZY101 all round the telescope.

    targets   so many hollow cubes in a ring above the pintle, which everybody sees, and no others; None: the site's own
    """
    site = read_site(ROOT / "examples" / "sites" / "gbt")
    values = {field.name: getattr(site, field.name) for field in fields(site)}
    if targets is not None:
        turns = TWO_PI * np.arange(targets) / targets
        places = np.stack([5e3 * np.cos(turns), 5e3 * np.sin(turns), np.full(targets, 4e4)], axis=1)
        values["targets"] = {
            f"L{k}": TargetRow(name=f"L{k}", type="hollow", frame="ground", position_mm=tuple(at.tolist()))
            for k, at in enumerate(places, 1)
        }
        values["triplets"], values["benchmarks"] = {}, ()
    if rangers > len(site.rangers):
        monument, mirror = site.monuments["ZY101"], site.mirrors[site.monuments["ZY101"].zp]
        names = [(f"ZY{201 + k}", f"ZP{201 + k}") for k in range(rangers)]
        values["monuments"] = {
            name: _turned(monument, name, zp, TWO_PI * k / rangers) for k, (name, zp) in enumerate(names)
        }
        values["mirrors"] = {zp: mirror.model_copy(update={"zp": zp}) for _, zp in names}
        values["feedarm"] = site.feedarm.model_copy(update={"ranger": ()})
        values["benchmarks"] = ()
    elif rangers < len(site.rangers):
        kept = dict(list(site.monuments.items())[:rangers])
        values["monuments"], values["benchmarks"] = kept, ()
        values["feedarm"] = site.feedarm.model_copy(update={"ranger": ()})
    return SiteFolder(**values)


def _turned(monument, name, zp, angle):
    """A monument carried about the pintle, counter-clockwise by rad."""
    x, y = monument.x_mm, monument.y_mm
    c, s = math.cos(angle), math.sin(angle)
    azimuth = (math.radians(monument.azimuth_deg) - angle) % TWO_PI
    return monument.model_copy(
        update={
            "monument": name,
            "zp": zp,
            "x_mm": c * x - s * y,
            "y_mm": s * x + c * y,
            "azimuth_deg": math.degrees(azimuth),
            "alpha1_rad": math.pi - azimuth,
        }
    )


class FastHead:
    """A head whose buffers lie ready: time is true, moves and homing take none, a return is worked out once a place.

    world   the site's truth: `Twin`
    noise   (VARIANTS, n) V, which all heads may share
    fired   stamps of all its buffers, its own count
    """

    def __init__(self, ranger, world, clock, noise):
        self.ranger, self.world, self.clock, self.fired = ranger, world, clock, []
        self._noise = noise
        self._tapes = {}
        self.reset()

    def reset(self):
        self._at, self._on, self._homes = [0, 0], [False, False], ["never", "never"]
        self._begun, self._laser = None, True

    def trigger(self, sampling):
        now = self.clock.now_ns()
        self._begun = now, sampling, tuple(self._at)
        self.fired.append(nanoseconds_to_ticks(now))

    def buffer(self):
        if self._begun is None:
            return None
        begun, sampling, at = self._begun
        if self.clock.now_ns() - begun < sampling.duration * PER_SECOND:
            return None
        if (at, sampling) not in self._tapes:
            self._tapes[at, sampling] = self._taped(at, sampling, self.world.seconds(begun))
        tapes = self._tapes[at, sampling]
        return Buffer(tapes[len(self.fired) % VARIANTS], TimeTag(*divmod(begun, PER_DAY)), sampling, VOLTS_PER_CODE)

    def _taped(self, at, sampling, seconds):
        n = sampling.samples
        phasor = self.world.phasors(self.ranger, np.array([at], dtype=float), np.array([seconds]))[0]
        cycle = np.real(phasor * np.exp(-1j * TWO_PI * np.arange(n) / n))
        volts = np.tile(cycle, sampling.cycles) + np.resize(self._noise, (VARIANTS, n * sampling.cycles))
        return np.rint(volts / VOLTS_PER_CODE).astype(np.int16)

    def now_ns(self):
        return self.clock.now_ns()

    def now(self):
        return TimeTag(*divmod(self.clock.now_ns(), PER_DAY))

    def set_clock(self, tag):
        """It has no error to be set right."""

    def clock_locked(self):
        return True

    def enable(self, axis, on):
        self._on[axis] = on

    def enabled(self, axis):
        return self._on[axis]

    def actual(self, axis):
        return self._at[axis]

    desired = actual

    def start(self, axis, position, *, velocity, acceleration):
        self._at[axis] = position
        return True

    def follow(self, counts, when):
        self._at = [round(float(c)) for c in counts[1]]
        return True

    def moving(self, axis):
        return False

    def motor_off(self, axis):
        return False

    def set_filter(self, axis, values):
        """There is no servo."""

    def set_error_limit(self, axis, counts):
        """There is no servo."""

    def find_home(self, axis):
        self._homes[axis] = "home"

    def homing(self, axis):
        return self._homes[axis]

    def stop(self):
        """Nothing is under way."""

    def switch_laser(self, on):
        self._laser = on

    def laser_on(self):
        return self._laser

    def supplies(self):
        return {"+5": 5.0}

    def enclosure_temperature_c(self):
        return 15.0


class EverySecond:
    """A planner: each ranger shoots once a second; first ZRG, then one after the other of what it can reach."""

    def __init__(self, site, live, *, seconds=10, lead=0.5, most=4):
        self.seconds, self.lead, self.number = seconds, lead, 0
        self.sampled = site.site.adc.cycles / site.site.ranging.if_hz
        self._site, self._live, self._most = site, live, most
        self._reached = None

    def round(self, state):
        self._reached = self._reached or self._reachable(state.now_ticks)
        begin = state.now_ticks + round(self.lead * TICKS_PER_SECOND)
        self.number += 1
        shots = {}
        for k, ranger in enumerate(state.ready):
            names = self._reached[ranger]
            beat = begin + round(0.8 * k / len(state.ready) * TICKS_PER_SECOND)  # not all in one moment
            targets = [REFERENCE, *(names[(self.number + j) % len(names)] for j in range(1, self.seconds))]
            shots[ranger] = tuple(
                PlannedShot(
                    ranger,
                    target,
                    beat + round(j * TICKS_PER_SECOND),
                    self.sampled,
                    np.zeros(3),
                    np.zeros(3),
                    fixed=True,
                    reason="once a second",
                )
                for j, target in enumerate(targets)
            )
        return Round(begin, begin + round(self.seconds * TICKS_PER_SECOND), shots)

    def _reachable(self, ticks):
        """By ranger, names of targets within its stops."""
        mjd = ticks / TICKS_PER_DAY
        places = np.array([self._live.place(name, mjd) for name in self._site.targets])
        found = {}
        for name, vantage in vantages_of(self._site).items():
            seen = np.isfinite(vantage.look(places)).all(axis=-1)
            found[name] = [target for target, on in zip(self._site.targets, seen, strict=True) if on][: self._most]
        return found


def lost_and_doubled(fired, journal):
    """How many stamps of the heads' own count a journal's last run lacks, and how many it has more than once.

    fired   stamps by ranger
    """
    with journal:
        run = journal.run().run
        stamps = Counter((a.shot.ranger, a.shot.ticks) for _, a in journal.shots(run, buffers=False))
    lost = sum((ranger, ticks) not in stamps for ranger, all_of_it in fired.items() for ticks in all_of_it)
    return lost, sum(stamps.values()) - len(stamps)


@dataclass
class LoadChild:
    """The process that serves the rangers; `told` is what each counted when it ended.

    rangers, targets   as `load_site`
    twin               real heads of the twin instead
    """

    rangers: int
    targets: int | None = None
    twin: bool = False

    def __enter__(self):
        self.clock = SystemClock.starting_at(START_MJD)
        program = [sys.executable, str(ROOT / "tests" / "faults" / "load_child.py"), str(self.rangers)]
        program += [str(self.targets or 0), repr(self.clock.offset), "twin" if self.twin else "fast"]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self.process = subprocess.Popen(program, text=True, preexec_fn=ends_with_us(), **pipes)
        with ThreadPoolExecutor(1) as reader:
            try:
                line = reader.submit(self.process.stdout.readline).result(LONGEST_START)
            except TimeoutError:
                self.process.kill()
                raise
        at = json.loads(line)
        self.addresses = {name: Address(host, (a, b)) for name, (host, a, b) in at["rangers"].items()}
        self.feed = tuple(at["feed"])
        return self

    def report(self):
        """What has been counted, by ranger; `cpu` is the process's own, s."""
        self.process.stdin.write("report\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def __exit__(self, *_):
        self.process.stdin.close()
        try:
            self.process.wait(10.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()
