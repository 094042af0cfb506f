"""Stray light of a range: further paths, a second pass, leakage, unequal quadratures, light back into the laser."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ArgumentError
from catseye.signal.systematics.cyclic import cyclic_orders, imbalance_range, leakage_range
from catseye.signal.systematics.feedback import (
    dephasing,
    feedback_fringe,
    feedback_parameter,
    fringe_contrast,
    fringe_uncertainty,
    interference_phase,
    optical_phase,
    regulation_phase,
)
from catseye.signal.systematics.multipath import cats_eye_error, largest_share, multipath_error, two_retroreflectors
from catseye.verdict import Verdict

PLACES = 240  # of a target over half a modulation wavelength
ORDERS = 4  # cyclic orders that are reported
FRINGES = 2.0  # half wavelengths of light in the figure of a fringe
LIMIT_M = 1e-6, 0.02  # of a range error


@dataclass(frozen=True, eq=False)
class StrayEffect:
    """Range error of one cause.

    name      of the cause
    at        m at the distance, positive where too long
    largest   m, greatest departure from its mean over half a modulation wavelength of distance
    mean      m, constant part: a zero, which a calibration holds
    orders    (4,) m, amplitude of the cyclic orders 1 to 4
    curve     (n,) m at the places
    """

    name: str
    at: float
    largest: float
    mean: float
    orders: Array
    curve: Array


@dataclass(frozen=True)
class LaserFeedback:
    """Light that returns into the mode of a laser.

    returned           its power over the emitted, 0 to 1
    coherence          0 to 1: contrast that linewidth and speckle leave
    regulation         rad for each unit of relative power: answer of the power's regulation
    laser_path         m, group optical path of the laser's cavity, one way
    facet              reflectance of the laser's facet
    enhancement        linewidth enhancement factor
    optical_wavelength m, of the light in air
    shots              averaged
    movement           m, standard deviation of the path's change from shot to shot
    """

    returned: float
    coherence: float
    regulation: float
    laser_path: float
    facet: float
    enhancement: float
    optical_wavelength: float
    shots: int
    movement: float


@dataclass(frozen=True)
class StrayCauses:
    """Causes of stray light.

    paths         share of the light and full detour, m, of paths that move with the target, as inside a prism
    reflectors    share of the light and separation beyond the target, m, of further retroreflectors that stand
    second_pass   share of the light that the detector sends out and the target returns once more
    leakage       amplitude over the light's
    gain, skew    of the sine channel over the cosine channel, less 1; departure from quadrature, rad
    feedback      light back into the laser; None: none
    """

    paths: Sequence[tuple[float, float]] = ()
    reflectors: Sequence[tuple[float, float]] = ()
    second_pass: float = 0.0
    leakage: float = 0.0
    gain: float = 0.0
    skew: float = 0.0
    feedback: LaserFeedback | None = None


@dataclass(frozen=True, eq=False)
class FeedbackSize:
    """Size of laser feedback.

    parameter       C: from 1 on the laser jumps between modes
    contrast        amplitude of the relative change of power
    largest_phase   rad, by regulation and interference together
    u_range         m, standard uncertainty of one shot
    u_mean          m, of the mean of the shots
    moved           (n,) m, small movements of the target
    fringe          (n,) m, range error at these; empty where the laser jumps
    """

    parameter: float
    contrast: float
    largest_phase: float
    u_range: float
    u_mean: float
    moved: Array
    fringe: Array


@dataclass(frozen=True, eq=False)
class StrayLight:
    """Stray light of a range.

    distance     m, ranger to target
    wavelength   m, of the modulation in air
    limit        m, range error allowed
    share        of one further path that stays within the limit wherever the target stands
    moved        (n,) m, movements of the target, half a wavelength
    effects      of each cause
    feedback     None: no light back into the laser
    """

    distance: float
    wavelength: float
    limit: float
    share: float
    moved: Array
    effects: tuple[StrayEffect, ...]
    feedback: FeedbackSize | None

    @property
    def largest(self) -> float:
        """Greatest departure from the mean of all causes together, m."""
        total = np.sum([effect.curve - effect.mean for effect in self.effects], axis=0) if self.effects else np.zeros(1)
        return float(np.abs(total).max())

    @property
    def verdict(self) -> Verdict:
        """Good within the limit, doubtful beyond or where the laser jumps."""
        size = max(self.largest, 0.0 if self.feedback is None else self.feedback.u_range)
        moved, limit = f"stray light moves ranges by {size * 1e6:.3g} µm", f"{self.limit * 1e6:g} µm"
        if self.feedback is not None and self.feedback.parameter >= 1.0:
            why = f"the feedback parameter is {self.feedback.parameter:.3g}: from 1 on the laser jumps between modes"
            return Verdict("doubtful", why)
        if size > self.limit:
            return Verdict("doubtful", f"{moved}, more than {limit}")
        return Verdict("good", f"{moved} at most, within {limit}")


def stray_light(distance: float, causes: StrayCauses, *, wavelength: float, limit: float) -> StrayLight:
    """Stray light of a range to a target that moves over half a modulation wavelength.

    distance     m, ranger to target
    causes       at least one
    wavelength   m, of the modulation in air
    limit        m, range error allowed, 1 µm to 20 mm

    Raises ArgumentError without any cause or for a limit outside; ValidityError for shares that are none.

    Source: [PARKER04] section 5.2.1, chapter 6, items 3 and 4; the formulas are those of `signal.systematics`.
    """
    if not LIMIT_M[0] <= limit <= LIMIT_M[1]:
        low, high = (1e6 * m for m in LIMIT_M)
        raise ArgumentError(f"limit_um = {limit * 1e6:g} is not within {low:g} to {high:g} µm", "limit_um")
    moved = np.arange(PLACES) * 0.5 * wavelength / PLACES
    place = distance + moved
    x = -2.0 * TWO_PI * place / wavelength
    curves: dict[str, Array] = {}
    for share, excess in causes.paths:
        error = multipath_error([share], [excess], wavelength)
        curves[f"path {1e3 * excess:g} mm longer"] = np.full(PLACES, float(error))
    for share, separation in causes.reflectors:
        curves[f"reflector {1e3 * separation:+g} mm"] = two_retroreflectors(share, separation - moved, wavelength)
    if causes.second_pass:
        curves["second pass"] = cats_eye_error(place, causes.second_pass, wavelength)
    if causes.leakage:
        curves["leakage"] = leakage_range(x, causes.leakage, wavelength)
    if causes.gain or causes.skew:
        curves["quadratures"] = imbalance_range(x, gain=causes.gain, skew=causes.skew, wavelength=wavelength)
    if not curves and causes.feedback is None:
        raise ArgumentError("no stray light is given (expected a path, a reflector, a share or feedback)", "path")
    size = None if causes.feedback is None else _feedback(distance, wavelength, causes.feedback)
    share_allowed = float(largest_share(min(limit, wavelength / 8.0), wavelength))
    effects = tuple(_effect(name, curve) for name, curve in curves.items())
    return StrayLight(
        distance=distance,
        wavelength=wavelength,
        limit=limit,
        share=share_allowed,
        moved=moved,
        effects=effects,
        feedback=size,
    )


def _effect(name: str, curve: Array) -> StrayEffect:
    mean, cosine, sine = cyclic_orders(curve, ORDERS)
    return StrayEffect(
        name=name,
        at=float(curve[0]),
        largest=float(np.abs(curve - mean).max()),
        mean=mean,
        orders=np.hypot(cosine, sine),
        curve=curve,
    )


def _feedback(distance: float, wavelength: float, light: LaserFeedback) -> FeedbackSize:
    """Size of light back into the laser, which interferes with that of the way there and back."""
    parameter = float(
        feedback_parameter(
            light.returned,
            distance,
            laser_path=light.laser_path,
            facet_reflectance=light.facet,
            enhancement=light.enhancement,
        )
    )
    contrast = float(fringe_contrast(light.returned, light.coherence))
    detour = 2.0 * TWO_PI * distance / wavelength
    # both go with the cosine of the light's phase, to first order in the contrast
    largest = abs(light.regulation * contrast + float(interference_phase(contrast, 0.0, detour)))
    per_radian = wavelength / (2.0 * TWO_PI)
    correlation = float(dephasing(light.movement, light.optical_wavelength))
    u = {n: per_radian * float(fringe_uncertainty(largest, shots=n, correlation=correlation)) for n in (1, light.shots)}
    moved = np.linspace(0.0, 0.5 * FRINGES * light.optical_wavelength, PLACES)
    fringe = np.zeros(0)
    if parameter < 1.0:
        answer = feedback_fringe(optical_phase(moved, light.optical_wavelength), parameter, light.enhancement)
        phase = regulation_phase(contrast, answer, light.regulation) + interference_phase(contrast, answer, detour)
        fringe = -per_radian * phase
    return FeedbackSize(
        parameter=parameter,
        contrast=contrast,
        largest_phase=largest,
        u_range=u[1],
        u_mean=u[light.shots],
        moved=moved,
        fringe=fringe,
    )
