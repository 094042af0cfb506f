"""Commands of measurement: sampling, buffers, phases, distances, scans."""

import base64
import cmath
import zlib
from collections.abc import Callable, Generator
from dataclasses import replace

import numpy as np

from catseye.errors import CatseyeError, InputError
from catseye.ranger.commands import LONGEST_PAGE
from catseye.ranger.cubes import Cube, RangerShot
from catseye.ranger.handlers.axes import Handler, wait_until
from catseye.ranger.handlers.cubes import illuminate, refuse_unready
from catseye.ranger.head import Buffer, SamplingSettings
from catseye.ranger.line import TICK_NS, Reply, nanoseconds_of, nanoseconds_to_ticks
from catseye.ranger.ranging import distance_mm, group_index
from catseye.ranger.state import MeasuredBuffer, Outgoing, RangerState, Stream, Values, Work
from catseye.ranger.values import Value
from catseye.signal.cycles.whole import fraction
from catseye.signal.detection.phase import detect, phasors

SLACK = 2.0  # s that a buffer may be late
CONVERTER_END = 32_767  # code


def _sampled(name: str) -> Handler:
    def handler(z: RangerState, _: int, value: int | None = None) -> Values:
        if value is not None:
            z.sampling = SamplingSettings(**{**vars(z.sampling), name: value})
        return (str(getattr(z.sampling, name)),)

    return handler


def _shoot(z: RangerState) -> Generator[int | None, None, None]:
    owner, times_off = z.aimed, z.times_off
    _fire(z)
    z.measured = None
    buffer = yield from _complete_buffer(z)
    _refuse_dark(z, times_off)
    z.measured = MeasuredBuffer(buffer, owner)


def _fire(z: RangerState) -> None:
    if z.in_sun:
        raise InputError("the beam looks into the Sun (expected a move away first)")
    if not z.head.laser_on():
        raise InputError("the laser is off (expected PS 1 first)")
    z.head.trigger(z.sampling)


def _refuse_dark(z: RangerState, times_off: int) -> None:
    """Raise InputError if the laser was off since a count of switch-offs.

    Light that is on again does not help.
    """
    if z.times_off != times_off or not z.head.laser_on():
        raise InputError("the laser went off meanwhile (expected PS 1 first)")


def _complete_buffer(z: RangerState) -> Generator[int | None, None, Buffer]:
    """The triggered buffer, when it is complete."""
    seconds, read_buffer = z.sampling.duration, z.head.buffer

    yield from wait_until(
        z, lambda: read_buffer() is not None, seconds + SLACK, what="no buffer received", earliest=seconds
    )
    buffer = read_buffer()
    if buffer is None:
        raise InputError("no buffer received")
    return buffer


def _computed(z: RangerState) -> MeasuredBuffer:
    """Buffer with amplitude and phase. Source: [PARKER04] eq. 5.5, 5.6."""
    measured = z.measured
    if measured is None:
        raise InputError("there is no buffer (expected TRG first)")
    if measured.phase is None:
        buffer = measured.buffer
        phasor = complex(phasors(buffer.samples, buffer.sampling.samples, buffer.volts_per_code))
        clipped = bool(buffer.samples.min() <= -CONVERTER_END - 1 or buffer.samples.max() >= CONVERTER_END)
        measured = replace(
            measured, amplitude=abs(phasor), phase=float(fraction(cmath.phase(phasor), 0.0)), clipped=clipped
        )
        z.measured = measured
    return measured


def _trg(z: RangerState, _: int) -> Work:
    yield from _shoot(z)
    return ()


def _mpc(z: RangerState, _: int) -> Values:
    measured = _computed(z)
    if measured.cube is not None:
        _keep(z, z.cubes.find(measured.cube), measured)
    return ()


def _evaluated(z: RangerState) -> MeasuredBuffer:
    if z.measured is None or z.measured.phase is None:
        raise InputError("no phase computed (expected TRG, then MPC, first)")
    return z.measured


def _rad(z: RangerState, _: int) -> Values:
    return (f"{_evaluated(z).phase:.7f}",)


def _mag(z: RangerState, _: int) -> Values:
    return (f"{_evaluated(z).amplitude:.6g}",)


