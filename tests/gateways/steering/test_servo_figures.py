"""Figures of a servo axis."""

from xml.etree import ElementTree

import numpy as np
import pytest

from catseye.gateways.steering.servo_figures import move_figure, step_figure
from catseye.ranger.motion_units import SAMPLE_TIME
from catseye.simulator.servo.axis import AxisTrace
from catseye.simulator.servo.tuning import Plant


@pytest.fixture(scope="module")
def trace():
    """A made-up move: a parabola followed with a lag of three counts."""
    t = np.arange(600) * SAMPLE_TIME
    desired = 1e4 * t**2
    return AxisTrace(t + 5.0, desired, 2e4 * t, np.floor(desired - 3.0), desired * 1e-5, np.sin(t))


@pytest.fixture(scope="module")
def plain(trace):
    return move_figure(trace, target=400.0)


def texts(svg: str) -> str:
    """The figure's comments, which hold its texts when glyphs are drawn as paths."""
    ElementTree.fromstring(svg)  # it is well formed
    return svg


def test_a_move_has_its_four_panels(trace, plain):
    drawn = texts(move_figure(trace, target=400.0, plant=Plant(7e3, 1.0, 3.0)))
    for words in (
        "Position, counts",
        "Velocity, counts/s",
        "Following error, counts: at most 4.0",
        "Drive, converter steps",
    ):
        assert words in drawn
    assert "required by the profile" in drawn
    assert "required by the profile" not in plain


def test_the_same_move_gives_the_same_figure(trace, plain):
    assert move_figure(trace, target=400.0) == plain


def test_step_responses_are_compared_with_linear_theory(trace):
    drawn = texts(step_figure({"one": trace, "two": trace}, target=50.0, linear={"one": np.linspace(0.0, 50.0, 700)}))
    for words in ("one", "two", "Step of 50 counts", "Final error"):
        assert words in drawn
    assert drawn.count("stroke-dasharray") > step_figure({"one": trace, "two": trace}, target=50.0).count(
        "stroke-dasharray"
    )
