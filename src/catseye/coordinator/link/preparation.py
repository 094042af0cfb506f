"""Make a ranger ready from the site's records, sending only what is missing.

That is geometry and cubes, amplifiers, home, laser. The last cube of the list is a mark: its name is a hash of all that
was sent. A ranger that still has it, and whose geometry reads back the same, needs nothing again, whoever asks: this
coordinator after a cut, or the next one.
"""

import asyncio
import hashlib
from collections.abc import Awaitable, Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

from catseye.coordinator.link.decode import reals_of
from catseye.errors import InputError, ValidityError
from catseye.ranger.commands import MOST_CUBES
from catseye.ranger.head import SamplingSettings
from catseye.ranger.line import Reply, Request
from catseye.ranger.status import StatusWord
from catseye.records.site.folder import REFERENCE

BATCH = 48  # requests outstanding together: fewer than a ZY queues
READ_BACK = {  # half of the last digit of each reply
    **dict.fromkeys(("BP", "MO", "EZ", "AZM", "ELV"), 5.1e-4),
    "D0": 5.1e-5,
    "ALPHA": 5.1e-8,
    "BETA": 5.1e-8,
}
OF_A_CUBE = {"AZM": ("0",), "ELV": ("0",)}  # ZRG's, the only ones that are set
HOMING_TIMEOUT = 35.0  # s an axis: a ZY gives up after 30
PATIENCE = 30.0  # s for a reply while many are outstanding
SETTLED_COUNTS = 1  # WTOL: a count of azimuth is 7.5 mm at 120 m, and a beam some 14 mm
SETTLE_S = 5.0  # WTMO: a mirror that has not settled by then is stuck
Ask = Callable[[Request, float], Awaitable[Reply]]


class Refused(InputError):
    """Refusal by the guard or the ranger.

    `kind` is that of the event.
    """

    def __init__(self, kind: str, text: str):
        super().__init__(text)
        self.kind = kind


@dataclass(frozen=True)
class Preparation:
    """Commands that make a ranger ready to measure.

    requests   from the records, including the mark
    numbers    of cubes by name, including ZRG
    mark       number and name of the marking cube; None if there was no room for it
    on_demand  by number of a cube: its commands, sent before its first shot
    """

    requests: tuple[Request, ...]
    numbers: dict[str, int]
    mark: tuple[int, str] | None
    on_demand: dict[int, tuple[Request, ...]]

    @staticmethod
    def of(commands: Sequence[Request], later: Collection[str] = ()) -> "Preparation":
        """Preparation from the records' commands (`ranger.initialisation`).

        They begin with INI; then COO n, x, y, z, name.

        later   names of cubes sent on demand: there are thousands on a dish, and a ZY reads 200 lines a second

        >>> Preparation.of([Request("INI", ("1",)), Request("COO", ("1", "0", "9", "0", "ZG11"))]).numbers
        {'ZRG': 0, 'ZG11': 1}
        """
        numbers = {REFERENCE: 0}
        for request in commands:
            if request.command == "COO" and len(request.parameters) == 5:
                numbers[request.parameters[4]] = int(request.parameters[0])
        room = [int(r.parameters[0]) for r in commands if r.command == "INI"]
        wait = {str(numbers[name]) for name in later if name in numbers}
        on_demand: dict[int, tuple[Request, ...]] = {}
        immediate: list[Request] = []
        for request in commands:
            if request.command in ("COO", "KND") and len(request.parameters) > 1 and request.parameters[0] in wait:
                number = int(request.parameters[0])
                on_demand[number] = (*on_demand.get(number, ()), request)
            else:
                immediate.append(request)
        if len(room) != 1 or room[0] >= MOST_CUBES:
            return Preparation(tuple(immediate), numbers, None, on_demand)
        lines = "\n".join(f"{r.command} {','.join(r.parameters)}" for r in commands)
        mark = room[0] + 1, "H" + hashlib.sha256(lines.encode("ascii", "replace")).hexdigest()[:14]
        more = [replace(r, parameters=(str(mark[0]),)) if r.command == "INI" else r for r in immediate]
        last = Request("COO", (str(mark[0]), "0", "0", "0", mark[1]))
        return Preparation((*more, last), numbers, mark, on_demand)

    def same(self, replies: dict[str, Reply]) -> bool:
        """True if the ranger has this preparation already.

        replies   to COO of the mark and to the geometry
        """
        if self.mark is None or replies["COO"].ok is not True:
            return False
        if replies["COO"].values[1:2] != (self.mark[1],):
            return False
        for request in self.requests:
            limit = READ_BACK.get(request.command)
            if limit is None or not request.parameters:
                continue
            try:
                values = reals_of(replies[request.command], len(request.parameters))
            except InputError:
                return False
            expected = [float(p) for p in request.parameters]
            if any(abs(a - b) > limit for a, b in zip(values, expected, strict=True)):
                return False
        return True

    @property
    def questions(self) -> tuple[Request, ...]:
        """Requests whose replies `same` needs."""
        mark = () if self.mark is None else (Request("COO", (str(self.mark[0]),)),)
        commands = {r.command for r in self.requests}
        return (*mark, *(Request(name, OF_A_CUBE.get(name, ())) for name in READ_BACK if name in commands))


