"""Decode replies of a shot: CMEAS (amplitude, phase) and BUF (samples)."""

import binascii
import math
import re
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catseye.errors import InputError, ValidityError
from catseye.ranger.head import SamplingSettings
from catseye.ranger.line import Reply
from catseye.records.night.live import LiveShot

REAL = re.compile(r"[+-]?([0-9]{1,25}(\.[0-9]{0,25})?|\.[0-9]{1,25})([eE][+-]?[0-9]{1,3})?")
INTEGER = re.compile(r"[0-9]{1,10}")
CHECK = re.compile(r"0x[0-9a-f]{8}")
LARGEST_CODE_V = 1.0  # V a code: more is invalid
LARGEST_V = 1e3  # a larger amplitude is invalid


@dataclass(frozen=True, eq=False)
class BufferRead:
    """A decoded BUF.

    Cube, time of its first sample, sampling, V a code, and the samples, (m n,) int16.
    """

    cube: int | None
    ticks: int
    sampling: SamplingSettings
    volts_per_code: float
    samples: NDArray[np.int16]


@dataclass(frozen=True)
class Measurement:
    """A decoded CMEAS.

    Cube, time of its buffer's first sample, amplitude in V, phase in rad.
    """

    cube: int
    name: str
    ticks: int
    amplitude: float
    phase: float


def buffer_of(reply: Reply) -> BufferRead:
    """Buffer of a BUF reply.

    Raises InputError: refused by the ranger, another form, an impossible sampling, a length or a CRC that does not
    match the bytes.
    """
    values = _values(reply, "BUF", 7)
    cube = None if values[0] == "none" else _integer(values[0], "BUF's cube")
    cycles, samples, frequency = (_integer(v, "BUF's sampling") for v in values[1:4])
    try:
        sampling = SamplingSettings(samples, cycles, frequency)
    except ValidityError as problem:
        raise InputError(f"BUF: {problem}") from problem
    volts = _real(values[4], "BUF's V a code", LARGEST_CODE_V)
    if not volts > 0.0:
        raise InputError(f"BUF: {values[4][:20]} V a code (expected above 0)")
    if not CHECK.fullmatch(values[5]):
        raise InputError(f"BUF: {values[5][:20]!a} is not a CRC (expected 0x and 8 digits)")
    try:
        raw = binascii.a2b_base64(values[6].encode("ascii"), strict_mode=True)
    except (binascii.Error, ValueError) as problem:
        raise InputError(f"BUF: not base64: {problem}") from problem
    if len(raw) != 2 * samples * cycles:
        raise InputError(
            f"BUF: {len(raw)} bytes received (expected {2 * samples * cycles} of {cycles} x {samples} samples)"
        )
    if zlib.crc32(raw) != int(values[5], 16):
        raise InputError(f"BUF: CRC is 0x{zlib.crc32(raw):08x}, not {values[5]}: damaged in transmission")
    return BufferRead(cube, _ticks(reply), sampling, volts, np.frombuffer(raw, dtype="<i2"))


def measurement_of(reply: Reply) -> Measurement:
    """Measurement of a CMEAS reply.

    Raises InputError: refused by the ranger, another form, or invalid numbers.
    """
    values = _values(reply, "CMEAS", 6)
    amplitude = _real(values[3], "CMEAS's amplitude", LARGEST_V)
    return Measurement(
        _integer(values[1], "CMEAS's cube"),
        values[2],
        _ticks(reply),
        amplitude,
        _real(values[4], "CMEAS's phase", 100.0),
    )


def shot_of(
    ranger: str, target: str, measured: Measurement, *, buffer: BufferRead | None, usual: SamplingSettings
) -> LiveShot:
    """Shot from its two replies.

    usual   sampling if the buffer was not received
    """
    sampling = usual if buffer is None else buffer.sampling
    return LiveShot(
        ranger=ranger,
        target=target,
        ticks=measured.ticks,
        cycles=sampling.cycles,
        samples_per_cycle=sampling.samples,
        if_hz=sampling.frequency_hz,
        volts_per_code=float("nan") if buffer is None else buffer.volts_per_code,
        samples=None if buffer is None else buffer.samples,
        amplitude=measured.amplitude,
        phase=measured.phase,
    )


def reals_of(reply: Reply, count: int) -> tuple[float, ...]:
    """Last values of a reply, as numbers.

    Raises InputError: fewer, or not numbers.
    """
    if reply.ok is not True or len(reply.values) < count:
        raise InputError(f"{reply.command}: {reply.text[:200]!a} (expected {count} numbers)")
    return tuple(_real(v, reply.command, math.inf) for v in reply.values[-count:])


def _values(reply: Reply, command: str, count: int) -> tuple[str, ...]:
    if reply.ok is not True:
        raise InputError(f"{command}: {reply.text[:200]}")
    if reply.command != command or len(reply.values) != count:
        raise InputError(f"{reply.command} with {len(reply.values)} values (expected {command} with {count})")
    return reply.values


def _ticks(reply: Reply) -> int:
    if reply.ticks is None:
        raise InputError(f"{reply.command} has no stamp (expected the trigger's time)")
    return reply.ticks


def _integer(text: str, what: str) -> int:
    if not INTEGER.fullmatch(text):
        raise InputError(f"{what}: {text[:20]!a} is not a whole number")
    return int(text)


def _real(text: str, what: str, most: float) -> float:
    if not REAL.fullmatch(text) or not abs(float(text)) <= most or not math.isfinite(float(text)):
        raise InputError(f"{what}: {text[:20]!a} is not a number within {most:g}")
    return float(text)
