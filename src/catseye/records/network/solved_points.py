"""Points of a reduction: coordinates.json with its full covariance, and the posture."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from catseye.estimation.least_squares.covariance import JointPoints
from catseye.records.files.covariance_file import part_of, stored_covariance
from catseye.records.files.examples import name_of
from catseye.records.files.point_table import read_point_table
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown
from catseye.records.files.verdicts import stored_verdict, verdict_of_table
from catseye.records.network.written_pose import FILE as POSE_FILE
from catseye.records.network.written_pose import NIGHT_POSE, read_written_pose
from catseye.verdict import Verdict

FORMAT = "catseye-reduction-1"  # of coordinates.json
FILE = "coordinates.json"
DRAWN = 1e-6  # of two standard uncertainties' product: largest asymmetry of a printed covariance


@dataclass(frozen=True, eq=False, repr=False)
class SolvedPoints:
    """Points of one epoch in the ground frame.

    file         as named by the user, for messages
    campaign     name
    names        n
    x            (n, 3) m
    covariance   (3n, 3n) m^2, or (n, 3, 3) of independent points, zero for exact ones; for many points mapped from a
                 file, or an object that gives its parts
    posture      azimuth and elevation, rad, from pose.json, if there
    hashes       SHA-256 of the files read, by name
    verdict      of the reduction; None if the file has none
    dish         names of the prisms of its surface, if it has one
    focal_length of that surface, m
    unchecked    points that an error of one of their lines, or of a survey, would move unseen
    """

    file: str
    campaign: str
    names: tuple[str, ...]
    x: np.ndarray
    covariance: np.ndarray | JointPoints
    posture: tuple[float, float] | None
    hashes: dict[str, str]
    verdict: Verdict | None = None
    dish: tuple[str, ...] = ()
    focal_length: float | None = None
    unchecked: tuple[str, ...] = ()

    def __repr__(self) -> str:
        where = Path(self.file).name
        return f"<Solved points of {self.campaign}: {len(self.names)} with their full covariance; from {where}>"

    def block(self, names: Sequence[str]) -> np.ndarray:
        """Covariance (3k, 3k) m^2 of some points in this order."""
        return self.between(names, names)

    def between(self, names: Sequence[str], columns_of: Sequence[str]) -> np.ndarray:
        """Covariance (3k, 3m) m^2 of some points with others."""
        rows, columns = self.rows(names), self.rows(columns_of)
        if isinstance(self.covariance, JointPoints):
            return self.covariance.between(rows, columns)
        if self.covariance.ndim == 3:
            same = rows[:, None] == columns
            blocks = self.covariance[rows][:, None] * same[:, :, None, None]
            return np.asarray(blocks.transpose(0, 2, 1, 3).reshape(3 * len(rows), 3 * len(columns)))
        rows, columns = ((3 * points[:, None] + np.arange(3)).ravel() for points in (rows, columns))
        return part_of(self.covariance, rows, columns)

    def places(self, names: Sequence[str]) -> np.ndarray:
        """Coordinates (k, 3) m of some points in this order."""
        return np.asarray(self.x[self.rows(names)])

    def rows(self, names: Sequence[str]) -> np.ndarray:
        """Row indices (k,) of some points."""
        at = {name: k for k, name in enumerate(self.names)}
        return np.array([at[n] for n in names], dtype=int)


def read_solved_points(path: Path | str, *, averaged: bool = True) -> SolvedPoints:
    """Points of a coordinates.json, or of a directory from `catseye reduce --out`.

    path       the file, or the directory
    averaged   mean of a printed covariance's two triangles, which differ by rounding; False: as printed

    Raises InputError with file, place, value and expectation.
    """
    path = Path(path)
    folder, name = (Folder(path), FILE) if path.is_dir() else (Folder(path.parent), path.name)
    document = _object(folder, name)
    points, order = document.get("points"), document.get("covariance_order")
    if not isinstance(points, dict) or not points or not isinstance(order, list):
        raise refusal(name, "has no points with covariance_order (expected coordinates.json of catseye reduce --out)")
    names = tuple(points)
    if order != [f"{n} {axis}" for n in names for axis in "xyz"]:
        raise refusal(name, "covariance_order is not that of points x, y, z (expected as catseye reduce writes it)")
    if document.get("frame") != "ground":
        raise refusal(name, f"frame = {shown(document.get('frame'))} (expected 'ground')")
    x = np.array([[_number(name, n, points[n], axis) for axis in "xyz"] for n in names])
    printed = stored_covariance(document, folder.directory, len(order))
    covariance = _covariance(name, printed, len(order), averaged=averaged)
    pose_file = folder.directory / POSE_FILE
    pose = read_written_pose(pose_file, expected=(NIGHT_POSE,), folder=folder) if pose_file.is_file() else None
    dish, focal_length = _dish(name, document, names)
    return SolvedPoints(
        file=str(path),
        campaign=str(document.get("campaign", "")),
        names=names,
        x=x,
        covariance=covariance,
        posture=None if pose is None else pose.posture,
        hashes={f"{path.name}/{f}" if path.is_dir() else f: digest for f, digest in folder.hashes.items()},
        verdict=stored_verdict(name, document),
        dish=dish,
        focal_length=focal_length,
        unchecked=_unchecked(name, document, names),
    )


def read_points(path: Path | str, *, u: float | None = None) -> SolvedPoints:
    """Points of an epoch: what `catseye reduce` wrote, or a CSV of any points (docs/formats/surface.md).

    path   directory, coordinates.json or .csv
    u      m, of each coordinate of a table without uncertainties, which is exact without

    Raises InputError as `read_solved_points` and `read_point_table`.
    """
    path = Path(path)
    if path.suffix.lower() != ".csv" or path.is_dir():
        return read_solved_points(path)
    folder = Folder(path.parent)
    table = read_point_table(folder.text(path.name), path.name, u=u)
    exact = np.zeros((len(table.names), 3, 3))
    return SolvedPoints(
        file=name_of(path),
        campaign=path.stem,
        names=table.names,
        x=table.x,
        covariance=exact if table.covariance is None else table.covariance,
        posture=None,
        hashes=folder.hashes,
        verdict=verdict_of_table(path),
    )


def _dish(file: str, document: dict[str, Any], names: tuple[str, ...]) -> tuple[tuple[str, ...], float | None]:
    """Names of a dish's prisms and its focal length; nothing where the reduction has no dish."""
    surface = document.get("surface")
    if surface is None:
        return (), None
    deviations = surface.get("deviations") if isinstance(surface, dict) else None
    if not isinstance(deviations, dict) or not deviations.keys() <= set(names):
        raise refusal(file, "surface.deviations is missing or names no point (expected as catseye reduce writes it)")
    return tuple(deviations), _number(file, "surface", surface, "focal_length")


