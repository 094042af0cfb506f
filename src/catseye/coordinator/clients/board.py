"""Commands of the coordinator's clients: functions that return rows."""

from collections.abc import Callable, Iterable, Mapping
from typing import cast

from catseye.coordinator.control.bindings import SiteControl, coordinator_parameters
from catseye.coordinator.control.parameters import Parameters
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.journal.entries import Entry
from catseye.coordinator.modes import mode_of
from catseye.coordinator.samplers.columns import COLUMNS
from catseye.coordinator.samplers.corrections import FRAME, NO_ZERO, PIVOT, CorrectionOutput
from catseye.coordinator.samplers.health import health_row
from catseye.coordinator.samplers.pose_rows import Row
from catseye.coordinator.samplers.rings import PARAMETERS_ACTIVE, RING_LENGTH, Samplers, plain
from catseye.coordinator.samplers.surface import SurfaceWatch
from catseye.coordinator.ziy import Coordinator
from catseye.errors import InputError
from catseye.ranger.line import Request, stamp_text
from catseye.records.night.live import Severity

VERSION = "1"
MOST_PLANNED = 100  # shots of each ranger
Rows = Iterable[tuple[str, ...]]
HELP = {
    "STATUS": (
        "STATUS",
        "mode; rangers ready; shots numbered; shots acknowledged; round; telescope; journal; site; last epoch; clock; "
        "disk; holder of the lease; problems",
    ),
    "RANGERS": (
        "RANGERS",
        "a line each: name; state; shots; failures in a row; target streamed; last status; trouble; condition",
    ),
    "PARAMETERS": (
        "PARAMETERS",
        "a line each: name; value; value that waits; legal values; unit; what it changes; meaning; its stage",
    ),
    "INTERLOCKS": (
        "INTERLOCKS",
        "a line each: parameters compared; rule; refusal of what waits, or none",
    ),
    "SET": ("SET name, value", "check a parameter's value and store it until START"),
    "PREPARE": ("PREPARE", "check all values that wait, together"),
    "START": ("START", "activate the prepared values, at the next round's begin"),
    "DISCARD": ("DISCARD", "forget the values that wait and are not started"),
    "REFERENCE": (
        "REFERENCE | REFERENCE NOW",
        "zero of corrections: epoch; MJD; azimuth; elevation; moves since; frame; pivot; NOW: by the last epoch",
    ),
    "MOVED": ("MOVED actuator, value, unit, name", "record a move of another actuator, as a person or a program"),
    "SAMPLERS": ("SAMPLERS", "a line each: name; values kept; what a value holds"),
    "SAMPLER": ("SAMPLER name | SAMPLER name, n", "the last n values, a line each, oldest first"),
    "SUBSCRIBE": ("SUBSCRIBE | SUBSCRIBE kind, ...", "push SHOT EPOCH EVENT POSTURE WEATHER; NONE ends it"),
    "MODE": ("MODE | MODE mode", "active, passive, hold"),
    "DROP": ("DROP ranger", "leave a ranger out; it stays connected"),
    "TAKE": ("TAKE ranger", "use a ranger again"),
    "STREAM": ("STREAM ranger, target | STREAM ranger", "one target repeatedly; without a target it ends"),
    "CLOCK": (
        "CLOCK | CLOCK ACCEPT",
        "s that its machine's UTC is ahead; kernel's state; trouble; ACCEPT adopts it",
    ),
    "PLAN": ("PLAN | PLAN n", "the next n shots of each ranger, a line each: ranger; begin; target; s; reason"),
    "SUN": ("SUN", "azimuth; elevation; half angle of the cone, rad; avoided, or set"),
    "ALARMS": ("ALARMS", "a line each: id; severity; since; acknowledged by; at; shelved by; until; text"),
    "ACK": ("ACK id, name", "acknowledge an alarm, as a person"),
    "SHELVE": ("SHELVE id, minutes, name", "shelve an alarm for some time, as a person"),
    "UNSHELVE": ("UNSHELVE id, name", "end an alarm's shelving, as a person"),
    "LEASE": ("LEASE | LEASE name | LEASE none", "ask the holder; take it by a name; give it back"),
    "VER": ("VER", "name and version; sent after a command of many lines it marks their end"),
    "HLP": ("HLP | HLP command", "commands, or one command's forms; HELP is the same"),
    "BYE": ("BYE", "close this connection"),
}
ALIASES = {"HELP": "HLP"}


