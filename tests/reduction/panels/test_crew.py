"""A crew's statistics by hand: three corners of one panel, in micrometres."""

from types import SimpleNamespace

import numpy as np
import pytest

from catseye.reduction.panels.crew import setting, standing

MICRO = 1e-6


def heights(relative, u, conforms=(0.5, 0.5, 0.5)):
    """One panel whose fourth corner nobody knows; goal 150 um, a screw of 1 mm a turn set to 0.01 turns."""
    lacking = [np.nan]
    return SimpleNamespace(
        known=np.array([[True, True, True, False]]),
        relative=MICRO * np.array([[*relative, *lacking]]),
        u_relative=MICRO * np.array([[*u, *lacking]]),
        conforms=np.array([[*conforms, *lacking]]),
        layout=SimpleNamespace(panels=("P1",), corners=("a", "b", "c", "d"), quad=np.array([[0, 1, 2, 3]])),
        sheet=SimpleNamespace(goal_um=150.0, screw=SimpleNamespace(u_turn=0.01, pitch_mm=1.0)),
    )


def test_corner_statistics_without_the_readings_scatter():
    """(100² + 200² + 300²)/3 = 46 666.7 as measured; less (10² + 20² + 30²)/3 = 466.7 is 46 200."""
    told = standing(heights((100.0, -200.0, 300.0), (10.0, 20.0, 30.0), (0.99, 0.02, 0.5)))
    assert told.rms == pytest.approx(MICRO * 46_666.667**0.5, rel=1e-6)
    assert told.rms_true == pytest.approx(MICRO * 46_200.0**0.5, rel=1e-6)
    assert (told.corners, told.surely, told.surely_not, told.undecided) == (3, 1, 1, 1)
    assert (told.within, told.expected_within) == pytest.approx((1.0 / 3.0, 1.51 / 3.0))
    assert told.median_u == pytest.approx(20.0 * MICRO)
    assert standing(heights((5.0, -5.0, 5.0), (10.0, 10.0, 10.0))).rms_true == 0.0


def test_turning_result_by_a_line_through_zero():
    """Asked -100, 200, -300; came -90, 220, -330. Variances 10² + 10² + 10², 20² + 10² + 10², 30² + 10² + 10² (readings
    before and after, the turn): (30 + 73.3 + 90)/(33.3 + 66.7 + 81.8) = 1.06333; rests 16.333, 7.333, -11.
    """
    told = setting(heights((100.0, -200.0, 300.0), (10.0, 20.0, 30.0)), heights((10.0, 20.0, -30.0), (10.0,) * 3))
    assert told.names == (("P1", "a"), ("P1", "b"), ("P1", "c"))
    np.testing.assert_allclose(told.wanted, MICRO * np.array([-100.0, 200.0, -300.0]), rtol=1e-12)
    np.testing.assert_allclose(told.got, MICRO * np.array([-90.0, 220.0, -330.0]), rtol=1e-12)
    assert told.gain == pytest.approx(1.063333, abs=1e-6)
    assert told.u_gain == pytest.approx(0.044680, abs=1e-6)
    assert told.scatter == pytest.approx(12.1319 * MICRO, abs=1e-4 * MICRO)