def _seq(z: RangerState, _: int, first: int = 1, count: int = LONGEST_PAGE) -> Work:
    """A page of cycles; a last line "more" has the next number."""
    measured = _computed(z)
    n = measured.buffer.sampling.samples
    cycles = measured.buffer.samples.reshape(-1, n)
    if first > len(cycles):
        raise InputError(f"cycle {first} is not in a buffer of {len(cycles)} (expected 1 to {len(cycles)})")
    page = cycles[first - 1 : first - 1 + count]
    detected = detect(page, n, measured.buffer.volts_per_code, harmonics=())
    for k, (amplitude, phase) in enumerate(
        zip(detected.amplitude.tolist(), detected.phase.tolist(), strict=True), first
    ):
        yield str(k), f"{amplitude:.6g}", f"{phase:.7f}"
    return ("more", str(first + count)) if first - 1 + count < len(cycles) else None


def _keep(z: RangerState, cube: Cube, measured: MeasuredBuffer) -> RangerShot:
    """Store a cube's shot, with its distance if a reference phase exists."""
    amplitude, phase = measured.amplitude or 0.0, measured.phase or 0.0
    if cube.number == 0:
        z.reference_phase = phase
        distance: float | None = z.d0_mm
    elif z.reference_phase is None:
        distance = None
    elif cube.kind == "B":
        distance = group_index(phase, z.reference_phase, cube.value_mm, index=z.index, d0_mm=z.d0_mm)
    else:
        coarse, constant = z.cubes.coarse_mm(cube), cube.value_mm
        distance = distance_mm(phase, z.reference_phase, coarse, index=z.index, d0_mm=z.d0_mm, constant_mm=constant)
    ticks = nanoseconds_to_ticks(nanoseconds_of(measured.buffer.triggered))
    shot = RangerShot(amplitude, phase, distance, ticks)
    z.cubes.put(replace(cube, shot=shot))
    return shot


def _distance_text(cube: Cube, distance: float | None) -> str:
    return "none" if distance is None else f"{distance:.9f}" if cube.kind == "B" else f"{distance:.3f}"


def _cmeas(z: RangerState, _: int, how: int, key: Value) -> Work:
    return (yield from measure(z, how, key))


def measure(z: RangerState, how: int, key: Value) -> Generator[int | None, None, Values]:
    cube = z.cubes.find(key)
    if how == 1:
        yield from illuminate(z, cube, z.cubes.counts(cube))
    else:
        _refuse_other_cube(z, cube)
    yield from _shoot(z)
    return _measured(z, how, cube.number)


def _refuse_other_cube(z: RangerState, cube: Cube) -> None:
    if z.aimed not in (None, cube.number):
        raise InputError(f"the beam is on cube {z.aimed}, not on {cube.number} (expected CIL {cube.number}, or f = 1)")


def _measured(z: RangerState, how: int, number: int) -> Values:
    """The buffer evaluated as a cube's: the values of CMEAS."""
    cube = z.cubes.find(number)
    if z.measured is not None:
        z.measured = replace(z.measured, cube=number)
    shot = _keep(z, cube, _computed(z))
    return (
        str(how),
        str(cube.number),
        cube.name,
        f"{shot.amplitude:.6g}",
        f"{shot.phase:.7f}",
        _distance_text(cube, shot.distance),
    )


def _last(pick: Callable[[Cube, RangerShot], str]) -> Handler:
    def handler(z: RangerState, _: int, key: Value) -> Values:
        cube = z.cubes.find(key)
        if cube.shot is None:
            raise InputError(f"cube {cube.name} has not been measured (expected CMEAS 1, {cube.number} first)")
        return str(cube.number), pick(cube, cube.shot)

    return handler


def _dst(cube: Cube, shot: RangerShot) -> str:
    if shot.distance is None:
        raise InputError("no reference phase (expected CMEAS 1, 0 first: ZRG)")
    return _distance_text(cube, shot.distance)


def _buf(z: RangerState, _: int) -> Values:
    if z.measured is None:
        raise InputError("there is no buffer (expected TRG or CMEAS first)")
    buffer, s = z.measured.buffer, z.measured.buffer.sampling
    raw = np.ascontiguousarray(buffer.samples, dtype="<i2").tobytes()
    cube = "none" if z.measured.cube is None else str(z.measured.cube)
    volts, check = f"{buffer.volts_per_code:.17g}", f"0x{zlib.crc32(raw):08x}"
    return cube, str(s.cycles), str(s.samples), str(s.frequency_hz), volts, check, base64.b64encode(raw).decode("ascii")