class Board:
    """A coordinator's commands, parameters and samplers."""

    def __init__(self, coordinator: Coordinator, control: SiteControl | None = None):
        self._ziy = coordinator
        self.samplers = Samplers()
        self.corrections = CorrectionOutput(lambda: coordinator.gives_corrections)
        self.surface = SurfaceWatch(coordinator.site, lambda row: self.samplers.put("SURFACE", row))
        coordinator.health_listeners.append(lambda health: self.samplers.put("HEALTH", health_row(health)))
        self._control = control
        own = coordinator_parameters(coordinator)
        log = EventLog("parameters", coordinator.clock, coordinator.tell)

        def tell(text: str, values: Mapping[str, str], active: bool) -> None:
            kind, severity = ("parameters", "note") if active else ("parameters-refused", "alarm")
            log.tell(kind, text, cast(Severity, severity), always=True, **values)

        def activated(values: Mapping[str, str]) -> None:
            text = "; ".join(f"{name} = {value}" for name, value in values.items())
            log.tell(PARAMETERS_ACTIVE, f"active from this round on: {text}", "debug", always=True, **values)

        if control is None:
            self.parameters = Parameters(own, tell=tell, activated=activated)
        else:
            everything = (*own, *control.parameters)
            self.parameters = Parameters(
                everything, refuse=control.refuse, adopt=control.adopt, tell=tell, activated=activated
            )
        coordinator.at_border.append(self.parameters.border)
        self._commands: dict[str, tuple[tuple[int, ...], Callable[[tuple[str, ...]], Rows]]] = {
            "STATUS": ((0,), lambda _: self._status()),
            "RANGERS": ((0,), lambda _: self._rangers()),
            "PARAMETERS": ((0,), lambda _: self._parameters()),
            "INTERLOCKS": ((0,), lambda _: self._interlocks()),
            "SET": ((2,), lambda words: self._set(*words)),
            "PREPARE": ((0,), lambda _: [(str(self.parameters.prepare()),)]),
            "START": ((0,), lambda _: [(str(self.parameters.start()),)]),
            "REFERENCE": ((0, 1), lambda words: self._reference(*words)),
            "MOVED": ((4,), lambda words: self._moved(*words)),
            "DISCARD": ((0,), lambda _: [(str(self.parameters.discard()),)]),
            "SAMPLERS": ((0,), lambda _: self._samplers()),
            "SAMPLER": ((1, 2), lambda words: self._sampler(*words)),
            "MODE": ((0, 1), lambda words: self._mode(*words)),
            "DROP": ((1,), lambda words: self._applied(coordinator.drop, *words)),
            "TAKE": ((1,), lambda words: self._applied(coordinator.take, *words)),
            "STREAM": ((1, 2), lambda words: self._stream(*words)),
            "CLOCK": ((0, 1), lambda words: self._clock(*words)),
            "PLAN": ((0, 1), lambda words: self._plan(*words)),
            "SUN": ((0,), lambda _: self._sun()),
            "ALARMS": ((0,), lambda _: self._alarms()),
            "ACK": ((2,), lambda words: self._acknowledge(*words)),
            "SHELVE": ((3,), lambda words: self._shelve(*words)),
            "UNSHELVE": ((2,), lambda words: self._unshelve(*words)),
            "VER": ((0,), lambda _: [("ZIY", VERSION)]),
            "HLP": ((0, 1), lambda words: self._help(*words)),
        }

    def entry(self, entry: Entry) -> list[tuple[str, Row]]:
        """Store a durable entry in the samplers; its rows by sampler, without points."""
        rows = self.samplers.add(entry)
        row = self.corrections.row(entry)
        if row is not None:
            self.samplers.put("CORRECTIONS", row)
            rows.append(("CORRECTIONS", row))
        self.surface.entry(entry)
        return rows

    def rows(self, request: Request) -> Rows | None:
        """Rows of the answer to a request; None for an unknown command.

        Raises InputError: wrong parameters, or an impossible request.
        """
        name = ALIASES.get(request.command, request.command)
        command = self._commands.get(name)
        if command is None:
            return None
        counts, handler = command
        if len(request.parameters) not in counts:
            raise InputError(f"{len(request.parameters)} parameters do not fit (expected {HELP[name][0]})")
        return handler(request.parameters)

    def _status(self) -> Rows:
        z = self._ziy
        ready = sum(link.state == "ready" for link in z.links.values())
        telescope = "known" if z.telescope_known else "silent"
        journal = plain(z.intake.trouble or "well")
        active = len(z.links) - len(z.firing.dropped)
        counts = (f"{ready} of {active}", str(z.intake.numbered), str(z.intake.acknowledged), str(z.round_number))
        condition = z.condition.now()
        epoch = "none" if condition.verdict is None else f"{condition.epoch} {condition.verdict.word}"
        wrong = "; ".join(problem.text for problem in condition.problems) or "nothing"
        site = (condition.word, epoch, condition.clock, condition.disk, condition.holder, plain(wrong))
        return [(z.mode, *counts, telescope, journal, *site)]

    def _rangers(self) -> Rows:
        z = self._ziy
        conditions = z.condition.now().rangers
        for name, link in z.links.items():
            state = "dropped" if name in z.firing.dropped else link.state
            status, stream = plain(z.firing.last_status.get(name, "none")), z.firing.streams.get(name, "none")
            counts, troubles = (str(link.shots), str(link.failures)), " ".join(link.troubles) or "none"
            yield name, state, *counts, stream, status, troubles, conditions[name]

    def _plan(self, count: str = "1") -> Rows:
        if not count.isdecimal() or not 1 <= int(count[:9]) <= MOST_PLANNED:
            raise InputError(f"n {count[:20]!a} is not 1 to {MOST_PLANNED}")
        return [
            (shot.ranger, stamp_text(shot.begin_ticks), shot.target, f"{shot.duration:g}", plain(shot.reason))
            for shot in self._ziy.next_shots(int(count))
        ]

    def _sun(self) -> Rows:
        sun = self._ziy.sun_zone()
        angles = (repr(round(angle, 9)) for angle in (sun.azimuth, sun.elevation, sun.cone))
        return [(*angles, "avoided" if sun.avoided else "set")]

    def _alarms(self) -> Rows:
        for alarm in self._ziy.alarms.look():
            shelving = alarm.shelving
            shelved = ("none", "none") if shelving is None else (shelving.by, stamp_text(shelving.until))
            at = stamp_text(alarm.acknowledged_at) if alarm.acknowledged_by else "none"
            acknowledged = (alarm.acknowledged_by or "none", at)
            first = (alarm.problem.id, alarm.problem.severity, stamp_text(alarm.since))
            yield *first, *acknowledged, *shelved, plain(alarm.problem.text)

    def _acknowledge(self, name: str, by: str) -> Rows:
        self._ziy.alarms.acknowledge(name, by)
        return [(name, by)]

    def _shelve(self, name: str, minutes: str, by: str) -> Rows:
        try:
            length = float(minutes)
        except ValueError:
            raise InputError(f"minutes = {minutes[:20]!a} (expected a number)") from None
        self._ziy.alarms.shelve(name, length, by)
        return [(name, minutes, by)]

    def _unshelve(self, name: str, by: str) -> Rows:
        self._ziy.alarms.unshelve(name, by)
        return [(name, by)]

    def _parameters(self) -> Rows:
        return [tuple(plain(word) for word in row) for row in self.parameters.rows()]

    def _interlocks(self) -> Rows:
        values = self.parameters.expected()
        for interlock in () if self._control is None else self._control.interlocks():
            refusal = interlock.refusal(values)
            yield " ".join(interlock.parameters), plain(interlock.rule), plain(refusal or "none")

    def _set(self, name: str, text: str) -> Rows:
        return [(plain(name.lower()), plain(self.parameters.set(name, text)))]

    def _reference(self, word: str = "") -> Rows:
        if word and word.upper() != "NOW":
            raise InputError(f"REFERENCE {word[:20]!a} (expected REFERENCE or REFERENCE NOW)")
        if word:
            self._ziy.set_reference()
        zero = self.corrections.zero
        words = NO_ZERO if zero is None else zero.words
        return [(*words, str(self.corrections.moves), plain(FRAME), plain(PIVOT))]

    def _moved(self, actuator: str, value: str, unit: str, by: str) -> Rows:
        zero = self.corrections.zero
        self._ziy.record_move(actuator, value, unit, by, reference=0 if zero is None else zero.number)
        return [(actuator, value, unit, by)]

    def _samplers(self) -> Rows:
        return [
            (name, str(count), " ".join(("mjd", *COLUMNS[name]))) for name, count in self.samplers.lengths().items()
        ]

    def _sampler(self, name: str, count: str = "1") -> Rows:
        if name.upper() not in COLUMNS:
            raise InputError(f"{name[:20]!a} is not a sampler (expected one of {' '.join(COLUMNS)})")
        if not count.isdecimal() or not 1 <= int(count[:9]) <= RING_LENGTH:
            raise InputError(f"n {count[:20]!a} is not 1 to {RING_LENGTH}")
        return [(name.upper(), *row) for row in self.samplers.last(name.upper(), int(count))]

    def _mode(self, text: str | None = None) -> Rows:
        if text is not None:
            self._ziy.set_mode(mode_of(text))
        return [(self._ziy.mode,)]

    def _clock(self, word: str = "") -> Rows:
        watch = self._ziy.host_clock
        if word and word.upper() != "ACCEPT":
            raise InputError(f"CLOCK {word[:20]!a} (expected CLOCK or CLOCK ACCEPT)")
        if word:
            watch.accept()
        kernel = "unknown" if watch.sync is None else watch.sync.source
        return [(f"{watch.departure:.6f}", kernel, plain(watch.trouble or "none"))]

    def _stream(self, ranger: str, target: str | None = None) -> Rows:
        self._ziy.stream(ranger.upper(), target)
        return [(ranger.upper(), target or "none")]

    def _help(self, name: str | None = None) -> Rows:
        if name is None:
            return [(" ".join(HELP),)]
        command = ALIASES.get(name.upper(), name.upper())
        if command not in HELP:
            raise InputError(f"{name[:20]!a} is not a command (expected one listed by HLP)")
        return [tuple(plain(word) for word in HELP[command])]

    def _applied(self, action: Callable[[str], None], ranger: str) -> Rows:
        action(ranger.upper())
        return [(ranger.upper(),)]
