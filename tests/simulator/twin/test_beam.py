"""The twin's beam by rays: signs by hand, and what needs no ray at all."""

import numpy as np
import pytest

from catseye.simulator.twin.beam import TracedDish
from live_scene import site

DISH = TracedDish.of(site().site.paraboloid)
STILL = np.zeros(6)
SMALL = 1e-5  # rad, or m


def six(*, shift=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    return np.array([*shift, *turn])


def test_at_rest_the_beam_lies_along_the_axis():
    np.testing.assert_allclose(DISH.beam(np.zeros(3), np.zeros(3), DISH.focus), [0.0, 0.0, 1.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(DISH.offset(STILL, STILL), 0.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("turn", "expected"),
    [
        ((SMALL, 0.0, 0.0), (0.0, SMALL)),  # about x, to the right: z goes to -y, up
        ((0.0, SMALL, 0.0), (SMALL, 0.0)),  # about y: z goes to x, to the right, clockwise
        ((0.0, 0.0, SMALL), (0.0, 0.0)),
    ],
)
def test_a_telescope_that_turns_as_a_whole_takes_its_beam_along(turn, expected):
    found = DISH.offset(six(turn=turn), six(shift=np.cross(turn, DISH.focus), turn=turn))
    np.testing.assert_allclose(found[:2], expected, rtol=0, atol=1e-9)  # turns of second order
    assert found[2] == pytest.approx(0.0, abs=1e-12)


def test_a_feed_that_goes_one_way_sends_the_beam_the_other_by_less_than_the_plate_scale():
    across = DISH.offset(STILL, six(shift=(SMALL, 0.0, 0.0)))
    assert -SMALL / 60.0 < across[0] < -0.5 * SMALL / 60.0
    down = DISH.offset(STILL, six(shift=(0.0, SMALL, 0.0)))  # the feed goes down, the beam up
    assert 0.4 * SMALL / 60.0 < down[1] < SMALL / 60.0
    away = DISH.offset(STILL, six(shift=(0.0, 0.0, SMALL)))
    assert away[2] == SMALL


def test_a_dish_that_shifts_is_a_feed_that_shifts_the_other_way():
    shift = np.array([2e-5, -1e-5, 3e-5])
    one, other = DISH.offset(six(shift=shift), STILL), DISH.offset(STILL, six(shift=-shift))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-14)
