"""Identified servo: planted axes, scatter over seeds, an axis integrated by scipy, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from catseye.constants import DEGREE
from catseye.errors import EstimationError
from catseye.ranger.motion_units import SAMPLE_TIME, acceleration_integer, velocity_integer
from catseye.records.laboratory.move_table import RecordedMove
from catseye.reduction.steering.servo_identification import ServoLoop, _equation, _starts, identify_axis
from catseye.simulator.servo.axis import ServoAxis
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign, Motor
from catseye.simulator.servo.tuning import design_filter, plant_of

DESIGN = AxisDesign(inertia=4e-3, viscous=12e-3, coulomb=10e-3, static=11e-3)
SEEDS = 24


def chip_moves(seed, design=DESIGN, targets=(4000, 0)):
    """Moves of the twin's axis, with torque noise of a seed."""
    noisy = replace(design, disturbance=1e-3)
    axis = ServoAxis(MotionChip(output_bits=12), Motor(noisy, generator=np.random.default_rng(seed)))
    axis.axis(True)
    axis.flt(*design_filter(plant_of(design), crossover_hz=20.0, interval=3).values)
    axis.erl(25_000)
    axis.abv(velocity_integer(12_000))
    axis.aba(acceleration_integer(60_000))
    moves = []
    for target in targets:
        axis.abp(target)
        axis.stt()
        trace = axis.run(1900)
        moves.append(RecordedMove(str(target), trace.time, trace.output / 16.0, trace.actual))
    return moves


def truth_of(design):
    plant = plant_of(design)
    return np.array([plant.gain, plant.decay, plant.friction, SAMPLE_TIME])


def test_axes_are_recovered_within_their_u_over_seeds():
    fits = [identify_axis(chip_moves(seed)) for seed in range(SEEDS)]
    pulls = np.array([(fit.values - truth_of(DESIGN)) / fit.u for fit in fits])
    assert (np.sqrt(np.mean(pulls**2, axis=0)) < 1.6).all()
    assert (np.sqrt(np.mean(pulls**2, axis=0)) > 0.5).all()
    assert np.mean([fit.u[0] for fit in fits]) < 0.004 * truth_of(DESIGN)[0]


def test_u_of_the_friction_is_that_of_a_fit_with_the_friction_itself_as_unknown():
    """The equations are linear in gain times friction; here their derivatives by the friction, [JCGM102] eq. 3."""
    fit = identify_axis(chip_moves(1))
    gain, _, friction, delay = fit.values
    windows = [(fit.moves[k], i) for k in range(len(fit.moves)) for i in _starts(fit.moves[k])]
    measured, drive, slope, sign, speed = np.array([_equation(move, i, delay) for move, i in windows]).T
    assert measured == pytest.approx(fit.measured)
    slopes = np.column_stack([drive - friction * sign, speed, -gain * sign, gain * slope])
    scale = np.sqrt(np.mean(slopes**2, axis=0))
    inverse = np.linalg.inv((slopes / scale).T @ (slopes / scale)) / np.outer(scale, scale)
    variance = float(fit.residual @ fit.residual) / (len(measured) - 4)
    assert fit.covariance == pytest.approx(variance * inverse, rel=1e-4)  # the last step of the delay


def test_an_axis_that_scipy_integrated_with_a_longer_delay():
    """Gain 5000, decay 8, friction 3 steps, drive 2.5 ms late; no chip, no quantization."""
    gain, decay, friction, delay, sample = 5000.0, 8.0, 3.0, 2.5e-3, 5e-4
    time = np.arange(3000) * sample
    moves = []
    for sign in (1.0, -1.0):
        drive = sign * (12.0 + 6.0 * np.sign(np.sin(9.0 * time)))

        def rates(t, state, drive=drive):
            k = int((t - delay) / sample)
            held = drive[min(k, len(drive) - 1)] if t >= delay else drive[0]
            return [state[1], gain * (held - friction * np.sign(drive[0])) - decay * state[1]]

        start = [0.0, sign * 2000.0]
        path = solve_ivp(rates, (0.0, time[-1]), start, t_eval=time, max_step=sample, rtol=1e-8, atol=1e-6)
        moves.append(RecordedMove(str(sign), time, drive, path.y[0]))
    found = identify_axis(moves)
    assert found.values[:3] == pytest.approx([gain, decay, friction], rel=2e-3)
    assert found.values[3] == pytest.approx(delay, abs=5e-5)


def test_a_tuned_filter_is_that_of_the_true_axis():
    found = identify_axis(chip_moves(1))
    plant = replace(plant_of(DESIGN), gain=found.values[0], decay=found.values[1], friction=found.values[2])
    chosen, ideal = (design_filter(p, crossover_hz=20.0, interval=3) for p in (plant, plant_of(DESIGN)))
    assert np.allclose(chosen.values[:3], ideal.values[:3], rtol=0.02)


@pytest.mark.parametrize(("row", "name"), [(1, "decay"), (2, "friction"), (3, "delay")])
def test_a_negative_value_that_no_axis_has_is_doubtful(row, name):
    fit = identify_axis(chip_moves(1))
    values = fit.values.copy()
    values[row] = -2.9 * fit.u[row]
    assert replace(fit, values=values).verdict.word == "good"
    values[row] = -5.0 * fit.u[row]
    assert replace(fit, values=values.copy()).verdict.why == f"the {name} is negative by 5.0 u, which no axis has"


def test_moves_one_way_are_doubtful():
    verdict = identify_axis(chip_moves(3, targets=(4000, 8000))).verdict
    assert verdict.word == "doubtful"
    assert "one way only" in verdict.why


def test_a_torque_outside_the_model_is_doubtful():
    verdict = identify_axis(chip_moves(3, replace(DESIGN, ripple=0.5, ripple_cycles=200))).verdict
    assert "times that of whole counts" in verdict.why


def test_leads_that_are_swapped_and_moves_without_motion_are_refused():
    moves = chip_moves(5)
    with pytest.raises(EstimationError, match="leads are swapped"):
        identify_axis([replace(move, drive=-move.drive) for move in moves])
    with pytest.raises(EstimationError, match="in 0 windows"):
        identify_axis([replace(move, position=np.zeros(len(move.time))) for move in moves])
    with pytest.raises(EstimationError, match="do not separate"):
        identify_axis([replace(move, drive=np.zeros(len(move.time))) for move in moves])


@pytest.mark.parametrize(
    ("phase", "gain", "said"),
    [(-0.1, 4.0, "not stable"), (20.0 * DEGREE, 4.0, "phase margin is 20°"), (1.0, 1.5, "rise by 1.50 only")],
)
def test_small_margins_are_objections(phase, gain, said):
    loop = ServoLoop(gains=(1, 0, 1, 0), crossover=1.0, bandwidth=2.0, phase=phase, gain=gain, gain_below=0.0)
    assert said in loop.doubts[0]
    assert not replace(loop, phase=1.0, gain=4.0).doubts
