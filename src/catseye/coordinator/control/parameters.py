"""Client parameters: checked singly and together, activated by PREPARE and START."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from catseye.coordinator.control.registry import ParameterRow
from catseye.errors import InputError

Check = Callable[[str], str]  # the normalised text, or InputError
Values = Mapping[str, str]


@dataclass(frozen=True)
class ClientParameter:
    """One parameter.

    row     of the registry
    now     its current value
    check   normalise a text that is legal by its row; raises InputError if it is not legal here
    apply   activate it at once; None: it is activated with the others of its set between two rounds
    """

    row: ParameterRow
    now: Callable[[], str]
    check: Check
    apply: Callable[[str], None] | None = None


class Parameters:
    """All parameters; values wait until `start`, after a `prepare`.

    refuse   raises InputError for values, all parameters', that do not fit together
    adopt    activates the values of a set that has been started, at `border`
    tell     called with each set that is started or, at the border, refused: its text, values, and True if active
    activated  called at the border with the values that are in force from then on
    """

    def __init__(
        self,
        parameters: tuple[ClientParameter, ...],
        *,
        refuse: Callable[[Values], None] = lambda values: None,
        adopt: Callable[[Values], None] = lambda values: None,
        tell: Callable[[str, Values, bool], None] = lambda text, values, active: None,
        activated: Callable[[Values], None] = lambda values: None,
    ):
        self._all = {p.row.name: p for p in parameters}
        self._refuse, self._adopt, self._tell, self._activated = refuse, adopt, tell, activated
        self._set: dict[str, str] = {}
        self._started: dict[str, str] = {}
        self._prepared = False

    def set(self, name: str, text: str) -> str:
        """Store a value; the normalised text.

        Raises InputError: no such parameter, not legal.
        """
        parameter = self._all.get(name.lower())
        if parameter is None:
            raise InputError(f"{name[:20]!a} is not a parameter (expected one of {' '.join(self._all)})")
        normalised = parameter.check(parameter.row.normalised(text))
        self._set[parameter.row.name], self._prepared = normalised, False
        return normalised

    def prepare(self) -> int:
        """Check all waiting values together; their number.

        Raises InputError: they do not fit together, or to the values in force; nothing is changed.
        """
        self._check(self._set)
        self._prepared = True
        return len(self._set)

    def start(self) -> int:
        """Activate all prepared values, between two rounds unless at once; their number.

        Raises InputError: not prepared since the last change, or no longer fitting; nothing is changed.
        """
        if not self._prepared:
            raise InputError("nothing is prepared (expected SET, then PREPARE, first)")
        self._check(self._set)
        waiting, self._set, self._prepared = self._set, {}, False
        changed = {name: text for name, text in waiting.items() if text != self._value(name)}
        if changed:
            words = "; ".join(f"{name} from {self._value(name)} to {text}" for name, text in changed.items())
            self._tell(f"started: {words}", changed, True)
        for name, text in waiting.items():
            apply = self._all[name].apply
            if apply is None:
                self._started[name] = text
            else:
                apply(text)
        return len(waiting)

    def discard(self) -> int:
        """Forget all values that wait and are not started; their number."""
        waiting, self._set, self._prepared = self._set, {}, False
        return len(waiting)

    def border(self) -> None:
        """Activate the started values; between two rounds."""
        if not self._started:
            return
        started, self._started = self._started, {}
        try:
            self._check(started)
            self._adopt(started)
        except InputError as problem:
            self._tell(f"not active, nothing is changed: {problem}", started, False)
        else:
            self._activated(started)

    def rows(self) -> list[tuple[str, ...]]:
        """Name, current value, waiting value or none, legal values, unit, what it changes, meaning, stage."""
        return [
            (
                *(name, p.now(), self._waiting(name), p.row.legal, p.row.unit or "none", p.row.changes),
                *(p.row.meaning, self._stage(name)),
            )
            for name, p in self._all.items()
        ]

    def expected(self) -> dict[str, str]:
        """All values once what waits is active."""
        return {name: p.now() for name, p in self._all.items()} | self._started | self._set

    def _check(self, values: Values) -> None:
        for name, text in values.items():
            self._all[name].check(text)
        self._refuse({name: p.now() for name, p in self._all.items()} | self._started | dict(values))

    def _value(self, name: str) -> str:
        return self._started.get(name, self._all[name].now())

    def _stage(self, name: str) -> str:
        """Stage of a waiting value: set, prepared, or started until the round's end; none."""
        if name in self._set:
            return "prepared" if self._prepared else "set"
        return "started" if name in self._started else "none"

    def _waiting(self, name: str) -> str:
        return self._set.get(name, self._started.get(name, "none"))
