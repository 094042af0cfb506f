"""M&C's parameters: checked for legality one by one and together, then activated by PREPARE and START."""

from collections.abc import Callable
from dataclasses import dataclass

from catseye.errors import InputError

Check = Callable[[str], str]  # the text as it is kept, or InputError


@dataclass(frozen=True)
class ClientParameter:
    """One parameter.

    name    as it is set
    help    one line, its legal values in it
    now     its value that counts now
    check   a text as it will be kept; raises InputError where it is not legal
    apply   make it count
    """

    name: str
    help: str
    now: Callable[[], str]
    check: Check
    apply: Callable[[str], None]


class Parameters:
    """All of them; what was set waits until `start`, which wants a `prepare` after the last change."""

    def __init__(self, parameters: tuple[ClientParameter, ...]):
        self._all = {p.name: p for p in parameters}
        self._set: dict[str, str] = {}
        self._prepared = False

    def set(self, name: str, text: str) -> str:
        """Keep a value; what is kept. Raises InputError: no such parameter, not legal."""
        parameter = self._all.get(name.lower())
        if parameter is None:
            raise InputError(f"{name[:20]!a} is no parameter (expected one of {' '.join(self._all)})")
        kept = parameter.check(text)
        self._set[parameter.name], self._prepared = kept, False
        return kept

    def prepare(self) -> int:
        """Look at all that waits once more, together with what else counts; how many they are."""
        for name, text in self._set.items():
            self._all[name].check(text)
        self._prepared = True
        return len(self._set)

    def start(self) -> int:
        """Make all that was prepared count. Raises InputError: not prepared since the last change."""
        if not self._prepared:
            raise InputError("nothing is prepared (expected SET, then PREPARE, first)")
        waiting, self._set, self._prepared = self._set, {}, False
        for name, text in waiting.items():
            self._all[name].apply(text)
        return len(waiting)

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Name, value now, value that waits or none, help."""
        return [(p.name, p.now(), self._set.get(p.name, "none"), p.help) for p in self._all.values()]
