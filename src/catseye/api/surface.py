"""`surface`: the shape of a dish from its prisms."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import numpy as np

from catseye.aliases import Progress
from catseye.api.night import NightResult
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.optics.zernike import Numbering
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.surface.actuators import Travel
    from catseye.reduction.surface.dish import DishDesign
    from catseye.reduction.surface.findings import SurfaceFindings
    from catseye.reduction.surface.prisms import EpochPlace, Frame
    from catseye.reduction.surface.shape import Prisms

    Input = str | os.PathLike[str] | NightResult

LIMITS = {  # argument -> smallest and largest value, unit
    "taper_db": (0.0, 60.0, "dB"),
    "frequency_ghz": (0.01, 1e4, "GHz"),
    "zernike": (1, 500, "terms"),
    "focal_length_m": (0.05, 1000.0, "m"),
    "radius_m": (0.02, 500.0, "m"),
    "diameter_m": (0.04, 1000.0, "m"),
    "u_mm": (1e-6, 100.0, "mm"),
    "azimuth_deg": (-540.0, 540.0, "degrees"),
    "elevation_deg": (-10.0, 100.0, "degrees"),
}
TABLES = (".csv", ".fits")  # endings of a table of actuators


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

    def rows(self) -> list[str]:
        """Lines of a terminal, one per Zernike term: of the change, the elevation model or the only epoch."""
        from catseye.gateways.surface.objects import term_lines

        return term_lines(self.found.shapes, self.found.change, self.found.lookup)

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

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of `report.html`, made at a time, UTC."""
        from catseye.gateways.surface.report import surface_report

        return surface_report(self.found, when, self.hashes)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye surface --out`."""
        from catseye.gateways.surface.files import write_surface

        write_surface(self.found, directory, self.hashes, progress=progress)

    def save_actuators(self, path: "str | os.PathLike[str]") -> Path:
        """Write the table of the actuators' corrections, .csv or .fits.

        path   new, or an earlier such table

        Raises InputError without corrections, for another ending, and where another's file would be lost.
        """
        from catseye.gateways.surface.files import write_actuators

        write_actuators(self.found, Path(path))
        return Path(path)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return self.hashes

    def sources(self) -> tuple[Path, ...]:
        """Files and folders that were read."""
        return self.read


@with_units
def surface(
    *inputs: "Input",
    points: Annotated[Any, In("m")] = None,
    u: Annotated[Any, In("m")] = None,
    covariance: Annotated[Any, In("m2")] = None,
    names: Sequence[str] | None = None,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    focal_length_m: Annotated[Any, In("m", one=True)] = None,
    radius_m: Annotated[Any, In("m", one=True)] = None,
    diameter_m: Annotated[Any, In("m", one=True)] = None,
    centre: Annotated[Any, In("m", many=True)] = (0.0, 0.0),
    vertex: Annotated[Any, In("m", many=True)] = (0.0, 0.0, 0.0),
    axis: Annotated[Any, In("", many=True)] = (0.0, 0.0, 1.0),
    u_mm: Annotated[Any, In("mm", one=True)] = None,
    free: Sequence[str] = ("vertex", "axis", "focal-length"),
    taper_db: Annotated[Any, In("dB", one=True)] = 0.0,
    frequency_ghz: Annotated[Any, In("GHz", many=True)] = (),
    zernike: Annotated[Any, In("", whole=True)] = 15,
    order: "Numbering" = "noll",
    frame: "Frame" = "reflector",
    azimuth_deg: Annotated[Any, In("deg", one=True)] = None,
    elevation_deg: Annotated[Any, In("deg", many=True)] = (),
    temperature_c: Annotated[Any, In("deg_C", many=True)] = (),
    actuators: bool = False,
    positions: "str | os.PathLike[str] | None" = None,
    travel: "Travel" = "normal",
    progress: Progress | None = None,
) -> SurfaceResult:
    """A dish's surface: best paraboloid, half-path errors, Zernike terms, gain, change, elevation, actuators.

    inputs          what `reduce` gave or wrote, or tables of prisms (docs/formats/surface.md), in the order measured.
                    One: its shape. Two: second less first as well. From three on: a look-up table by elevation
    points          instead: (n, 3) m of one epoch, or (T, n, 3) of several; nan where missing
    u               of points, m: a number, (n,), or (n, 3) by coordinate; independent of each other; or
    covariance      of points, m²: (n, 3, 3), or (3n, 3n) of all together; of every epoch
    names           of points; P1, P2, ... without
    site            the telescope's records; gbt without. Or another dish:
    focal_length_m  of its paraboloid, roughly where it is fitted; with
    radius_m, diameter_m   one of the two, of its aperture
    centre          (2,) m, of an offset dish's aperture from the axis, along the dish's x and y
    vertex, axis    (3,) m and (3,) of any length, in the frame of the points; roughly, where they are fitted
    u_mm            of each coordinate of tables without columns of u
    free            what is fitted: of "vertex", "axis", "focal-length"
    taper_db        illumination's edge below its middle
    frequency_ghz   gain there
    zernike, order  number of terms, and their numbering
    frame           of tables and points; azimuth_deg for those in the ground frame
    elevation_deg, temperature_c   once for each epoch; a reduction knows its elevation
    actuators       corrections of all actuators, from the last epoch
    positions       table of the actuators' positions; their middle without
    travel          of an actuator: along the normal or the axis
    progress        called with (what, done, of how many)

    Raises InputError for what cannot be used, EstimationError for too few prisms, ValidityError for settings.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-40.0, 40.0, 9), np.linspace(15.0, 95.0, 9)))
    >>> dish = np.column_stack([x, y, (x**2 + y**2) / 240.0])
    >>> found = surface(points=dish, u=1e-4)
    >>> round(found.focal_length, 6), bool(np.abs(found.deviations).max() < 1e-9)
    (60.0, True)

    >>> ring = surface(points=dish - [0.0, 55.0, 0.0], u=1e-4, focal_length_m=60.0, radius_m=57.0, vertex=(0, -55, 0),
    ...                centre=(0.0, 55.0))
    >>> ring.found.dish.site is None, np.round(ring.translation, 9).tolist()
    (True, [0.0, 0.0, 0.0])
    """
    from catseye.reduction.surface.findings import reduce_surface
    from catseye.reduction.surface.shape import ShapeSettings

    _refuse_values(taper_db=taper_db, frequency_ghz=frequency_ghz, zernike=zernike, elevation_deg=elevation_deg)
    _refuse_values(azimuth_deg=() if azimuth_deg is None else azimuth_deg)
    _refuse_words(free=free, order=[order], frame=[frame], travel=[travel])
    sizes = {"focal_length_m": focal_length_m, "radius_m": radius_m, "diameter_m": diameter_m, "u_mm": u_mm}
    _refuse_values(**{name: value for name, value in sizes.items() if value is not None})
    dish = _dish(site, sizes, centre=centre, vertex=vertex, axis=axis)
    if dish.site is None:
        _refuse_of_site(frame=frame != "reflector", azimuth_deg=azimuth_deg is not None, actuators=actuators)
    placed = _Placed(
        dish=dish,
        frame=frame,
        azimuth_deg=azimuth_deg,
        elevation_deg=_row(elevation_deg),
        temperature_c=_row(temperature_c),
        u=None if u_mm is None else u_mm * MILLIMETRE,
    )
    if points is None:
        prisms, hashes, sources = _of_inputs(inputs, placed)
    elif inputs:
        raise ArgumentError("points stand alone (expected no inputs beside them)", "points")
    else:
        prisms, hashes, sources = _of_points(points, u, covariance, names, placed), {}, ()
    found = reduce_surface(
        prisms,
        dish,
        ShapeSettings(tuple(free), taper_db, tuple(f * 1e9 for f in _row(frequency_ghz)), zernike, order),
        actuators=actuators,
        positions=_positions(positions, sources, actuators=actuators),
        travel=travel,
        progress=progress,
    )
    return _result(found, hashes, sources)


def _row(values: float | Sequence[float]) -> tuple[float, ...]:
    """Numbers of one or several."""
    return tuple(np.atleast_1d(np.asarray(values, dtype=float)).tolist())


def _dish(
    site: "str | os.PathLike[str] | SiteFolder | None",
    sizes: dict[str, Any],
    *,
    centre: Sequence[float],
    vertex: Sequence[float],
    axis: Sequence[float],
) -> "DishDesign":
    """Design: of a site's records, or of a focal length with a size.

    sizes   focal_length_m, radius_m and diameter_m; None where they are not given

    Raises ArgumentError for arguments that do not fit together.
    """
    from catseye.records.site.folder import SiteFolder, read_site
    from catseye.reduction.surface.dish import DishDesign

    focal_length, radius, diameter = sizes["focal_length_m"], sizes["radius_m"], sizes["diameter_m"]
    rows = {"centre": (centre, 2), "vertex": (vertex, 3), "axis": (axis, 3)}
    numbers = {name: np.array(_row(value)) for name, (value, _) in rows.items()}
    if focal_length is None:
        placements = {"radius_m": radius is not None, "diameter_m": diameter is not None}
        placements |= {name: bool(np.any(numbers[name] != (0.0, 0.0, 1.0)[-rows[name][1] :])) for name in ("axis",)}
        placements |= {name: bool(np.any(numbers[name])) for name in ("centre", "vertex")}
        for name, is_given in placements.items():
            if is_given:
                raise ArgumentError(f"{name} needs focal_length_m, too: a dish without a site", name, "focal_length_m")
        return DishDesign.of_site(site if isinstance(site, SiteFolder) else read_site(place_of(site or "gbt")))
    if site is not None:
        raise ArgumentError("give site or focal_length_m, one of the two", "site", "focal_length_m")
    if (radius is None) == (diameter is None):
        raise ArgumentError(
            "focal_length_m needs radius_m or diameter_m, one of the two", "focal_length_m", "radius_m", "diameter_m"
        )
    for name, (_, count) in rows.items():
        if numbers[name].shape != (count,) or not np.isfinite(numbers[name]).all():
            raise InputError(f"{name} = {numbers[name].tolist()} (expected {count} numbers)")
    return DishDesign.of_paraboloid(
        focal_length, diameter / 2.0 if radius is None else radius, **numbers,
        size="diameter_m" if radius is None else "radius_m",
    )  # fmt: skip


def _refuse_of_site(**arguments: bool) -> None:
    """Raise ArgumentError for arguments that need a site's records."""
    for name, is_given in arguments.items():
        if is_given:
            raise ArgumentError(f"{name} needs the records of a site, not focal_length_m", name, "focal_length_m")


def _positions(
    positions: "str | os.PathLike[str] | None", sources: Sequence[Path], *, actuators: bool
) -> dict[str, float] | None:
    """Positions of the actuators, mm, by name."""
    from catseye.records.panels.actuators import read_positions

    if positions is None:
        return None
    if not actuators:
        raise InputError(f"positions {positions}: goes with actuators only")
    path = place_of(positions)
    if any(path.resolve() == source.resolve() for source in sources):
        raise InputError(f"{path}: is an input, too (expected another file)")
    return read_positions(path)


def require_actuators_file(path: Path | None, *sources: "str | os.PathLike[str]") -> None:
    """Refuse a table of actuators that cannot be written, before the long work.

    path      to be written; None: none
    sources   files that are read

    Raises InputError for another ending than .csv or .fits, and for an input.
    """
    if path is None:
        return
    if path.suffix.lower() not in TABLES:
        raise InputError(f"actuators {path}: ends in {path.suffix!r} (expected .csv or .fits)")
    if any(path.resolve() == Path(source).resolve() for source in sources):
        raise InputError(f"{path}: is an input, too (expected another file)")


@dataclass(frozen=True)
class _Placed:
    """Dish and frame of tables and points, and postures and temperatures of the epochs."""

    dish: "DishDesign"
    frame: "Frame"
    azimuth_deg: float | None
    elevation_deg: Sequence[float]
    temperature_c: Sequence[float]
    u: float | None

    def of(self, epoch: int) -> "EpochPlace":
        """Frame and posture of one epoch."""
        from catseye.reduction.surface.prisms import EpochPlace

        elevation = self.elevation_deg[epoch] if self.elevation_deg else None
        temperature = self.temperature_c[epoch] if self.temperature_c else None
        return EpochPlace(self.frame, self.azimuth_deg, elevation, temperature, self.u)

    def require(self, count: int) -> None:
        """Raise InputError where a posture or temperature is missing or too many."""
        for name in ("elevation_deg", "temperature_c"):
            values = getattr(self, name)
            if values and len(values) != count:
                raise InputError(f"{name} has {len(values)} values for {count} epochs (expected one for each)")


def _refuse_values(**values: Any) -> None:
    """Raise InputError for a number outside its limits."""
    for name, value in values.items():
        low, high, unit = LIMITS[name]
        for one in np.atleast_1d(np.asarray(value, dtype=float)):
            if not low <= one <= high:
                raise InputError(f"{name} = {one:g} (expected {low:g} to {high:g} {unit})")


def _refuse_words(**values: Sequence[str]) -> None:
    """Raise InputError for an unknown word."""
    from catseye.estimation.shapes.paraboloid import PARAMETERS
    from catseye.optics.zernike import Numbering
    from catseye.reduction.surface.actuators import Travel
    from catseye.reduction.surface.prisms import Frame

    known = {
        "free": tuple(PARAMETERS),
        "order": get_args(Numbering),
        "frame": get_args(Frame),
        "travel": get_args(Travel),
    }
    for name, words in values.items():
        for word in words:
            if word not in known[name]:
                raise InputError(f"{name} = {word!r} (expected {', '.join(known[name])})")


def _of_inputs(inputs: "Sequence[Input]", placed: _Placed) -> "tuple[list[Prisms], dict[str, str], tuple[Path, ...]]":
    """Prisms of each input, SHA-256 of the files read, and the files and folders."""
    from catseye.reduction.surface.prisms import prisms_of, read_prisms

    if not inputs:
        raise InputError("surface needs an epoch: what reduce gave or wrote, a table of prisms, or points")
    placed.require(len(inputs))
    prisms: list[Prisms] = []
    hashes: dict[str, str] = {}
    places: list[Path] = []
    for k, epoch in enumerate(inputs):
        if isinstance(epoch, NightResult):
            prisms.append(replace(prisms_of(epoch.reduction), verdict=epoch.verdict))
            hashes |= epoch.reduction.campaign.hashes
            continue
        places.append(place_of(epoch, output=True))
        table, read = read_prisms(places[-1], placed.dish, placed.of(k))
        prisms.append(table)
        hashes |= read
    return prisms, hashes, tuple(places)


def _of_points(points: Any, u: Any, covariance: Any, names: Sequence[str] | None, placed: _Placed) -> "list[Prisms]":
    """Prisms of each epoch of an array."""
    from catseye.reduction.surface.prisms import independent, prisms_of_points

    x = np.asarray(points, dtype=float)
    x = x[None] if x.ndim == 2 else x
    if x.ndim != 3 or x.shape[2] != 3:
        raise InputError(f"points of shape {np.shape(points)} (expected (n, 3) or (epochs, n, 3))")
    if (u is None) == (covariance is None):
        raise ArgumentError("points need either u or covariance", "points", "u", "covariance")
    n = x.shape[1]
    if covariance is None:
        spread = np.asarray(u, dtype=float)
        spread = spread[:, None] if spread.ndim == 1 else spread
        if spread.ndim > 2 or (spread.ndim == 2 and spread.shape not in ((n, 1), (n, 3))):
            raise InputError(f"u of shape {np.shape(u)} (expected a number, ({n},) or ({n}, 3))")
        q = independent(np.broadcast_to(spread, (n, 3)))
    else:
        q = np.asarray(covariance, dtype=float)
    placed.require(len(x))
    labels = tuple(names) if names is not None else tuple(f"P{k + 1}" for k in range(n))
    return [
        prisms_of_points(
            epoch, q, labels, placed.dish, placed.of(k), source="points" if len(x) == 1 else f"points {k + 1}"
        )
        for k, epoch in enumerate(x)
    ]


def _result(found: "SurfaceFindings", hashes: dict[str, str], sources: tuple[Path, ...]) -> SurfaceResult:
    shape = found.shapes[-1]
    fit = shape.fit
    return SurfaceResult(
        verdict=found.verdict,
        names=shape.prisms.names,
        deviations=fit.deviation,
        u=np.sqrt(np.maximum(np.diag(fit.deviation_covariance), 0.0)),
        covariance=fit.deviation_covariance,
        half_path=fit.half_path,
        places=fit.local,
        translation=fit.translation,
        rotation=fit.rotation,
        focal_length=fit.focal_length,
        u_focal_length=fit.u_focal_length,
        found=found,
        hashes=hashes,
        read=sources,
    )
