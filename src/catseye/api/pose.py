"""`pose`: where the antenna's parts are, and where its beam points."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from catseye.aliases import Progress
from catseye.api.night import NightResult
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import InputError
from catseye.processors import free_threads

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.pose.verdicts import PoseFindings

Optics = Literal["prime", "gregorian"]
CARRIED = {"prime": "feed-arm", "gregorian": "subreflector"}


@dataclass(frozen=True, eq=False, repr=False)
class PoseResult(Result):
    """Six degrees of freedom of a group of points: second = pivot + translation + rotation (first - pivot).

    frame         axes of the answer: "ground", "alidade" or "reflector"
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
    site: "str | os.PathLike[str] | SiteFolder",
    group: str | None = None,
    points: Sequence[str] | None = None,
    frame: str | None = None,
    pivot: Annotated[Any, In("m", many=True)] = None,
    robust: str | None = None,
    pointing: Optics | None = None,
    tilt_arcsec: Annotated[Any, In("arcsec", many=True)] = None,
    posture_deg: Annotated[Any, In("deg", many=True)] = None,
    earlier_posture_deg: Annotated[Any, In("deg", many=True)] = None,
) -> PoseResult:
    """Six degrees of freedom of a part of the antenna between two epochs or against design; beam and focus too.

    epoch         what `reduce` gave or wrote, or its coordinates.json
    earlier       the epoch to count from; the site's design without
    site          site or campaign whose records say what stands where
    group         "dish" (usual), "feed-arm", "alidade" or "subreflector", or
    points        names of points that move as one
    frame         "ground" (usual), "alidade" or "reflector"
    pivot         (3,) m, of the rotation, in the frame; vertex, focus or mean of the points without
    robust        how points that moved alone are left out, as `catseye pose --robust`
    pointing      optics whose beam and focus are derived; then frame and group are the reflector's and the dish
    tilt_arcsec   x, y and their u of an inclinometer on the alidade, its zero taken out
    posture_deg, earlier_posture_deg   azimuth and elevation of the epochs, where their files do not say

    Raises InputError where points, postures or files are missing and EstimationError where nothing can be fitted.
    """
    from catseye.records.site.folder import SiteFolder, read_site
    from catseye.reduction.pose.pose import at_posture
    from catseye.reduction.pose.verdicts import pose_status, pose_verdict

    records = site if isinstance(site, SiteFolder) else read_site(place_of(site))
    later, before = _solved(epoch, posture_deg), None if earlier is None else _solved(earlier, earlier_posture_deg)
    if later.posture is None:
        raise InputError(f"{later.file}: its posture is unknown (expected pose.json beside it, or --posture AZ,EL)")
    chosen = {
        "group": None if points is not None else group or "dish",
        "points": None if points is None else list(points),
        "frame": frame or ("reflector" if pointing else "alidade" if tilt_arcsec is not None else "ground"),
        "pivot": None if pivot is None else np.array(pivot, dtype=float),
        "robust": robust,
    }
    with free_threads():
        found = _posed(later, before, at_posture(records, *later.posture), chosen, pointing, tilt_arcsec)
    fit = found.pose.pose
    hashes = {**later.hashes, **({} if before is None else before.hashes), **records.hashes}
    read = [place_of(each, output=True) for each in (epoch, earlier) if isinstance(each, str | os.PathLike)]
    read += [place_of(site)] if isinstance(site, str | os.PathLike) else []
    return PoseResult(
        pose_verdict(found),
        fit.frame,
        fit.pivot,
        fit.translation,
        fit.rotation,
        fit.covariance,
        fit.u,
        tuple(fit.names),
        fit.motion.residual,
        pose_status(found),
        None if found.beam is None else found.beam.offset,
        None if found.beam is None else found.beam.covariance,
        found,
        {**chosen, "pivot": pivot, "pointing": pointing, "tilt": tilt_arcsec},
        hashes,
        tuple(read),
    )


def _posed(
    later: "SolvedPoints",
    before: "SolvedPoints | None",
    site: "SiteFolder",
    chosen: dict[str, Any],
    optics: Optics | None,
    tilt_arcsec: Sequence[float] | None,
) -> "PoseFindings":
    """The pose, with an inclinometer joined or the beam derived where asked for."""
    from catseye.reduction.pose.pointing_offsets import cross_covariance, pointing_offset
    from catseye.reduction.pose.pose import pose_of_group
    from catseye.reduction.pose.track_profile import pose_with_tilt
    from catseye.reduction.pose.verdicts import PoseFindings

    group_pose = pose_of_group(later, before, site, **chosen)
    if tilt_arcsec is not None:
        x, y, u = (v * ARCSECOND for v in tilt_arcsec)
        return PoseFindings(pose_with_tilt(group_pose, np.array([x, y]), u), None)
    if optics is None:
        return PoseFindings(group_pose, None)
    robust = chosen["robust"]
    carried = pose_of_group(later, before, site, group=CARRIED[optics], frame="reflector", robust=robust)
    cross = cross_covariance(carried, group_pose, site, earlier=before)
    return PoseFindings(group_pose, pointing_offset(group_pose.pose, carried.pose, site, cross=cross, optics=optics))


def _solved(
    epoch: "str | os.PathLike[str] | SolvedPoints | NightResult", posture_deg: Sequence[float] | None
) -> "SolvedPoints":
    """The points of an epoch, with the posture that was told for it."""
    from catseye.records.network.solved_points import SolvedPoints, read_solved_points
    from catseye.reduction.pose.dish_ways import solved_points

    if isinstance(epoch, NightResult):
        solved = replace(solved_points(epoch.reduction), verdict=epoch.verdict)
    else:
        solved = epoch if isinstance(epoch, SolvedPoints) else read_solved_points(place_of(epoch, output=True))
    if posture_deg is None:
        return solved
    azimuth, elevation = posture_deg
    return replace(solved, posture=(azimuth * DEGREE, elevation * DEGREE))
