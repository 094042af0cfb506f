"""Shape of a dish from its prisms.

Best-fitting paraboloid, half-path errors, Zernike terms, rms, gain.
"""

from dataclasses import dataclass, field

import numpy as np

from catseye.constants import MILLIMETRE, SPEED_OF_LIGHT
from catseye.errors import EstimationError, ValidityError
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.estimation.shapes.paraboloid import ParaboloidFit, covariance_along, fit_paraboloid, place_paraboloid
from catseye.geometry.frames.frame import Transform
from catseye.geometry.frames.rotation import from_vector
from catseye.optics.aperture import cells, coherent_gain, ruze_gain
from catseye.optics.zernike import Numbering, Term, orthonormal, terms, zernike
from catseye.records.site.site import ParaboloidRecord
from catseye.verdict import Verdict

CLEAR = 2.0  # standard uncertainties by which a mean square stands out: 95 %
ABSORBED = 0.5  # share of a term's square that the paraboloid absorbs mostly
SMALLEST_SEPARATION = (
    1e-8  # smallest singular value of Zernike terms beside the paraboloid: below, they are inseparable
)


@dataclass(frozen=True, eq=False)
class LitAperture:
    """Illuminated part of a paraboloid: a circle in projection along its axis.

    centre         (2,) m, from the axis
    radius         m
    focal_length   m, as designed
    """

    centre: np.ndarray
    radius: float
    focal_length: float

    @classmethod
    def of(cls, record: ParaboloidRecord) -> "LitAperture":
        """Aperture of a site's record."""
        return cls(
            np.array(record.aperture_centre_mm) * MILLIMETRE,
            record.aperture_radius_mm * MILLIMETRE,
            record.focal_length_mm * MILLIMETRE,
        )

    def unit(self, local: np.ndarray) -> np.ndarray:
        """Points (k, 2) in units of the aperture.

        From points (k, 2 or 3), m, of the paraboloid's frame.
        """
        return (local[:, :2] - self.centre) / self.radius


@dataclass(frozen=True)
class ShapeSettings:
    """Fitted parameters of a surface, and requested results.

    free           of "vertex", "axis", "focal-length": fitted parameters of the paraboloid
    taper_db       illumination at the edge below that of the middle; 0: uniform
    frequencies    Hz, of the computed gain
    terms          number of Zernike terms
    numbering      "noll" or "ansi"
    """

    free: tuple[str, ...] = ("vertex", "axis", "focal-length")
    taper_db: float = 0.0
    frequencies: tuple[float, ...] = ()
    terms: int = 15
    numbering: Numbering = "noll"


@dataclass(frozen=True, eq=False)
class Prisms:
    """Prisms of a dish in one epoch.

    names         of k prisms
    points        (k, 3) m, in the frame `nominal.to`
    covariance    (3k, 3k), or (k, 3, 3) where they are independent, m^2, or for k points an object that gives its parts
    nominal       that frame from the nominal paraboloid's
    source        file or job
    elevation_deg, azimuth_deg, temperature_c   of the epoch, None if unknown
    verdict       of the reduction; None without one
    """

    names: tuple[str, ...]
    points: np.ndarray
    covariance: np.ndarray | JointPoints
    nominal: Transform
    source: str
    elevation_deg: float | None = None
    azimuth_deg: float | None = None
    temperature_c: float | None = None
    verdict: Verdict | None = None

    def along(self, normals: np.ndarray) -> np.ndarray:
        """Covariance (k, k), m^2, of the prisms along unit vectors (k, 3)."""
        if isinstance(self.covariance, JointPoints):
            return self.covariance.along(np.arange(len(self.names)), normals)
        return covariance_along(self.covariance, normals)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Zernike terms of half-path errors over the aperture.

    terms              t of them
    value, covariance  (t,) m, (t, t) m^2: weighted least squares, of the errors after the fit
    share              (t,) of each term's square that the free parameters of the paraboloid absorb
    joint              (t,) m, the term itself, paraboloid and terms estimated together; nan where the paraboloid stands
                       for it (piston and tilts of a free vertex, defocus of a free focal length), or they are
                       inseparable
    joint_covariance   (t, t) m^2
    orthonormal        (t,) m, in terms made orthonormal on these prisms under the weights, each from itself and those
                       before it: their squares sum up to the square of the rms that the terms explain
    u_orthonormal      (t,) m
    rest               (k,) m, half-path errors less the terms
    """

    terms: tuple[Term, ...]
    value: np.ndarray
    covariance: np.ndarray
    share: np.ndarray
    joint: np.ndarray
    joint_covariance: np.ndarray
    orthonormal: np.ndarray
    u_orthonormal: np.ndarray
    rest: np.ndarray


def _root(square: float) -> float | None:
    """Square root; None if subtracting the noise left a negative square."""
    return float(np.sqrt(square)) if square >= 0.0 else None


@dataclass(frozen=True)
class MeanSquare:
    """Mean square of half-path errors under the illumination.

    About their mean: a constant phase costs no gain.

    measured   m^2, of the measured errors
    noise      m^2, expected contribution of the measurement
    u          m^2, standard uncertainty of `own`
    """

    measured: float
    noise: float
    u: float

    @property
    def own(self) -> float:
        """Mean square of the surface alone, m^2.

        Unbiased, and below zero where the noise hides it.
        """
        return self.measured - self.noise

    @property
    def rms(self) -> float | None:
        """Root mean square of the surface alone, m; None where the noise hides it."""
        return _root(self.own)

    @property
    def u_rms(self) -> float | None:
        """Standard uncertainty of `rms`, m; None without one."""
        return self.u / (2.0 * self.rms) if self.rms else None

    @property
    def measured_rms(self) -> float | None:
        """Root mean square as measured, m."""
        return _root(self.measured)

    @property
    def noise_rms(self) -> float | None:
        """Root mean square of the noise, m."""
        return _root(self.noise)

    @property
    def stands_out(self) -> bool:
        """True for errors above the measurement's noise, with 95 %."""
        return bool(self.own > CLEAR * self.u)


