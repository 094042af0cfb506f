"""Surface of the dish night by night: focal length, half-path errors, Zernike terms, and each prism over the nights."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Progress
from catseye.errors import EstimationError, InputError
from catseye.estimation.shapes.paraboloid import place_paraboloid
from catseye.geometry.frames.frame import Transform
from catseye.names import counted
from catseye.optics.aperture import cells
from catseye.optics.zernike import Term, terms, zernike
from catseye.records.archive.layout import AXES, PRODUCTS
from catseye.records.archive.reading import read_table
from catseye.reduction.query.point import covariances, pivots_of, reflector_axes
from catseye.reduction.query.span import ArchiveSpan
from catseye.reduction.surface.shape import LitAperture
from catseye.verdict import Verdict

PRISM = "dish prism"  # kind of the points that shape the dish
ZERNIKE = 15  # Noll's terms: to the third radial order and the spherical one
HELD = 4  # the first of them, which a paraboloid of free place, axis and focal length takes up
FEWEST = 20  # prisms of a night that can tell eleven terms from noise
MARGIN, MOST_OUTSIDE = 0.05, 0.1  # of the aperture's radius, and of the prisms beyond it
FREE = ("vertex", "axis", "focal-length")


@dataclass(frozen=True, eq=False)
class NightSurface:
    """Surface of one night.

    focal_length, u_focal_length   m
    measured, noise     m^2, mean square of the half-path errors under uniform illumination, and what the prisms'
                        uncertainties contribute
    term, u_term        (t,) m
    rows                (k,) of its prisms among those of the series
    half_path, u_half_path   (k,) m
    """

    focal_length: float
    u_focal_length: float
    measured: float
    noise: float
    term: np.ndarray
    u_term: np.ndarray
    rows: np.ndarray
    half_path: np.ndarray
    u_half_path: np.ndarray


@dataclass(frozen=True, eq=False)
class SurfaceNights:
    """Surfaces of n nights, of k prisms altogether.

    night, mjd               (n,)
    azimuth, elevation       (n,) rad, of the telescope
    temperature_c            (n,) of the air
    surfaces                 n of them
    terms                    Zernike terms t
    prisms                   (k,) names
    places                   (k, 2) m, mean x and y in the nominal reflector frame
    left_out                 night -> why it has no surface
    """

    verdict: Verdict
    night: np.ndarray
    mjd: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    temperature_c: np.ndarray
    surfaces: tuple[NightSurface, ...]
    terms: tuple[Term, ...]
    prisms: np.ndarray
    places: np.ndarray
    left_out: dict[str, str]

    def column(self, name: str) -> np.ndarray:
        """A field of every night, (n,) or (n, t)."""
        return np.array([getattr(surface, name) for surface in self.surfaces])

    @property
    def rms(self) -> np.ndarray:
        """Root mean square (n,) m of the surface alone; nan where the noise hides it."""
        noise_free = self.column("measured") - self.column("noise")
        return np.sqrt(np.where(noise_free >= 0.0, noise_free, np.nan))

    def of_prisms(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nights, mean half-path error and its scatter over the nights, m, of each prism, (k,) each."""
        count, total, square = (np.zeros(len(self.prisms)) for _ in range(3))
        for surface in self.surfaces:
            count[surface.rows] += 1.0
            total[surface.rows] += surface.half_path
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / count
            for surface in self.surfaces:
                square[surface.rows] += (surface.half_path - mean[surface.rows]) ** 2
            return count.astype(int), mean, np.sqrt(square / np.where(count > 1.0, count - 1.0, np.nan))


@dataclass(frozen=True, eq=False)
class _Prisms:
    """Columns of all nights' prisms, sorted by night."""

    names: np.ndarray
    index: np.ndarray
    starts: np.ndarray
    local: np.ndarray
    covariance: np.ndarray


