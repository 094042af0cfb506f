"""Prisms of a dish from a reduction, its output directory, a table of coordinates or arrays."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.estimation.least_squares.covariance import Dense, JointPoints
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.geometry.frames.frame import Transform
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown
from catseye.records.files.verdicts import verdict_of_table
from catseye.records.network.solved_points import FILE, read_solved_points
from catseye.records.network.written_pose import FILE as POSE_FILE
from catseye.records.network.written_pose import NIGHT_POSE, read_written_pose
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.surface.shape import Prisms

Frame = Literal["reflector", "ground"]
AXES = "xyz"
PLACES = ("point", "x_m", "y_m", "z_m")
SPREADS = ("u_x_mm", "u_y_mm", "u_z_mm")
PAIRS = {"cov_xy_mm2": (0, 1), "cov_xz_mm2": (0, 2), "cov_yz_mm2": (1, 2)}
EXTRAS = ("kind", "shots", "from_approximate_mm", "u_mm")
SURFACE = ("point", "x_dish_m", "y_dish_m", "z_dish_m", "deviation_mm", "u_deviation_mm")
DISH = "dish prism"  # the kind, in coordinates.csv
LARGEST_U_MM = 100.0
FARTHEST_M = 1000.0
HELD_F = 1e-6  # m, largest difference of a reduction's focal length from the site's


class EpochPlace(NamedTuple):
    """Frame and posture of an epoch's prisms.

    frame           of coordinates; a reduction's are in the ground frame
    azimuth_deg, elevation_deg   posture; needed in the ground frame; a reduction has its own
    temperature_c   of the structure, if known
    """

    frame: Frame = "reflector"
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    temperature_c: float | None = None


def read_prisms(source: Path, site: SiteFolder, place: EpochPlace) -> tuple[Prisms, dict[str, str]]:
    """Prisms of one epoch, and SHA-256 of each input file.

    source   directory of `catseye reduce --out`, or a CSV of docs/formats/surface.md
    site     of the telescope
    place    frame of a CSV's coordinates, and posture

    Raises InputError for files that cannot be used.
    """
    try:
        folder = source.is_dir()
    except OSError as problem:
        raise InputError(f"{source}: cannot be read: {problem.strerror or problem}") from problem
    if folder:
        if place.azimuth_deg is not None:
            raise InputError(f"{source}: has its own azimuth (expected azimuth_deg with tables only)")
        return _reduced(source, site, place)
    return _table(source, site, place)


def prisms_of(reduction: Reduction) -> Prisms:
    """Dish prisms of a reduced night; InputError if it has no dish."""
    surface, coordinates, campaign = reduction.surface, reduction.coordinates, reduction.campaign
    name = campaign.site.campaign.name
    if surface is None:
        raise InputError(f"{name}: the reduction found no dish (expected a night that saw its prisms)")
    rows = coordinates.rows(surface.names)
    posture = campaign.site.campaign
    nominal = _frame(campaign, posture.azimuth_deg, posture.elevation_deg)
    azimuth, elevation = posture.azimuth_deg, posture.elevation_deg
    joint = coordinates.joint.of_points(rows)
    return Prisms(
        names=surface.names,
        points=coordinates.x[rows],
        covariance=joint,
        nominal=nominal,
        source=name,
        elevation_deg=elevation,
        azimuth_deg=azimuth,
    )


def _frame(site: SiteFolder, azimuth_deg: float, elevation_deg: float) -> Transform:
    reflector = site.site.frames.reflector
    return ground_from_reflector(
        np.radians(azimuth_deg),
        np.radians(elevation_deg),
        elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
        reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
    )


def _reduced(source: Path, site: SiteFolder, place: EpochPlace) -> tuple[Prisms, dict[str, str]]:
    """Dish prisms of a reduction, with their part of its full covariance."""
    solved = read_solved_points(source, averaged=False)
    if not solved.dish:
        raise refusal(f"{source}/{FILE}", "the reduction found no dish (expected a surface)")
    posture = read_written_pose(source / POSE_FILE, expected=(NIGHT_POSE,)).posture_deg
    if posture is None:
        raise refusal(f"{source}/{POSE_FILE}", "nominal_posture is missing (expected catseye reduce's)")
    block = solved.block(solved.dish)
    if not np.isfinite(block).all():
        raise refusal(f"{source}/{FILE}", "has a covariance that is not a number")
    designed = site.site.paraboloid.focal_length_mm * MILLIMETRE
    if solved.focal_length is None or abs(solved.focal_length - designed) > HELD_F:
        raise InputError(
            f"{source}: focal length {solved.focal_length:g} m, the site's is {designed:g} m (expected the site that "
            "was reduced with)"
        )
    azimuth, elevation = posture
    said = place.elevation_deg
    if said is not None and abs(said - elevation) > 1e-6:
        raise InputError(f"{source}: was measured at elevation {elevation:g}°, elevation_deg says {said:g}")
    prisms = Prisms(
        names=solved.dish,
        points=solved.places(solved.dish),
        covariance=JointPoints(Dense(block), np.arange(len(block)).reshape(-1, 3)),
        nominal=_frame(site, azimuth, elevation),
        source=str(source),
        elevation_deg=elevation,
        azimuth_deg=azimuth,
        temperature_c=place.temperature_c,
        verdict=solved.verdict,
    )
    return prisms, solved.hashes


def _table(source: Path, site: SiteFolder, place: EpochPlace) -> tuple[Prisms, dict[str, str]]:
    folder = Folder(source.parent)
    text = folder.text(source.name)
    dish = "x_dish_m" in text.partition("\n")[0]
    if dish and place.frame == "ground":
        raise refusal(source.name, "is in the dish's frame (expected frame = reflector)")
    if dish:
        columns = columns_of(text, source.name, SURFACE, optional=("shots",))
        points = np.column_stack([columns.numbers(f"{axis}_dish_m") for axis in AXES])
        u = _spread(columns, "u_deviation_mm")
        covariance = (u**2)[:, None, None] * np.eye(3)
    else:
        single = "u_mm" in [cell.strip() for cell in text.partition("\n")[0].split(",")]
        needed = (*PLACES, "u_mm") if single else (*PLACES, *SPREADS)
        columns = columns_of(text, source.name, needed, optional=(*PAIRS, *EXTRAS, *(SPREADS if single else ())))
        if "kind" in columns.cells:
            columns = _of_kind(columns)
        points = np.column_stack([columns.numbers(f"{axis}_m") for axis in AXES])
        covariance = _covariance(columns, single)
    names = _names(columns)
    far = np.flatnonzero(np.abs(points).max(axis=1) > FARTHEST_M)
    if len(far):
        raise columns.refuse(
            int(far[0]), f"a coordinate of {np.abs(points[far[0]]).max():g} m looks like mm (expected {FARTHEST_M:g} m)"
        )
    prisms = Prisms(
        names=names,
        points=points,
        covariance=covariance,
        nominal=_nominal(source.name, site, place),
        source=str(source),
        elevation_deg=place.elevation_deg,
        azimuth_deg=place.azimuth_deg,
        temperature_c=place.temperature_c,
        verdict=verdict_of_table(source),
    )
    return prisms, folder.hashes


def prisms_of_points(
    points: np.ndarray,
    covariance: np.ndarray,
    names: Sequence[str],
    site: SiteFolder,
    place: EpochPlace,
    *,
    source: str = "points",
) -> Prisms:
    """Prisms of one epoch from arrays.

    points       (n, 3) m; nan where missing
    covariance   (n, 3, 3) m², or (3n, 3n) of all together
    names        n, each once
    site, place  as for `read_prisms`
    source       name for messages

    Raises InputError for shapes that do not join and values that cannot be used.
    """
    n = len(points)
    if points.shape != (n, 3) or len(names) != n or covariance.shape not in ((n, 3, 3), (3 * n, 3 * n)):
        raise InputError(
            f"points {points.shape}, covariance {covariance.shape}, {len(names)} names (expected (n, 3), (n, 3, 3) or "
            "(3n, 3n), n)"
        )
    if len(set(names)) != n:
        raise InputError(f"names = {shown(next(x for x in names if list(names).count(x) > 1))} twice (expected once)")
    rows = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(rows) and (far := float(np.abs(points[rows]).max())) > FARTHEST_M:
        raise InputError(f"points: a coordinate of {far:g} m looks like mm (expected {FARTHEST_M:g} m)")
    joint = covariance.ndim == 2
    at = (3 * rows[:, None] + np.arange(3)).ravel()
    part = covariance[np.ix_(at, at)] if joint else covariance[rows]
    variances = np.diag(part) if joint else np.einsum("nii->ni", part)
    if not (np.isfinite(part).all() and (variances > 0.0).all()):
        raise InputError("covariance of the points is not finite with variances above 0 (expected m²)")
    return Prisms(
        names=tuple(names[int(row)] for row in rows),
        points=points[rows],
        covariance=part,
        nominal=_nominal(source, site, place),
        source=source,
        elevation_deg=place.elevation_deg,
        azimuth_deg=place.azimuth_deg,
        temperature_c=place.temperature_c,
    )


def independent(u: np.ndarray) -> np.ndarray:
    """Covariances (n, 3, 3), m², of coordinates with standard uncertainties u (n, 3), m."""
    return np.asarray(u[:, :, None] * np.eye(3) * u[:, None, :])


def _nominal(source: str, site: SiteFolder, place: EpochPlace) -> Transform:
    """Outer frame from the nominal paraboloid's."""
    if place.frame == "reflector":
        return Transform("reflector", "reflector", np.eye(3), np.zeros(3))
    if place.azimuth_deg is None or place.elevation_deg is None:
        raise refusal(source, "is in the ground frame: give the telescope's azimuth_deg and elevation_deg")
    return _frame(site, place.azimuth_deg, place.elevation_deg)


