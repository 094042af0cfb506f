"""A head without physics: constant speeds, scripted buffers, manual time."""

import numpy as np

from catseye.geometry.sky.time_tag import PER_SECOND, TimeTag
from catseye.ranger.head import Buffer
from catseye.ranger.motion_units import FRACTION, SAMPLE_TIME

VOLTS_PER_CODE = 10.0 / 32768
START = TimeTag(52889, 0)


class ScriptedHead:
    """`signals` maps whole azimuth counts to (amplitude V, phase rad); elsewhere there is only noise."""

    def __init__(self, signals=None, *, home_at=(-40, 60), seed=8):
        self.signals = dict(signals or {})
        self.home_at = home_at
        self.rng = np.random.default_rng(seed)
        self.clock, self.locked = START, True
        self.stuck = False
        self.fired = 0
        self.reset()

    def reset(self):
        self.at = np.zeros(2)
        self.goal, self.speed = np.zeros(2), np.ones(2)
        self.on, self.off = [False, False], [False, False]
        self.homes = ["never", "never"]
        self.taking, self.last, self.laser = None, None, True
        self.track = None

    def advance(self, seconds):
        """Let time pass, in one stride."""
        self.clock = self.clock.after(seconds)
        for axis in (0, 1):
            if self.on[axis] and not self.stuck:
                way = self.goal[axis] - self.at[axis]
                self.at[axis] += np.sign(way) * min(abs(way), self.speed[axis] * seconds)
            if self.homes[axis] == "searching" and self.at[axis] == self.goal[axis]:
                self.at[axis] = self.goal[axis] = 0.0
                self.homes[axis] = "home"
        if self.track is not None:
            (n0, n1), (t0, t1) = self.track
            share = min(max((self.clock - t0).item() / (t1 - t0).item(), 0.0), 1.0)
            self.at = n0 + share * (n1 - n0)
            self.goal = self.at.copy()
            if share == 1.0:
                self.track = None
        if self.taking is not None:
            sampling, begun = self.taking
            if (self.clock - begun).item() >= sampling.duration * PER_SECOND:
                self.last, self.taking = self._taken(sampling, begun), None

    def _taken(self, sampling, begun):
        amplitude, phase = self.signals.get(round(self.at[0]), (0.0, 0.0))
        j = np.arange(sampling.samples * sampling.cycles)
        volts = amplitude * np.cos(2 * np.pi * j / sampling.samples - phase) + self.rng.normal(0.0, 2e-3, len(j))
        codes = np.clip(np.rint(volts / VOLTS_PER_CODE), -32768, 32767).astype(np.int16)
        return Buffer(codes, begun, sampling, VOLTS_PER_CODE)

    def now(self):
        return self.clock

    def set_clock(self, tag):
        self.clock = tag

    def clock_locked(self):
        return self.locked

    def trigger(self, sampling):
        self.taking, self.last = (sampling, self.clock), None
        self.fired += 1

    def buffer(self):
        return self.last

    def enable(self, axis, on):
        self.on[axis] = on

    def enabled(self, axis):
        return self.on[axis]

    def actual(self, axis):
        return round(self.at[axis])

    def desired(self, axis):
        return round(self.goal[axis])

    def start(self, axis, position, *, velocity, acceleration):
        if not self.on[axis]:
            return False
        self.off[axis], self.track = False, None
        self.goal[axis], self.speed[axis] = position, velocity / FRACTION / SAMPLE_TIME
        return True

    def follow(self, counts, when):
        if not all(self.on):
            return False
        self.track = (counts, when)
        return True

    def moving(self, axis):
        return self.track is not None or self.at[axis] != self.goal[axis] or self.homes[axis] == "searching"

    def motor_off(self, axis):
        return self.off[axis]

    def set_filter(self, axis, values):
        self.filter = (axis, values)

    def set_error_limit(self, axis, counts):
        self.limit = (axis, counts)

    def find_home(self, axis):
        if not self.on[axis]:
            self.homes[axis] = "failed"
            return
        self.homes[axis], self.goal[axis], self.speed[axis] = "searching", self.home_at[axis], 1000.0

    def homing(self, axis):
        return self.homes[axis]

    def stop(self):
        self.goal, self.track = self.at.copy(), None

    def switch_laser(self, on):
        self.laser = on

    def laser_on(self):
        return self.laser

    def supplies(self):
        return {"+5": 5.02, "+12": 11.97, "-12": -12.04}

    def enclosure_temperature_c(self):
        return 0.0
