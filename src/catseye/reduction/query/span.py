"""Span of a question, and verdicts of the nights that its answer rests on."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from catseye.errors import InputError
from catseye.records.archive.reading import ArchiveFolder, read_table
from catseye.records.query.rows import select_rows
from catseye.verdict import Verdict


@dataclass(frozen=True)
class ArchiveSpan:
    """Archive, and the times that a question is about.

    since, until   MJD, the last excluded; None for no limit
    """

    archive: ArchiveFolder
    since: float | None = None
    until: float | None = None

    def table(self, kind: str, /, *columns: str, **where: str) -> dict[str, np.ndarray]:
        """Columns of a table within the span, of the few rows whose columns equal `where`."""
        return select_rows(self.archive, kind, columns, where, since=self.since, until=self.until)

    def refuse_empty(self, kind: str, column: str, name: str) -> None:
        """Raise InputError for a name without a row: unknown, or outside the span."""
        known = np.unique(read_table(self.archive, kind, (column,))[column]).tolist()
        where = self.archive.directory
        if name in known:
            raise InputError(f"{where}: {column} {name!r} has no night in this span (expected another since or until)")
        alike = difflib.get_close_matches(name, known, 3) or known[:3]
        expected = f"expected one of {len(known)}, such as {', '.join(alike)}" if known else "its table is empty"
        raise InputError(f"{where}: {column} {name!r} is not in the archive ({expected})")

    def verdict(self, nights: Iterable[str], good: str) -> Verdict:
        """Verdict of a series: doubtful where a night of it is not good, failed where none is.

        nights   identifiers
        good     reason of a good verdict
        """
        wanted = set(nights)
        rows = self.table("nights", "night", "verdict", "why")
        judged = [
            (night, word, why)
            for night, word, why in zip(*(rows[key].tolist() for key in ("night", "verdict", "why")), strict=True)
            if night in wanted
        ]
        bad = [item for item in judged if item[1] != "good"]
        if not bad:
            return Verdict("good", good)
        night, word, why = bad[0]
        named = f"{len(bad)} of {len(judged)} nights are not good, first {night} ({word}: {why})"
        return Verdict("failed" if all(item[1] == "failed" for item in judged) else "doubtful", named)
