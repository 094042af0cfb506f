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
from catseye.records.files.examples import name_of
from catseye.records.files.point_table import read_point_table, refuse_far, require_uncertainty
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown
from catseye.records.files.verdicts import verdict_of_table
from catseye.records.network.solved_points import FILE, read_solved_points
from catseye.records.network.written_pose import FILE as POSE_FILE
from catseye.records.network.written_pose import NIGHT_POSE, read_written_pose
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.surface.dish import DishDesign
from catseye.reduction.surface.shape import Prisms

Frame = Literal["reflector", "ground"]
AXES = "xyz"
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
    u               m, of each coordinate of a table without uncertainties
    """

    frame: Frame = "reflector"
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    temperature_c: float | None = None
    u: float | None = None


def read_prisms(source: Path, dish: DishDesign, place: EpochPlace) -> tuple[Prisms, dict[str, str]]:
    """Prisms of one epoch, and SHA-256 of each input file.

    source   directory of `catseye reduce --out`, or a CSV of docs/formats/surface.md
    dish     design
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
        return _reduced(source, dish.require_site(f"{source}: a directory"), place)
    return _table(source, dish, place)


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
        source=name_of(source),
        elevation_deg=elevation,
        azimuth_deg=azimuth,
        temperature_c=place.temperature_c,
        verdict=solved.verdict,
    )
    return prisms, solved.hashes


def _table(source: Path, dish: DishDesign, place: EpochPlace) -> tuple[Prisms, dict[str, str]]:
    folder = Folder(source.parent)
    text = folder.text(source.name)
    fitted = "x_dish_m" in text.partition("\n")[0]
    if fitted and place.frame == "ground":
        raise refusal(source.name, "is in the dish's frame (expected frame = reflector)")
    if fitted:
        columns = columns_of(text, source.name, SURFACE, optional=("shots",))
        points = np.column_stack([columns.numbers(f"{axis}_dish_m") for axis in AXES])
        u = _spread(columns, "u_deviation_mm")
        covariance, names = (u**2)[:, None, None] * np.eye(3), _names(columns)
    else:
        table = read_point_table(text, source.name, kind=DISH, u=place.u)
        points, covariance, names = table.x, require_uncertainty(table), table.names
        refuse_far(table, np.zeros(3) if dish.nominal is None else dish.nominal.translation, FARTHEST_M)
    prisms = Prisms(
        names=names,
        points=points,
        covariance=covariance,
        nominal=_nominal(source.name, dish, place),
        source=name_of(source),
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
    dish: DishDesign,
    place: EpochPlace,
    *,
    source: str = "points",
) -> Prisms:
    """Prisms of one epoch from arrays.

    points       (n, 3) m; nan where missing
    covariance   (n, 3, 3) m², or (3n, 3n) of all together
    names        n, each once
    dish, place  as for `read_prisms`
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
        nominal=_nominal(source, dish, place),
        source=source,
        elevation_deg=place.elevation_deg,
        azimuth_deg=place.azimuth_deg,
        temperature_c=place.temperature_c,
    )


def independent(u: np.ndarray) -> np.ndarray:
    """Covariances (n, 3, 3), m², of coordinates with standard uncertainties u (n, 3), m."""
    return np.asarray(u[:, :, None] * np.eye(3) * u[:, None, :])


def _nominal(source: str, dish: DishDesign, place: EpochPlace) -> Transform:
    """Outer frame from the nominal paraboloid's."""
    if dish.nominal is not None:
        return dish.nominal
    if place.frame == "reflector":
        return Transform("reflector", "reflector", np.eye(3), np.zeros(3))
    if place.azimuth_deg is None or place.elevation_deg is None:
        raise refusal(source, "is in the ground frame: give the telescope's azimuth_deg and elevation_deg")
    return _frame(dish.require_site(source), place.azimuth_deg, place.elevation_deg)


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
