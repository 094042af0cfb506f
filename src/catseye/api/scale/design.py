"""`design`: number and place of rangers and targets, by the exact derivative of a criterion."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE, PPM
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.estimation.design.network import RangeVariance
    from catseye.estimation.network.model import ObservationNetwork
    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.site.design_layout import DesignLayout
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.solids import Solids
    from catseye.reduction.design.scene import DesignScene
    from catseye.reduction.design.study import DesignStudy


@dataclass(frozen=True, eq=False, repr=False)
class DesignResult(Result):
    """Design study: k points of interest before and after.

    study    states before and after, moves, numbers, scatter, maps
    hashes   SHA-256 of the files read, by name
    read     files and folders that were read
    """

    study: "DesignStudy"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the k points of interest."""
        return self.study.aim.interest

    @property
    def u_before(self) -> float:
        """Root of the criterion before, m."""
        return self.study.before.u

    @property
    def u_after(self) -> float:
        """Root of the criterion after, m."""
        return self.study.after.u

    @property
    def longest_before(self) -> np.ndarray:
        """Longest semi-axes (k,) m of the points of interest before."""
        return self.study.before.longest[0]

    @property
    def longest_after(self) -> np.ndarray:
        """Longest semi-axes (k,) m of the points of interest after."""
        return self.study.after.longest[0]

    @property
    def places(self) -> dict[str, np.ndarray]:
        """Places (3,) m of all points after, by name, each in the frame that carries it."""
        scene = self.study.after.scene
        return {point.name: scene.places[i] for i, point in enumerate(scene.points)}

    def network(self, *, before: bool = False) -> "ObservationNetwork":
        """Network of the design in its worst posture, for `catseye.plan` and its Monte Carlo.

        before   True: of the design before
        """
        from catseye.reduction.design.as_network import network_of_scene

        state = self.study.before if before else self.study.after
        return network_of_scene(state.scene, state.posture)

    def passages(self) -> "Sequence[Passage]":
        """Sentences on design, worst axis, moves, numbers, scatter, maps and search."""
        from catseye.gateways.design.objects import design_passages

        return design_passages(self.study)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye design --json`."""
        from catseye.gateways.design.objects import design_object

        return design_object(self.study)

    def tables(self) -> "dict[str, QTable]":
        """`points`: a row a point of interest; `moves`: a row a unit; `numbers`: a row a number."""
        from catseye.gateways.design.tables import MOVES, NUMBERS, POINTS

        tables = {"points": POINTS, "moves": MOVES, "numbers": NUMBERS}
        return {
            name: quantities(table.quantities(self.study, [column.name for column in table.columns]))
            for name, table in tables.items()
        }

    def figures(self) -> "dict[str, Figure]":
        """Places, points, numbers, maps and search, where there is something to show."""
        from catseye.gateways.design.figures import design_figures

        return design_figures(self.study)

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.design.report import design_report

        return design_report(self.study, when, self.inputs())

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye design --out`."""
        from catseye.gateways.design.report import write_design

        write_design(self.study, directory, self.inputs(), progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def design(
    site: "str | os.PathLike[str] | SiteFolder | DesignLayout",
    *,
    vary: "str | Sequence[str]",
    criterion: str = "worst",
    interest: "str | Sequence[str]" = (),
    frequency_ghz: Annotated[Any, In("GHz", one=True)] = None,
    posture_deg: Annotated[Any, In("deg")] = None,
    solids: "str | os.PathLike[str] | Solids | None" = None,
    keep_out: "str | os.PathLike[str] | KeepOut | None" = None,
    apart_m: Annotated[Any, In("m", one=True)] = 5.0,
    clearance_m: Annotated[Any, In("m", one=True)] = 1.0,
    sigma_mm: Annotated[Any, In("mm", one=True)] = None,
    sigma_ppm: Annotated[Any, In("ppm", one=True)] = None,
    limit_mm: Annotated[Any, In("mm", one=True)] = None,
    steps: Annotated[Any, In("", whole=True)] = 60,
    exchanges: Annotated[Any, In("", whole=True)] = 2,
    map_side: Annotated[Any, In("", whole=True)] = 15,
    runs: Annotated[Any, In("", whole=True)] = 4000,
    seed: Annotated[Any, In("", whole=True)] = 1,
    progress: Progress | None = None,
) -> DesignResult:
    """Design study of a site: number and place of rangers and targets, searched, mapped, and confirmed by scatter.

    site            folder of a site, layout of docs/formats/design.md, or either as read
    vary            what may change, such as "rangers within 20 m"; the words are in docs/formats/design.md
    criterion       "trace", "worst", "pose" or "gain": what is made small
    interest        names or patterns of the points that it is about; the feed arm's without, the dish's for the gain
    frequency_ghz   of the gain
    posture_deg     (k, 2) azimuth and elevation; the site's own without; of several the mean counts
    solids          that obstruct beams, beside the site's own dish
    keep_out        boxes closed to beams and rangers
    apart_m         least distance between two rangers on the ground
    clearance_m     least distance of one from solids and boxes
    sigma_mm, sigma_ppm   of a range, squared and added; 0.03 mm and the site's path fluctuation without
    limit_mm        the smallest number that reaches it is chosen; without, the largest
    steps           of each descent, at most
    exchanges       rounds of exchange among candidates, at most
    map_side        places along each side of a map; 0: no map
    runs            simulated measurements before and after, with the generator of `seed`; 0: none
    progress        called with (what, done, of how many)

    Raises InputError for a file that cannot be used and for variations that do not fit, ArgumentError for options.

    >>> quick = {"steps": 5, "exchanges": 0, "map_side": 0, "runs": 0}
    >>> found = design("designs/structure-60m.toml", vary="rangers within 5 m", **quick)
    >>> bool(found.u_after < found.u_before)
    True
    """
    from catseye.reduction.design.aim import aim_of
    from catseye.reduction.design.regions import Constraints
    from catseye.reduction.design.search import SearchSettings
    from catseye.reduction.design.study import StudySettings, design_study
    from catseye.reduction.design.vary import variations

    _refuse(criterion, frequency_ghz, steps=steps, exchanges=exchanges, map_side=map_side, runs=runs)
    for name, value in (("apart_m", apart_m), ("clearance_m", clearance_m)):
        if not 0.0 <= value <= 1000.0:
            raise ArgumentError(f"{name} = {value:g} (expected 0 to 1000)", name)
    varied = variations([vary] if isinstance(vary, str) else list(vary))
    scene, hashes, read = _scene(
        site,
        solids=solids,
        keep_out=keep_out,
        claim=(sigma_mm, sigma_ppm),
        postures=_postures(posture_deg),
        dish=criterion == "gain",
    )
    patterns = [interest] if isinstance(interest, str) else list(interest)
    frequency = None if frequency_ghz is None else frequency_ghz * 1e9
    aim = aim_of(scene, criterion, patterns, frequency)  # type: ignore[arg-type]
    settings = StudySettings(
        search=SearchSettings(steps=steps, exchanges=exchanges),
        limit=None if limit_mm is None else limit_mm * MILLIMETRE,
        map_side=map_side,
        runs=runs,
        seed=seed,
    )
    constraints = Constraints(apart_m, clearance_m, scene.solids)
    study = design_study(scene, aim, varied, constraints, settings, progress=progress)
    return DesignResult(verdict=study.verdict, study=study, hashes=hashes, read=read)


def _refuse(criterion: str, frequency_ghz: float | None, **counts: int) -> None:
    """Raise ArgumentError for options out of range or that do not fit together."""
    from catseye.reduction.design.aim import CRITERIA

    if criterion not in CRITERIA:
        raise ArgumentError(f"criterion {criterion!r} (expected one of {', '.join(CRITERIA)})", "criterion")
    if (criterion == "gain") != (frequency_ghz is not None):
        have = "missing for" if criterion == "gain" else "not for"
        raise ArgumentError(f"frequency_ghz is {have} criterion {criterion!r}", "frequency_ghz", "criterion")
    if frequency_ghz is not None and not 0.01 <= frequency_ghz <= 10_000.0:
        raise ArgumentError(f"frequency_ghz = {frequency_ghz:g} (expected 0.01 to 10000)", "frequency_ghz")
    limits = {"steps": (1, 10_000), "exchanges": (0, 100), "map_side": (0, 200), "runs": (0, 1_000_000)}
    for name, value in counts.items():
        low, high = limits[name]
        if not low <= value <= high or (name == "map_side" and value == 1) or (name == "runs" and 0 < value < 100):
            expected = {"map_side": "0, or 2 to 200", "runs": "0, or 100 to 1000000"}.get(name, f"{low} to {high}")
            raise ArgumentError(f"{name} = {value} (expected {expected})", name)


def _postures(posture_deg: Any) -> list[tuple[float, float]]:
    """Azimuth and elevation of each posture, rad."""
    if posture_deg is None or not len(posture_deg):
        return []
    table = np.atleast_2d(np.asarray(posture_deg, dtype=float))
    if table.ndim != 2 or table.shape[1] != 2:
        raise ArgumentError(
            "posture_deg is no list of azimuth and elevation (expected two numbers each)", "posture_deg"
        )
    wrong = next((row for row in table if not (-540 <= row[0] <= 540 and 0 <= row[1] <= 95)), None)
    if wrong is not None:
        raise ArgumentError(
            f"posture_deg = {wrong[0]:g}, {wrong[1]:g} (expected azimuth -540 to 540, elevation 0 to 95)", "posture_deg"
        )
    return [(float(a), float(e)) for a, e in np.radians(table)]


def _scene(
    site: Any,
    *,
    solids: Any,
    keep_out: Any,
    claim: tuple[float | None, float | None],
    postures: list[tuple[float, float]],
    dish: bool,
) -> "tuple[DesignScene, dict[str, str], tuple[Path, ...]]":
    """Scene, hashes of the files read, and their paths."""
    from catseye.records.site.design_layout import DesignLayout, read_design_layout
    from catseye.records.site.folder import SiteFolder, read_site
    from catseye.reduction.design.scene import scene_of_layout, scene_of_site

    hashes: dict[str, str] = {}
    read: tuple[Path, ...] = ()
    if not isinstance(site, SiteFolder | DesignLayout):
        path = place_of(site)
        read = (path,)
        if path.is_dir():
            site = read_site(path)
        else:
            hashes[path.name] = digest_of(path) if path.is_file() else ""
            site = read_design_layout(path)
    around, files = _around(solids, keep_out)
    hashes |= {path.name: digest_of(path) for path in files}
    read = (*read, *files)
    if isinstance(site, DesignLayout):
        if postures or dish:
            name = "posture_deg" if postures else "criterion"
            raise ArgumentError(f"{name} needs a site with a telescope (expected the folder of a site)", name)
        usual = (site.ranges.u_mm, site.ranges.u_ppm)
        return scene_of_layout(site, around, claim=_claim(claim, usual)), hashes, read
    hashes |= site.hashes
    usual = (0.03, site.site.ranging.path_index_fluctuation_ppm)
    scene = scene_of_site(site, around, postures=postures, claim=_claim(claim, usual), dish=dish)
    return scene, hashes, read


def _claim(claim: tuple[float | None, float | None], usual: tuple[float, float]) -> "RangeVariance":
    """Claim of a range from options, mm and ppm, or the usual one."""
    from catseye.estimation.design.network import RangeVariance

    constant, relative = (given if given is not None else other for given, other in zip(claim, usual, strict=True))
    if not 0.0 < constant <= 100.0:
        raise ArgumentError(f"sigma_mm = {constant:g} (expected above 0, at most 100)", "sigma_mm")
    if not 0.0 <= relative <= 1000.0:
        raise ArgumentError(f"sigma_ppm = {relative:g} (expected 0 to 1000)", "sigma_ppm")
    return RangeVariance(constant * MILLIMETRE, relative * PPM)


def _around(solids: Any, keep_out: Any) -> "tuple[Solids, tuple[Path, ...]]":
    """Solids and keep-out boxes as one, and the files read."""
    from catseye.records.files.reading import read_record
    from catseye.records.site.keep_out import KeepOut
    from catseye.records.site.solids import Solids, read_solids
    from catseye.reduction.design.obstacles import with_keep_out

    files: list[Path] = []
    if solids is not None and not isinstance(solids, Solids):
        files.append(place_of(solids))
        solids = read_solids(files[-1])
    if keep_out is not None and not isinstance(keep_out, KeepOut):
        files.append(place_of(keep_out))
        keep_out = read_record(files[-1], KeepOut)
    around = solids or Solids()
    return around if keep_out is None else with_keep_out(around, keep_out), tuple(files)
