"""Figures of a servo axis as SVG text: moves with following error, and step responses."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, STYLE, Figure, Svg, mpl, svg
from catseye.simulator.servo.axis import AxisTrace
from catseye.simulator.servo.tuning import Plant

WIDTH = 9.4  # inches, as all figures


def move_figure(trace: AxisTrace, *, target: float, plant: Plant | None = None) -> Svg:
    """Position, velocity, following error and drive of one move, as SVG text.

    trace    of the move, from its start
    target   counts
    plant    of the axis, to draw the drive that the profile requires; None for none
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=(WIDTH, 8.6), layout="constrained")
        position, velocity, error, drive = figure.subplots(4, 1, sharex=True)
        t = trace.time - trace.time[0]
        position.plot(t, trace.desired, color=SERIES[0], label="desired")
        position.plot(t, trace.actual, "--", color=SERIES[1], label="actual")
        position.axhline(target, color=FAINT, lw=0.8, ls=":")
        position.set_title("Position, counts")
        position.legend(loc="lower right")
        velocity.plot(t, trace.velocity, color=SERIES[0], label="desired", zorder=3)
        middle, speed = _speed(trace)
        velocity.plot(middle - trace.time[0], speed, color=SERIES[1], label="actual, mean of 10 ms")
        velocity.set_title("Velocity, counts/s")
        velocity.legend(loc="upper right")
        error.plot(t, trace.error, color=SERIES[2], lw=0.8)
        error.set_title(f"Following error, counts: at most {np.max(np.abs(trace.error)):.1f}")
        drive.plot(t, trace.output, color=SERIES[3], lw=0.5, label="filter output")
        if plant is not None:
            drive.plot(t, _required_drive(trace, plant), color=INK, lw=1.1, label="required by the profile", zorder=3)
            drive.legend(loc="upper right")
        drive.set_title("Drive, converter steps")
        drive.set_xlabel("time since the start, s")
        return svg(figure)


def step_figure(
    responses: Mapping[str, AxisTrace], *, target: float, linear: Mapping[str, NDArray[np.float64]] | None = None
) -> Svg:
    """Step responses compared, as SVG text: the first moments and the final error.

    responses   traces by name, with the step at time zero
    target      of the step, counts
    linear      response by linear theory, counts by sample, with the same names; None for none
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
        first, last = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
        for colour, (name, trace) in zip(SERIES, responses.items(), strict=False):
            t = 1e3 * (trace.time - trace.time[0])
            first.plot(t, trace.actual, color=colour, lw=1.1, label=name)
            last.plot(t / 1e3, trace.actual - target, color=colour, lw=0.9)
            theory = (linear or {}).get(name)
            if theory is not None:
                first.plot(t[: len(theory)], theory[: len(t)], ":", color=colour, lw=1.3)
        first.axhline(target, color=FAINT, lw=0.8)
        first.set_xlim(0.0, 200.0)
        first.set_title(f"Step of {target:g} counts; dotted: linear theory, no friction")
        first.set_xlabel("time since the step, ms")
        first.set_ylabel("position, counts")
        last.axhspan(-1.0, 1.0, color=BAD, alpha=0.12, lw=0)
        last.set_ylim(-8.0, 8.0)
        last.set_title("Final error; shaded: within one count")
        last.set_xlabel("time since the step, s")
        last.set_ylabel("actual minus target, counts")
        figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        return svg(figure)


def _speed(trace: AxisTrace) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and mean speeds, counts/s, over about 10 ms of encoder readings."""
    sample = float(trace.time[1] - trace.time[0])
    n = max(1, min(round(0.01 / sample), len(trace.time) - 1))
    speed = (trace.actual[n:] - trace.actual[:-n]) / (n * sample)
    return 0.5 * (trace.time[n:] + trace.time[:-n]), speed


def _required_drive(trace: AxisTrace, plant: Plant) -> NDArray[np.float64]:
    """Converter steps required by an axis to follow its profile."""
    acceleration = np.gradient(trace.velocity, trace.time[1] - trace.time[0])
    return (acceleration + plant.decay * trace.velocity) / plant.gain + plant.friction * np.sign(trace.velocity)
