"""Tuning: against scipy's sampling, the roots of the loop, the chip itself and planted axes."""

from dataclasses import replace
from math import exp, pi, sqrt

import numpy as np
import pytest
from scipy.signal import cont2discrete, freqz

from catseye.constants import DEGREE
from catseye.errors import ValidityError
from catseye.ranger.motion_units import SAMPLE_TIME
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign
from catseye.simulator.servo.tuning import (
    Filter,
    Plant,
    bandwidth,
    closed_loop,
    design_filter,
    filter_response,
    margins,
    plant_of,
    plant_response,
    step_metrics,
)

PLANT = plant_of(AxisDesign())


@pytest.mark.parametrize("plant", [PLANT, Plant(7e3, 0.0), Plant(2e4, 40.0), Plant(7e3, 0.2)])
def test_the_sampled_axis_is_scipy_s(plant):
    above, below, _ = cont2discrete(([plant.gain], [1.0, plant.decay, 0.0]), plant.sample, method="zoh")
    frequency = np.geomspace(2.0, 3.0 / plant.sample, 40)
    _, expected = freqz(above.ravel(), below, worN=frequency * plant.sample)
    late = np.exp(-1j * frequency * plant.sample)
    assert np.allclose(plant_response(plant, frequency), expected * late, rtol=3e-6)  # scipy's own roundings at 2 rad/s


def test_the_gain_of_an_axis_is_torque_over_inertia():
    """0.3 N m/A, 1 A at 128 steps, 5e-3 kg m^2: 0.46875 rad/s^2 a step, 7460 counts/s^2."""
    assert pytest.approx(0.46875 / (2 * pi) * 1e5) == PLANT.gain
    assert pytest.approx(1.0) == PLANT.decay
    assert pytest.approx(8e-3 / 0.3 * 128) == PLANT.friction


@pytest.mark.parametrize("interval", [0, 3, 7])
@pytest.mark.parametrize("hertz", [7.0, 31.0])
def test_the_filter_s_response_is_the_chip_s(interval, hertz):
    """A sine of error put into the chip, 12 bits, and what comes out fitted at its frequency."""
    asked = Filter(150, 400, 600, 32_767, interval)  # no product passes 16 bits
    chip = MotionChip(output_bits=12)
    chip.load_filter(kp=asked.kp, ki=asked.ki, kd=asked.kd, il=asked.il, interval=interval)
    chip.update_filter()
    chip.start()
    frequency, n = 2 * pi * hertz, np.arange(40_000)
    errors = np.rint(60.0 * np.cos(frequency * SAMPLE_TIME * n)).astype(int)
    words = np.array([chip.step(-int(e)) for e in errors]) / 16.0
    late = n >= 20_000
    basis = np.stack([np.cos(frequency * SAMPLE_TIME * n), np.sin(frequency * SAMPLE_TIME * n), np.ones(len(n)), n], 1)
    (c, s, *_), *_ = np.linalg.lstsq(basis[late], words[late], rcond=None)
    expected = filter_response(asked, frequency) * 60.0
    assert abs((c - 1j * s) - expected) < 0.01 * abs(expected)  # roundings of the error and of the sum's 256


@pytest.mark.parametrize(("hertz", "margin"), [(10.0, 60.0), (20.0, 45.0), (30.0, 55.0)])
def test_a_designed_loop_has_its_crossover_and_margin(hertz, margin):
    for interval in (0, 2):
        found = margins(
            PLANT, design_filter(PLANT, crossover_hz=hertz, phase_margin=margin * DEGREE, interval=interval)
        )
        assert found.crossover == pytest.approx(2 * pi * hertz, rel=0.02)  # the integers are rounded
        assert found.phase == pytest.approx(margin * DEGREE, abs=1.0 * DEGREE)
        assert found.gain_below < 0.5 < 2.0 < found.gain


def poles(chosen: Filter, *, gain: float = 1.0, delay: int = 0) -> float:
    """Largest magnitude of the roots of the loop, its gain changed and samples of delay added."""
    above, below = closed_loop(PLANT, chosen)
    return float(
        np.max(np.abs(np.roots(np.polyadd(np.polymul(np.polysub(below, above), [1.0] + [0.0] * delay), gain * above))))
    )


@pytest.mark.parametrize("hertz", [12.0, 30.0])
def test_the_margins_are_those_of_the_roots(hertz):
    """The loop turns unstable just when its gain passes a margin, or delay eats the phase margin."""
    chosen = design_filter(PLANT, crossover_hz=hertz)
    found = margins(PLANT, chosen)
    assert poles(chosen) < 1.0
    assert poles(chosen, gain=0.99 * found.gain) < 1.0 < poles(chosen, gain=1.01 * found.gain)
    assert poles(chosen, gain=1.02 * found.gain_below) < 1.0 < poles(chosen, gain=0.98 * found.gain_below)
    borne = found.phase / (found.crossover * SAMPLE_TIME)  # samples of delay
    assert poles(chosen, delay=int(borne)) < 1.0 < poles(chosen, delay=int(borne) + 2)


