"""Table of ZY commands: forms, effects, help.

A form is a list of parameters; the number of parameters selects the form of a command. `asks` lists the forms that do
not change the ranger. The sources name about sixty of eighty-one commands; those marked `chosen` are ours, for
functions of the ranger whose command the sources do not state (docs/formats/zy.md gives the reasons).
"""

import math
import re
from dataclasses import dataclass

from catseye.errors import InputError
from catseye.ranger.line import Request
from catseye.ranger.motion_units import LIMITS
from catseye.ranger.values import CommandParameter, Value

MOST_CUBES = 4096
LONGEST_PAGE = 128  # lines of one answer
FARTHEST_MM = 1e7
COUNTS_LIMIT = 2**30
ZERO = re.compile(r"[+-]?0{1,12}")
Form = tuple[CommandParameter, ...]


@dataclass(frozen=True)
class CommandRow:
    """A row of the table.

    name     as on the line, upper case
    forms    parameter lists; no two of one length
    asks     lengths of the forms that only query
    help     one line
    chosen   True if not in the sources
    """

    name: str
    forms: tuple[Form, ...]
    asks: frozenset[int]
    help: str
    chosen: bool = False

    @property
    def usage(self) -> str:
        """The forms as typed.

        >>> COMMANDS["ABV"].usage
        'ABV axis | ABV axis, velocity'
        """
        return " | ".join(f"{self.name} {', '.join(p.name for p in form)}".rstrip() for form in self.forms)

    def read(self, request: Request) -> tuple[Value, ...]:
        """Values of a request's parameters.

        request   of this command

        Raises InputError: no form with this number of parameters; a value of the wrong kind or outside its limits.

        >>> COMMANDS["ABP"].read(Request("ABP", ("0", "29000")))
        (0, 29000)
        """
        count = len(request.parameters)
        for form in self.forms:
            if len(form) == count:
                return tuple(p.read(self.name, text) for p, text in zip(form, request.parameters, strict=True))
        raise InputError(f"{self.name}: {count} parameters do not fit (expected {self.usage})")

    def only_asks(self, request: Request) -> bool:
        """True if a request of this command changes nothing."""
        return len(request.parameters) in self.asks


def _real(name: str, low: float = -FARTHEST_MM, high: float = FARTHEST_MM, unit: str = "mm") -> CommandParameter:
    return CommandParameter(name, "real", low, high, unit)


def _of(name: str, low: int, high: int, unit: str = "") -> CommandParameter:
    return CommandParameter(name, "whole", low, high, unit)


AXIS = _of("axis", 0, 1, "(0 azimuth, 1 elevation)")
SWITCH = _of("state", 0, 1, "(0 off, 1 on)")
CUBE = CommandParameter("cube", "cube")
XYZ = (_real("x_mm"), _real("y_mm"), _real("z_mm"))
PLACE = _of("place", 1, MOST_CUBES)
COUNTS = _real("counts", -COUNTS_LIMIT, COUNTS_LIMIT - 1, "counts")
TARGETS = tuple(_real(f"{axis}_counts", -COUNTS_LIMIT, COUNTS_LIMIT - 1, "counts") for axis in ("azimuth", "elevation"))
TURN = 2.0 * math.pi
PART = tuple(_real(f"{axis}_unit", -1.0, 1.0, "") for axis in "xyz")


def _chip(command: str) -> CommandParameter:
    limits = LIMITS[command]
    return CommandParameter(limits.name.replace(" ", "_"), "whole", limits.low, limits.high, limits.unit)


def _angles(count: int, name: str) -> Form:
    return tuple(_real(f"{name}{k}_rad", -TURN, TURN, "rad") for k in range(1, count + 1))


def _row(name: str, help_: str, *forms: Form, asks: tuple[int, ...] = (), chosen: bool = False) -> CommandRow:
    return CommandRow(name, forms or ((),), frozenset(asks), help_, chosen)


def _setting(name: str, help_: str, *values: CommandParameter, before: Form = (), chosen: bool = False) -> CommandRow:
    """Asked without its values, set with them."""
    return _row(name, help_, before, (*before, *values), asks=(len(before),), chosen=chosen)


