"""Measured returns by angle beside the theory of each kind of retroreflector.

The return is gain share(incidence - zero, rotation - zero), share of the kind's theory over its value at normal
incidence. A power has its background added; an amplitude is the length of a phasor, so that noise of any phase adds its
square, and a floor is left where nothing returns. A negative incidence is one from the other side. Amplitude and power
have the same shape, since the detector's current grows with the light's power. The rotation's zero is sought where the
share depends on it (a bare prism), modulo the 120 degrees of a cube corner. Of polarized light, through an analyser or
not, the share is times the ratio of `reduction.scans.analyser`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.aliases import Array
from catseye.atmosphere.index.air import air
from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import EstimationError, InputError
from catseye.names import NOTES_AIR_MODEL
from catseye.optics.glass import index_over_air
from catseye.optics.retroreflector.interface import Retroreflector
from catseye.optics.retroreflector.kinds.kind import DrawnSizes
from catseye.optics.retroreflector.kinds.registry import KINDS
from catseye.records.laboratory.angle_table import AngleReadings
from catseye.reduction.scans.analyser import PolarizedShare
from catseye.verdict import Verdict

AngleShare = Callable[..., Array]  # of incidence, azimuth, and perhaps an analyser

NAMES = ("gain", "background", "incidence_zero", "rotation_zero")
FEWEST = 6
SECTOR = 120.0 * DEGREE
STARTS = 6  # of the rotation's zero, within a sector
ROUNDS = 3  # of the readings' weights
MARGIN = 5.0 * DEGREE  # the largest incidence, of the theory in polarized light
LARGEST_ZERO = 20.0 * DEGREE  # of a stage's incidence
DARK = 2.0  # times the noise: prior of the background, which is near 0
LEVEL = 1e-3  # of the test of a kind
DEPENDS = 1e-6  # change of a share with the rotation that is none
BALL = {"r1": 1.969 * 0.0254, "r2": 3.799 * 0.0254, "ball_aperture": 0.015}  # m, of the GBT's targets
VACUUM_UM = 0.780


@dataclass(frozen=True, eq=False)
class KindFit:
    """Readings fitted with the theory of one kind.

    kind         label, such as "bare prism"
    values       (4,) of NAMES; in the readings' unit, and rad
    covariance   (4, 4); zero for a parameter that the readings do not determine
    determined   (4,) bool
    predicted    (n,) in the readings' unit
    sigma        (n,) standard uncertainty of each reading
    chi2, degrees_of_freedom   of the readings and the background's prior
    quadrature   True if the background adds its square
    share        theory: share over that at normal incidence, of incidence, azimuth and perhaps analyser in rad
    """

    kind: str
    values: Array
    covariance: Array
    determined: np.ndarray
    predicted: Array
    sigma: Array
    chi2: float
    degrees_of_freedom: int
    quadrature: bool
    share: AngleShare

    @property
    def u(self) -> Array:
        """Standard uncertainties (4,); NaN for a parameter that is not determined."""
        return np.where(self.determined, np.sqrt(np.diag(self.covariance)), np.nan)

    @property
    def p(self) -> float:
        """Probability of a larger chi-square if the kind and the noise are right."""
        from scipy.special import gammaincc

        return float(gammaincc(0.5 * self.degrees_of_freedom, 0.5 * self.chi2))

    def at(self, incidence: Array, rotation: Array, analyser: float = np.nan) -> Array:
        """Return (m,) by the stage's angles and an analyser's, rad; nan for none."""
        return _model(self.values, incidence, rotation, self.share, self.quadrature, np.full(len(incidence), analyser))

    @cached_property
    def half(self) -> float:
        """Incidence, rad, at half of the normal return, azimuth 0; NaN if nowhere."""
        angles = np.linspace(0.0, 89.0 * DEGREE, 891)
        below = np.flatnonzero(self.share(angles, np.zeros(len(angles))) <= 0.5)
        return float(angles[below[0]]) if len(below) else float("nan")


@dataclass(frozen=True, eq=False)
class AngleComparison:
    """Readings beside every kind's theory.

    readings   of all tables
    fits       of every kind, the likeliest first
    chosen     index of the kind that is judged
    stated     True if the user said the kind
    polarization   rad, of the light's field from the plane of incidence; None: not known
    """

    readings: AngleReadings
    fits: tuple[KindFit, ...]
    chosen: int
    stated: bool
    polarization: float | None = None

    @property
    def fit(self) -> KindFit:
        """Fit of the kind that is judged."""
        return self.fits[self.chosen]

    @cached_property
    def verdict(self) -> Verdict:
        """Good where the readings agree with the kind's theory, and with no other if the kind was not stated."""
        fit, best = self.fit, self.fits[0]
        if fit.p < LEVEL:
            factor = fit.chi2 / max(fit.degrees_of_freedom, 1)
            better = f"; {best.kind} fits better" if best is not fit else ""
            return Verdict("doubtful", f"no {fit.kind} returns this (variance factor {factor:.1f}){better}")
        others = [second.kind for second in self.fits if second is not fit and second.p >= LEVEL]
        if others and not self.stated:
            return Verdict("doubtful", f"the readings agree with {fit.kind} and with {', '.join(others)} alike")
        return Verdict("good", f"the readings agree with the theory of the kind {fit.kind}")


