"""What the coordinator needs of a journal, whoever writes it."""

from concurrent.futures import Future
from typing import Protocol

from catseye.coordinator.journal.entries import Entry
from catseye.errors import InputError


class NotDurable(InputError):
    """Entries that are not on the disk yet: they stay in line, and are written when that is possible."""


class JournalWriter(Protocol):
    """What was given is durable when its future is done, in the order given; a full queue raises InputError."""

    @property
    def trouble(self) -> str | None:
        """Why nothing is durable at present; None where all is well."""
        ...

    def append(self, *items: Entry) -> "Future[int]": ...
    def close(self) -> None: ...
