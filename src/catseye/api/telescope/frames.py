"""`convert`: points of one frame of a telescope in another."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.telescope.inputs import InputFiles, points_of, posture_of, telescope_of
from catseye.api.units import In, with_units
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.network.solved_points import SolvedPoints
    from catseye.records.site.folder import SiteFolder
    from catseye.reduction.steering.conversion import ConvertedPoints


@dataclass(frozen=True, eq=False, repr=False)
class ConversionResult(Result):
    """Points of one frame of a telescope in another, n of them.

    points       (n, 3) m, in the frame `to_frame`
    covariance   (n, 3, 3) m^2, axes of `to_frame`: of points and posture; None where the points have none
    names        of the points
    from_frame, to_frame   names
    converted    points before, transform, telescope
    read         files that were read
    """

    points: np.ndarray
    covariance: np.ndarray | None
    names: tuple[str, ...]
    from_frame: str
    to_frame: str
    converted: "ConvertedPoints"
    read: tuple[Path, ...] = field(default=())

    def passages(self) -> "Sequence[Passage]":
        """Frames, posture, transform, and what a rigid telescope leaves out."""
        from catseye.gateways.steering.conversion_objects import conversion_passages

        return [*conversion_passages(self.converted)]

    def rows(self) -> list[str]:
        """Lines of the table of points that the command prints."""
        from catseye.gateways.steering.conversion_objects import conversion_lines

        return conversion_lines(self.converted)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye convert --json`."""
        from catseye.gateways.steering.conversion_objects import conversion_object

        return conversion_object(self.converted, self.verdict)

    def tables(self) -> "dict[str, QTable]":
        """`points`: a row a point."""
        conversion = self.converted
        columns: dict[str, tuple[Any, str]] = {"point": (list(self.names), "")}
        columns |= {f"{axis}_{self.from_frame}": (conversion.before[:, k], "m") for k, axis in enumerate("xyz")}
        columns |= {axis: (self.points[:, k], "m") for k, axis in enumerate("xyz")}
        if self.covariance is not None:
            columns |= {f"u_{a}": (np.sqrt(self.covariance[:, k, k]), "m") for k, a in enumerate("xyz")}
            pairs = ((0, 1), (0, 2), (1, 2))
            columns |= {f"cov_{'xyz'[i]}{'xyz'[j]}": (self.covariance[:, i, j], "m2") for i, j in pairs}
        return {"points": quantities(columns, frame=self.to_frame)}

    def figures(self) -> "dict[str, Figure]":
        """Seven frames at this posture with the points, from the side and from above."""
        from catseye.gateways.steering.frame_figures import frames_figure

        return {"frames": frames_figure(self.converted)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """Files and directories that `save` leaves alone: those read."""
        return self.read


@with_units
def convert(
    points: Annotated[Any, In("m", text=True)],
    *,
    from_frame: str,
    to_frame: str,
    posture_deg: Annotated[Any, In("deg", many=True)] = None,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    u_mm: Annotated[Any, In("mm", many=True)] = None,
    covariance: Annotated[Any, In("m2")] = None,
    u_posture_arcsec: Annotated[Any, In("arcsec", many=True)] = None,
    subreflector_shift_mm: Annotated[Any, In("mm", many=True)] = None,
    subreflector_turn_deg: Annotated[Any, In("deg", many=True)] = None,
    subreflector_pivot_mm: Annotated[Any, In("mm", many=True)] = None,
) -> ConversionResult:
    """Points of one frame of a telescope in another.

    For a rigid telescope on a perfect track: gravity, temperature and track move a real one by millimetres.

    points             (n, 3) or (3,) m; or a file: coord.dat of lines x y z in mm, a CSV table of points, perhaps with
                       covariance, or a directory of `reduce`, of the ground frame
    from_frame, to_frame   "ground", "alidade", "elevation", "reflector", "feed_arm", "prime_focus" or "subreflector"
    posture_deg        azimuth and elevation of the telescope; a reduction's or the site's own without
    site               whose elevation axis, vertex and focal length count; the notes' without
    u_mm               standard uncertainty of x, y, z in the frame they come from, where a table has none
    covariance         (3, 3) or (n, 3, 3) m², of each point, axes of that frame; instead of u_mm
    u_posture_arcsec   standard uncertainty of azimuth and elevation, as encoders read them
    subreflector_shift_mm, subreflector_turn_deg   six degrees of freedom from rest: prime-focus axes; about x, then y,
                       then z
    subreflector_pivot_mm   of these turns, prime-focus frame; its origin without

    Raises ArgumentError for arguments that do not fit together, InputError for points or a site that cannot be used.
    Source: [PARKER04] eqs. 2.40 to 2.46; subreflector, feed arm and prime focus: `geometry.antenna`.

    >>> focus = convert([0.0, 0.0, 60.0], from_frame="reflector", to_frame="ground", posture_deg=(90.0, 45.0))
    >>> focus.points.round(6).tolist()
    [[7.184829, 0.0, 132.999039]]
    """
    from catseye.geometry.antenna.rigid_telescope import FRAMES
    from catseye.reduction.steering.conversion import converted, depends_on_posture
    from catseye.reduction.steering.mounted import posture_of_site

    for name, frame in (("from_frame", from_frame), ("to_frame", to_frame)):
        if frame not in FRAMES:
            raise ArgumentError(f"{name} = {frame!r} is unknown (expected one of {', '.join(FRAMES)})", name)
    files = InputFiles()
    stands = None if site is None else files.site(site)
    names, where, spread, solved = _points(files, points, from_frame)
    spread_of_points = _covariance(len(where), u_mm, covariance, of_file=spread)
    posture = posture_of(posture_deg)
    if posture is None and solved is not None:
        posture = solved.posture
    if posture is None and stands is not None:
        posture = posture_of_site(stands)
    if posture is None and depends_on_posture(to_frame, from_frame):
        raise ArgumentError(
            f"posture_deg is missing: where {from_frame} stands in {to_frame} depends on it (expected azimuth and "
            "elevation, or a site)",
            "posture_deg",
        )
    u_posture = _triple(u_posture_arcsec, "u_posture_arcsec", count=2, least=0.0, most=36_000.0)
    if u_posture_arcsec is not None and spread_of_points is None:
        raise ArgumentError(
            "u_posture_arcsec says nothing without an uncertainty of the points, which may be 0",
            "u_posture_arcsec",
            "u_mm",
        )
    telescope = replace(
        telescope_of(stands, posture or (0.0, 0.5 * np.pi)),
        subreflector_shift=_scaled(subreflector_shift_mm, "subreflector_shift_mm", MILLIMETRE, 5000.0),
        subreflector_turn=_scaled(subreflector_turn_deg, "subreflector_turn_deg", DEGREE, 80.0),
        subreflector_pivot=_scaled(subreflector_pivot_mm, "subreflector_pivot_mm", MILLIMETRE, 50_000.0),
    )
    conversion = converted(
        where,
        telescope,
        to=to_frame,
        from_=from_frame,
        names=names,
        covariance=spread_of_points,
        u_posture=(u_posture[0] * ARCSECOND, u_posture[1] * ARCSECOND),
        posture_known=posture is not None,
    )
    rests = {} if solved is None or solved.verdict is None else {Path(solved.file).name: solved.verdict}
    return ConversionResult(
        verdict=conversion.verdict.resting_on(rests),
        points=conversion.after,
        covariance=conversion.covariance,
        names=conversion.names,
        from_frame=from_frame,
        to_frame=to_frame,
        converted=conversion,
        read=tuple(files.paths),
    )


def _points(
    files: InputFiles, points: Any, from_frame: str
) -> "tuple[tuple[str, ...], np.ndarray, np.ndarray | None, SolvedPoints | None]":
    """Names, points (n, 3) m, covariance of a table, and the reduction that they come from.

    Raises ArgumentError for a reduction's points, which are of the ground, in another frame.
    """
    if not isinstance(points, str | os.PathLike):
        return (), points_of(points), None, None
    from catseye.records.network.solved_points import read_points

    path = place_of(points, output=True)
    if not path.is_dir() and path.suffix.lower() not in (".csv", ".json"):
        return (), files.points(points), None, None
    files.paths.append(path)
    solved = read_points(path)
    if path.suffix.lower() != ".csv" and from_frame != "ground":
        raise ArgumentError(
            f"from_frame = {from_frame!r}: the points of {path.name} are of the ground frame", "from_frame"
        )
    blocks = np.array([solved.block((name,)) for name in solved.names])
    exact = path.suffix.lower() == ".csv" and not blocks.any()
    return solved.names, solved.x, None if exact else blocks, solved if path.suffix.lower() != ".csv" else None


def _covariance(count: int, u_mm: Any, covariance: Any, *, of_file: np.ndarray | None) -> np.ndarray | None:
    """Covariance (n, 3, 3), m^2, of the points; None where nothing states it."""
    stated = {"u_mm": u_mm, "covariance": covariance}
    twice = [name for name, value in stated.items() if value is not None]
    if len(twice) == 2:
        raise ArgumentError("u_mm and covariance both say the points' uncertainty (expected one)", *twice)
    if of_file is not None and twice:
        raise ArgumentError(f"{twice[0]} does not go with a table that has its own uncertainty", twice[0])
    if u_mm is not None:
        u = np.array(_triple(u_mm, "u_mm", count=3, least=0.0, most=1e5))
        return np.tile(np.diag(np.square(u * MILLIMETRE)), (count, 1, 1))
    if covariance is None:
        return of_file
    q = np.asarray(covariance, dtype=float)
    if q.shape not in ((3, 3), (count, 3, 3)) or not np.isfinite(q).all():
        raise InputError(f"covariance has shape {q.shape} (expected (3, 3) or ({count}, 3, 3), finite, m^2)")
    if (
        not np.allclose(q, np.swapaxes(q, -1, -2), rtol=1e-9, atol=0.0)
        or np.linalg.eigvalsh(q).min() < -1e-12 * q.max()
    ):
        raise InputError("covariance is not symmetric or has a negative eigenvalue (expected a covariance, m^2)")
    return np.broadcast_to(q, (count, 3, 3))


def _triple(values: Any, name: str, *, count: int, least: float, most: float) -> tuple[float, ...]:
    """Numbers of an argument within limits; zeros without. Raises ArgumentError otherwise."""
    if values is None:
        return (0.0,) * count
    row = tuple(float(v) for v in np.atleast_1d(values))
    if len(row) != count or not all(least <= v <= most for v in row):
        text = ", ".join(f"{v:g}" for v in row)
        raise ArgumentError(f"{name} = {text} (expected {count} numbers, each {least:g} to {most:g})", name)
    return row


def _scaled(values: Any, name: str, unit: float, most: float) -> tuple[float, float, float]:
    """Three numbers of an argument in SI. Raises ArgumentError otherwise."""
    x, y, z = (v * unit for v in _triple(values, name, count=3, least=-most, most=most))
    return x, y, z
