"""Lines of the ZY language: requests, replies, stamps, comments.

Text in, values out; no socket, no clock.

    request   [TID<TAB>[TS<TAB>]]CMD[ P1[, P2 ...]]
    reply     TID<TAB>TS<TAB>CMD f[, P1, ...]       f = 1 or 0; after 0 comes a text, which may hold commas

Lines are printable ASCII. Commands are case-insensitive. A stamp is an MJD with eight decimals; internally it is a
whole number of *ticks*, 1e-8 day = 864 000 ns, so that it compares and travels without loss. Open in the sources and
chosen here: the meaning of a request's stamp (docs/formats/zy.md), the limits of length, and that every line of the ZY,
greeting included, carries TID and stamp; a greeting without them is accepted, too.
"""

import re
from collections.abc import Container
from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError, ValidityError
from catseye.geometry.sky.time_tag import PER_DAY, TimeTag

TICKS_PER_DAY = 10**8
TICK_NS = PER_DAY // TICKS_PER_DAY  # 864 000, exact
LAST_TID = 2**32 - 1
FIRST_CLIENT_TID = 1000  # 0 to 999 belong to the ZY
LONGEST_REQUEST = 1024  # bytes without the line's end
LONGEST_REPLY = 2**18  # a buffer of 65 536 samples in base64 has 174 764
MOST_PARAMETERS = 32
LONG = 512  # characters, above which arrays are faster than str
COMMAND = re.compile(r"[A-Za-z][A-Za-z0-9]{0,15}")
STAMP = re.compile(r"([0-9]{1,5})\.([0-9]{8})")  # the form that programs write
DIGITS = re.compile(r"[0-9]{1,10}")
STATEMENTS = ("HELLO", "UNKNOWN")  # a text follows, no f


@dataclass(frozen=True)
class Request:
    """A client's request; `tid` 0 and `ticks` None if not given."""

    command: str
    parameters: tuple[str, ...] = ()
    tid: int = 0
    ticks: int | None = None


@dataclass(frozen=True)
class Reply:
    """A ranger's reply; `ok` is f, None for HELLO and UNKNOWN.

    `values` is one text if f is not 1. `ticks` is None only for a greeting without a stamp.
    """

    command: str
    ok: bool | None
    values: tuple[str, ...] = ()
    tid: int = 0
    ticks: int | None = 0

    @property
    def text(self) -> str:
        """Error text or statement; otherwise the values in a row."""
        return ", ".join(self.values)


def ticks_of(tag: TimeTag) -> int:
    """Nearest stamp to an instant, in ticks of 1e-8 day since MJD 0.

    tag   one instant

    >>> ticks_of(TimeTag.parse("52889.12500000432"))
    5288912500000
    """
    return nanoseconds_to_ticks(nanoseconds_of(tag))


def nanoseconds_of(tag: TimeTag) -> int:
    """Whole nanoseconds since MJD 0 of one instant, exact."""
    return int(tag.day) * PER_DAY + int(tag.nanoseconds)


def nanoseconds_to_ticks(nanoseconds: int) -> int:
    """Nearest tick of whole nanoseconds, halves up."""
    return (2 * nanoseconds + TICK_NS) // (2 * TICK_NS)


def tag_of(ticks: int) -> TimeTag:
    """Instant of a stamp, exact: a tick is 864 000 ns."""
    day, ticks_of_day = divmod(ticks, TICKS_PER_DAY)
    return TimeTag(np.asarray(day), np.asarray(ticks_of_day * TICK_NS))


def stamp_text(ticks: int) -> str:
    """Text of a stamp, as sent.

    >>> stamp_text(5288912500000)
    '52889.12500000'
    """
    day, ticks_of_day = divmod(ticks, TICKS_PER_DAY)
    return f"{day}.{ticks_of_day:08d}"


def parse_stamp(text: str) -> int:
    """Ticks of a decimal MJD, rounded to the nearest tick.

    text   such as 52889.12500000

    Raises InputError: not an MJD of 0 to 106 000.
    """
    usual = STAMP.fullmatch(text)
    if usual is not None:
        return int(usual[1]) * TICKS_PER_DAY + int(usual[2])
    try:
        return ticks_of(TimeTag.parse(text))
    except ValidityError as problem:
        raise InputError(f"stamp {_quoted(text)} is not an MJD (expected digits such as 52889.12500000)") from problem


def parse_request(line: str) -> Request | None:
    """Request of a line without its end; None for an empty line.

    line   [TID<TAB>[TS<TAB>]]CMD[ P1[, P2 ...]]

    Raises InputError: too long, not ASCII, no command, an invalid TID or stamp, too many or empty parameters, a
    semicolon (a comment in files; on the wire one line is one command).

    >>> parse_request("1000\\tcmeas 1, 17")
    Request(command='CMEAS', parameters=('1', '17'), tid=1000, ticks=None)
    """
    if len(line) > LONGEST_REQUEST:
        raise InputError(f"line of {len(line)} characters is too long (expected at most {LONGEST_REQUEST})")
    if not line.strip(" \t"):
        return None
    *head, body = line.split("\t")
    if len(head) > 2:
        raise InputError(f"line has {len(head)} tabs (expected [TID<TAB>[TS<TAB>]]CMD parameters)")
    tid = _tid(head[0]) if head else 0
    ticks = parse_stamp(head[1]) if len(head) == 2 else None
    if ";" in body:
        raise InputError("';' begins a comment in files only (expected one command a line)")
    _printable(body)
    command, parameters = _body(body)
    values = tuple(part.strip(" ") for part in parameters.split(",")) if parameters else ()
    if len(values) > MOST_PARAMETERS:
        raise InputError(f"{command}: {len(values)} parameters (expected at most {MOST_PARAMETERS})")
    if "" in values:
        raise InputError(f"{command}: parameter {values.index('') + 1} is empty (expected a value between commas)")
    return Request(command, values, tid, ticks)


