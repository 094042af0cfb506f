"""Writes the example of a servo: moves of one axis.

    python examples/servo/make_examples.py

A twin's motion chip, motor and encoder made them (catseye.simulator.servo), with the seed and truth below.
"""

from pathlib import Path

import numpy as np

from catseye.ranger.motion_units import acceleration_integer, velocity_integer
from catseye.simulator.servo.axis import ServoAxis
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign, Motor
from catseye.simulator.servo.tuning import design_filter, plant_of

HERE = Path(__file__).parent
SEED = 46
TRUE = AxisDesign(inertia=4e-3, viscous=12e-3, coulomb=10e-3, static=11e-3, disturbance=1e-3)
TARGETS = (4000, -1000, 3000, 0)  # counts
SAMPLES = 1900  # of each move


def main(seed: int = SEED, folder: Path = HERE) -> Path:
    """Write the moves and return their file."""
    chip = MotionChip(output_bits=12)
    axis = ServoAxis(chip, Motor(TRUE, generator=np.random.default_rng(seed)))
    axis.axis(True)
    axis.flt(*design_filter(plant_of(TRUE), crossover_hz=20.0, interval=3).values)
    axis.erl(25_000)
    axis.abv(velocity_integer(12_000))
    axis.aba(acceleration_integer(60_000))
    rows = ["move,time_s,drive_steps,position_counts"]
    for number, target in enumerate(TARGETS, 1):
        axis.abp(target)
        axis.stt()
        trace = axis.run(SAMPLES)
        columns = zip(trace.time, trace.output / 16.0, trace.actual, strict=True)
        rows += [f"{number},{time:.7f},{drive:.4f},{position:.0f}" for time, drive, position in columns]
    path = folder / "moves.csv"
    path.write_text("\n".join(rows) + "\n", "utf-8")
    return path


if __name__ == "__main__":
    main()