def surface_series(span: ArchiveSpan, aperture: LitAperture, progress: Progress | None = None) -> SurfaceNights:
    """Surfaces of the nights of a span that have a pose of the dish and enough prisms.

    Prisms count as independent of each other: what a night's air or zeros move alike on the whole dish is not in the
    u of a night, and shows as scatter between nights.

    Raises InputError: no night with a surface.
    """
    columns = ("night", "mjd", "point", *AXES, *PRODUCTS, "azimuth", "elevation", "temperature_c")
    rows = read_table(span.archive, "points", columns, where={"body": PRISM}, since=span.since, until=span.until)
    if not len(rows["night"]):
        raise InputError(f"{span.archive.directory}: no night of this span has a {PRISM} (expected a dish's nights)")
    order = np.lexsort((rows["night"], rows["mjd"]))
    rows = {name: values[order] for name, values in rows.items()}
    pivots = pivots_of(span)
    starts = np.flatnonzero(np.r_[True, rows["night"][1:] != rows["night"][:-1]])
    ends = np.r_[starts[1:], len(order)]
    prisms, index = np.unique(rows["point"], return_inverse=True)
    axes = reflector_axes(rows["azimuth"][starts], rows["elevation"][starts])
    x, q = np.column_stack([rows[axis] for axis in AXES]), covariances(rows)
    sums, times = np.zeros((len(prisms), 2)), np.zeros(len(prisms))
    left_out: dict[str, str] = {}
    found: dict[int, NightSurface] = {}
    for number, (low, high) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        if progress is not None:
            progress("surfaces", number, len(starts))
        night = str(rows["night"][low])
        if night not in pivots:
            left_out[night] = "it has no pose of the dish"
            continue
        turn = axes[number]
        local = (x[low:high] - pivots[night]) @ turn
        at = index[low:high]
        try:
            found[low] = _surface(local, turn.T @ q[low:high] @ turn, at, aperture)
        except EstimationError as problem:
            left_out[night] = str(problem)
            continue
        sums[at] += local[:, :2]
        times[at] += 1.0
    if not found:
        raise InputError(f"{span.archive.directory}: no night has a surface ({next(iter(left_out.values()))})")
    nights_of = np.array(list(found), dtype=int)
    nights = rows["night"][nights_of]
    with np.errstate(invalid="ignore"):
        places = sums / times[:, None]
    return SurfaceNights(
        verdict=span.verdict(nights.tolist(), f"{counted(len(nights), 'night')}, all of them good"),
        night=nights,
        mjd=rows["mjd"][nights_of],
        azimuth=rows["azimuth"][nights_of],
        elevation=rows["elevation"][nights_of],
        temperature_c=rows["temperature_c"][nights_of],
        surfaces=tuple(found.values()),
        terms=terms(ZERNIKE, "noll")[HELD:],
        prisms=prisms,
        places=places,
        left_out=left_out,
    )


def _surface(local: np.ndarray, q: np.ndarray, rows: np.ndarray, aperture: LitAperture) -> NightSurface:
    """Surface of one night's prisms (k, 3) m, with covariances (k, 3, 3), in the nominal reflector frame."""
    if len(local) < FEWEST:
        raise EstimationError(f"{len(local)} prisms are too few for a surface (expected {FEWEST})")
    unit = aperture.unit(local)
    outside = int(np.count_nonzero(np.hypot(*unit.T) > 1.0 + MARGIN))
    if outside > MOST_OUTSIDE * len(local):
        raise EstimationError(f"{outside} of {len(local)} prisms lie outside the aperture of the site: another dish")
    weights = cells(unit, edge_db=0.0)
    nominal = Transform("reflector", "reflector", np.eye(3), np.zeros(3))
    fit = place_paraboloid(
        local, nominal, focal_length=aperture.focal_length, free=FREE, weights=weights, measure="half-path"
    )
    variance = np.einsum("ki,kij,kj->k", fit.normal, q, fit.normal)
    parameters = (fit.gain * variance) @ fit.gain.T
    of_fit = np.einsum("kp,pk->k", fit.design, fit.gain)
    after = variance * (1.0 - 2.0 * of_fit) + np.einsum("kp,pq,kq->k", fit.design, parameters, fit.design)
    cos = fit.cos_incidence
    error, noise_free = fit.deviation * cos, np.maximum(after, 0.0) * cos**2
    shares = weights / weights.sum()
    mean = float(shares @ error)
    removed = (fit.design * cos[:, None], fit.gain / cos)  # of half-path errors
    term, u_term = _terms(aperture.unit(fit.local), error, variance * cos**2, shares, removed)
    return NightSurface(
        focal_length=fit.focal_length,
        u_focal_length=float(np.sqrt(parameters[-1, -1])),
        measured=float(shares @ error**2) - mean**2,
        noise=float(shares @ noise_free),
        term=term,
        u_term=u_term,
        rows=rows,
        half_path=error,
        u_half_path=np.sqrt(noise_free),
    )


def _terms(
    places: np.ndarray,
    error: np.ndarray,
    variance: np.ndarray,
    shares: np.ndarray,
    removed: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Zernike terms of the errors after the paraboloid, beyond those that it stands for, and their uncertainties.

    places     (k, 2) in units of the aperture's radius
    error      (k,) m after the paraboloid
    variance   (k,) m^2 of the errors before it
    shares     (k,) of the illumination
    taken      design (k, p) and gain (p, k) of the paraboloid, whose product it takes away from the errors
    """
    values = zernike(terms(ZERNIKE, "noll"), places[:, 0], places[:, 1])
    weighted = values * shares[:, None]
    gain = np.linalg.solve(values.T @ weighted, weighted.T)[HELD:]
    behind = gain - (gain @ removed[0]) @ removed[1]
    return gain @ error, np.sqrt((behind**2) @ variance)