def format_request(request: Request) -> str:
    """Line of a request, without its end.

    request   with values without comma, tab, semicolon, line end, or blanks at their ends

    Raises InputError if the line would not be parsed back to the same.

    >>> format_request(Request("CMEAS", ("1", "17"), 1000))
    '1000\\tCMEAS 1, 17'
    """
    head = ""
    if request.tid or request.ticks is not None:
        head = f"{request.tid}\t" + ("" if request.ticks is None else f"{stamp_text(request.ticks)}\t")
    line = head + request.command + (" " + ", ".join(request.parameters) if request.parameters else "")
    if parse_request(line) != request:
        raise InputError(f"request {_quoted(line)} contains separators (expected plain values without , ; or tab)")
    return line


def parse_reply(line: str) -> Reply | None:
    """Reply of a line without its end; None for a keep-alive.

    line   TID<TAB>TS<TAB>CMD f[, P1, ...]; HELLO and CONNECT also without TID and stamp

    Raises InputError: too long, not ASCII, no such form.

    >>> parse_reply("0\\t52889.12500000\\tBYE 1, 5240, Closing Connection").values
    ('5240', 'Closing Connection')
    """
    if len(line) > LONGEST_REPLY:
        raise InputError(f"reply of {len(line)} characters is too long (expected at most {LONGEST_REPLY})")
    if not line.strip(" \t"):
        return None
    *head, body = line.split("\t")
    _printable(body)
    command, body_text = _body(body)
    if len(head) != 2 and (head or command not in ("HELLO", "CONNECT")):
        raise InputError(f"reply {_quoted(line)} has {len(head)} tabs (expected TID<TAB>TS<TAB>CMD f, ...)")
    tid, ticks = (_tid(head[0]), parse_stamp(head[1])) if head else (0, None)
    if command in STATEMENTS:
        return Reply(command, None, (body_text,) if body_text else (), tid, ticks)
    flag, comma, values = body_text.partition(",")
    if flag.strip(" ") not in ("0", "1"):
        raise InputError(f"reply {_quoted(line)}: {_quoted(flag)} is neither 1 nor 0")
    ok = flag.strip(" ") == "1"
    if not comma:
        return Reply(command, ok, (), tid, ticks)
    parts = tuple(part.strip(" ") for part in values.split(",")) if ok else (values.strip(" "),)
    return Reply(command, ok, parts, tid, ticks)


def format_reply(reply: Reply) -> str:
    """Line of a reply, without its end.

    reply   with a stamp

    Raises InputError if the line would not be parsed back to the same.

    >>> format_reply(Reply("DST", True, ("17", "108453.287"), 1000, 5288912500000))
    '1000\\t52889.12500000\\tDST 1, 17, 108453.287'
    """
    if reply.ok is None:
        words = [f"{reply.command} {reply.text}"] if reply.values else [reply.command]
    else:
        words = [f"{reply.command} {int(reply.ok)}", *reply.values]
    line = f"{reply.tid}\t{stamp_text(reply.ticks or 0)}\t" + ", ".join(words)
    if parse_reply(line) != reply:
        raise InputError(f"reply {_quoted(line)} contains separators (expected plain values without , or tab)")
    return line


def commands_of_file(text: str, name: str, skipped: Container[str] = ()) -> list[tuple[int, Request]]:
    """Commands of an initialisation file with line numbers, without comments.

    text      of the file
    name      of the file, for messages
    skipped   lines that are not read

    Raises InputError with the unreadable line.

    >>> commands_of_file("; cubes\\nINI 40 ; places\\n\\nD0 181.2\\n", "CUBES.INI")[1]
    (4, Request(command='D0', parameters=('181.2',), tid=0, ticks=None))
    """
    commands = []
    for number, line in enumerate(text.splitlines(), 1):
        if line in skipped:
            continue
        try:
            request = parse_request(line.partition(";")[0].strip())
        except InputError as problem:
            raise InputError(f"{name} line {number}: {problem}") from problem
        if request is not None:
            commands.append((number, request))
    return commands


def next_tid(tid: int) -> int:
    """Next TID of a client: 1000 to 4 294 967 295, then 1000 again.

    >>> next_tid(4_294_967_295)
    1000
    """
    return tid + 1 if FIRST_CLIENT_TID <= tid < LAST_TID else FIRST_CLIENT_TID


def _tid(text: str) -> int:
    word = text.strip(" ")
    if not DIGITS.fullmatch(word) or int(word) > LAST_TID:
        raise InputError(f"TID {_quoted(text)} is not a whole number of 0 to {LAST_TID}")
    return int(word)


def _printable(body: str) -> None:
    if not body.isascii() or not (_all_printable(body) if len(body) > LONG else body.isprintable()):
        at = next(i for i, letter in enumerate(body) if not " " <= letter <= "~")
        raise InputError(f"character {at + 1} is {body[at]!a} (expected printable ASCII)")


def _all_printable(body: str) -> bool:
    """True for printable ASCII, ten times as fast as `isprintable` for long lines."""
    codes = np.frombuffer(body.encode("ascii"), dtype=np.uint8)
    return bool(codes.min() >= ord(" ") and codes.max() <= ord("~"))


def _body(body: str) -> tuple[str, str]:
    word, _, parameters = body.strip(" ").partition(" ")
    if not COMMAND.fullmatch(word):
        raise InputError(f"{_quoted(word)} is not a command (expected a letter, then at most 15 letters and digits)")
    return word.upper(), parameters.strip(" ")


def _quoted(text: str) -> str:
    return ascii(text if len(text) <= 40 else f"{text[:40]}...")
