"""Recipe for a crew's files: heights as found and as left, turns, notes."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import PanelLayout
from catseye.records.panels.readings import digest_of_maps, read_maps, read_panel_readings, read_survey
from catseye.reduction.panels.crew import SURE, Setting, setting
from catseye.reduction.panels.heights import PanelHeights, conformity, reduce_panels
from catseye.reduction.panels.maps import FittedMap, fitted_map
from catseye.verdict import Verdict


@dataclass(frozen=True)
class PanelFiles:
    """Files to read.

    Readings and sheet; optionally survey, maps and the readings as left.
    """

    readings: Path
    sheet: Path
    survey: Path | None = None
    maps: Path | None = None
    as_left: Path | None = None
    survey_left: Path | None = None

    @property
    def all(self) -> tuple[Path, ...]:
        files = (self.readings, self.sheet, self.survey, self.maps, self.as_left, self.survey_left)
        return tuple(path for path in files if path is not None)


@dataclass(frozen=True, eq=False)
class PanelWork:
    """Heights as found and as left, with the result of turning.

    layout    of the whole dish
    found, left   heights as found and as left
    setting   result of turning
    maps      by panel
    inputs    SHA-256 of each file read, by its name
    notes     for the reader
    """

    layout: PanelLayout
    sheet: PanelInstrument
    found: PanelHeights
    left: PanelHeights | None
    setting: Setting | None
    maps: dict[str, FittedMap]
    inputs: dict[str, str]
    notes: tuple[str, ...]

    @property
    def latest(self) -> PanelHeights:
        """Heights as left if available, else as found: input of the screw turns."""
        return self.found if self.left is None else self.left

    @property
    def verdict(self) -> Verdict:
        """Verdict from the control of the readings, not from the number of screws to turn."""
        if self.notes:
            return Verdict("doubtful", self.notes[0].rstrip("."))
        advice = verdicts(self.latest)
        turn = int((advice == "turn").sum())
        return Verdict("good", f"{turn} of {advice.size} screws are to be turned, and the readings are in control")


def panel_work(
    files: PanelFiles, layout: PanelLayout, *, reject: bool = False, progress: Progress | None = None
) -> PanelWork:
    """Reduction of a crew's files.

    Raises InputError or EstimationError in one line.

    files      paths
    layout     all panels of the dish
    reject     leave out readings that the tests reject
    progress   called at each step
    """

    def say(what: str, turning: int) -> None:
        if progress is not None:
            progress(what, turning, 4)

    say("reading", 0)
    sheet = read_record(files.sheet, PanelInstrument)
    names = [path.name for path in files.all]
    if len(set(names)) != len(names):
        double = next(n for n in names if names.count(n) > 1)
        raise InputError(f"{double}: two inputs have this name (expected different names, for the provenance)")
    inputs = dict(layout.hashes) | {files.sheet.name: sha256(files.sheet.read_bytes()).hexdigest()}
    survey = None if files.survey is None else read_survey(files.survey, layout)
    later = survey if files.survey_left is None else read_survey(files.survey_left, layout)
    maps: dict[str, FittedMap] = {}
    if files.maps is not None:
        raw = read_maps(files.maps, layout)
        inputs[f"{files.maps.name}/ ({len(raw)} maps)"] = digest_of_maps(list(raw.values()))
        say("maps", 1)
        maps = {name: fitted_map(one) for name, one in raw.items()}
    for path, one in ((files.survey, survey), (files.survey_left, later)):
        if path is not None and one is not None:
            inputs[path.name] = one.digest
    readings = read_panel_readings(files.readings, layout, sheet)
    inputs[readings.file] = readings.digest
    say("solving as found", 2)
    as_found = reduce_panels(readings, layout, sheet, survey=survey, maps=maps, reject=reject)
    as_left = None
    if files.as_left is not None:
        later_readings = read_panel_readings(files.as_left, layout, sheet)
        inputs[later_readings.file] = later_readings.digest
        say("solving as left", 3)
        as_left = reduce_panels(later_readings, layout, sheet, survey=later, maps=maps, reject=reject)
    turning = None if as_left is None else setting(as_found, as_left)
    return PanelWork(
        layout=layout,
        sheet=sheet,
        found=as_found,
        left=as_left,
        setting=turning,
        maps=maps,
        inputs=inputs,
        notes=tuple(_notes(files, layout, as_found, as_left, turning)),
    )


def verdicts(heights: PanelHeights) -> np.ndarray:
    """Advice (p, 4): "leave", "turn", "read" or "alone".

    "read" where no reading is used, "alone" without an adjacent panel.

    "leave": within the goal with a probability of 0.95, or not improved by 0.05 by a turn: after it a corner has the
    present uncertainty and that of the turn.
    """
    screw = heights.sheet.screw
    after = np.hypot(heights.u_relative, screw.u_turn * screw.pitch_mm * MILLIMETRE)
    gained = conformity(np.zeros_like(after), after, heights.sheet.goal_um * 1e-6) - heights.conforms
    verdict = np.where((heights.conforms >= SURE) | (gained < 1.0 - SURE), "leave", "turn")
    return np.where(heights.known, verdict, np.where(heights.times > 0, "alone", "read"))


def beyond_lean(heights: PanelHeights) -> list[str]:
    """Placements with a lean over the sheet's limit."""
    lean = np.hypot(*heights.readings.lean.T) / ARCSECOND / 60.0
    far = np.flatnonzero(np.nan_to_num(lean) > heights.sheet.lean_limit_arcmin)
    return [f"{heights.readings.where[k]} ({lean[k]:.1f}′)" for k in far]


def _notes(
    files: PanelFiles,
    layout: PanelLayout,
    as_found: PanelHeights,
    as_left: PanelHeights | None,
    turning: Setting | None,
) -> list[str]:
    notes = []
    if not as_found.surveyed:
        notes.append(
            "No survey of the actuators: heights of the whole surface depend on u_set_um alone, only relative heights "
            "at a corner are measured; the gauges touch panels beside the corner, so that even these carry the "
            "unknown slopes of panels."
        )
    if files.maps is None:
        notes.append("No maps of panels: corners are set as if every panel had its design's shape.")
    elif not as_found.model.mapped.all():
        bare = [n for n, mapped in zip(as_found.layout.panels, as_found.model.mapped, strict=True) if not mapped]
        notes.append(f"{len(bare)} of {len(as_found.layout.panels)} panels read have no map ({bare[0]} among them).")
    if len(as_found.layout.panels) < len(layout.panels):
        notes.append(
            f"{len(as_found.layout.panels)} of {len(layout.panels)} panels were read; the others are not reported."
        )
    if np.isnan(as_found.readings.lean[as_found.readings.corner >= 0, 0]).any():
        notes.append("Where no lean was read, the shaft counts as upright within the sheet's limit over root three.")
    for name, one in (("as found", as_found), ("as left", as_left)):
        if one is None:
            continue
        far = beyond_lean(one)
        if far:
            notes.append(f"{name}: the shaft leans beyond the limit in {len(far)} placements, first {far[0]}.")
        repeated = sorted({d.corner for d in one.doubts if d.rivals})
        if repeated:
            notes.append(
                f"{name}: at {', '.join(repeated[:6])}{' ...' if len(repeated) > 6 else ''} undecided which of two "
                "readings is wrong; a placement in another turn would decide."
            )
    if as_left is not None and turning is None:
        notes.append("As found and as left have fewer than three corners in common: the turns are not judged.")
    return notes
