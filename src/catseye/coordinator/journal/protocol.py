"""Interface of a journal's writer."""

from concurrent.futures import Future
from typing import Protocol

from catseye.coordinator.journal.entries import Entry
from catseye.errors import InputError


class NotDurable(InputError):
    """Entries that are not on disk yet; they stay queued."""


class JournalWriter(Protocol):
    """A journal's writer: a future is done when its entries are durable.

    Entries are written in the order appended; a full queue raises InputError.
    """

    @property
    def trouble(self) -> str | None:
        """Reason why writing fails at present; else None."""
        ...

    def append(self, *items: Entry) -> "Future[int]": ...
    def close(self) -> None: ...