ROWS = (
    _setting("ABA", "acceleration of an axis's next moves", _chip("ABA"), before=(AXIS,)),
    _setting("ABV", "velocity of an axis's next moves, at least the acceleration", _chip("ABV"), before=(AXIS,)),
    _row("ABP", "target of an axis's next move, which STT starts", (AXIS, _chip("ABP"))),
    _row("STT", "start the move of an axis", (AXIS,)),
    _row("WAI", "wait until the move of an axis is complete", (AXIS,)),
    _row("ACP", "actual position of an axis, counts", (AXIS,), asks=(1,)),
    _row("DSP", "desired position of an axis, counts", (AXIS,), asks=(1,)),
    _setting("AXIS", "amplifier of an axis, off at boot", SWITCH, before=(AXIS,)),
    _setting("ERL", "position error past which the motor goes off until the next move", _chip("ERL"), before=(AXIS,)),
    _row("FHM", "find the index of an axis and call it zero", (AXIS,)),
    *(
        _setting(name, f"{LIMITS[name].name} of an axis's filter", _chip(name), before=(AXIS,))
        for name in ("FKP", "FKI", "FKD", "FIL", "FSI")
    ),
    _setting(
        "FLT", "all five values of an axis's filter", *map(_chip, ("FKP", "FKI", "FKD", "FIL", "FSI")), before=(AXIS,)
    ),
    _row("CWT", "wait until both servos have settled on a cube", (CUBE,)),
    _setting("WCNT", "reads in a row within WTOL that CWT wants", _of("reads", 1, 10_000)),
    _setting("WTOL", "tolerance of CWT", _of("tolerance", 0, 25_000, "counts")),
    _setting("WTMO", "longest wait of CWT", _real("timeout_s", 0.001, 3600.0, "s")),
    _setting("WMD", "1: a timeout of CWT fails; 0: it still succeeds", SWITCH),
    _setting("ACU", "automatic updates", SWITCH),
    _row("AMP", "last amplitude of a cube, V", (CUBE,), asks=(1,)),
    _row("PHI", "last phase of a cube, rad", (CUBE,), asks=(1,)),
    _row("DST", "last distance of a cube, mm; of a benchmark the group index", (CUBE,), asks=(1,)),
    _setting("AZM", "azimuth encoder value of a cube", COUNTS, before=(CUBE,)),
    _setting("ELV", "elevation encoder value of a cube", COUNTS, before=(CUBE,)),
    _setting("ALPHA", "monument angles", *_angles(3, "alpha")),
    _setting("BETA", "mirror angles", *_angles(2, "beta")),
    _setting("MO", "mirror offsets", *(_real(f"d{axis}_mm", -2000.0, 2000.0) for axis in "xyz")),
    _setting("BP", "base point: the monument's fixed point", *XYZ),
    _setting(
        "EZ",
        "encoder zeros",
        *(_real(f"{axis}_zero_counts", -1e6, 1e6, "counts") for axis in ("azimuth", "elevation")),
    ),
    _row("CIL", "illuminate a cube, or a point given with it", (CUBE,), (CUBE, *TARGETS), (CUBE, *XYZ)),
    _row("CMEAS", "measure a cube: f = 1 points first, 2 measures at once", (_of("f", 1, 2), CUBE)),
    _row(
        "COO",
        "cubes: list them by pages, ask one, move it, create or replace it",
        (),
        (CUBE,),
        (_of("first", 0, MOST_CUBES), _of("count", 1, LONGEST_PAGE)),
        (CUBE, *XYZ),
        (CUBE, *XYZ, CommandParameter("cube_name", "name")),
        asks=(0, 1, 2),
    ),
    _row("INI", "allocate n cubes, dropping all present ones", (_of("cubes", 0, MOST_CUBES),)),
    _setting("CYC", "cycles of a buffer", _of("cycles", 1, 65_536)),
    _setting("SFQ", "samples of a cycle", _of("samples", 3, 65_536)),
    _setting("IFF", "intermediate frequency", _of("frequency_hz", 1, 10_000, "Hz")),
    _setting("D0", "distance of the reference cube", _real("d0_mm", 0.0, 1000.0)),
    _row("TRG", "take a buffer"),
    _row("MPC", "compute amplitude and phase of the buffer"),
    _row("RAD", "phase of the buffer, rad", asks=(0,)),
    _row("MAG", "amplitude of the buffer, V", asks=(0,)),
    _row(
        "SEQ",
        "amplitude and phase of each cycle of the buffer, a line each, by pages",
        (),
        (_of("first", 1, 65_536), _of("count", 1, LONGEST_PAGE)),
        asks=(0, 2),
    ),
    _setting("NUM", "cubes in the scan list", _of("number", 0, MOST_CUBES)),
    _setting("ORD", "which cube stands at a place of the scan list", CUBE, before=(PLACE,)),
    _row(
        "SCN",
        "scan: ask, stop (0) or start (1), from a time on, so many rounds",
        (),
        (SWITCH,),
        (SWITCH, CommandParameter("start_mjd", "stamp")),
        (SWITCH, CommandParameter("start_mjd", "stamp"), _of("rounds", 0, 1_000_000)),
        asks=(0,),
    ),
    _row("STW", "status word", asks=(0,)),
    _row("VER", "name and version", asks=(0,)),
    _row("STI", "set the clock", (), (CommandParameter("mjd", "stamp"),), asks=(0,)),
    _row("RST", "cold boot: everything as when power comes on"),
    _row("PS", "power supplies, V; or the laser's power on and off", (), (SWITCH,), asks=(0,)),
    _row("INITZY", "run the initialisation files"),
    _row("ENTEMP", "temperature in the enclosure, Celsius", asks=(0,)),
    _row("BYE", "close this connection"),
    _setting("MOD", "mode: 1 Auto, 0 by hand", SWITCH, chosen=True),
    _setting("NG", "group index of air that distances are computed with", _real("index", 1.0, 1.001, ""), chosen=True),
    _row(
        "KND",
        "kind of a cube: S standard with its constant, B benchmark with its certified distance",
        (CUBE,),
        (CUBE, CommandParameter("kind", "name"), _real("value_mm")),
        asks=(1,),
        chosen=True,
    ),
    _setting("SUN", "unit vector to the Sun, ground frame", *PART, chosen=True),
    _row(
        "TRK",
        "follow a cube from x0 at t0 to x1 at t1",
        (
            CUBE,
            CommandParameter("t0_mjd", "stamp"),
            *(_real(f"{axis}0_mm") for axis in "xyz"),
            CommandParameter("t1_mjd", "stamp"),
            *(_real(f"{axis}1_mm") for axis in "xyz"),
        ),
        chosen=True,
    ),
    _row(
        "BUF", "the buffer itself: cube, cycles, samples, Hz, V a code, CRC-32, base64 of int16", asks=(0,), chosen=True
    ),
    _row(
        "STM",
        "stream: measure the cube that the beam is on count times without a gap, CMEAS and BUF of each; 0 stops",
        (CUBE, _of("count", 0, 1_000_000)),
        chosen=True,
    ),
    _row(
        "LEASE",
        "ask the holder; take it by a name, from any holder; renew it with its token; none gives it back",
        (),
        (CommandParameter("holder", "name"),),
        (CommandParameter("holder", "name"), CommandParameter("token", "text")),
        asks=(0, 1, 2),
        chosen=True,
    ),
    _row("STOP", "at once, from any connection: laser and motors off, everything stops", chosen=True),
    _row("LATCH", "the latched stop order from outside the lease", asks=(0,), chosen=True),
    _row(
        "UNLATCH",
        "clear that order, with the name of a person who does not hold the lease",
        (CommandParameter("person", "name"),),
        asks=(1,),
        chosen=True,
    ),
    _row("LST", "scheduled commands of this connection", asks=(0,), chosen=True),
    _row("CLR", "clear the scheduled commands of this connection", chosen=True),
    _row(
        "HLP", "commands, or one command's forms", (), (CommandParameter("command", "name"),), asks=(0, 1), chosen=True
    ),
    _row("HELP", "the same as HLP", (), (CommandParameter("command", "name"),), asks=(0, 1), chosen=True),
)
COMMANDS = {row.name: row for row in ROWS}
UNSCHEDULED = ("AT", "BYE", "RST", "INITZY", "LEASE", "UNLATCH")
WORDS = frozenset([*COMMANDS, "AT", "KEY"])  # allowed first words of a connection


