"""`surface`: what shape the dish has."""

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
from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.surface.shape import Prisms
    from catseye.reduction.surface.verdict import SurfaceFindings


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceResult(Result):
    """A dish's surface, of the last epoch where there were several: k prisms.

    names           of the prisms
    deviations      (k,) m, along the normal off the fitted paraboloid, above zero towards the focus
    u               (k,) m, standard uncertainties
    covariance      (k, k) m² of the deviations
    half_path       (k,) m, half of what each shortens the path by
    places          (k, 3) m, in the dish's frame
    translation     (3,) m, of the vertex off nominal, ground axes
    rotation        (3,) rad, of the dish off nominal
    focal_length    m
    u_focal_length  m, zero where it was held
    found           everything else: Zernike terms, gain, change, look-up table, actuators
    hashes          SHA-256 of each file read, by its name
    read            files and folders that were read
    """

    names: tuple[str, ...]
    deviations: np.ndarray
    u: np.ndarray
    covariance: np.ndarray
    half_path: np.ndarray
    places: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    focal_length: float
    u_focal_length: float
    found: "SurfaceFindings"
    hashes: dict[str, str] = field(default_factory=dict)
    read: tuple[Path, ...] = ()

    def passages(self) -> "Sequence[Passage]":
        """The dish, its paraboloid, half path and gain; the change; the look-up table; the actuators."""
        from catseye.gateways.surface.objects import surface_passages

        return surface_passages(self.found)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye surface --json`."""
        from catseye.gateways.surface.files import surface_object

        return surface_object(self.found)

    def tables(self) -> "dict[str, QTable]":
        """`prisms`: a row a prism; `zernike`: a row a term; `actuators` where they were asked for."""
        from catseye.optics.zernike import number

        shape = self.found.shapes[-1]
        prisms = {
            "point": (self.names, ""),
            **{axis: (self.places[:, k], "m") for k, axis in enumerate("xyz")},
            "deviation": (self.deviations / MILLIMETRE, "mm"),
            "u_deviation": (self.u / MILLIMETRE, "mm"),
            "half_path": (self.half_path / MILLIMETRE, "mm"),
        }
        terms = shape.expansion
        zernike = {
            shape.settings.numbering: ([number(term, shape.settings.numbering) for term in terms.terms], ""),
            "name": ([term.name for term in terms.terms], ""),
            "value": (terms.value / MILLIMETRE, "mm"),
            "u": (np.sqrt(np.diag(terms.covariance)) / MILLIMETRE, "mm"),
            "taken": (100.0 * terms.share, "%"),
        }
        tables = {"prisms": quantities(prisms), "zernike": quantities(zernike)}
        actuators = self.found.actuators
        if actuators is not None:
            columns = {
                "correction": (actuators.correction / MILLIMETRE, "mm"),
                "u_correction": (actuators.u_correction / MILLIMETRE, "mm"),
            }
            tables["actuators"] = quantities(columns)
        return tables

    def figures(self) -> "dict[str, Figure]":
        """Map of half-path errors, Zernike terms; change, terms by elevation, actuators where there are such."""
        from catseye.gateways.surface.figures import (
            actuator_map,
            change_map,
            elevation_terms,
            shape_map,
            zernike_bars,
        )

        found, shape = self.found, self.found.shapes[-1]
        drawn = {"map": shape_map(shape), "zernike": zernike_bars(shape.expansion, shape.settings)}
        if found.change is not None:
            drawn["change"] = change_map(found.change)
        if found.lookup is not None:
            drawn["elevation"] = elevation_terms(found.lookup)
        if found.actuators is not None:
            drawn["actuators"] = actuator_map(found.actuators, shape.aperture)
        return drawn

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye surface --out`."""
        from catseye.gateways.surface.files import write_surface

        write_surface(self.found, directory, self.hashes, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def surface(
    *epochs: "str | os.PathLike[str] | NightResult",
    site: "str | os.PathLike[str] | SiteFolder" = "gbt",
    free: Sequence[str] = ("vertex", "axis", "focal-length"),
    taper_db: Annotated[Any, In("dB", one=True)] = 0.0,
    frequency_ghz: Annotated[Any, In("GHz", many=True)] = (),
    zernike: Annotated[Any, In("", whole=True)] = 15,
    order: Literal["noll", "ansi"] = "noll",
    frame: Literal["reflector", "ground"] = "reflector",
    azimuth_deg: Annotated[Any, In("deg", one=True)] = None,
    elevation_deg: Annotated[Any, In("deg", many=True)] = (),
    temperature_c: Annotated[Any, In("deg_C", many=True)] = (),
    actuators: bool = False,
    positions: "str | os.PathLike[str] | None" = None,
    travel: Literal["normal", "axis"] = "normal",
    progress: Progress | None = None,
) -> SurfaceResult:
    """A dish's surface: best paraboloid, half-path errors, Zernike terms, gain, change, elevation, actuators.

    epochs          what `reduce` gave or wrote, or tables of prisms (docs/formats/surface.md), in the order measured.
                    One: its shape. Two: second less first as well. From three on: a look-up table by elevation
    site            the telescope's records
    free            what is fitted: of "vertex", "axis", "focal-length"
    taper_db        illumination's edge below its middle
    frequency_ghz   gain there
    zernike, order  how many terms, and their numbering
    frame           of tables; azimuth_deg for those in the ground frame
    elevation_deg, temperature_c   once for each epoch; a reduction knows its elevation
    actuators       corrections of all actuators, from the last epoch
    positions       where the actuators stand; their middle without
    travel          of an actuator: along the normal or the axis
    progress        called with (what, done, of how many)

    Raises InputError for what cannot be used, EstimationError for too few prisms, ValidityError for settings.
    """
    from catseye.gateways.surface.inputs import prisms_of, read_prisms
    from catseye.records.panels.actuators import read_positions
    from catseye.records.site.folder import SiteFolder, read_site
    from catseye.reduction.surface.actuators import actuators_of, corrections
    from catseye.reduction.surface.change import change_between
    from catseye.reduction.surface.lookup import lookup_of
    from catseye.reduction.surface.placement import design_places, placement_of
    from catseye.reduction.surface.shape import LitAperture, ShapeSettings, shape_of
    from catseye.reduction.surface.verdict import SurfaceFindings, surface_verdict

    if not epochs:
        raise InputError("surface needs an epoch: what reduce gave or wrote, or a table of prisms")
    records = site if isinstance(site, SiteFolder) else read_site(place_of(site))
    aperture = LitAperture.of(records.site.paraboloid)
    settings = ShapeSettings(tuple(free), taper_db, tuple(f * 1e9 for f in frequency_ghz), zernike, order)
    prisms: list[Prisms] = []
    hashes: dict[str, str] = {}
    for k, epoch in enumerate(epochs):
        if isinstance(epoch, NightResult):
            prisms.append(replace(prisms_of(epoch.reduction), verdict=epoch.verdict))
            hashes |= epoch.reduction.campaign.hashes
            continue
        table, read = read_prisms(
            place_of(epoch, output=True),
            records,
            frame=frame,
            azimuth_deg=azimuth_deg,
            elevation_deg=elevation_deg[k] if elevation_deg else None,
            temperature_c=temperature_c[k] if temperature_c else None,
        )
        prisms.append(table)
        hashes |= read
    design = design_places(records)
    shapes, placements = [], []
    for k, each in enumerate(prisms):
        if progress is not None:
            progress("fitting epochs", k, len(prisms))
        placement = placement_of(each, aperture, design)
        try:
            if np.all(placement.outside > 0.0):
                raise EstimationError(placement.doubt)
            shapes.append(shape_of(each, aperture, settings))
        except EstimationError as problem:
            raise EstimationError(f"{each.source}: {placement.doubt or problem}") from problem
        placements.append(placement)
    change = change_between(prisms[0], prisms[1], aperture, settings=settings) if len(prisms) == 2 else None
    lookup = lookup_of(shapes) if len(prisms) >= 3 else None
    moved = None
    if actuators:
        known = None if positions is None else read_positions(place_of(positions))
        moved = corrections(shapes[-1], *actuators_of(records), positions=known, travel=travel)
    found = SurfaceFindings(tuple(shapes), change, lookup, moved, tuple(placements))
    fit = shapes[-1].fit
    return SurfaceResult(
        surface_verdict(found),
        shapes[-1].prisms.names,
        fit.deviation,
        np.sqrt(np.maximum(np.diag(fit.deviation_covariance), 0.0)),
        fit.deviation_covariance,
        fit.half_path,
        fit.local,
        fit.translation,
        fit.rotation,
        fit.focal_length,
        fit.u_focal_length,
        found,
        hashes,
        tuple(place_of(each, output=True) for each in epochs if not isinstance(each, NightResult)),
    )
