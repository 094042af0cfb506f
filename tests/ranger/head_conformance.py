"""Conformance tests of heads: derive, provide `head()` and `pass_time()`."""

import numpy as np
import pytest

from catseye.geometry.sky.time_tag import PER_SECOND, TimeTag
from catseye.ranger.head import SamplingSettings

VELOCITY, ACCELERATION = 400_000, 1_000
SHORT = SamplingSettings(samples=64, cycles=4, frequency_hz=1000)


class HeadConformance:
    """A subclass gives a head just switched on, and lets its time pass."""

    def head(self):
        raise NotImplementedError

    def pass_time(self, head, seconds):
        raise NotImplementedError

    def until(self, head, done, seconds):
        for _ in range(round(seconds / 0.02)):
            if done():
                return True
            self.pass_time(head, 0.02)
        return done()

    def ready(self):
        head = self.head()
        for axis in (0, 1):
            head.set_error_limit(axis, 5000)
            head.enable(axis, True)
        return head

    def test_amplifiers_homing_and_buffer_are_off_at_boot(self):
        head = self.head()
        for axis in (0, 1):
            assert not head.enabled(axis)
            assert head.homing(axis) == "never"
            assert not head.motor_off(axis)
        assert head.buffer() is None

    def test_clock_runs_and_can_be_set(self):
        head = self.head()
        before = head.now()
        self.pass_time(head, 0.5)
        assert abs((head.now() - before).item() - 0.5 * PER_SECOND) < 0.05 * PER_SECOND
        head.set_clock(TimeTag(52890, 0))
        assert abs((head.now() - TimeTag(52890, 0)).item()) < 0.1 * PER_SECOND

    def test_a_buffer_has_the_samples_asked_and_the_time_of_its_trigger(self):
        head = self.head()
        asked = head.now()
        head.trigger(SHORT)
        assert head.buffer() is None
        assert self.until(head, lambda: head.buffer() is not None, 2.0)
        buffer = head.buffer()
        assert buffer.samples.shape == (256,)
        assert buffer.samples.dtype == np.int16
        assert buffer.sampling == SHORT
        assert buffer.volts_per_code > 0.0
        assert 0 <= (buffer.triggered - asked).item() < 0.1 * PER_SECOND

    def test_a_second_trigger_hides_the_first_buffer(self):
        head = self.head()
        head.trigger(SHORT)
        assert self.until(head, lambda: head.buffer() is not None, 2.0)
        head.trigger(SHORT)
        assert head.buffer() is None

    def test_an_axis_without_amplifier_does_not_start(self):
        assert not self.head().start(0, 1000, velocity=VELOCITY, acceleration=ACCELERATION)

    def test_an_axis_moves_to_its_target_and_only_it(self):
        head = self.ready()
        assert head.start(0, 1500, velocity=VELOCITY, acceleration=ACCELERATION)
        assert self.until(head, lambda: not head.moving(0), 20.0)
        assert self.until(head, lambda: abs(head.actual(0) - 1500) <= 5, 5.0)
        assert head.desired(0) == 1500
        assert abs(head.actual(1)) <= 5

    def test_homing_finds_the_index_within_30_s(self):
        head = self.ready()
        for axis in (0, 1):
            head.find_home(axis)
            assert self.until(head, lambda axis=axis: head.homing(axis) in ("home", "failed"), 30.0)
            assert head.homing(axis) == "home"
            assert abs(head.actual(axis)) <= 5

    def test_stop_ends_a_move(self):
        head = self.ready()
        assert head.start(0, 50_000, velocity=VELOCITY, acceleration=ACCELERATION)
        self.pass_time(head, 0.1)
        head.stop()
        assert self.until(head, lambda: not head.moving(0), 10.0)
        assert abs(head.actual(0)) < 49_000

    def test_a_track_ends_where_it_was_told(self):
        head = self.ready()
        begin = head.now()
        ends = (np.array([0.0, 0.0]), np.array([120.0, -60.0]))
        assert head.follow(ends, (begin, begin.after(1.0)))
        assert self.until(head, lambda: not (head.moving(0) or head.moving(1)), 3.0)
        assert abs(head.actual(0) - 120) <= 10
        assert abs(head.actual(1) + 60) <= 10

    def test_a_track_waits_at_its_first_counts_for_its_time(self):
        head = self.ready()
        begin = head.now().after(0.8)
        assert head.follow((np.array([90.0, -40.0]), np.array([140.0, 0.0])), (begin, begin.after(0.5)))
        self.pass_time(head, 0.3)
        for _ in range(20):
            self.pass_time(head, 0.02)
            assert abs(head.actual(0) - 90) <= 5
            assert abs(head.actual(1) + 40) <= 5
        assert self.until(head, lambda: not (head.moving(0) or head.moving(1)), 3.0)
        assert abs(head.actual(0) - 140) <= 10

    def test_a_track_takes_over_from_another_and_a_move_from_a_track(self):
        head = self.ready()
        begin = head.now()
        for goal in (100.0, 300.0):
            ends = (np.array([0.0, 0.0]), np.array([goal, 50.0]))
            assert head.follow(ends, (begin, begin.after(30.0)))
            self.pass_time(head, 0.2)
        assert head.moving(0)
        for axis in (0, 1):
            assert head.start(axis, -200, velocity=VELOCITY, acceleration=ACCELERATION)
        assert self.until(head, lambda: not (head.moving(0) or head.moving(1)), 10.0)
        assert self.until(head, lambda: abs(head.actual(0) + 200) <= 5 and abs(head.actual(1) + 200) <= 5, 5.0)

    def test_an_axis_without_amplifier_does_not_follow(self):
        head = self.ready()
        head.enable(1, False)
        begin = head.now()
        assert not head.follow((np.zeros(2), np.ones(2)), (begin, begin.after(1.0)))

    @pytest.mark.parametrize(
        "sampling", [SamplingSettings(), SamplingSettings(3, 1, 1000), SamplingSettings(10, 1, 10_000)]
    )
    def test_any_sampling_gives_its_words_and_no_sooner(self, sampling):
        head = self.head()
        head.trigger(sampling)
        assert head.buffer() is None
        assert self.until(head, lambda: head.buffer() is not None, sampling.duration + 2.0)
        assert head.buffer().samples.shape == (sampling.samples * sampling.cycles,)

    def test_power_and_reset(self):
        head = self.ready()
        head.switch_laser(False)
        assert not head.laser_on()
        assert all(np.isfinite(v) for v in head.supplies().values())
        head.trigger(SHORT)
        head.reset()
        assert not head.enabled(0)
        assert head.homing(0) == head.homing(1) == "never"
        assert head.buffer() is None
