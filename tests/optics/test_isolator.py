"""An isolator against Malus' law, and what a corner cube that turns the polarization makes of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.optics.isolator import (
    Isolator,
    back_share,
    faraday_turn,
    forward_share,
    jones_back,
    jones_out,
)

angles = st.floats(0.1, 1.4)


@given(angles, angles)
def test_ideal_polarizers_follow_malus_both_ways(turn, second):
    made = Isolator(turn=turn, second=second, leak=0.0, transmission=1.0)
    assert forward_share(made) == pytest.approx(np.cos(turn - second) ** 2, abs=1e-12)
    left = [np.cos(second), np.sin(second)]
    assert back_share(made, left) == pytest.approx(np.cos(turn + second) ** 2, abs=1e-12)


@given(angles, angles, st.floats(0.0, 0.1), st.floats(0.0, 2.0 * np.pi), st.floats(0.0, np.pi))
def test_no_polarization_comes_back_stronger_than_the_worst(turn, second, leak, delay, mix):
    made = Isolator(turn=turn, second=second, leak=leak)
    light = [np.cos(mix), np.sin(mix) * np.exp(1j * delay)]
    assert back_share(made, light) <= back_share(made) + 1e-12
    assert back_share(made, np.multiply(light, 7.0)) == pytest.approx(back_share(made, light), rel=1e-9)


def test_a_rotator_that_worked_alike_both_ways_would_isolate_nothing():
    made = Isolator(leak=0.0, transmission=1.0)
    assert back_share(made, [1.0, 1.0]) < 1e-20
    reciprocal = jones_out(made).T  # what light retracing its way through passive glass meets
    assert np.sum((reciprocal @ np.sqrt([0.5, 0.5])) ** 2) == pytest.approx(1.0)
    assert np.sum((jones_back(made) @ np.sqrt([0.5, 0.5])) ** 2) == pytest.approx(0.0, abs=1e-20)


def test_light_across_comes_back_by_the_leak_of_the_second_polarizer():
    made = Isolator(leak=1e-3, transmission=1.0)
    assert back_share(made, [1.0, -1.0]) == pytest.approx(1e-3, rel=1e-9)
    assert back_share(made) == pytest.approx(1e-3, rel=1e-3)


def test_ten_degrees_of_warmth_leave_32_db():
    warm = Isolator(turn=float(faraday_turn(0.78, 30.0)), leak=0.0, transmission=1.0)
    missed = np.pi / 4.0 * (1.0 - 293.15 / 303.15)
    isolation_db = -10.0 * np.log10(back_share(warm, [1.0, 1.0]))
    assert isolation_db == pytest.approx(-20.0 * np.log10(np.sin(missed)), abs=1e-6)
    assert isolation_db == pytest.approx(31.7, abs=0.1)
    assert np.degrees(faraday_turn(0.79)) < 45.0 < np.degrees(faraday_turn(0.77))


def test_the_garnet_turns_at_two_wavelengths_in_the_ratio_of_its_tabulated_constants():
    # Verdet constants of terbium gallium garnet: -134 rad/(T m) at 632.8 nm, -40 at 1064 nm, data sheets of the trade
    assert faraday_turn(0.6328) / faraday_turn(1.064) == pytest.approx(134.0 / 40.0, rel=0.05)


def test_invalid_isolators_are_refused():
    with pytest.raises(ValidityError, match=r"leak 1\.5"):
        Isolator(leak=1.5)
    with pytest.raises(ValidityError, match=r"transmission 0\.0"):
        Isolator(transmission=0.0)
    with pytest.raises(ValidityError, match="no power"):
        back_share(Isolator(), [0.0, 0.0])
    with pytest.raises(ValidityError, match="outside -40 to 80"):
        faraday_turn(0.78, 300.0)