def drawn_kinds(sizes: DrawnSizes) -> dict[str, Retroreflector]:
    """Retroreflectors of every kind's curves, once each, by label."""
    curves = [curve for kind in KINDS.values() for curve in kind.curves]
    built = {curve.build: curve.label.split(",")[0] for curve in reversed(curves)}
    return {label: build(sizes) for build, label in built.items()}


def sizes_of(*, aperture_mm: float, height_mm: float, reflectance: float, glass: str = "BK7-old") -> DrawnSizes:
    """Sizes of the retroreflectors, in the notes' air.

    aperture_mm, height_mm   radius of the face; face to corner
    reflectance              of each mirror
    glass                    of prism and ball
    """
    about = air(20.0, 933.0, 50.0, wavelength_um=VACUUM_UM, model=NOTES_AIR_MODEL)
    n = index_over_air(VACUUM_UM, glass, air_phase=about.phase_index, air_group=about.group_index)
    return DrawnSizes(
        height=height_mm * MILLIMETRE,
        aperture=aperture_mm * MILLIMETRE,
        group=float(n.group),
        phase=float(n.phase),
        reflectance=reflectance,
        **BALL,
    )


def compare_angles(
    readings: AngleReadings,
    sizes: DrawnSizes,
    *,
    noise: float,
    relative: float,
    kind: str | None = None,
    polarization: float | None = None,
) -> AngleComparison:
    """Readings fitted with each kind's theory.

    readings   of one or several tables
    sizes      of the retroreflectors
    noise      standard uncertainty of a reading without light, in the readings' unit
    relative   and of its size
    kind       label of the kind to judge; None for the likeliest
    polarization   rad, of the light's field from the plane of incidence; None: unpolarized theory

    Raises EstimationError for too few readings or none with light, InputError for an unknown kind.

    Source: theory of `optics.retroreflector.kinds`; least squares, [JCGM100] 5.2; [PARKER04] chapter 8.
    """
    if len(readings) < FEWEST:
        raise EstimationError(f"{readings.names[0]}: {len(readings)} readings are too few (expected {FEWEST})")
    if not np.max(readings.value) > 5.0 * noise:
        raise EstimationError(
            f"{readings.names[0]}: no reading is above 5 x {noise:g} {readings.unit}, five times the noise"
        )
    made = drawn_kinds(sizes)
    words = {label.replace(" ", "-"): label for label in made}
    if kind is not None and kind not in words:
        raise InputError(f"kind {kind!r} is unknown (expected one of {', '.join(sorted(words))})")
    fits = [_fitted(label, retro, readings, noise, relative, polarization) for label, retro in made.items()]
    fits.sort(key=lambda fit: fit.chi2)
    chosen = 0 if kind is None else next(k for k, fit in enumerate(fits) if fit.kind == words[kind])
    return AngleComparison(readings, tuple(fits), chosen, stated=kind is not None, polarization=polarization)


def _model(p: Array, incidence: Array, rotation: Array, share: AngleShare, quadrature: bool, analyser: Array) -> Array:
    off = incidence - p[2]
    azimuth = rotation - p[3] + np.where(off < 0.0, np.pi, 0.0)
    bright = p[0] * share(np.minimum(np.abs(off), 0.499 * np.pi), azimuth, analyser)
    return np.hypot(bright, p[1]) if quadrature else bright + p[1]


