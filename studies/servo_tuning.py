"""Which filter makes a mirror axis settle to the count? Prints the tables of docs/studies/servo.md, draws its figures.

python studies/servo_tuning.py DIRECTORY

The axis is assumed (`AxisDesign`); the chip is the data sheet's. Every number comes from the simulated axis.
"""

import sys
from pathlib import Path

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import ValidityError
from catseye.gateways.steering.servo_figures import move_figure, step_figure
from catseye.ranger.motion_units import acceleration_integer, velocity_integer
from catseye.records.laboratory.move_table import RecordedMove
from catseye.reduction.steering.servo_identification import ServoFit, identify_axis
from catseye.simulator.servo.axis import TRACKING_SAMPLES, AxisTrace, ServoAxis, Settling
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign
from catseye.simulator.servo.tuning import (
    Filter,
    closed_loop,
    design_filter,
    margins,
    plant_of,
    ready_axis,
    step_metrics,
)

AXIS = AxisDesign()
MOVE, STEP = 10_000, 50  # counts
MOVES = 20  # of any length up to the first, of each line of the table
SPEED, ACCELERATION = 12_000.0, 40_000.0  # counts/s, counts/s^2
MANUAL = Filter(200, 300, 3500, 20, 1)  # the manual's example of FLT
CHOSEN = (30.0, 3)  # Hz, interval
SLEW = 35.0 / 60.0 / 360.0 * 100_000  # counts/s: the antenna's azimuth at 35 degrees a minute


def axis(filter_: Filter, *, design: AxisDesign = AXIS, bits=8, overflow="saturate", angle: float = 0.0) -> ServoAxis:
    """An axis, its amplifier on, its filter at work."""
    return ready_axis(
        filter_,
        velocity=velocity_integer(SPEED),
        acceleration=acceleration_integer(ACCELERATION),
        design=design,
        angle=angle,
        chip=MotionChip(output_bits=bits, overflow=overflow),
    )


def move(made: ServoAxis, target: int = MOVE, samples: int = 6000) -> AxisTrace:
    """A move from where the axis is."""
    made.abp(target)
    made.stt()
    return made.run(samples)


def step(made: ServoAxis, size: int = STEP, samples: int = 6000) -> AxisTrace:
    """A move so fast that the profile is a step."""
    made.abv(size * 65_536)
    made.aba(size * 65_536)
    return move(made, size, samples)


def row(name: str, filter_: Filter, **options) -> str:
    """One line of the table: margins, one move, a step, and how many moves of any length come to rest."""
    found = margins(plant_of(AXIS), filter_)
    moved = move(axis(filter_, **options))
    arrivals = [arrival(filter_, int(to), **options) for to in np.random.default_rng(628).integers(500, MOVE, MOVES)]
    settled = [seconds for seconds in arrivals if not np.isnan(seconds)]
    stepped = step(axis(filter_, **options))
    shape = step_metrics(stepped.time, stepped.actual, target=STEP)
    when = f"{1e3 * np.median(settled):.0f}, {1e3 * np.max(settled):.0f}" if settled else ""
    return (
        f"| {name} | {filter_.kp}, {filter_.ki}, {filter_.kd}, {filter_.il}, {filter_.interval} "
        f"| {found.phase / DEGREE:.0f} | {found.gain_below:.2f} to {found.gain:.1f} "
        f"| {np.max(np.abs(moved.error)):.1f} | {len(settled)} of {MOVES} | {when} | {100 * shape.overshoot:.0f} |"
    )


def arrival(filter_: Filter, target: int, **options) -> float:
    """Time from the end of a profile until the axis stays within a count, s; NaN when it hunts in the last second."""
    trace = move(axis(filter_, **options), target, 9000)
    end = int(np.argmax(trace.desired >= target))
    settling = step_metrics(trace.time, trace.actual, target=target).settling
    late = trace.time[-1] - 1.0
    return max(0.0, settling - trace.time[end]) if settling < late else float("nan")


def table() -> str:
    """Filters designed for crossovers and intervals, the manual's example, a finer converter."""
    lines = [
        "| crossover, Hz / interval | kp, ki, kd, il, interval | phase margin, ° | gain may change by "
        "| following error, counts | moves that come to rest | settling after the profile, ms: median, longest "
        "| overshoot of a step, % |",
        "|" + "---|" * 8,
    ]
    plant = plant_of(AXIS)
    for hertz in (8.0, 12.0, 20.0, 30.0, 40.0):
        for interval in (0, 3, 7):
            name = f"{hertz:g} / {interval}"
            try:
                lines.append(row(name, design_filter(plant, crossover_hz=hertz, interval=interval)))
            except ValidityError as refused:
                lines.append(f"| {name} | {refused} |" + " |" * 6)
    lines.append(row("the manual's example", MANUAL))
    lines.append(row("the same, il 4096", Filter(*MANUAL.values[:3], 4096, 1)))
    chosen = design_filter(plant, crossover_hz=CHOSEN[0], interval=CHOSEN[1])
    lines.append(row("30 / 3, converter of 12 bits", chosen, bits=12))
    return "\n".join(lines)


def frictions() -> str:
    """How much static friction above the moving one the chosen filter bears."""
    chosen = design_filter(plant_of(AXIS), crossover_hz=CHOSEN[0], interval=CHOSEN[1])
    lines = []
    for static in (8e-3, 12e-3, 16e-3, 24e-3):
        design = AxisDesign(static=static)
        rests = [np.ptp(move(axis(chosen, design=design), to, 9000).actual[-2930:]) for to in range(900, 9900, 450)]
        lines.append(
            f"static {1e3 * static:.0f} mN m: {sum(r == 0 for r in rests)} of {len(rests)} moves rest, "
            f"the others hunt by {max(rests):.0f} counts peak to peak at most"
        )
    return "\n".join(lines)


