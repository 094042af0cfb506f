"""The motor and its load against an integrator that knows none of its closed forms."""

from math import exp, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.ranger.motion_units import SAMPLE_TIME
from catseye.simulator.servo.motor import AxisDesign, Motor, index_between

FREE = {"coulomb": 0.0, "static": 0.0}


def integrated(design: AxisDesign, drives, *, velocity: float = 0.0) -> np.ndarray:
    """Angles after each sample by scipy, cut where the axis comes to rest; friction holds below `static`."""
    from scipy.integrate import solve_ivp

    state, angles = np.array([0.0, velocity]), []
    for drive in drives:
        torque, t = drive * design.full_torque, 0.0
        while t < SAMPLE_TIME:
            sense = np.sign(state[1]) if state[1] else np.sign(torque)
            if state[1] == 0.0 and abs(torque) <= design.static:
                break

            def motion(_, y, torque=torque, sense=sense):
                return [y[1], (torque - design.coulomb * sense - design.damping * y[1]) / design.inertia]

            def rest(_, y, sense=sense):
                return y[1] * sense

            rest.terminal, rest.direction = True, -1
            done = solve_ivp(motion, (t, SAMPLE_TIME), state, events=rest, rtol=1e-11, atol=1e-14, max_step=1e-4)
            state, t = done.y[:, -1].copy(), done.t[-1]
            if done.status == 1:
                state[1] = 0.0
        angles.append(state[0])
    return np.array(angles)


@pytest.mark.parametrize("design", [AxisDesign(), AxisDesign(amplifier="voltage", full_scale=12.0), AxisDesign(**FREE)])
def test_an_axis_moves_as_a_numerical_integrator(design):
    drives = np.random.default_rng(5).choice([-0.9, -0.06, -0.03, 0.0, 0.03, 0.06, 0.9], 60)
    motor, angles = Motor(design), []
    for drive in drives:
        motor.advance(drive)
        angles.append(motor.angle)
    expected = integrated(design, drives)
    assert np.ptp(expected) > 1e-5  # it moved
    assert np.allclose(angles, expected, rtol=0, atol=1e-10)  # rad; a count is 6e-5


def test_a_free_axis_reaches_its_speed_exponentially():
    design = AxisDesign(inertia=1e-4, viscous=2e-3, **FREE)
    motor = Motor(design)
    for _ in range(400):
        motor.advance(0.5)
    t = 400 * SAMPLE_TIME
    final, rate = 0.5 * design.full_torque / 2e-3, 2e-3 / 1e-4
    assert motor.velocity == pytest.approx(final * (1 - exp(-rate * t)), rel=1e-12)
    assert motor.angle == pytest.approx(final * (t - (1 - exp(-rate * t)) / rate), rel=1e-11)


def test_without_damping_it_is_a_parabola():
    design = AxisDesign(viscous=0.0, coulomb=5e-3, static=6e-3)
    motor = Motor(design)
    for _ in range(100):
        motor.advance(-0.5)
    rate = (-0.5 * design.full_torque + 5e-3) / design.inertia  # friction against the motion, here upwards
    assert motor.velocity == pytest.approx(rate * 100 * SAMPLE_TIME, rel=1e-12)
    assert motor.angle == pytest.approx(0.5 * rate * (100 * SAMPLE_TIME) ** 2, rel=1e-12)


def test_a_voltage_amplifier_brakes_with_the_motor_s_own_voltage():
    design = AxisDesign(amplifier="voltage", full_scale=10.0, viscous=0.0, **FREE)
    motor = Motor(design)
    for _ in range(20_000):
        motor.advance(1.0)
    assert motor.velocity == pytest.approx(10.0 / 0.3, rel=1e-6)  # V over V s/rad


def test_friction_brakes_to_rest_within_the_sample_and_holds():
    design = AxisDesign()
    motor = Motor(design)
    motor.advance(0.5)
    angles, speeds = [], []
    for _ in range(200):
        motor.advance(0.03)  # 9 mN m: more than moving friction, less than what holds
        angles.append(motor.angle)
        speeds.append(motor.velocity)
    assert min(speeds) > 0.0  # 9 mN m keep it going
    for _ in range(200):
        motor.advance(0.0)
        angles.append(motor.angle)
        speeds.append(motor.velocity)
    assert speeds[-1] == 0.0
    assert min(np.diff(angles)) >= 0.0  # it never turned back
    for _ in range(200):
        motor.advance(0.03)
        assert motor.velocity == 0.0  # the same drive does not free it
    assert motor.angle == angles[-1]
    motor.advance(0.05)
    assert motor.velocity > 0.0