def _share(retro: Retroreflector, largest: float, polarization: float | None) -> AngleShare:
    """Theory of one kind, over the return at normal incidence without analyser."""
    normal = float(retro.return_share(0.0))
    polarized = None if polarization is None else PolarizedShare(retro, polarization, largest)

    def share(incidence: Array, azimuth: Array, analyser: Array | None = None) -> Array:
        plain = np.nan_to_num(retro.return_share(incidence, azimuth)) / normal
        if polarized is None:
            return plain
        return plain * polarized(incidence, azimuth, np.full(len(plain), np.nan) if analyser is None else analyser)

    return share


def _fitted(
    label: str, retro: Retroreflector, r: AngleReadings, noise: float, relative: float, polarization: float | None
) -> KindFit:
    from scipy.optimize import least_squares

    quadrature = r.unit == "V"
    share = _share(retro, float(np.max(np.abs(r.incidence))) + MARGIN, polarization)
    analyser = np.full(len(r), np.nan) if r.analyser is None else r.analyser
    turn = np.linspace(0.0, SECTOR, 25)
    ranges = [
        float(np.ptp(share(np.full(25, abs(i)), turn, np.full(25, angle))))
        for i in (*np.unique(r.incidence), 0.3)
        for angle in np.unique(analyser)
    ]
    depends = max(ranges) > DEPENDS
    free = np.array([True, True, bool(np.ptp(r.incidence) > 0.0), depends])
    best: tuple[float, Array, Array, Array] | None = None
    for k in range(STARTS if depends else 1):
        p = np.array([float(np.max(r.value)), noise, 0.0, k * SECTOR / STARTS])
        sigma = np.hypot(noise, relative * r.value)
        for _ in range(ROUNDS):

            def whole(x: Array, p: Array = p) -> Array:
                full = p.copy()
                full[free] = x
                return full

            def residual(x: Array, sigma: Array = sigma, whole: Callable[[Array], Array] = whole) -> Array:
                full = whole(x)
                return np.append(
                    (r.value - _model(full, r.incidence, r.rotation, share, quadrature, analyser)) / sigma,
                    full[1] / (DARK * noise),
                )

            low = np.array([0.0, 0.0, -LARGEST_ZERO, -np.inf])[free]
            high = np.array([np.inf, np.inf, LARGEST_ZERO, np.inf])[free]
            scale = np.array([max(p[0], noise), noise, DEGREE, DEGREE])[free]
            solution = least_squares(residual, np.clip(p[free], low, high), bounds=(low, high), x_scale=scale)
            p = whole(solution.x)
            sigma = np.hypot(noise, relative * _model(p, r.incidence, r.rotation, share, quadrature, analyser))
        if best is None or solution.cost < best[0]:
            best = (float(solution.cost), p, solution.jac, sigma)
    assert best is not None
    _, p, jac, sigma = best
    values = p.copy()
    values[3] = np.mod(values[3] + 0.5 * SECTOR, SECTOR) - 0.5 * SECTOR if depends else 0.0
    covariance, determined = _covariance(jac, free)
    predicted = _model(p, r.incidence, r.rotation, share, quadrature, analyser)
    chi2 = float(np.sum(((r.value - predicted) / sigma) ** 2) + (p[1] / (DARK * noise)) ** 2)
    dof = len(r) - int(determined.sum()) + 1  # the background's prior counts
    return KindFit(
        kind=label,
        values=values,
        covariance=covariance,
        determined=determined,
        predicted=predicted,
        sigma=sigma,
        chi2=chi2,
        degrees_of_freedom=dof,
        quadrature=quadrature,
        share=share,
    )


def _covariance(jac: Array, free: np.ndarray) -> tuple[Array, np.ndarray]:
    """Covariance (4, 4) and the parameters that the readings determine."""
    size = np.linalg.norm(jac, axis=0)
    observed = size > 1e-9 * size.max()
    columns = jac[:, observed] / size[observed]
    inverse = np.linalg.pinv(columns.T @ columns, rcond=1e-10, hermitian=True) / np.outer(
        size[observed], size[observed]
    )
    determined = free.copy()
    determined[np.flatnonzero(free)[~observed]] = False
    covariance = np.zeros((4, 4))
    covariance[np.ix_(determined, determined)] = inverse
    return covariance, determined
