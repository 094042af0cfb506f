"""`panels`: corners of a dish's panels from the panel setting instrument."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.errors import InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.panels.layout import PanelLayout
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.panels.job import PanelWork

SHORTEST_M, LONGEST_M = 0.1, 1000.0  # focal length of a layout
MICROMETRE = 1e-6  # m


@dataclass(frozen=True, eq=False, repr=False)
class PanelsResult(Result):
    """Panel corners and the turns of their screws, as found and as left: p panels of four corners.

    work   heights, setting, maps and notes; `work.latest` is what the screws are turned by
    read   files and folders that were read
    """

    work: "PanelWork"
    read: tuple[Path, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p panels that were read."""
        return tuple(self.work.latest.layout.panels)

    @property
    def turns(self) -> np.ndarray:
        """Turns (p, 4) of the screws, clockwise above zero; nan where no neighbour was read."""
        return self.work.latest.turns

    @property
    def u_turns(self) -> np.ndarray:
        """Standard uncertainties (p, 4) of the turns."""
        return self.work.latest.u_turns

    @property
    def advice(self) -> np.ndarray:
        """Advice (p, 4): "leave", "turn", "read" or "alone"."""
        from catseye.reduction.panels.job import verdicts

        return verdicts(self.work.latest)

    def passages(self) -> "Sequence[Passage]":
        """The tool, the corners, the turning, the screws, the surface, readings in doubt, notes."""
        from catseye.gateways.panels.objects import passages

        return passages(self.work)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye panels --json`."""
        from catseye.gateways.panels.objects import panels_object

        return panels_object(self.work)

    def tables(self) -> "dict[str, QTable]":
        """`screws`: a row a screw; `panels`: a row a panel, its best fit."""
        from catseye.gateways.panels.objects import screws

        heights = self.work.latest
        rows = list(screws(heights))
        columns = {
            "panel": ([row.panel for row in rows], ""),
            "corner": ([row.corner for row in rows], ""),
            "x": ([row.x for row in rows], "m"),
            "y": ([row.y for row in rows], "m"),
            "height": (np.array([row.departure for row in rows]) / MICROMETRE, "um"),
            "u_height": (np.array([row.u_departure for row in rows]) / MICROMETRE, "um"),
            "relative": (np.array([row.relative for row in rows]) / MICROMETRE, "um"),
            "u_relative": (np.array([row.u_relative for row in rows]) / MICROMETRE, "um"),
            "turns": ([row.turns for row in rows], ""),
            "u_turns": ([row.u_turns for row in rows], ""),
            "verdict": ([row.verdict for row in rows], ""),
        }
        fits = {
            "panel": (heights.layout.panels, ""),
            "piston": (heights.fit[:, 0] / MICROMETRE, "um"),
            "u_piston": (heights.u_fit[:, 0] / MICROMETRE, "um"),
            "slope_x": (heights.fit[:, 1] / MICROMETRE, "urad"),
            "slope_y": (heights.fit[:, 2] / MICROMETRE, "urad"),
        }
        return {"screws": quantities(columns), "panels": quantities(fits)}

    def figures(self) -> "dict[str, Figure]":
        """Corners, surface, shares within the goal, control chart; the effect of turning where there is one."""
        from catseye.gateways.panels.figures import panel_figures

        return panel_figures(self.work)

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.panels.report import panels_report

        return panels_report(self.work, when)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye panels --out`."""
        from catseye.gateways.panels.report import write_panels

        write_panels(self.work, directory, progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.work.inputs

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def panels(
    readings: "str | os.PathLike[str]",
    instrument: "str | os.PathLike[str]",
    *,
    layout: "str | os.PathLike[str] | SiteFolder | PanelLayout" = "gbt",
    survey: "str | os.PathLike[str] | None" = None,
    cmm: "str | os.PathLike[str] | None" = None,
    as_left: "str | os.PathLike[str] | None" = None,
    survey_left: "str | os.PathLike[str] | None" = None,
    focal_length_m: Annotated[Any, In("m", one=True)] = 60.0,
    reject: bool = False,
    progress: Progress | None = None,
) -> PanelsResult:
    """Panel corners from the panel setting instrument: heights, turns of screws, a crew's statistics.

    readings         table of placements of the tool, as found
    instrument       data sheet of the tool
    layout           table of panels and corners, or a site with its prisms
    survey           heights of actuators by their prisms
    cmm              folder of maps of panels by a coordinate measuring machine
    as_left          placements after the screws were turned
    survey_left      survey as left; `survey` without
    focal_length_m   of the paraboloid of a table of panels
    reject           leave out readings that the tests reject; only named without
    progress         called with (what, done, of how many)

    Files are those of docs/formats/panels.md. Raises InputError for what cannot be used, EstimationError where there
    is no answer.

    >>> example = "panels/{}".format
    >>> found = panels(example("as-found.csv"), example("tool.toml"), layout=example("layout.csv"))
    >>> found.turns.shape, found.verdict.word
    ((72, 4), 'doubtful')
    """
    from catseye.reduction.panels.job import PanelFiles, panel_work

    if not SHORTEST_M <= focal_length_m <= LONGEST_M:
        raise InputError(f"focal_length_m = {focal_length_m:g} (expected {SHORTEST_M:g} to {LONGEST_M:g} m)")
    optional = {"survey": survey, "maps": cmm, "as_left": as_left, "survey_left": survey_left}
    paths = {name: None if each is None else place_of(each) for name, each in optional.items()}
    files = PanelFiles(readings=place_of(readings), sheet=place_of(instrument), **paths)
    work = panel_work(files, _layout(layout, focal_length_m), reject=reject, progress=progress)
    return PanelsResult(verdict=work.verdict, work=work, read=files.all)


def _layout(layout: "str | os.PathLike[str] | SiteFolder | PanelLayout", focal_length: float) -> "PanelLayout":
    """The layout of a table, or of a site's prisms."""
    from catseye.records.panels.layout import PanelLayout, layout_of_site, read_layout
    from catseye.records.site.folder import SiteFolder, read_site

    if isinstance(layout, PanelLayout):
        return layout
    if isinstance(layout, SiteFolder):
        return layout_of_site(layout)
    if str(layout).endswith(".csv"):
        return read_layout(place_of(layout), focal_length)
    return layout_of_site(read_site(place_of(layout)))