def _stm(z: RangerState, client: int, key: Value, count: int) -> Values:
    cube = z.cubes.find(key)
    if count == 0:
        z.end_stream()
    else:
        refuse_unready(z)
        _refuse_other_cube(z, cube)
        if z.stream is not None:
            raise InputError(f"a stream is under way (expected STM {z.stream.cube}, 0 first)")
        z.stream = Stream(client, z.tid, cube.number, count)
    return str(cube.number), str(count)


def stream_shots(z: RangerState, stream: Stream) -> Generator[Outgoing | int | None, None, None]:
    """Measure one cube repeatedly, without gaps.

    The next buffer is triggered before the last is evaluated and sent.
    """

    times_off = z.times_off

    def fire() -> str | None:
        try:
            _refuse_other_cube(z, z.cubes.find(stream.cube))
            _fire(z)
        except CatseyeError as problem:
            return str(problem)
        return None

    problem = fire()
    for remaining in range(stream.count - 1, -1, -1):
        if problem is None:
            try:
                buffer = yield from _complete_buffer(z)
                _refuse_dark(z, times_off)
                problem = fire() if remaining else None
                z.measured = MeasuredBuffer(buffer, stream.cube)
                yield Outgoing(Reply("CMEAS", True, _measured(z, 2, stream.cube), stream.tid))
                yield Outgoing(Reply("BUF", True, _buf(z, stream.client), stream.tid), stream.client)
            except CatseyeError as trouble:
                problem = str(trouble)
        if problem is not None:
            yield Outgoing(Reply("CMEAS", False, (f"cube {stream.cube}: {problem}",), stream.tid))
            return


def _num(z: RangerState, _: int, count: int | None = None) -> Values:
    if count is not None:
        z.order = (z.order + [0] * count)[:count]
    return (str(len(z.order)),)


def _ord(z: RangerState, _: int, place: int, key: Value | None = None) -> Values:
    if place > len(z.order):
        raise InputError(f"place {place} is not in the scan list of {len(z.order)} (expected NUM {place} first)")
    if key is not None:
        z.order[place - 1] = z.cubes.find(key).number
    return str(place), str(z.order[place - 1])


def _scn(z: RangerState, _: int, on: int | None = None, start: int = 0, rounds: int = 0) -> Values:
    if on == 1:
        if not z.order:
            raise InputError("the scan list is empty (expected NUM and ORD first)")
        refuse_unready(z)
        if z.scanning:
            raise InputError("a scan is under way (expected SCN 0 first)")
        if z.stream is not None:
            raise InputError(f"a stream is under way (expected STM {z.stream.cube}, 0 first)")
        z.scan_start, z.scan_rounds, z.scanning = start, rounds, True
    elif on == 0:
        z.end_scan()
    return (str(int(z.scanning)),)


def scan_rounds(z: RangerState) -> Generator[Reply | int | None, None, None]:
    """Measure the listed cubes in rounds, from the scan's start on."""
    while z.now_ns() < z.scan_start * TICK_NS:
        yield z.scan_start * TICK_NS
    rounds = 0
    while z.scan_rounds == 0 or rounds < z.scan_rounds:
        for number in tuple(z.order):
            try:
                yield Reply("CMEAS", True, (yield from measure(z, 1, number)))
            except CatseyeError as problem:
                yield Reply("CMEAS", False, (f"cube {number}: {problem}",))
        rounds += 1


SHOTS: dict[str, Handler] = {
    "SFQ": _sampled("samples"),
    "CYC": _sampled("cycles"),
    "IFF": _sampled("frequency_hz"),
    "TRG": _trg,
    "MPC": _mpc,
    "RAD": _rad,
    "MAG": _mag,
    "SEQ": _seq,
    "CMEAS": _cmeas,
    "AMP": _last(lambda cube, shot: f"{shot.amplitude:.6g}"),
    "PHI": _last(lambda cube, shot: f"{shot.phase:.7f}"),
    "DST": _last(_dst),
    "BUF": _buf,
    "STM": _stm,
    "NUM": _num,
    "ORD": _ord,
    "SCN": _scn,
}