def offsets() -> str:
    """Where a step ends with the manual's limit of the integral, and with one that holds the friction."""
    ends = []
    for limit in (MANUAL.il, 4096):
        stepped = step(axis(Filter(*MANUAL.values[:3], limit, MANUAL.interval)), samples=9000)
        ends.append(f"il {limit}: {np.min(stepped.actual[-2930:]):.0f} to {np.max(stepped.actual[-2930:]):.0f}")
    return f"a step of {STEP} counts with the manual's example ends, over the last second, at: " + "; ".join(ends)


def overflow(chosen: Filter) -> str:
    """A step at which the literal reading of the data sheet turns the drive round."""
    lines = []
    for size in (50, 90, 100, 200):
        ends = []
        for kind in ("saturate", "wrap"):
            made = axis(chosen, overflow=kind)
            step(made, size)
            ends.append("motor off" if made.chip.motor_off else f"at {made.acp()}")
        lines.append(f"step of {size} counts: saturating {ends[0]}, wrapping {ends[1]}")
    return "\n".join(lines)


def tracking(chosen: Filter) -> str:
    """A target at the antenna's slew rate, a new speed every 128 ms."""
    made = axis(chosen)
    made.stt()
    targets = SLEW * TRACKING_SAMPLES * made.motor.sample * np.arange(1, 41)
    trace = made.follow(list(targets))
    late = trace.error[TRACKING_SAMPLES * 8 :]
    truth = trace.desired - trace.angle * made.motor.design.counts_per_turn / (2 * np.pi)
    rms = np.std(truth[TRACKING_SAMPLES * 8 :])
    return (
        f"{SLEW:.1f} counts/s: following error {np.mean(late):.2f} counts on average, {np.max(np.abs(late)):.2f} "
        f"at most after the first second; true angle {rms:.2f} counts rms about it; profile off the last target by "
        f"{trace.desired[-1] - targets[-1]:.5f} counts"
    )


def homing(chosen: Filter) -> str:
    """The index from several places between the stops of an axis with 97 000 counts of travel."""
    stops = {"low_stop": -18_069 / 100_000 * 2 * np.pi, "high_stop": 78_931 / 100_000 * 2 * np.pi}
    lines = []
    for count in (-15_000, 40_000, 78_000):
        made = axis(chosen, design=AxisDesign(**stops), angle=count / 100_000 * 2 * np.pi)
        found = made.fhm()
        lines.append(f"from {count} counts: {found.text} after {found.seconds:.1f} s")
    return "\n".join(lines)


def waits(chosen: Filter) -> str:
    """WAI and CWT after the move."""
    made = axis(chosen)
    made.abp(MOVE)
    made.stt()
    profile = made.wai()
    settled = made.cwt(MOVE, Settling(tolerance=1))
    return f"WAI {profile.seconds:.3f} s, then CWT with WTOL 1, WCNT 5: {1e3 * settled.seconds:.1f} ms"


def draw(directory: Path, chosen: Filter) -> None:
    """The figures of the study."""
    plant = plant_of(AXIS)
    directory.mkdir(parents=True, exist_ok=True)
    moved = move(axis(chosen), samples=3600)
    (directory / "servo-move.svg").write_text(move_figure(moved, target=MOVE, plant=plant), encoding="utf-8")
    responses, linear = {}, {}
    for hertz in (12.0, 20.0, 30.0):
        every = design_filter(plant, crossover_hz=hertz)
        name = f"{hertz:g} Hz, interval 0"
        responses[name] = step(axis(every))
        linear[name] = STEP * unit_step(*closed_loop(plant, every), len(responses[name].time))
    responses["30 Hz, interval 3"] = step(axis(chosen))
    (directory / "servo-step.svg").write_text(step_figure(responses, target=STEP, linear=linear), encoding="utf-8")


def identified(chosen: Filter) -> ServoFit:
    """Axis identified from a move each way."""
    traces = {name: move(axis(chosen), target) for name, target in (("there", MOVE), ("back", -MOVE))}
    return identify_axis([RecordedMove(name, t.time, t.output, t.actual) for name, t in traces.items()])


def unit_step(above: np.ndarray, below: np.ndarray, samples: int) -> np.ndarray:
    """Response of a discrete transfer function to a unit step."""
    from scipy.signal import lfilter

    above = np.concatenate([np.zeros(len(below) - len(above)), above])
    return lfilter(above, below, np.ones(samples))


def main(directory: str) -> None:
    """Print the numbers, write the figures."""
    plant = plant_of(AXIS)
    chosen = design_filter(plant, crossover_hz=CHOSEN[0], interval=CHOSEN[1])
    gain, decay, friction, _ = identified(chosen).values
    parts = [
        f"axis: gain {plant.gain:.0f} counts/s2, decay {plant.decay:.2f} 1/s, friction {plant.friction:.2f} steps",
        f"identified: {gain:.0f}, {decay:.2f}, {friction:.2f}",
        table(), waits(chosen), frictions(), offsets(), overflow(chosen), tracking(chosen), homing(chosen),
    ]  # fmt: skip
    sys.stdout.write("\n\n".join(parts) + "\n")
    draw(Path(directory), chosen)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python studies/servo_tuning.py DIRECTORY")
    main(sys.argv[1])
