"""Phases of shots at several modulation frequencies: a table of its own."""

from pathlib import Path
from typing import Annotated

from catseye.records.files.reading import Folder
from catseye.records.files.record import Name, Record, Within
from catseye.records.files.refusal import in_row, refusal


class PhaseRow(Record):
    """Row of a table of phases: one shot at one modulation frequency.

    shot            name; a shot's frequencies are its rows, two or more
    modulation_hz   frequency of the modulation
    phase_rad       phase after the reference cube's at the same frequency; it falls as the distance grows
    u_phase_rad     its standard uncertainty
    """

    shot: Name
    modulation_hz: Annotated[float, Within(1e6, 1e11)]
    phase_rad: Annotated[float, Within(-1e6, 1e6)]
    u_phase_rad: Annotated[float, Within(1e-9, 1.0)]


def read_phases(path: Path) -> tuple[dict[str, list[PhaseRow]], dict[str, str]]:
    """Rows of a table by shot, in its order, and the SHA-256 of the file.

    path   of the table

    Raises InputError for a bad table, a frequency twice in a shot, and a shot of one frequency.
    """
    folder = Folder(path.parent)
    shots: dict[str, list[PhaseRow]] = {}
    for number, row in enumerate(folder.table(path.name, PhaseRow), start=1):
        mine = shots.setdefault(row.shot, [])
        if any(second.modulation_hz == row.modulation_hz for second in mine):
            text = f"modulation_hz = {row.modulation_hz:g} is in shot {row.shot} already (expected each frequency once)"
            raise in_row(path.name, number, text)
        mine.append(row)
    if not shots:
        raise refusal(path.name, "has no row (expected two or more a shot)")
    for name, rows in shots.items():
        if len(rows) < 2:
            raise refusal(path.name, f"shot {name} has one frequency (expected two or more, which have a beat)")
    return shots, folder.hashes
