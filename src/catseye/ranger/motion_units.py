"""Units of the LM628 motion chip: conversion to counts and limits.

Velocities and accelerations are counts a sample, and a sample squared, times 65 536; a sample lasts 2048 periods of the
clock: 341.33 us at the ranger's 6 MHz. The data sheet's worked example rounds it to 341 us: it loads 446 956 for 600
rpm at 2000 counts a turn, which runs at 599.4 rpm. With the exact sample time, the default here, 447 392 is right.
"""

import operator
from dataclasses import dataclass

from catseye.errors import ValidityError
from catseye.geometry.mirror.slew import Pace
from catseye.records.site.mirror import MirrorGeometry

CLOCK_HZ = 6e6
CLOCKS_PER_SAMPLE = 2048
SAMPLE_TIME = CLOCKS_PER_SAMPLE / CLOCK_HZ
FRACTION = 65_536  # of a count: the unit of velocity and acceleration
POSITION_LOW, POSITION_HIGH = -(2**30), 2**30 - 1
LARGEST_RATE = 2**30 - 1
LARGEST_GAIN = 32_767
LONGEST_INTERVAL = 255
LARGEST_ERROR_LIMIT = 25_000  # of the ZY; the chip's own is 32 767


@dataclass(frozen=True)
class ValueLimits:
    """Limits of one command: value name, lowest, highest, unit."""

    name: str
    low: int
    high: int
    unit: str


LIMITS = {
    "ABA": ValueLimits("acceleration", 0, LARGEST_RATE, "1/65536 count per sample squared"),
    "ABV": ValueLimits("velocity", 0, LARGEST_RATE, "1/65536 count per sample"),
    "ABP": ValueLimits("target position", POSITION_LOW, POSITION_HIGH, "counts"),
    "FKP": ValueLimits("proportional gain", 0, LARGEST_GAIN, "an integer of the filter"),
    "FKI": ValueLimits("integral gain", 0, LARGEST_GAIN, "an integer of the filter"),
    "FKD": ValueLimits("derivative gain", 0, LARGEST_GAIN, "an integer of the filter"),
    "FIL": ValueLimits("integration limit", 0, LARGEST_GAIN, "1/256 of a step of the 8-bit converter"),
    "FSI": ValueLimits("derivative interval", 0, LONGEST_INTERVAL, "samples less one"),
    "ERL": ValueLimits("position error limit", 0, LARGEST_ERROR_LIMIT, "counts"),
}


def checked(command: str, value: int) -> int:
    """Value of a command as a plain integer, if within limits.

    command   ABA, ABV, ABP, FKP, FKI, FKD, FIL, FSI or ERL
    value     as the command takes it

    Raises ValidityError: not an integer, or outside the command's limits. Source: [CREAGER02], the pages of the
    commands.

    >>> checked("ERL", 25_001)
    Traceback (most recent call last):
        ...
    catseye.errors.ValidityError: ERL: position error limit 25001 is outside 0 to 25000 (counts)
    """
    limits = LIMITS[command]
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or isinstance(value, bool):
        raise ValidityError(
            f"{command}: {limits.name} {value!r} is not an integer (expected {limits.low} to {limits.high})"
        )
    if not limits.low <= number <= limits.high:
        raise ValidityError(
            f"{command}: {limits.name} {number} is outside {limits.low} to {limits.high} ({limits.unit})"
        )
    return number


def checked_rates(command: str, velocity: int, acceleration: int) -> None:
    """Refuse a velocity below the acceleration, as the ZY does.

    command        ABA or ABV, whichever is asked
    velocity       1/65536 count a sample
    acceleration   1/65536 count a sample squared

    Raises ValidityError: the velocity is below the acceleration. Source: [CREAGER02], pages ABA and ABV.

    >>> checked_rates("ABA", 20_000, 20_000)
    """
    if velocity < acceleration:
        first = "the velocity (ABV)" if command == "ABA" else "the acceleration (ABA)"
        raise ValidityError(
            f"{command}: velocity {velocity} is below acceleration {acceleration} (expected at least as much): "
            f"set {first} first"
        )


def velocity_integer(counts_per_second: float, sample: float = SAMPLE_TIME) -> int:
    """Integer of ABV for a speed.

    counts_per_second   speed, counts/s, 0 or above
    sample              time between samples, s

    Raises ValidityError: below zero, too small to move, too large. Source: [TEXAS13], page 11, whose example this is.

    >>> velocity_integer(10 * 2000, 341e-6), velocity_integer(10 * 2000)
    (446956, 447392)
    """
    return _integer("ABV", counts_per_second * sample * FRACTION, f"{counts_per_second:g} counts/s")


def acceleration_integer(counts_per_second2: float, sample: float = SAMPLE_TIME) -> int:
    """Integer of ABA for an acceleration.

    counts_per_second2   acceleration, counts/s^2, 0 or above
    sample               time between samples, s

    Raises ValidityError: below zero, too small to move, too large. Source: [TEXAS13], page 11, whose example this is.

    >>> acceleration_integer(2000, 341e-6)
    15
    """
    return _integer("ABA", counts_per_second2 * sample**2 * FRACTION, f"{counts_per_second2:g} counts/s^2")


def velocity_counts(integer: int, sample: float = SAMPLE_TIME) -> float:
    """Speed, counts/s, of an integer of ABV.

    integer   1/65536 count a sample
    sample    time between samples, s

    >>> f"{velocity_counts(446956) / 2000 * 60:.2f} rpm"
    '599.41 rpm'
    """
    return integer / FRACTION / sample


def acceleration_counts(integer: int, sample: float = SAMPLE_TIME) -> float:
    """Acceleration, counts/s^2, of an integer of ABA.

    integer   1/65536 count a sample squared
    sample    time between samples, s
    """
    return integer / FRACTION / sample**2


def pace_of(mirror: MirrorGeometry, sample: float = SAMPLE_TIME) -> Pace:
    """Speeds and accelerations of a mirror's axes from its record.

    mirror    with abv_0, aba_0, abv_1, aba_1
    sample    time between samples, s

    Raises ValidityError if the record lacks them, or has zero.
    """
    for key in ("abv_0", "aba_0", "abv_1", "aba_1"):
        if not getattr(mirror, key):
            raise ValidityError(
                f"{mirror.zp}: {key} = {getattr(mirror, key)} (expected above 0: speed or acceleration of its axes)"
            )
    return Pace(
        (velocity_counts(mirror.abv_0 or 0, sample), velocity_counts(mirror.abv_1 or 0, sample)),
        (acceleration_counts(mirror.aba_0 or 0, sample), acceleration_counts(mirror.aba_1 or 0, sample)),
    )


def _integer(command: str, exact: float, request: str) -> int:
    limits = LIMITS[command]
    if not 0.0 <= exact < limits.high + 0.5:
        raise ValidityError(f"{command}: {limits.name} {request} is outside 0 to {limits.high} ({limits.unit})")
    rounded = round(exact)
    if rounded == 0 and exact > 0.0:
        raise ValidityError(f"{command}: {limits.name} {request} is below half of {limits.unit}: nothing would move")
    return rounded