@given(st.lists(st.floats(-0.0395, 0.0395), min_size=1, max_size=50))
def test_no_drive_below_static_friction_ever_moves_an_axis_at_rest(drives):
    motor = Motor(AxisDesign(), 0.3)
    for drive in drives:
        motor.advance(drive)
    assert (motor.angle, motor.velocity) == (0.3, 0.0)


@given(st.floats(-1.0, 1.0), st.floats(1e-6, 5.0))
def test_friction_alone_never_turns_the_motion_round(start, coulomb):
    motor = Motor(AxisDesign(coulomb=coulomb, static=coulomb))
    motor.velocity = start
    for _ in range(50):
        motor.advance(0.0)
        assert motor.velocity * start >= 0.0
        assert abs(motor.velocity) <= abs(start)


def test_kinetic_energy_goes_where_it_should():
    """Coulomb friction alone: half J w^2 is spent over the way, C |a|."""
    design = AxisDesign(viscous=0.0)
    motor = Motor(design)
    motor.velocity = 0.4
    while motor.velocity:
        motor.advance(0.0)
    assert motor.angle * design.coulomb == pytest.approx(0.5 * design.inertia * 0.4**2, rel=1e-9)


def test_an_end_stop_holds_and_lets_go():
    motor = Motor(AxisDesign(low_stop=-0.01, high_stop=0.01))
    for _ in range(500):
        motor.advance(1.0)
    assert (motor.angle, motor.velocity) == (0.01, 0.0)
    for _ in range(500):
        motor.advance(-1.0)
    assert (motor.angle, motor.velocity) == (-0.01, 0.0)


def test_the_encoder_counts_a_hundred_thousand_a_turn():
    assert Motor(AxisDesign(), 2 * pi).count == 100_000
    assert Motor(AxisDesign(), -2 * pi * 0.4 / 100_000).count == 0
    assert Motor(AxisDesign(), -2 * pi * 0.6 / 100_000).count == -1


def test_ripple_follows_the_angle():
    design = AxisDesign(ripple=0.1, ripple_cycles=4)
    assert Motor(design, pi / 8).torque(0.5) == pytest.approx(0.5 * 0.3 * 1.1)
    assert Motor(design, -pi / 8).torque(0.5) == pytest.approx(0.5 * 0.3 * 0.9)


def test_a_disturbance_has_its_rms_and_is_the_same_for_the_same_seed():
    def torques(seed):
        motor = Motor(AxisDesign(disturbance=2e-3), generator=np.random.default_rng(seed))
        return np.array([motor.torque(0.0) for _ in range(4000)])

    assert np.array_equal(torques(1), torques(1))
    assert np.std(torques(1)) == pytest.approx(2e-3, rel=0.05)  # 4 sigma of 4000 draws


@settings(max_examples=300)
@given(st.integers(-250, 250), st.integers(-250, 250), st.integers(-300, 300))
def test_an_index_is_passed_when_it_lies_between_two_readings(before, after, index):
    way = range(before, after + 1) if after >= before else range(before, after - 1, -1)
    expected = next((count for count in way if (count - index) % 100 == 0), None)  # the first on the way
    assert index_between(before, after, index=index, turn=100) == expected


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"inertia": 0.0}, "inertia = 0 "),
        ({"coulomb": -1.0, "static": 0.0}, "coulomb = -1 "),
        ({"static": 1e-3}, "static = 0.001 N m is below coulomb"),
        ({"low_stop": 1.0, "high_stop": 1.0}, "low_stop = 1 is not below"),
        ({"amplifier": "steam"}, "amplifier 'steam'"),
        ({"full_scale": float("nan")}, "full_scale = nan"),
    ],
)
def test_an_axis_that_cannot_be_is_refused(keys, said):
    with pytest.raises(ValidityError, match=said):
        AxisDesign(**keys)


def test_a_disturbance_without_a_generator_and_a_start_beyond_the_stops_are_refused():
    with pytest.raises(ValidityError, match="needs a generator"):
        Motor(AxisDesign(disturbance=1e-3))
    with pytest.raises(ValidityError, match="outside its stops"):
        Motor(AxisDesign(low_stop=0.0, high_stop=1.0), 2.0)