def stops(request: Request) -> bool:
    """True for a request that stops or switches light off.

    It passes every queue and needs no lease.

    >>> [stops(Request(*words)) for words in (("PS", ("0",)), ("PS", ("1",)), ("STOP",), ("AXIS", ("0", "0")))]
    [True, False, True, True]
    """
    if request.command == "STOP":
        return not request.parameters
    count = {"PS": 1, "SCN": 1, "AXIS": 2, "STM": 2}.get(request.command)
    return len(request.parameters) == count and ZERO.fullmatch(request.parameters[-1]) is not None


def undoes(request: Request, stop: Request) -> bool:
    """True if a waiting request would undo a later stop.

    >>> undoes(Request("PS", ("1",)), Request("PS", ("0",))), undoes(Request("PS"), Request("PS", ("0",)))
    (True, False)
    """
    if request.command == "AT":
        try:
            return undoes(schedule_of(request.parameters)[3], stop)
        except InputError:
            return False
    if request.command != stop.command or stops(request) or COMMANDS[request.command].only_asks(request):
        return False
    return request.command != "AXIS" or request.parameters[:1] == stop.parameters[:1]


def schedule_of(parameters: tuple[str, ...]) -> tuple[int, int, float, Request]:
    """Start in ticks (0: at once), repeats, interval in s, and AT's command.

    parameters   of the line

    Raises InputError: too few, outside limits, or a command that cannot be scheduled.

    >>> schedule_of(("0", "10", "0.5", "CMEAS 1", "17"))[3]
    Request(command='CMEAS', parameters=('1', '17'), tid=0, ticks=None)
    """
    if len(parameters) < 4:
        raise InputError(
            f"AT: {len(parameters)} parameters do not fit (expected AT start, repeats, interval, CMD P1, ...)"
        )
    start = CommandParameter("start_mjd", "stamp").read("AT", parameters[0])
    repeats = _of("repeats", 1, 1_000_000).read("AT", parameters[1])
    interval = _real("interval_s", 0.0, 86_400.0, "s").read("AT", parameters[2])
    word, _, first = parameters[3].partition(" ")
    parts = tuple(part for part in (first.strip(" "), *parameters[4:]) if part)
    name = word.upper()
    if name in UNSCHEDULED or name not in COMMANDS:
        raise InputError(f"AT: {word!a} cannot be scheduled (expected a command other than {', '.join(UNSCHEDULED)})")
    request = Request(name, parts)
    COMMANDS[name].read(request)
    return int(start), int(repeats), float(interval), request
