"""`displace_model`: displacements of targets and rangers by a structural model."""

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
from catseye.constants import DEGREE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.structural_model import StructuralModel
    from catseye.reduction.structure.beam import BeamOffset
    from catseye.reduction.structure.displacement import ModelDisplacements


@dataclass(frozen=True, eq=False, repr=False)
class DisplacementResult(Result):
    """Displacements of n points of the telescope in p postures.

    displaced    places of the rigid telescope, displacements, covariances
    beam     offset of the prime focus's beam; None without a site
    hashes   SHA-256 of each file read, by its name
    read     files and folders that were read
    """

    displaced: "ModelDisplacements"
    beam: "BeamOffset | None" = None
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the n targets and rangers."""
        return self.displaced.names

    @property
    def displacement(self) -> np.ndarray:
        """Displacements (p, n, 3) m, ground axes."""
        return self.displaced.ground

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (p, n, 3, 3) m² of each."""
        return self.displaced.covariance

    def passages(self) -> "Sequence[Passage]":
        """The model, the point that moves most, the beam, notes."""
        from catseye.gateways.structure.model.objects import displacement_passages

        return displacement_passages(self.displaced, self.beam)

    def rows(self) -> list[str]:
        """Lines of a terminal: each point's displacement with u."""
        from catseye.gateways.structure.model.objects import displacement_lines

        return displacement_lines(self.displaced)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye model displace --json`."""
        from catseye.gateways.structure.model.objects import displacement_object

        return displacement_object(self.displaced, self.beam)

    def tables(self) -> "dict[str, QTable]":
        """`displacements`: a row a posture and point; `beam`: a row a posture."""
        from catseye.gateways.structure.model.tables import BEAM, DISPLACEMENTS, BeamRows

        columns = [column.name for column in DISPLACEMENTS.columns]
        tables = {"displacements": quantities(DISPLACEMENTS.quantities(self.displaced, columns))}
        if self.beam is not None:
            rows = BeamRows(self.displaced, self.beam)
            tables["beam"] = quantities(BEAM.quantities(rows, [column.name for column in BEAM.columns]))
        return tables

    def figures(self) -> "dict[str, Figure]":
        """Displacement with elevation, and from the side."""
        from catseye.gateways.structure.model.figures import elevation_figure, side_figure

        return {"elevation": elevation_figure(self.displaced), "side": side_figure(self.displaced)}

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.structure.model.files import displacement_report

        return displacement_report(self.displaced, self.beam, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye model displace --out`."""
        from catseye.gateways.structure.model.files import write_displacements

        write_displacements(self.displaced, self.beam, directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def displace_model(
    model: "str | os.PathLike[str] | StructuralModel",
    *,
    posture_deg: Annotated[Any, In("deg")],
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    points: str | Sequence[str] = (),
) -> DisplacementResult:
    """Displacements of targets and moving rangers by a structural model, with u.

    model           file of docs/formats/structural-model.md, or its record
    posture_deg     (p, 2) azimuth and elevation, or one pair
    temperature_c   of the structure; the model's assumed or reference temperature without
    site            whose targets and rangers are displaced, and whose beam; the model's own points without
    points          names or patterns; without, all but the prisms of a site's dish

    Raises InputError for a file that cannot be used and for unknown points, ValidityError outside the model's range,
    ArgumentError for a posture that is none.

    >>> displaced = displace_model("structural-model/telescope.toml", posture_deg=[0.0, 10.0], points="ZEG41040L")
    >>> (1e3 * displaced.displacement[0, 0]).round(1).tolist()
    [-1.2, 18.8, -62.0]
    """
    from catseye.geometry.antenna.deformation import TelescopePosture
    from catseye.reduction.pose.pointing_offsets import site_aperture
    from catseye.reduction.structure.beam import model_beam
    from catseye.reduction.structure.displacement import displacements, model_points, site_points

    angles = postures_of(posture_deg)
    antenna, hashes, read = antenna_from(model)
    warm = antenna.record.usual_temperature_c if temperature_c is None else float(temperature_c)
    at = TelescopePosture(angles[:, 0], angles[:, 1], warm)
    patterns = [points] if isinstance(points, str) else list(points)
    if site is None:
        displaced = displacements(antenna, model_points(antenna, patterns), at)
        return DisplacementResult(verdict=displaced.verdict, displaced=displaced, hashes=hashes, read=read)
    records, more = site_from(site)
    moving, unmoved = site_points(antenna, records, patterns)
    displaced = displacements(antenna, moving, at, unmoved=unmoved)
    return DisplacementResult(
        verdict=displaced.verdict,
        displaced=displaced,
        beam=model_beam(antenna, site_aperture(records), at),
        hashes=hashes | records.hashes,
        read=(*read, *more),
    )


def postures_of(posture_deg: Any) -> np.ndarray:
    """Azimuth and elevation (p, 2) rad; ArgumentError for another shape or an angle out of range.

    posture_deg   one pair, or (p, 2)
    """
    try:
        table = np.atleast_2d(np.asarray(posture_deg, dtype=float))
    except ValueError:
        table = np.zeros((0, 0))
    if table.ndim != 2 or table.shape[1:] != (2,) or not len(table):
        raise ArgumentError("posture_deg is no azimuth and elevation (expected two numbers each)", "posture_deg")
    for a, e in table:
        if not (-540.0 <= a <= 540.0 and -10.0 <= e <= 100.0):
            raise ArgumentError(
                f"posture_deg = {a:g}, {e:g} (expected azimuth -540 to 540, elevation -10 to 100)", "posture_deg"
            )
    return np.asarray(table * DEGREE)


def antenna_from(model: Any) -> "tuple[Any, dict[str, str], tuple[Path, ...]]":
    """Antenna of a structural model, hashes and paths of the files read.

    model   path, bundled name, or the record
    """
    from catseye.records.site.structural_model import StructuralModel, read_structural_model
    from catseye.reduction.structure.antenna import antenna_of

    if isinstance(model, StructuralModel):
        return antenna_of(model), {}, ()
    path = place_of(model)
    record = read_structural_model(path)
    return antenna_of(record), {path.name: digest_of(path)}, (path,)


def site_from(site: Any) -> "tuple[SiteFolder, tuple[Path, ...]]":
    """Records of a site, and the paths read.

    site   path, bundled name, or the records
    """
    from catseye.records.site.folder import SiteFolder, read_site

    if isinstance(site, SiteFolder):
        return site, ()
    path = place_of(site)
    return read_site(path), (path,)
