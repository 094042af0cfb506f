"""`pose`: where the antenna's parts are, and where its beam points."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.night import NightResult
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import ArgumentError
from catseye.processors import free_threads

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.pose.findings import PoseFindings

OPTICS = ("prime", "gregorian")
LEAST_U_MM, MOST_U_MM = 1e-6, 100.0


@dataclass(frozen=True, eq=False, repr=False)
class PoseResult(Result):
    """Pose of a group of points, six degrees of freedom.

    second = pivot + translation + rotation (first - pivot)

    frame         axes of the answer: "ground", "alidade" or "reflector"; "table" of tables without a site
    pivot         (3,) m, in that frame
    translation   (3,) m, of the pivot
    rotation      (3,) rad, rotation vector, right-handed
    covariance    (6, 6) m², m rad, rad²: translation then rotation
    u             (6,) standard uncertainties
    names         of the points that count
    residuals     (n, 3) m, second place less first place moved by the pose
    status        "converged", or what speaks against the pose
    beam          (3,) rad, rad, m: beam off in azimuth times cos E and in elevation, focus; None unless asked for
    beam_covariance   (3, 3) of it
    found         everything else
    settings      what was asked for
    hashes        SHA-256 of each file read, by its name
    read          files and folders that were read
    """

    frame: str
    pivot: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    covariance: np.ndarray
    u: np.ndarray
    names: tuple[str, ...]
    residuals: np.ndarray
    status: str
    beam: np.ndarray | None
    beam_covariance: np.ndarray | None
    found: "PoseFindings"
    settings: dict[str, Any] = field(default_factory=dict)
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """The group, its frame, whether it is rigid, what was left out."""
        from catseye.gateways.pose.objects import pose_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in pose_words(self.found)]

    def headline(self) -> "Sequence[Passage]":
        """The group and its frame, and the six numbers in one passage."""
        from catseye.gateways.pose.objects import pose_rows
        from catseye.gateways.writers.passage import Passage

        six = "; ".join(f"{name} {value} {unit} (u {u})" for name, value, u, unit in pose_rows(self.found))
        return [*self.passages()[:2], Passage("Pose", six + ".")]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye pose --json`."""
        from catseye.gateways.pose.objects import pose_result_object

        return pose_result_object(self.found)

    def lines(self) -> list[str]:
        """Lines of numbers that the command prints: the six, and those of the beam."""
        from catseye.gateways.pose.objects import pose_lines

        return pose_lines(self.found)

    def tables(self) -> "dict[str, QTable]":
        """`pose`: a row a component, translations in mm and rotations in arc seconds; `points`: a row a point."""
        scale = np.array([MILLIMETRE] * 3 + [ARCSECOND] * 3)
        values = np.concatenate([self.translation, self.rotation])
        six = {
            "component": (["translation x", "y", "z", "rotation x", "y", "z"], ""),
            "value": (values / scale, ""),
            "u": (self.u / scale, ""),
            "unit": (["mm"] * 3 + ["arcsec"] * 3, ""),
        }
        points = {
            "point": (self.names, ""),
            **{axis: (self.found.pose.places[:, k], "m") for k, axis in enumerate("xyz")},
            **{f"residual_{axis}": (self.residuals[:, k] / MILLIMETRE, "mm") for k, axis in enumerate("xyz")},
            "w": (self.found.pose.pose.w, ""),
        }
        return {"pose": quantities(six, frame=self.frame), "points": quantities(points, frame=self.frame)}

    def figures(self) -> "dict[str, Figure]":
        """Residuals of the points and, with a beam, what its offset is made of."""
        from catseye.gateways.pose.figures import pose_figures

        return pose_figures(self.found)

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.pose.files import pose_report

        return pose_report(self.found, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye pose --out`."""
        from catseye.gateways.pose.files import write_pose

        write_pose(self.found, directory, self.hashes, settings=self.settings, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def pose(
    epoch: "str | os.PathLike[str] | SolvedPoints | NightResult",
    earlier: "str | os.PathLike[str] | SolvedPoints | NightResult | None" = None,
    *,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    group: str | None = None,
    points: Sequence[str] | None = None,
    frame: str | None = None,
    pivot: Annotated[Any, In("m", many=True)] = None,
    robust: str | None = None,
    pointing: str | None = None,
    tilt_arcsec: Annotated[Any, In("arcsec", many=True)] = None,
    posture_deg: Annotated[Any, In("deg", many=True)] = None,
    earlier_posture_deg: Annotated[Any, In("deg", many=True)] = None,
    u_mm: Annotated[Any, In("mm", one=True)] = None,
) -> PoseResult:
    """Pose of a part of the antenna, and its beam; or of any points of two tables.

    Six degrees of freedom between two epochs or against design; beam and focus on request.

    epoch         what `reduce` gave or wrote, its coordinates.json, or a table of points (docs/formats/surface.md)
    earlier       the epoch to count from; the site's design without; a table without u is exact
    site          site or campaign whose records say what stands where; without, points of the same names are one body,
                  in the axes of both tables
    group         "dish" (usual), "feed-arm", "alidade" or "subreflector", or
    points        names of points that move as one
    frame         "ground" (usual), "alidade" or "reflector"
    pivot         (3,) m, of the rotation, in the frame; vertex, focus or mean of the points without
    robust        how points that moved alone are left out, "l1", "huber", "igg3" or "biweight"
    pointing      "prime" or "gregorian": optics whose beam and focus are derived, of the dish in the reflector frame
    tilt_arcsec   x, y and their u of an inclinometer on the alidade, its zero taken out
    u_mm          of each coordinate of EPOCH, a table without columns of u
    posture_deg, earlier_posture_deg   azimuth and elevation of the epochs, where their files do not say

    Raises ArgumentError for arguments that do not fit together, InputError where points, postures or files are missing
    and EstimationError where nothing can be fitted.
    """
    from catseye.records.site.folder import SiteFolder, read_site
    from catseye.reduction.pose.findings import PoseFindings, PoseSettings, find_pose
    from catseye.reduction.pose.points import pose_of_points

    _refuse_mixtures(group, points, frame, pointing, tilt_arcsec)
    if u_mm is not None and not LEAST_U_MM <= u_mm <= MOST_U_MM:
        raise ArgumentError(f"u_mm = {u_mm:g} (expected {LEAST_U_MM:g} to {MOST_U_MM:g} mm)", "u_mm")
    if site is None:
        _refuse_without_site(
            earlier=earlier is None, group=group, frame=frame, pointing=pointing, tilt_arcsec=tilt_arcsec,
            posture_deg=posture_deg, earlier_posture_deg=earlier_posture_deg,
        )  # fmt: skip
    postures = _posture("posture_deg", posture_deg), _posture("earlier_posture_deg", earlier_posture_deg)
    records = site if isinstance(site, SiteFolder) or site is None else read_site(place_of(site))
    later = _solved(epoch, postures[0], None if u_mm is None else u_mm * MILLIMETRE)
    before = None if earlier is None else _solved(earlier, postures[1])
    settings = PoseSettings(
        group=None if points is not None else group or "dish",
        points=None if points is None else tuple(points),
        frame=frame or ("reflector" if pointing else "alidade" if tilt_arcsec is not None else "ground"),
        pivot=None if pivot is None else np.array(pivot, dtype=float),
        robust=robust,
    )
    tilt = None if tilt_arcsec is None else tuple(v * ARCSECOND for v in tilt_arcsec)
    with free_threads():
        if records is None:
            assert before is not None
            group_pose = pose_of_points(later, before, points=settings.points, pivot=settings.pivot, robust=robust)
            found = PoseFindings(group_pose)
        else:
            found = find_pose(later, before, records, settings=settings, optics=pointing, tilt=tilt)
    fit = found.pose.pose
    read = [place_of(each, output=True) for each in (epoch, earlier) if isinstance(each, str | os.PathLike)]
    read += [place_of(site)] if isinstance(site, str | os.PathLike) else []
    return PoseResult(
        verdict=found.verdict,
        frame=fit.frame,
        pivot=fit.pivot,
        translation=fit.translation,
        rotation=fit.rotation,
        covariance=fit.covariance,
        u=fit.u,
        names=tuple(fit.names),
        residuals=fit.motion.residual,
        status=found.status,
        beam=None if found.beam is None else found.beam.offset,
        beam_covariance=None if found.beam is None else found.beam.covariance,
        found=found,
        settings={
            "group": None if records is None else settings.group,
            "points": None if points is None else list(points),
            "frame": fit.frame,
            "pivot": pivot,
            "robust": robust,
            "pointing": pointing,
            "tilt": tilt_arcsec,
            "u_mm": u_mm,
        },
        hashes={
            **later.hashes,
            **({} if before is None else before.hashes),
            **({} if records is None else records.hashes),
        },
        read=tuple(read),
    )


def _refuse_mixtures(
    group: str | None,
    points: Sequence[str] | None,
    frame: str | None,
    pointing: str | None,
    tilt_arcsec: Sequence[float] | None,
) -> None:
    """Raises ArgumentError for arguments that do not fit together."""
    if group is not None and points is not None:
        raise ArgumentError("give group or points, one of the two", "group", "points")
    if tilt_arcsec is not None:
        if group != "alidade" or frame not in (None, "alidade"):
            raise ArgumentError("tilt_arcsec needs the group alidade in the frame alidade", "tilt_arcsec")
        if len(tilt_arcsec) != 3 or not np.isfinite(tilt_arcsec).all() or tilt_arcsec[2] <= 0.0:
            text = f"tilt_arcsec = {', '.join(f'{v:g}' for v in tilt_arcsec)} (expected x, y and u, u above 0)"
            raise ArgumentError(text, "tilt_arcsec")
    if pointing is not None:
        if pointing not in OPTICS:
            raise ArgumentError(f"pointing = {pointing!r} (expected one of {', '.join(OPTICS)})", "pointing")
        if points is not None or frame not in (None, "reflector") or group not in (None, "dish"):
            raise ArgumentError("pointing needs the dish in the frame reflector", "pointing")


def _refuse_without_site(*, earlier: bool, **arguments: Any) -> None:
    """Raise ArgumentError for arguments that need a site's records.

    earlier     True where no earlier epoch is given
    arguments   the others; None where they are not given
    """
    if earlier:
        raise ArgumentError(
            "earlier or site is needed: the same points at another epoch or as designed, or a telescope's records",
            "earlier",
            "site",
        )
    for name, value in arguments.items():
        if value is not None:
            raise ArgumentError(f"{name} needs site: the records of a telescope", name, "site")


def _posture(name: str, posture_deg: Sequence[float] | None) -> tuple[float, float] | None:
    """Posture (2,), rad. Raises ArgumentError beyond the telescope's."""
    if posture_deg is None:
        return None
    if len(posture_deg) != 2 or not (abs(posture_deg[0]) <= 540.0 and -5.0 <= posture_deg[1] <= 95.0):
        text = f"{name} = {', '.join(f'{v:g}' for v in posture_deg)} (expected azimuth -540 to 540, elevation -5 to 95)"
        raise ArgumentError(text, name)
    return posture_deg[0] * DEGREE, posture_deg[1] * DEGREE


def _solved(
    epoch: "str | os.PathLike[str] | SolvedPoints | NightResult",
    posture: tuple[float, float] | None,
    u: float | None = None,
) -> "SolvedPoints":
    """Points of an epoch, with the posture given for it, and u (m) where a table has none."""
    from catseye.records.network.solved_points import SolvedPoints, read_points
    from catseye.reduction.pose.dish_ways import solved_points

    if isinstance(epoch, NightResult):
        solved = replace(solved_points(epoch.reduction), verdict=epoch.verdict)
    else:
        solved = epoch if isinstance(epoch, SolvedPoints) else read_points(place_of(epoch, output=True), u=u)
    return solved if posture is None else replace(solved, posture=posture)
