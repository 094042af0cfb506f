"""`identify_servo`: recorded moves of a mirror's axis to its servo."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.scans.tabled import TabledResult
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from catseye.gateways.scans.files import Sources
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.steering.servo_identification import ServoFit, ServoLoop


@dataclass(frozen=True, eq=False, repr=False)
class ServoResult(TabledResult):
    """Axis of a mirror identified from its moves.

    values       (4,) gain, counts/s² a step; decay, 1/s; dry friction, steps; delay of the drive, s
    covariance   (4, 4)
    fit          everything else: windows, residuals
    loop         bandwidth and margins with the filter's gains; None without them
    """

    COMMAND = "servo identify"
    values: np.ndarray
    covariance: np.ndarray
    fit: "ServoFit"
    loop: "ServoLoop | None"

    def passages(self) -> "Sequence[Passage]":
        """Quantities of the axis, scatter, loop."""
        from catseye.gateways.scans.servo_objects import servo_passages

        return servo_passages(self.fit, self.loop)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye servo identify --json`."""
        from catseye.gateways.scans.servo_objects import servo_object

        return servo_object(self.fit, self.loop, self.verdict)

    def _sources(self) -> "Sources":
        from catseye.gateways.scans.servo_objects import WINDOWS

        return {WINDOWS: self.fit}

    def figures(self) -> "dict[str, Figure]":
        """Moves, their accelerations and the residuals."""
        from catseye.gateways.scans.servo_moves_figure import servo_moves_figure

        return {"moves": servo_moves_figure(self.fit)}


@with_units
def identify_servo(
    moves: "str | os.PathLike[str]",
    *,
    kp: Annotated[Any, In("", whole=True)] = None,
    ki: Annotated[Any, In("", whole=True)] = 0,
    kd: Annotated[Any, In("", whole=True)] = None,
    interval: Annotated[Any, In("", whole=True)] = 0,
) -> ServoResult:
    """Gain, decay, friction and delay of a mirror's axis from its recorded moves; margins of its loop.

    moves        MOVES.csv, of moves that accelerate, cruise and brake, both ways
    kp, ki, kd   integers of the axis's filter, as FKP, FKI and FKD take them; no loop without kp and kd
    interval     of its derivative, samples less one, as FSI takes it

    Raises InputError for an unusable file, ArgumentError for invalid gains, EstimationError for moves that do not
    determine the axis. Source: [PARKER04] section 6.3.1.

    >>> result = identify_servo("servo/moves.csv", kp=176, ki=217, kd=2273, interval=3)
    >>> result.verdict.word, (result.values / [1e3, 1, 1, 1e-3]).round(1).tolist()
    ('good', [9.3, 3.0, 4.3, 0.5])
    """
    from catseye.api.result import digest_of
    from catseye.records.laboratory.move_table import read_moves
    from catseye.reduction.steering.servo_identification import identify_axis

    if (kp is None) != (kd is None):
        missing = "kp" if kp is None else "kd"
        raise ArgumentError(f"{missing} is missing (expected kp and kd together, or neither)", missing)
    for name, value, most in (("kp", kp, 32_767), ("ki", ki, 32_767), ("kd", kd, 32_767), ("interval", interval, 255)):
        if value is not None and not 0 <= value <= most:
            raise ArgumentError(f"{name} = {value} is outside 0 to {most}", name)
    path = place_of(moves)
    fit = identify_axis(read_moves(path))
    loop = None if kp is None or kd is None else _loop(fit, (kp, ki, kd, interval))
    return ServoResult(
        verdict=fit.verdict.hearing([] if loop is None else loop.doubts),
        values=fit.values,
        covariance=fit.covariance,
        fit=fit,
        loop=loop,
        hashes={str(path): digest_of(path)},
        read=(path,),
    )


def _loop(fit: "ServoFit", gains: tuple[int, int, int, int]) -> "ServoLoop":
    """Loop of the identified axis: the drive's delay beyond the chip's sample is in it.

    Decay and friction below 0 count as 0: within 3 u that is their noise, beyond it the fit's verdict is doubtful.
    """
    from catseye.errors import ValidityError
    from catseye.reduction.steering.servo_identification import ServoLoop
    from catseye.simulator.servo.tuning import Filter, Plant, bandwidth, margins

    kp, ki, kd, interval = gains
    gain, decay, friction, delay = (float(value) for value in fit.values)
    sample = float(np.mean([move.sample for move in fit.moves]))
    plant = Plant(gain, max(0.0, decay), friction=max(0.0, friction), sample=sample, late=delay - sample)
    chosen = Filter(kp, ki, kd, il=0, interval=interval)
    try:
        found = margins(plant, chosen)
    except ValidityError as error:
        raise ArgumentError(str(error), "kp") from error
    return ServoLoop(
        gains=gains,
        crossover=found.crossover,
        bandwidth=bandwidth(plant, chosen),
        phase=found.phase,
        gain=found.gain,
        gain_below=found.gain_below,
    )
