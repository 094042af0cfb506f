"""Client parameters: checked singly and together, activated by PREPARE and START."""

from collections.abc import Callable
from dataclasses import dataclass

from catseye.errors import InputError

Check = Callable[[str], str]  # the normalised text, or InputError


@dataclass(frozen=True)
class ClientParameter:
    """One parameter.

    name    of the parameter
    help    one line, including its legal values
    now     its current value
    check   normalise a text; raises InputError if it is not legal
    apply   activate it
    """

    name: str
    help: str
    now: Callable[[], str]
    check: Check
    apply: Callable[[str], None]


class Parameters:
    """All parameters; values wait until `start`, after a `prepare`."""

    def __init__(self, parameters: tuple[ClientParameter, ...]):
        self._all = {p.name: p for p in parameters}
        self._set: dict[str, str] = {}
        self._prepared = False

    def set(self, name: str, text: str) -> str:
        """Store a value; the normalised text.

        Raises InputError: no such parameter, not legal.
        """
        parameter = self._all.get(name.lower())
        if parameter is None:
            raise InputError(f"{name[:20]!a} is not a parameter (expected one of {' '.join(self._all)})")
        normalised = parameter.check(text)
        self._set[parameter.name], self._prepared = normalised, False
        return normalised

    def prepare(self) -> int:
        """Check all waiting values together; their number."""
        for name, text in self._set.items():
            self._all[name].check(text)
        self._prepared = True
        return len(self._set)

    def start(self) -> int:
        """Activate all prepared values; their number.

        Raises InputError: not prepared since the last change.
        """
        if not self._prepared:
            raise InputError("nothing is prepared (expected SET, then PREPARE, first)")
        waiting, self._set, self._prepared = self._set, {}, False
        for name, text in waiting.items():
            self._all[name].apply(text)
        return len(waiting)

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Name, current value, waiting value or none, help."""
        return [(p.name, p.now(), self._set.get(p.name, "none"), p.help) for p in self._all.values()]