@dataclass(frozen=True)
class Gain:
    """Gain relative to the perfect surface's at one frequency.

    ruze, u_ruze   by Ruze, from the surface's own mean square
    measured       by Ruze, the measurement's noise included
    coherent       the aperture's own integral over the measured errors, noise included
    """

    frequency: float
    ruze: float
    u_ruze: float
    measured: float
    coherent: float

    @property
    def loss_db(self) -> float:
        """Loss by Ruze, dB; infinite where no gain is left."""
        return -10.0 * float(np.log10(self.ruze)) if self.ruze > 0.0 else float("inf")


@dataclass(frozen=True, eq=False)
class SurfaceShape:
    """Surface of one epoch.

    weights      (k,) share of the illumination of each prism
    places       (k, 2) in the aperture, units of its radius
    """

    prisms: Prisms
    aperture: LitAperture
    settings: ShapeSettings
    fit: ParaboloidFit
    weights: np.ndarray
    places: np.ndarray
    expansion: Expansion
    square: MeanSquare
    gains: tuple[Gain, ...] = field(default=())

    @property
    def rms_normal(self) -> float:
        """Root mean square of the normal deviations, m, unweighted."""
        return float(np.sqrt(np.mean(self.fit.deviation**2)))

    @property
    def absorbed(self) -> tuple[Term, ...]:
        """Terms that the free paraboloid absorbs mostly, besides those that it stands for."""
        return tuple(
            term
            for term, share in zip(self.expansion.terms, self.expansion.share, strict=True)
            if term.n >= 2 and share > ABSORBED and not (term == (2, 0) and "focal-length" in self.fit.free)
        )


def fitted_frame(prisms: Prisms, aperture: LitAperture, settings: ShapeSettings) -> Transform:
    """Outer frame from the best paraboloid's, all points of equal weight.

    Raises EstimationError as `shape_of`.
    """
    placed = place_paraboloid(
        prisms.points, prisms.nominal, focal_length=aperture.focal_length, free=settings.free, measure="half-path"
    )
    rotation = from_vector(placed.rotation) @ prisms.nominal.rotation
    nominal = prisms.nominal
    return Transform(nominal.to, nominal.from_, rotation, nominal.translation + placed.translation)


def shape_of(
    prisms: Prisms, aperture: LitAperture, settings: ShapeSettings | None = None, *, lit: Transform | None = None
) -> SurfaceShape:
    """Surface of one epoch.

    The sum of squared half-path errors under the illumination is least.

    prisms     their places and covariance
    aperture   of the design
    settings   free parameters, illumination, results
    lit        outer frame from the illuminated dish's; the nominal one without

    The weight of each prism is the illumination nearest to it. Raises EstimationError for too few prisms and for
    prisms that do not determine the paraboloid or the terms; ValidityError for settings out of range.
    """
    settings = settings or ShapeSettings()
    first = aperture.unit((lit or prisms.nominal).inverse().points(prisms.points))
    weights = cells(first, edge_db=settings.taper_db)
    fit = fit_paraboloid(
        prisms.points,
        prisms.along,
        prisms.nominal,
        focal_length=aperture.focal_length,
        free=settings.free,
        weights=weights,
        measure="half-path",
    )
    places, cos = aperture.unit(fit.local), fit.cos_incidence
    expansion = expansion_of(
        places,
        fit.half_path,
        weights=weights,
        covariance=fit.half_path_covariance,
        along=fit.along * cos[:, None] * cos,
        design=fit.design * cos[:, None],
        settings=settings,
    )
    square = mean_square(fit.half_path, fit.half_path_covariance, weights)
    gains = gains_of(fit.half_path, weights, square, frequencies=settings.frequencies)
    return SurfaceShape(
        prisms=prisms,
        aperture=aperture,
        settings=settings,
        fit=fit,
        weights=weights,
        places=places,
        expansion=expansion,
        square=square,
        gains=gains,
    )