async def prepare(ask: Ask, preparation: Preparation, status: Callable[[], StatusWord]) -> bool:
    """Send a ranger what it lacks; True if records were sent.

    ask      sends a request past the guard and returns its reply: (request, s)
    status   its last status word

    Raises Refused: a command, or the search for an index.
    """
    sent = False
    if not (status() & StatusWord.INITIALISED and await _has_it(ask, preparation)):
        sent = True
        for at in range(0, len(preparation.requests), BATCH):
            await _all(ask, preparation.requests[at : at + BATCH])
    settling = [("WMD", "1"), ("WTOL", f"{SETTLED_COUNTS}"), ("WTMO", f"{SETTLE_S:g}"), ("MOD", "1")]
    await _all(ask, [Request(name, (value,)) for name, value in settling])
    await _axes(ask, status)
    return sent


async def sampling_of(ask: Ask) -> SamplingSettings:
    """Sampling settings of a ranger, queried."""
    cycles, samples, frequency = [
        int(reals_of(await ask(Request(name), PATIENCE), 1)[0]) for name in ("CYC", "SFQ", "IFF")
    ]
    return SamplingSettings(samples, cycles, frequency)


def sampling_requests(before: SamplingSettings, after: SamplingSettings) -> tuple[Request, ...]:
    """CYC, SFQ and IFF from one sampling to another, in an order in which a ranger refuses none.

    >>> [r.command for r in sampling_requests(SamplingSettings(), SamplingSettings(16, 1200, 2000))]
    ['SFQ', 'CYC', 'IFF']
    """
    old, new = ((("CYC", s.cycles), ("SFQ", s.samples), ("IFF", s.frequency_hz)) for s in (before, after))
    changed = [pair for pair in new if pair not in old]
    for order in permutations(changed):
        values = dict(old)
        try:
            for name, value in order:
                values[name] = value
                SamplingSettings(values["SFQ"], values["CYC"], values["IFF"])
        except ValidityError:
            continue
        return tuple(Request(name, (str(value),)) for name, value in order)
    shortest = (("CYC", 1), ("IFF", 1), ("SFQ", after.samples), ("IFF", after.frequency_hz), ("CYC", after.cycles))
    return tuple(Request(name, (str(value),)) for name, value in shortest)


async def counts_of(ask: Ask) -> tuple[float, float]:
    """Position of a mirror, counts, queried."""
    first, second = [await ask(Request("ACP", (axis,)), PATIENCE) for axis in "01"]
    return reals_of(first, 1)[0], reals_of(second, 1)[0]


async def _has_it(ask: Ask, preparation: Preparation) -> bool:
    if preparation.mark is None:
        return False
    replies = {question.command: await ask(question, PATIENCE) for question in preparation.questions}
    return preparation.same(replies)


async def _all(ask: Ask, requests: Sequence[Request]) -> None:
    """Send requests together and wait for all replies.

    asyncio keeps their order, and so does a ZY.
    """
    for request, reply in zip(requests, await asyncio.gather(*(ask(r, PATIENCE) for r in requests)), strict=True):
        if reply.ok is not True:
            line = f"{request.command} {', '.join(request.parameters)}"
            raise Refused("not-initialised", f"{line[:60]} was refused: {reply.text[:120]}")


async def _axes(ask: Ask, status: Callable[[], StatusWord]) -> None:
    """Enable amplifiers and home both axes.

    The laser is off meanwhile, since the search may cross the Sun.
    """
    word = status()
    for axis, on in enumerate((StatusWord.AZIMUTH_ENABLED, StatusWord.ELEVATION_ENABLED)):
        if not word & on:
            await _all(ask, [Request("AXIS", (str(axis), "1"))])
    unhomed = [k for k, home in enumerate((StatusWord.AZIMUTH_HOMED, StatusWord.ELEVATION_HOMED)) if not word & home]
    if not unhomed:
        return
    if not word & StatusWord.LASER_OFF:
        await _all(ask, [Request("PS", ("0",))])
    for axis in unhomed:
        reply = await ask(Request("FHM", (str(axis),)), HOMING_TIMEOUT)
        if reply.ok is not True:
            raise Refused("lost-index", f"axis {axis}: {reply.text[:160]} (index not found: check the encoder)")
