"""Ranges of a solved epoch as columns, for those who look at residuals and corrections."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catseye.constants import PPM, SPEED_OF_LIGHT
from catseye.reduction.epoch.range_shots import RangeShots
from catseye.reduction.live.shots import PhasedShot
from catseye.signal.cycles.whole import unwrapped_length

RangeColumns = dict[str, list[Any]]


def range_columns(ranges: RangeShots, rows: Sequence[PhasedShot]) -> RangeColumns:
    """Columns of an epoch's ranges, one row per shot in order of its number; m unless said otherwise.

    shot                 number; joined repeats share all other values
    used                 True where it took part
    u_range              of the range, without systematic parameters
    residual, w          range minus the adjusted distance at that shot, and the test statistic of the adjustment
    redundancy           share of an error of this range that shows in its residual
    cycles, phase        whole half wavelengths; rad
    refractivity_ppm     along the path
    glass, obliquity, zero, leakage, moved, head    corrections, as of `RangeShots`
    """
    numbers = [rows[int(k)].numbers for k in ranges.shot]
    lengths = [len(each) for each in numbers]
    shots = np.array([number for each in numbers for number in each], dtype=int)
    columns = {
        "used": ranges.used,
        "u_range": ranges.u_range,
        "residual": ranges.residual,
        "w": ranges.standardised,
        "redundancy": ranges.redundancy,
        "cycles": ranges.cycles,
        "phase": ranges.phase,
        "refractivity_ppm": ranges.refractivity / PPM,
        "glass": ranges.glass,
        "obliquity": ranges.obliquity,
        "zero": ranges.zero,
        "leakage": ranges.leakage,
        "moved": ranges.moved,
        "head": ranges.head,
    }
    order = np.argsort(shots, kind="stable")
    repeated = {name: np.repeat(np.asarray(column), lengths)[order] for name, column in columns.items()}
    return {"shot": shots[order].tolist()} | {name: column.tolist() for name, column in repeated.items()}


def range_steps(
    columns: RangeColumns, shot: int, *, d0: float, modulation_hz: float
) -> tuple[tuple[str, float, str], ...]:
    """Numbers that make one shot's range, in order: name, value, unit; none for a shot without a range.

    columns          of `range_columns`
    d0               m, reference distance of the ranger's head
    modulation_hz    of the ranging

    The range, scan point to target at that shot, is the length in air plus D0 and all corrections behind it.

    Source: [PARKER04] eq. 5.18 and 5.19.
    """
    if shot not in columns.get("shot", ()):
        return ()
    row = columns["shot"].index(shot)
    value = {name: column[row] for name, column in columns.items()}
    half = 0.5 * SPEED_OF_LIGHT / modulation_hz
    index = 1.0 + value["refractivity_ppm"] * PPM
    vacuum, air = (float(unwrapped_length(value["cycles"], value["phase"], h)) for h in (half, half / index))
    corrections = ("glass", "obliquity", "zero", "leakage", "moved", "head")
    return (
        ("half wavelength in vacuum", half, "m"),
        ("whole half wavelengths", value["cycles"], ""),
        ("phase after the electronics'", value["phase"], "rad"),
        ("optical length", vacuum, "m"),
        ("refractivity along the path", value["refractivity_ppm"], "ppm"),
        ("vacuum to air", air - vacuum, "m"),
        ("reference distance D0", d0, "m"),
        ("glass", value["glass"], "m"),
        ("oblique incidence on the glass", value["obliquity"], "m"),
        ("zero of the ranger", value["zero"], "m"),
        ("residual leakage", value["leakage"], "m"),
        ("averages and the telescope's change", value["moved"], "m"),
        ("axes, amplitude and cyclic terms", value["head"], "m"),
        ("range", air + d0 + sum(value[name] for name in corrections), "m"),
        ("standard uncertainty of the range", value["u_range"], "m"),
        ("residual", value["residual"], "m"),
        ("test statistic w", value["w"], ""),
        ("redundancy", value["redundancy"], ""),
    )
