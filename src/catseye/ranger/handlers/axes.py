"""Commands of the axes: moves, filters, homing, waiting. See `ranger.handlers.table`.

Source: [PARKER04] section 6.4.3.
"""

from collections.abc import Callable, Generator

from catseye.errors import InputError
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger import motion_units
from catseye.ranger.state import RangerState, Values, Work
from catseye.ranger.values import Value

FILTER = ("FKP", "FKI", "FKD", "FIL", "FSI")
TURN = round(COUNTS_PER_TURN)
MOVE_TIME = 60.0  # s, longest wait of WAI
HOMING_TIME = 30.0  # s, [CREAGER02] page FHM
Handler = Callable[..., Values | Work]


def _aba(z: RangerState, _: int, axis: int, value: int | None = None) -> Values:
    settings = z.axes[axis]
    if value is not None:
        motion_units.checked_rates("ABA", settings.velocity, value)
        settings.acceleration = value
    return str(axis), str(settings.acceleration)


def _abv(z: RangerState, _: int, axis: int, value: int | None = None) -> Values:
    settings = z.axes[axis]
    if value is not None:
        motion_units.checked_rates("ABV", value, settings.acceleration)
        settings.velocity = value
    return str(axis), str(settings.velocity)


def _abp(z: RangerState, _: int, axis: int, counts: int) -> Values:
    z.axes[axis].position = counts
    return str(axis), str(counts)


def _stt(z: RangerState, _: int, axis: int) -> Values:
    start_moves(z, {axis: z.axes[axis].position})
    z.aimed = None
    return (str(axis),)


def start_moves(z: RangerState, targets: dict[int, int]) -> None:
    """Start moves, unless amplifiers are off, a stop or the Sun forbids."""
    end = [targets.get(axis, z.head.desired(axis)) for axis in (0, 1)]
    for axis in targets:
        if not z.head.enabled(axis):
            raise InputError(f"amplifier of axis {axis} is off (expected AXIS {axis}, 1 first)")
    if z.homed:  # before homing counts are no directions
        if 0 in targets and not z.limits[0] <= end[0] <= z.limits[1]:
            raise InputError(f"azimuth {end[0]} counts is outside the stops {z.limits[0]:g} to {z.limits[1]:g}")
        z.refuse_sun(end)
    z.heading = (end[0], end[1])
    for axis, position in targets.items():
        settings = z.axes[axis]
        if not z.head.start(axis, position, velocity=settings.velocity, acceleration=settings.acceleration):
            raise InputError(f"axis {axis} did not start (expected the last move to have ended: WAI {axis})")


def _wai(z: RangerState, _: int, axis: int) -> Work:
    yield from wait_until(z, lambda: not z.head.moving(axis), MOVE_TIME, what=f"axis {axis} has not arrived")
    refuse_motors_off(z, (axis,))
    return str(axis), str(z.head.actual(axis))


def refuse_motors_off(z: RangerState, axes: tuple[int, ...]) -> None:
    for axis in axes:
        if z.head.motor_off(axis):
            raise InputError(
                f"motor of axis {axis} went off: position error past ERL (expected a free axis; STT again)"
            )


def wait_until(
    z: RangerState, condition: Callable[[], bool], seconds: float, *, what: str, earliest: float | None = None
) -> Generator[int | None, None, None]:
    """Yield until a condition holds.

    earliest   s, before which it need not be polled

    Raises InputError after `seconds`.
    """
    begin = z.now_ns()
    end = begin + round(seconds * PER_SECOND)
    ask = None if earliest is None else begin + round(earliest * PER_SECOND)
    while not condition():
        if z.now_ns() > end:
            raise InputError(f"{what} after {seconds:g} s")
        yield ask


def _acp(z: RangerState, _: int, axis: int) -> Values:
    return str(axis), str(z.head.actual(axis))


def _dsp(z: RangerState, _: int, axis: int) -> Values:
    return str(axis), str(z.head.desired(axis))


def _axis(z: RangerState, _: int, axis: int, on: int | None = None) -> Values:
    if on is not None:
        z.head.enable(axis, bool(on))
    return str(axis), str(int(z.head.enabled(axis)))