def _of_kind(columns: TextColumns) -> TextColumns:
    """Rows of a reduction's coordinates that are dish prisms."""
    rows = [k for k, kind in enumerate(columns.cells["kind"]) if kind == DISH]
    if not rows:
        raise refusal(columns.file, f"has no row of kind {DISH!r} (expected prisms of the dish)")
    cells = {name: [values[k] for k in rows] for name, values in columns.cells.items()}
    return TextColumns(columns.file, cells, [columns.lines[k] for k in rows])


def _names(columns: TextColumns) -> tuple[str, ...]:
    names = columns.cells["point"]
    used: set[str] = set()
    for row, name in enumerate(names):
        if not name or name in used:
            raise columns.refuse(row, f"point = {shown(name)} (expected a unique name)")
        used.add(name)
    return tuple(names)


def _spread(columns: TextColumns, name: str) -> np.ndarray:
    values = columns.numbers(name)
    columns.check(name, (values > 0.0) & (values <= LARGEST_U_MM), f"above 0 to {LARGEST_U_MM:g} mm")
    return values * MILLIMETRE


def _covariance(columns: TextColumns, single: bool) -> np.ndarray:
    """Covariance of each point, (k, 3, 3) m^2."""
    spreads: Sequence[str] = ("u_mm",) * 3 if single else SPREADS
    u = np.column_stack([_spread(columns, name) for name in spreads])
    covariance = independent(u)
    for name, (i, j) in PAIRS.items():
        if name in columns.cells:
            covariance[:, i, j] = covariance[:, j, i] = columns.numbers(name) * MILLIMETRE**2
    least = np.linalg.eigvalsh(covariance)[:, 0]
    columns.check("point", least > 0.0, "covariances smaller than the product of both u")
    return covariance