def _object(folder: Folder, name: str) -> dict[str, Any]:
    text = folder.text(name)
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise refusal(name, f"is not JSON: {problem}") from problem
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        version = shown(document.get("format")) if isinstance(document, dict) else "none"
        raise refusal(name, f"format = {version} (expected '{FORMAT}', as catseye reduce --out writes it)")
    return document


def _number(file: str, point: str, row: Any, axis: str) -> float:
    value = row.get(axis) if isinstance(row, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise refusal(file, f"points[{shown(point)}].{axis} = {shown(value)} (expected a number, m)")
    return float(value)


def _covariance(file: str, rows: Any, size: int, *, averaged: bool) -> np.ndarray:
    if isinstance(rows, np.ndarray):  # mapped: checked when used
        if not np.all(np.diag(rows) >= 0.0):
            raise refusal(file, "its covariance file has a negative variance (expected a covariance, m^2)")
        return rows
    try:
        q = np.array(rows, dtype=float)
    except (TypeError, ValueError) as problem:
        raise refusal(file, "covariance is not a table of numbers (expected one row per coordinate)") from problem
    if q.shape != (size, size) or not np.isfinite(q).all():
        raise refusal(file, f"covariance has shape {q.shape} (expected ({size}, {size}), all finite)")
    scale = np.sqrt(np.abs(np.outer(np.diag(q), np.diag(q))))
    if np.any(np.diag(q) < 0.0) or np.any(np.abs(q - q.T) > DRAWN * scale + 1e-30):
        raise refusal(file, "covariance is not symmetric or has a negative variance (expected a covariance, m^2)")
    return 0.5 * (q + q.T) if averaged else q


def _unchecked(file: str, document: dict[str, Any], names: tuple[str, ...]) -> tuple[str, ...]:
    """Unchecked points; none in a file written before they were listed."""
    listed = document.get("unchecked", [])
    if not isinstance(listed, list) or not all(isinstance(n, str) and n in names for n in listed):
        raise refusal(file, "unchecked names no point (expected as catseye reduce writes it)")
    return tuple(listed)