def expansion_of(
    places: np.ndarray,
    error: np.ndarray,
    *,
    weights: np.ndarray,
    covariance: np.ndarray,
    along: np.ndarray,
    design: np.ndarray,
    settings: ShapeSettings,
) -> Expansion:
    """Zernike terms of half-path errors.

    places       (k, 2) in units of the aperture's radius
    error        (k,) m
    weights      (k,)
    covariance   (k, k) m^2 of the errors
    along        (k, k) m^2 of them before the paraboloid was fitted
    design       (k, p) of the paraboloid's free parameters, half-path
    settings     number and numbering of terms

    Raises EstimationError where the prisms are too few or do not determine the terms.
    """
    selected = terms(settings.terms, settings.numbering)
    values = zernike(selected, places[:, 0], places[:, 1])
    try:
        basis, matrix = orthonormal(values, weights)
    except ValidityError as problem:
        raise EstimationError(f"{len(selected)} Zernike terms: {problem}") from problem
    shares = weights / weights.sum()
    ortho_gain = (basis * shares[:, None]).T
    gain = matrix @ ortho_gain
    value = gain @ error
    share, joint, joint_covariance = _joint_terms(values, error, along, shares, design, selected, settings.free)
    return Expansion(
        terms=selected,
        value=value,
        covariance=_rounded(gain @ covariance @ gain.T),
        share=share,
        joint=joint,
        joint_covariance=joint_covariance,
        orthonormal=ortho_gain @ error,
        u_orthonormal=np.sqrt(np.maximum(np.diag(ortho_gain @ covariance @ ortho_gain.T), 0.0)),  # rounding below 0
        rest=error - values @ value,
    )


def _rounded(covariance: np.ndarray) -> np.ndarray:
    """Covariance with variances 0 where rounding left them negative.

    For terms that the paraboloid absorbs.
    """
    rounded = covariance.copy()
    rounded[np.diag_indices_from(rounded)] = np.maximum(np.diag(rounded), 0.0)
    return rounded


def _joint_terms(
    values: np.ndarray,
    error: np.ndarray,
    along: np.ndarray,
    shares: np.ndarray,
    design: np.ndarray,
    selected: tuple[Term, ...],
    free: tuple[str, ...],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share absorbed by the paraboloid, joint terms, and their covariance.

    For each term: estimated together with the paraboloid.
    """
    root = np.sqrt(shares)[:, None]
    rows = root * values
    absorbed = np.linalg.qr(root * design / np.linalg.norm(root * design, axis=0))[0]
    remainder = rows - absorbed @ (absorbed.T @ rows)
    share = 1.0 - np.sum(remainder**2, axis=0) / np.sum(rows**2, axis=0)
    stood_for = {t for t in selected if t.n <= 1 and "vertex" in free}
    stood_for |= {t for t in selected if t == (2, 0) and "focal-length" in free}
    estimated = [k for k, t in enumerate(selected) if t not in stood_for]
    joint, covariance = np.full(len(selected), np.nan), np.full((len(selected),) * 2, np.nan)
    if estimated:
        u_matrix, sizes, right = np.linalg.svd(remainder[:, estimated], full_matrices=False)
        if sizes[-1] > SMALLEST_SEPARATION:
            gain = (right.T / sizes) @ u_matrix.T
            gain = (gain - (gain @ absorbed) @ absorbed.T) * root.T
            joint[estimated] = gain @ error
            covariance[np.ix_(estimated, estimated)] = gain @ along @ gain.T
    return share, joint, covariance


def mean_square(error: np.ndarray, covariance: np.ndarray, weights: np.ndarray) -> MeanSquare:
    """Weighted mean square of errors about their weighted mean.

    Also the share of noise, and the uncertainty.

    error        (k,) m
    covariance   (k, k) m^2
    weights      (k,)

    With Q = diag(w) - w w^T the mean square is e^T Q e. Of e = true + noise its expectation is true^T Q true + tr(QC)
    and its variance 4 true^T QCQ true + 2 tr(QCQC); true^T QCQ true is e^T QCQ e - tr(QCQC), above zero or left out.
    """
    w = weights / weights.sum()
    centred = error - w @ error
    spread = w[:, None] * covariance - w[:, None] * (w @ covariance)  # Q C
    pulled = w * centred
    twice = float(np.sum(spread * spread.T))
    signal = max(float(pulled @ covariance @ pulled) - twice, 0.0)
    return MeanSquare(float(w @ centred**2), float(np.trace(spread)), float(np.sqrt(4.0 * signal + 2.0 * twice)))


def gains_of(
    error: np.ndarray, weights: np.ndarray, square: MeanSquare, *, frequencies: tuple[float, ...]
) -> tuple[Gain, ...]:
    """Gain at each frequency (Hz).

    By Ruze and by the aperture's own integral.
    """
    result = []
    for frequency in frequencies:
        wavelength = SPEED_OF_LIGHT / frequency
        ruze = float(ruze_gain(square.own, wavelength))
        slope = ruze * (4.0 * np.pi / wavelength) ** 2
        measured = float(ruze_gain(square.measured, wavelength))
        result.append(Gain(frequency, ruze, slope * square.u, measured, coherent_gain(error, weights, wavelength)))
    return tuple(result)
