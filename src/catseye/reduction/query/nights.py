"""Nights of an archive, a row each."""

from dataclasses import dataclass

import numpy as np

from catseye.names import counted
from catseye.reduction.query.span import ArchiveSpan
from catseye.verdict import Verdict

COLUMNS = (
    *("night", "mjd", "name", "source", "points", "shots", "rejected", "variance_factor", "verdict", "why"),
    *("azimuth", "elevation", "temperature_c", "version", "digest"),
)


@dataclass(frozen=True, eq=False)
class NightRows:
    """Nights of a span in order of time.

    verdict   of the list: doubtful where a night is not good
    rows      the archive's columns `COLUMNS`, (n,) each
    """

    verdict: Verdict
    rows: dict[str, np.ndarray]

    @property
    def count(self) -> int:
        """Number of nights, 0 or more."""
        return len(self.rows["night"])


def night_rows(span: ArchiveSpan) -> NightRows:
    """Nights of a span, in order of time."""
    rows = span.table("nights", *COLUMNS)
    order = np.argsort(rows["mjd"], kind="stable")
    rows = {name: values[order] for name, values in rows.items()}
    bad = [night for night, word in zip(rows["night"], rows["verdict"], strict=True) if word != "good"]
    if not bad:
        return NightRows(Verdict("good", f"{counted(len(order), 'night')}, all of them good"), rows)
    return NightRows(Verdict("doubtful", f"{len(bad)} of {len(order)} nights are not good, first {bad[0]}"), rows)
