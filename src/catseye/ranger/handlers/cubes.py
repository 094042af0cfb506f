"""Commands of cubes and geometry: tables, encoder values, pointing, tracking."""

from collections.abc import Generator
from dataclasses import replace

from catseye.errors import InputError
from catseye.ranger.commands import LONGEST_PAGE
from catseye.ranger.cubes import GEOMETRY, Cube
from catseye.ranger.handlers.axes import MOVE_TIME, Handler, refuse_motors_off, settle, start_moves, wait_until
from catseye.ranger.line import stamp_text as stamp
from catseye.ranger.line import tag_of
from catseye.ranger.state import RangerState, Values, Work
from catseye.ranger.values import Value


def _geometry(name: str) -> Handler:
    def handler(z: RangerState, _: int, *values: float) -> Values:
        if values:
            z.cubes.set_geometry(name, values)
            z.given.add(name)
        digits = 7 if name in ("ALPHA", "BETA") else 3
        return tuple(f"{v:.{digits}f}" for v in z.cubes.geometry[name])

    return handler


def _d0(z: RangerState, _: int, value: float | None = None) -> Values:
    if value is not None:
        z.d0_mm = value
        z.given.add("D0")
    return (f"{z.d0_mm:.4f}",)


def _ini(z: RangerState, _: int, count: int) -> Values:
    z.cubes.allocate(count)
    z.order, z.aimed = [], None
    return (str(count),)


def listed(cube: Cube) -> Values:
    return str(cube.number), cube.name, *(f"{v:.3f}" for v in cube.place_mm)


def _coo(z: RangerState, _: int, *values: Value) -> Values | Work:
    if len(values) in (0, 2):
        first, count = values or (0, LONGEST_PAGE)
        return _page(z, int(first), int(count))
    key, *rest = values
    if not rest:
        return listed(z.cubes.find(key))
    x, y, at_z = (float(v) for v in rest[:3])
    cube = z.cubes.place(key, (x, y, at_z), str(rest[3]) if len(rest) == 4 else None)
    if z.aimed == cube.number:
        z.aimed = None
    return listed(cube)


def _page(z: RangerState, first: int, count: int) -> Work:
    """A page of cubes; a last line "more" has the next number."""
    numbers = sorted(number for number in z.cubes.by_number if number >= first)
    for number in numbers[:count]:
        if number in z.cubes.by_number:
            yield listed(z.cubes.by_number[number])
    return ("more", str(numbers[count])) if len(numbers) > count else None


def _knd(z: RangerState, _: int, key: Value, kind: str | None = None, value: float = 0.0) -> Values:
    cube = z.cubes.find(key)
    if kind is not None:
        if cube.number == 0 or kind.upper() not in ("S", "B"):
            raise InputError(f"kind {kind} of cube {cube.number} (expected S or B, of a cube other than ZRG)")
        cube = replace(cube, kind=kind.upper(), value_mm=value)
        z.cubes.put(cube)
    return str(cube.number), cube.kind, f"{cube.value_mm:.4f}"


def _encoder(axis: int) -> Handler:
    def handler(z: RangerState, _: int, key: Value, value: float | None = None) -> Values:
        cube = z.cubes.find(key)
        if value is not None:
            z.cubes.set_counts(cube, axis, value)
        return str(cube.number), f"{z.cubes.one_count(cube, axis):.3f}"

    return handler


def _cil(z: RangerState, _: int, key: Value, *where: float) -> Work:
    cube = z.cubes.find(key)
    if len(where) == 2:
        counts = (where[0], where[1])
    elif where:
        looked = z.cubes.look(where)
        counts = (float(looked[0]), float(looked[1]))
    else:
        counts = z.cubes.counts(cube)
    yield from illuminate(z, cube, counts)
    return *listed(cube), *(f"{n:.3f}" for n in counts)


def illuminate(z: RangerState, cube: Cube, counts: tuple[float, float]) -> Generator[int | None, None, None]:
    refuse_unready(z)
    z.aimed = None
    start_moves(z, {0: round(counts[0]), 1: round(counts[1])})

    def arrived() -> bool:
        return not (z.head.moving(0) or z.head.moving(1))

    yield from wait_until(z, arrived, MOVE_TIME, what=f"cube {cube.name}: axes have not arrived")
    refuse_motors_off(z, (0, 1))
    yield from settle(z, counts)
    z.aimed = cube.number


def refuse_unready(z: RangerState) -> None:
    if not z.auto:
        raise InputError("not in Auto mode (expected MOD 1 first)")
    for axis in (0, 1):
        if z.head.homing(axis) != "home":
            raise InputError(f"axis {axis} is not homed (expected FHM {axis} first)")
    if not z.initialised:
        raise InputError("not initialised (expected BP, ALPHA, BETA, MO, EZ and D0, or INITZY, first)")


def _trk(z: RangerState, _: int, key: Value, t0: int, *values: float) -> Work:
    """Track a cube: encoder counts linear between t0 and t1.

    A move under way ends first. Source: [PARKER04] eq. 2.45, 2.46.
    """
    cube, start, t1, end = z.cubes.find(key), values[:3], int(values[3]), values[4:]
    refuse_unready(z)
    if not (t0 < t1 and t1 > z.now_ticks()):
        raise InputError(f"t0 {stamp(t0)}, t1 {stamp(t1)} (expected t0 before t1, and t1 to come)")
    n0 = z.cubes.look(start)
    n1 = z.cubes.look(end, (float(n0[0]), float(n0[1])))
    z.refuse_sun(n0)
    z.refuse_sun(n1, n0)
    line = (n0, n1), (tag_of(t0), tag_of(t1))
    if not z.head.follow(*line):
        if not all(z.head.enabled(axis) for axis in (0, 1)):
            raise InputError("axes do not follow (expected both amplifiers on: AXIS n, 1)")
        free = "the axes are not free"
        yield from wait_until(z, lambda: not (z.head.moving(0) or z.head.moving(1)), MOVE_TIME, what=free)
        if t1 <= z.now_ticks():
            raise InputError(f"t1 {stamp(t1)} was over before the axes were free (expected it to come)")
        z.refuse_sun(n0)
        if not z.head.follow(*line):
            raise InputError("axes do not follow (expected no search for the index under way)")
    z.aimed, z.heading = cube.number, (float(n1[0]), float(n1[1]))
    return str(cube.number), *(f"{n:.3f}" for n in (*n0, *n1))


CUBES: dict[str, Handler] = {
    **{name: _geometry(name) for name in GEOMETRY},
    "D0": _d0,
    "INI": _ini,
    "COO": _coo,
    "KND": _knd,
    "AZM": _encoder(0),
    "ELV": _encoder(1),
    "CIL": _cil,
    "TRK": _trk,
}
