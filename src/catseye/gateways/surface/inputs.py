"""Prisms of a dish from an output directory of `catseye reduce` or a table of coordinates."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.estimation.least_squares.covariance import Dense, JointPoints
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.geometry.frames.frame import Transform
from catseye.records.files.columns import TextColumns, columns_of
from catseye.records.files.covariance_file import part_of, stored_covariance
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown
from catseye.records.files.verdicts import stored_verdict, verdict_of_table
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


def read_prisms(
    source: Path,
    site: SiteFolder,
    *,
    frame: Frame = "reflector",
    azimuth_deg: float | None = None,
    elevation_deg: float | None = None,
    temperature_c: float | None = None,
) -> tuple[Prisms, dict[str, str]]:
    """Prisms of one epoch, and SHA-256 of each input file.

    source          directory of `catseye reduce --out`, or a CSV of docs/formats/surface.md
    site            of the telescope
    frame           of a CSV's coordinates
    azimuth_deg, elevation_deg   posture; needed for a CSV in the ground frame; a directory has its own
    temperature_c   of the structure, if known

    Raises InputError for files that cannot be used.
    """
    try:
        folder = source.is_dir()
    except OSError as problem:
        raise InputError(f"{source}: cannot be read: {problem.strerror or problem}") from problem
    if folder:
        if azimuth_deg is not None:
            raise InputError(f"{source}: has its own azimuth (expected --azimuth-deg with tables only)")
        return _reduced(source, site, elevation_deg, temperature_c)
    return _table(source, site, frame, (azimuth_deg, elevation_deg), temperature_c)


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
    return Prisms(surface.names, coordinates.x[rows], joint, nominal, name, elevation, azimuth)


def _frame(site: SiteFolder, azimuth_deg: float, elevation_deg: float) -> Transform:
    reflector = site.site.frames.reflector
    return ground_from_reflector(
        np.radians(azimuth_deg),
        np.radians(elevation_deg),
        elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
        reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
    )


def _object(folder: Folder, file: str) -> dict[str, Any]:
    try:
        stored = json.loads(folder.text(file))
    except (ValueError, RecursionError) as problem:
        raise refusal(file, f"cannot be read as JSON: {problem}") from problem
    if not isinstance(stored, dict):
        raise refusal(file, f"holds {type(stored).__name__} (expected an object from catseye reduce)")
    return stored


def _reduced(
    source: Path, site: SiteFolder, elevation_deg: float | None, temperature_c: float | None
) -> tuple[Prisms, dict[str, str]]:
    """Dish prisms of a reduction, with their part of its full covariance."""
    folder = Folder(source)
    answer, pose = _object(folder, "coordinates.json"), _object(folder, "pose.json")
    try:
        surface = answer["surface"]
        if surface is None:
            raise refusal(f"{source}/coordinates.json", "surface = null: the reduction found no dish")
        names = tuple(surface["deviations"])
        points = np.array([[answer["points"][name][axis] for axis in AXES] for name in names], dtype=float)
        at = {label: row for row, label in enumerate(answer["covariance_order"])}
        rows = np.array([at[f"{name} {axis}"] for name in names for axis in AXES])
        block = part_of(np.asarray(stored_covariance(answer, folder.directory, len(at))), rows, rows)
        posture = pose["nominal_posture"]
        azimuth, elevation = float(posture["azimuth_deg"]), float(posture["elevation_deg"])
        focal = float(surface["focal_length"])
    except (KeyError, TypeError, ValueError, IndexError) as problem:
        raise refusal(
            f"{source}/coordinates.json", f"is not a reduction: {problem!r} (expected the output of catseye reduce)"
        ) from problem
    if not (np.isfinite(points).all() and np.isfinite(block).all()):
        raise refusal(f"{source}/coordinates.json", "has a coordinate or covariance that is not a number")
    designed = site.site.paraboloid.focal_length_mm * MILLIMETRE
    if abs(focal - designed) > HELD_F:
        raise InputError(
            f"{source}: focal length {focal:g} m, the site's is {designed:g} m (expected the reduction's own site by "
            "--site)"
        )
    if elevation_deg is not None and abs(elevation_deg - elevation) > 1e-6:
        raise InputError(f"{source}: was measured at elevation {elevation:g}°, --elevation-deg says {elevation_deg:g}")
    hashes = {f"{source.name}/{name}": digest for name, digest in folder.hashes.items()}
    nominal = _frame(site, azimuth, elevation)
    covariance = JointPoints(Dense(block), np.arange(len(rows)).reshape(-1, 3))
    prisms = Prisms(names, points, covariance, nominal, str(source), elevation, azimuth, temperature_c)
    return replace(prisms, verdict=stored_verdict(f"{source}/coordinates.json", answer)), hashes


def _table(
    source: Path,
    site: SiteFolder,
    frame: Frame,
    posture: tuple[float | None, float | None],
    temperature_c: float | None,
) -> tuple[Prisms, dict[str, str]]:
    folder = Folder(source.parent)
    text = folder.text(source.name)
    azimuth, elevation = posture
    dish = "x_dish_m" in text.partition("\n")[0]
    if dish and frame == "ground":
        raise refusal(source.name, "is in the dish's frame (expected --frame reflector)")
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
    if frame == "ground":
        if azimuth is None or elevation is None:
            raise refusal(source.name, "is in the ground frame: give the telescope's --azimuth-deg and --elevation-deg")
        nominal = _frame(site, azimuth, elevation)
    else:
        nominal = Transform("reflector", "reflector", np.eye(3), np.zeros(3))
    prisms = Prisms(names, points, covariance, nominal, str(source), elevation, azimuth, temperature_c)
    return replace(prisms, verdict=verdict_of_table(source)), folder.hashes


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
    covariance = u[:, :, None] * np.eye(3) * u[:, None, :]
    for name, (i, j) in PAIRS.items():
        if name in columns.cells:
            covariance[:, i, j] = covariance[:, j, i] = columns.numbers(name) * MILLIMETRE**2
    least = np.linalg.eigvalsh(covariance)[:, 0]
    columns.check("point", least > 0.0, "covariances smaller than the product of both u")
    return covariance
