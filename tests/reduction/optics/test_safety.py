"""Safety of a beam: verdict by class, and the parts of the question."""

import pytest

from catseye.errors import ArgumentError
from catseye.optics.safety.hazard import AVERSION, BINOCULARS, NAKED, TIME_BASE, LaserBeam
from catseye.reduction.optics.safety import DURATIONS, SafetyQuestion, assess_safety

STRONG = LaserBeam(0.010, 0.780, 0.020, 0.05e-3, 0.0)
WEAK = LaserBeam(10e-6, 0.600, 0.020, 0.05e-3, 0.0)


def test_only_class_1_is_good():
    assert assess_safety(SafetyQuestion(WEAK)).verdict.word == "good"
    strong = assess_safety(SafetyQuestion(STRONG))
    assert (strong.outcome.laser_class, strong.verdict.word) == ("3B", "doubtful")
    assert "never a certificate" in strong.verdict.why


def test_the_exposure_is_an_aversion_in_visible_light_and_the_time_base_in_infrared():
    assert (SafetyQuestion(WEAK).seconds, SafetyQuestion(STRONG).seconds) == (AVERSION, TIME_BASE)
    assert SafetyQuestion(STRONG, duration=3.0).seconds == 3.0
    assert (SafetyQuestion(STRONG).viewer, SafetyQuestion(STRONG, aided=True).viewer) == (NAKED, BINOCULARS)


def test_a_row_for_each_duration_and_the_longest_exposure_reaches_farthest():
    found = assess_safety(SafetyQuestion(STRONG, duration=DURATIONS[-1]))
    assert [row.duration for row in found.what_if] == list(DURATIONS)
    assert found.exposure == found.what_if[-1]
    assert all(a.nohd <= b.nohd for a, b in zip(found.what_if, found.what_if[1:], strict=False))
    assert (found.scan, found.returned) == (None, None)


def test_a_period_needs_a_rate_and_a_reflector_sends_light_back():
    with pytest.raises(ArgumentError, match="scan_period_s needs scan_rad_per_s"):
        assess_safety(SafetyQuestion(STRONG, period=1.0))
    found = assess_safety(SafetyQuestion(STRONG, scan=0.5, reflector_distance=100.0))
    assert found.scan.hazard_distance < found.exposure.nohd
    assert 0.0 < found.returned.power_into_eye < STRONG.power