def test_without_an_integral_the_gain_may_fall_to_nothing():
    assert margins(PLANT, Filter(356, 0, 17_000, 0)).gain_below == 0.0


def test_the_bandwidth_is_where_the_closed_loop_halves_the_power():
    chosen = design_filter(PLANT, crossover_hz=20.0)
    above, below = closed_loop(PLANT, chosen)
    frequency = bandwidth(PLANT, chosen) * SAMPLE_TIME * np.array([1.0, 1.01])
    at, past = np.abs(freqz(above, below, worN=frequency)[1])
    assert at == pytest.approx(sqrt(0.5), rel=1e-3)
    assert past < at


def test_a_late_drive_costs_phase_by_its_delay():
    chosen, late = design_filter(PLANT, crossover_hz=20.0), 1e-3
    prompt, delayed = (margins(plant, chosen) for plant in (PLANT, replace(PLANT, late=late)))
    assert prompt.phase - delayed.phase == pytest.approx(prompt.crossover * late, rel=1e-9)
    with pytest.raises(ValidityError, match=r"drive late by 0\.001 s"):
        closed_loop(replace(PLANT, late=late), chosen)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"crossover_hz": 90.0, "interval": 7}, "phase margin 55 degrees is not attainable at 90 Hz"),
        ({"crossover_hz": 80.0}, "FKD: derivative gain"),
        ({"crossover_hz": 0.0}, "crossover 0 Hz is outside"),
        ({"crossover_hz": 2000.0}, "crossover 2000 Hz is outside"),
        ({"crossover_hz": 0.2}, "FKP: proportional gain 0"),
        ({"phase_margin": 55.0}, "check its unit"),
        ({"phase_margin": -1.0}, "phase margin -1 rad"),
        ({"phase_margin": float("nan")}, "phase margin nan rad"),
        ({"interval": -1}, "FSI"),
        ({"interval": 256, "crossover_hz": 1.0}, "FSI"),
    ],
)
def test_a_loop_that_cannot_be_had_is_refused(keys, said):
    with pytest.raises(ValidityError, match=said):
        design_filter(PLANT, **keys)


def test_other_refusals():
    with pytest.raises(ValidityError, match="plant: gain 0"):
        Plant(0.0, 1.0)
    with pytest.raises(ValidityError, match="holds for a derivative every sample"):
        closed_loop(PLANT, Filter(1, 1, 1, 1, 2))
    with pytest.raises(ValidityError, match="no crossover"):
        margins(PLANT, Filter(0, 0, 0, 0))
    with pytest.raises(ValidityError, match="starts at its target"):
        step_metrics([0.0, 1.0], [5.0, 5.0], target=5.0)
    for time, position in (([0.0, 1.0], [0.0, np.nan]), ([], []), ([0.0, 1.0], [0.0])):
        with pytest.raises(ValidityError, match="finite numbers"):
            step_metrics(time, position, target=5.0)


def test_the_limit_of_the_integral_holds_the_friction():
    assert design_filter(Plant(7460.0, 1.0, 40.0)).il == 256 * 120
    assert design_filter(Plant(7460.0, 1.0, 0.0)).il == 4096


@pytest.mark.parametrize("damping", [0.2, 0.5])
def test_step_metrics_are_the_textbook_s_second_order_loop(damping):
    t, w = np.linspace(0.0, 60.0, 60_001), 1.0
    wd = w * sqrt(1 - damping**2)
    y = 1 - np.exp(-damping * w * t) * (np.cos(wd * t) + damping * w / wd * np.sin(wd * t))

    def crossing(values, level):
        return t[np.argmax(values > level)]

    found = step_metrics(t, 40.0 * y, target=40.0, tolerance=0.8)
    assert found.overshoot == pytest.approx(exp(-pi * damping / sqrt(1 - damping**2)), abs=1e-6)
    assert found.rise == pytest.approx(crossing(y, 0.9) - crossing(y, 0.1), abs=1e-3)
    envelope = -np.log(0.02 * sqrt(1 - damping**2)) / damping
    assert envelope - pi / wd < found.settling <= envelope
    assert np.isnan(step_metrics(t[:3000], 40.0 * y[:3000], target=40.0, tolerance=0.1).settling)
    down = step_metrics(t, -40.0 * y, target=-40.0, tolerance=0.8)
    assert down == found