def _erl(z: RangerState, _: int, axis: int, counts: int | None = None) -> Values:
    if counts is not None:
        z.head.set_error_limit(axis, counts)
        z.axes[axis].error_limit = counts
    return str(axis), str(z.axes[axis].error_limit)


def _filter_value(place: int) -> Handler:
    def handler(z: RangerState, _: int, axis: int, value: int | None = None) -> Values:
        if value is not None:
            old = list(z.axes[axis].filter)
            old[place] = value
            _flt(z, 0, axis, *old)
        return str(axis), str(z.axes[axis].filter[place])

    return handler


def _flt(z: RangerState, _: int, axis: int, *values: int) -> Values:
    if values:
        kp, ki, kd, il, interval = values
        z.head.set_filter(axis, (kp, ki, kd, il, interval))
        z.axes[axis].filter = (kp, ki, kd, il, interval)
    return str(axis), *map(str, z.axes[axis].filter)


def _fhm(z: RangerState, _: int, axis: int) -> Work:
    if not z.head.enabled(axis):
        raise InputError(f"amplifier of axis {axis} is off (expected AXIS {axis}, 1 first)")
    if z.homed and z.head.laser_on():
        turn = list(z.here)
        turn[axis] += TURN
        try:
            z.refuse_sun(turn)
        except InputError as problem:
            raise InputError(f"the search makes a full turn: {problem}; or search with the laser off: PS 0") from None
    z.aimed = None
    if not z.laser_at_boot:  # dark until homed
        z.switch_laser(False)
    z.head.find_home(axis)
    text = f"the index of axis {axis} is not found"
    yield from wait_until(z, lambda: z.head.homing(axis) != "searching", HOMING_TIME, what=text)
    if z.head.homing(axis) != "home":
        raise InputError(text)
    return (str(axis),)


def _cwt(z: RangerState, _: int, key: Value) -> Work:
    cube = z.cubes.find(key)
    yield from settle(z, z.cubes.counts(cube))
    return (str(cube.number),)


def settle(z: RangerState, counts: tuple[float, float]) -> Generator[int | None, None, None]:
    """Wait for WCNT reads in a row within WTOL of both axes, before WTMO."""
    desired, row = [round(n) for n in counts], 0
    end = z.now_ns() + round(z.timeout * PER_SECOND)
    while True:
        off = max(abs(z.head.actual(axis) - desired[axis]) for axis in (0, 1))
        row = row + 1 if off <= z.tolerance else 0
        if row >= z.reads:
            return
        if z.now_ns() > end:
            if not z.strict:
                return
            refuse_motors_off(z, (0, 1))
            raise InputError(f"not settled after {z.timeout:g} s: {off} counts off (expected within {z.tolerance})")
        yield None


def _number(name: str, text: Callable[[float], str] = str) -> Handler:
    """A setting that is one attribute of the ranger."""

    def handler(z: RangerState, _: int, value: float | None = None) -> Values:
        if value is not None:
            setattr(z, name, value)
        return (text(getattr(z, name)),)

    return handler


def _switch(name: str) -> Handler:
    def handler(z: RangerState, _: int, value: int | None = None) -> Values:
        if value is not None:
            setattr(z, name, bool(value))
        return (str(int(getattr(z, name))),)

    return handler


AXES: dict[str, Handler] = {
    **{name: _filter_value(place) for place, name in enumerate(FILTER)},
    "ABA": _aba,
    "ABV": _abv,
    "ABP": _abp,
    "STT": _stt,
    "WAI": _wai,
    "ACP": _acp,
    "DSP": _dsp,
    "AXIS": _axis,
    "ERL": _erl,
    "FLT": _flt,
    "FHM": _fhm,
    "CWT": _cwt,
    "WCNT": _number("reads"),
    "WTOL": _number("tolerance"),
    "WTMO": _number("timeout", "{:g}".format),
    "WMD": _switch("strict"),
    "ACU": _switch("updates"),
    "MOD": _switch("auto"),
    "NG": _number("index", "{:.9f}".format),
}
