"""`track_pointing`: tilt of the alidade by azimuth."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.laboratory.tilts import TiltReadings
    from catseye.records.network.written_pose import WrittenPose
    from catseye.reduction.pose.track_profile import TrackProfile


@dataclass(frozen=True, eq=False, repr=False)
class TrackProfileResult(Result):
    """Tilt of the alidade by azimuth as a Fourier series of c coefficients.

    names       of the coefficients
    values      (c,) rad, about east and north; nan where undetermined
    covariance  (c, c) rad^2
    axis        (2,) rad, AN and AW of the azimuth axis
    axis_covariance   (2, 2)
    undetermined      names of coefficients that the observations do not determine
    profile     everything else
    hashes      SHA-256 of each file read, by its name
    read        files that were read
    """

    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    axis: np.ndarray
    axis_covariance: np.ndarray
    undetermined: tuple[str, ...]
    profile: "TrackProfile"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """Observations, the axis, the inclinometer's zero and the fit."""
        from catseye.gateways.pose.pointing_series_files import track_words
        from catseye.gateways.writers.passage import Passage

        return [Passage(title, text) for title, text in track_words(self.profile)]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye pointing track --json`."""
        from catseye.gateways.pose.pointing_series_objects import track_object

        return track_object(self.profile)

    def lines(self) -> list[str]:
        """Lines of the coefficients that the command prints."""
        from catseye.gateways.pose.pointing_series_files import track_lines

        return track_lines(self.profile)

    def tables(self) -> "dict[str, QTable]":
        """`coefficients`: a row a coefficient; `observations`: a row a pose or reading."""
        profile = self.profile
        coefficients = {
            "coefficient": (self.names, ""),
            "value": (self.values / ARCSECOND, "arcsec"),
            "u": (np.sqrt(np.diag(self.covariance)) / ARCSECOND, "arcsec"),
        }
        observations = {
            "azimuth": (profile.azimuth / DEGREE, "deg"),
            **{f"residual_{axis}": (profile.residual[:, k] / ARCSECOND, "arcsec") for k, axis in enumerate("xy")},
            **{f"w_{axis}": (profile.w[:, k], "") for k, axis in enumerate("xy")},
        }
        return {"coefficients": quantities(coefficients), "observations": quantities(observations)}

    def figures(self) -> "dict[str, Figure]":
        """Tilt by azimuth, and residuals."""
        from catseye.gateways.pose.pointing_series_figures import track_figures

        return track_figures(self.profile)

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.pose.pointing_series_files import track_report

        return track_report(self.profile, self.hashes, when)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye pointing track --out`."""
        from catseye.gateways.pose.pointing_series_files import write_track

        write_track(self.profile, directory, self.hashes)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files that were read, which `save` leaves alone."""
        return self.read


@with_units
def track_pointing(
    poses: "Sequence[str | os.PathLike[str] | WrittenPose] | None" = None,
    *,
    tilts: "str | os.PathLike[str] | TiltReadings | None" = None,
    harmonics: Annotated[Any, In("", whole=True)] = 2,
) -> TrackProfileResult:
    """Tilt of the alidade by azimuth: poses and inclinometer in one Fourier series.

    poses       pose.json of the alidade in its own frame, at several azimuths (`pose` with group="alidade")
    tilts       TILTS.csv of an inclinometer on the alidade, or its readings
    harmonics   waves a turn, 0 to 36

    Raises ArgumentError without poses and tilts, InputError for files that cannot be used, EstimationError where the
    observations do not determine the coefficients.

    >>> profile = track_pointing(tilts="pointing/tilts.csv", harmonics=3)
    >>> profile.verdict.word, len(profile.names), len(profile.undetermined)
    ('good', 14, 4)
    """
    from catseye.records.laboratory.tilts import TiltReadings, read_tilts
    from catseye.records.network.written_pose import WrittenPose, read_written_pose
    from catseye.reduction.pose.track_profile import track_of_poses

    if not poses and tilts is None:
        raise ArgumentError("a track profile needs poses, tilts or both", "tilts")
    paths = [place_of(each) for each in poses or () if not isinstance(each, WrittenPose)]
    records = [each if isinstance(each, WrittenPose) else read_written_pose(place_of(each)) for each in poses or ()]
    hashes = {pose.file: pose.digest for pose in records}
    if tilts is not None and not isinstance(tilts, TiltReadings):
        paths.append(place_of(tilts))
        tilts = read_tilts(paths[-1])
        hashes[str(paths[-1])] = tilts.digest
    profile = track_of_poses(records, tilts=tilts, harmonics=harmonics)
    axis, spread = profile.series.axis
    return TrackProfileResult(
        verdict=profile.verdict,
        names=profile.series.names,
        values=profile.series.values,
        covariance=profile.series.covariance,
        axis=axis,
        axis_covariance=spread,
        undetermined=profile.series.undetermined,
        profile=profile,
        hashes=hashes,
        read=tuple(paths),
    )
