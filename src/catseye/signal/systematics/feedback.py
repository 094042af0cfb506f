"""Optical feedback and interference: errors at the light's period.

The modulation's phase is tied to the optical path: it swings through a whole period for each half wavelength of light
(390 nm) that the target moves. No path is known to that, so from shot to shot it is noise, and on a constant
path a bias. Derived here: the interference, its averages and correlations. Models: that the laser answers a change of
its power by a phase in proportion (`regulation_phase`), and [LANG80]'s laser (`feedback_parameter`, `feedback_fringe`).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.errors import ValidityError

HALVINGS = 60  # halvings of the interval of a fringe's phase: below rounding


def optical_phase(distance: ArrayLike, optical_wavelength: ArrayLike) -> Array:
    """Optical phase there and back, rad, not wrapped.

    4 pi distance/optical wavelength.

    distance             m, one way
    optical_wavelength   m, in air: that of the light, not of its modulation

    >>> float(optical_phase(195e-9, 780e-9) / np.pi).__round__(9)
    1.0
    """
    return 2.0 * TWO_PI * np.asarray(distance, dtype=float) / np.asarray(optical_wavelength, dtype=float)


def fringe_contrast(returned: ArrayLike, coherence: ArrayLike = 1.0) -> Array:
    """Relative power change by interference, amplitude: 2 coherence sqrt(returned).

    returned    power that comes back in the same mode, over the power it meets, 0 to 1
    coherence   0 to 1: contrast lost to linewidth, to chirp, to speckle and to polarisation

    In a laser the change is of the emitted power, for facet and threshold alike (coherence then holds the laser's own
    answer); on a detector it is of the detected power. Raises ValidityError outside these limits.

    Source: two fields of power 1 and q: 1 + q + 2 sqrt(q) cos theta, the q itself left to `multipath_error`.

    >>> round(float(fringe_contrast(1e-6)), 9)
    0.002
    """
    q, c = np.asarray(returned, dtype=float), np.asarray(coherence, dtype=float)
    for name, value in (("returned power", q), ("coherence", c)):
        _expect((value >= 0.0) & (value <= 1.0), value, name, "within 0 to 1")
    return 2.0 * c * np.sqrt(q)


def regulation_phase(contrast: ArrayLike, optical_phase: ArrayLike, coefficient: ArrayLike) -> Array:
    """Phase that power regulation adds to the modulation, rad.

    Coefficient times relative power change.

    contrast        amplitude of the relative power change, see `fringe_contrast`
    optical_phase   rad, of the light that returns
    coefficient     rad for each unit of relative change, measured by changing the set power

    A model: the loop takes fringes for slow changes of power, and moves the bias, and with it the phase, in proportion.
    True within the loop's bandwidth; faster fringes do not reach the bias. A phase too high is a range too short.

    Source: [PARKER04] chapter 6, item 4, names the cause.

    >>> round(float(regulation_phase(0.002, 0.0, 0.5)), 9)
    0.001
    """
    return np.asarray(coefficient, dtype=float) * np.asarray(contrast, dtype=float) * np.cos(optical_phase)


def interference_phase(contrast: ArrayLike, optical_phase: ArrayLike, modulation_phase: ArrayLike) -> Array:
    """Phase that interference adds to the modulation, rad.

    contrast           amplitude of the fringe, 0 to below 1, see `fringe_contrast`
    optical_phase      rad, theta, of the detour
    modulation_phase   rad, psi = 2 pi detour/wavelength of the modulation

    The product of the two fields carries the modulation of both: to first order in the depth m of 1 + m cos(w t) the
    modulation's phasor is multiplied by 1 + (a/2) cos(theta) (1 + exp(-i psi)). To first order in a the phase moves by
    -(a/2) cos(theta) sin(psi). The cross-term goes with the root of the power, so it is far above the share itself:
    1e-6 of power is 2e-3 of contrast. Deep modulation makes more of it (up to 8 % at m = 0.7), chirp of the laser over
    the detour less.

    Raises ValidityError for a contrast outside these limits.

    Source: derived here; exact for small m.

    >>> round(float(interference_phase(0.002, 0.0, np.pi / 2)), 6)
    -0.000999
    """
    a = np.asarray(contrast, dtype=float)
    _expect((a >= 0.0) & (a < 1.0), a, "contrast of a fringe", "within 0 to below 1")
    psi = np.asarray(modulation_phase, dtype=float)
    return np.angle(1.0 + 0.5 * a * np.cos(optical_phase) * (1.0 + np.exp(-1j * psi)))


def dephasing(u_displacement: ArrayLike, optical_wavelength: ArrayLike) -> Array:
    """Fringe correlation after random motion, 0 to 1.

    It is the correlation between two shots, or the amplitude left of a fringe in one.

    u_displacement       m, standard deviation of the change of distance between the shots, or of the motion in a shot
    optical_wavelength   m

    Source: mean of exp(i theta) for a normal theta of standard deviation 4 pi u/wavelength. Exact.

    >>> round(float(dephasing(780e-9 / 8, 780e-9)), 4)
    0.2912
    """
    return np.exp(-0.5 * optical_phase(u_displacement, optical_wavelength) ** 2)


def fringe_uncertainty(largest: ArrayLike, *, shots: ArrayLike = 1, correlation: ArrayLike = 1.0) -> Array:
    """Standard uncertainty of a mean of shots with unknown fringe phase.

    largest       largest effect of a fringe, any unit
    shots         their number
    correlation   between any two of them, 0 to 1, see `dephasing`; 1, a path at rest, averages nothing

    u^2 = largest^2/2 (1 + (n - 1) correlation)/n; for one shot the distribution is arcsine.
    Raises ValidityError for a correlation outside 0 to 1 or less than one shot.

    Source: [JCGM100] 4.3 and 5.2.2. Exact.

    >>> round(float(fringe_uncertainty(1.0, shots=4, correlation=0.0)), 6)
    0.353553
    """
    n, r = np.asarray(shots, dtype=float), np.asarray(correlation, dtype=float)
    _expect(n >= 1.0, n, "number of shots", "at least 1")
    _expect((r >= 0.0) & (r <= 1.0), r, "correlation between shots", "within 0 to 1")
    share = (1.0 + (n - 1.0) * r) / n
    return np.abs(np.asarray(largest, dtype=float)) * np.sqrt(0.5 * share)


def feedback_parameter(
    returned: ArrayLike,
    path: ArrayLike,
    *,
    laser_path: ArrayLike,
    facet_reflectance: ArrayLike,
    enhancement: ArrayLike,
) -> Array:
    """Feedback parameter C of a laser diode.

    Above 1 the laser has several modes and jumps.

    returned            power that comes back into the laser's mode, over the emitted, 0 to 1
    path                m, optical path from the facet to the reflector, one way
    laser_path          m, group optical path of the laser's cavity, one way (1 mm for a chip of 0.28 mm)
    facet_reflectance   of power, above 0, below 1 (0.32 bare)
    enhancement         linewidth enhancement factor alpha (2 to 6)

    C = (path/laser_path) (1 - R) sqrt(returned/R) sqrt(1 + alpha^2). It grows with the distance: at 100 m a billionth
    of the power is far above 1, so that an isolator, or a retroreflector that offsets the beam, is necessary.

    Raises ValidityError for a reflectance outside these limits.

    Source: [ACKET84], of [LANG80]'s equations; for one weak reflector.

    >>> c = feedback_parameter(1e-12, 100.0, laser_path=1e-3, facet_reflectance=0.32, enhancement=5.0)
    >>> round(float(c), 3)
    0.613
    """
    r = np.asarray(facet_reflectance, dtype=float)
    _expect((r > 0.0) & (r < 1.0), r, "reflectance of the laser's facet", "between 0 and 1")
    coupling = (1.0 - r) * np.sqrt(np.asarray(returned, dtype=float) / r)
    widened = np.sqrt(1.0 + np.asarray(enhancement, dtype=float) ** 2)
    return coupling * widened * np.asarray(path, dtype=float) / np.asarray(laser_path, dtype=float)


def feedback_fringe(solitary_phase: ArrayLike, parameter: ArrayLike, enhancement: ArrayLike) -> Array:
    """Phase of the returned light in a laser detuned by it, rad.

    solitary_phase   rad, as `optical_phase` at the frequency of the laser alone
    parameter        C, 0 to below 1
    enhancement      linewidth enhancement factor alpha

    Solves phase + C sin(phase + arctan alpha) = solitary phase. Its cosine is a skewed sawtooth: over all distances
    its mean square is 1/2, and its mean becomes C/(2 sqrt(1 + alpha^2)).

    Raises ValidityError for C of 1 and more, where the equation has several solutions and the laser jumps.

    Source: [LANG80], stationary solution. Halving to rounding.

    >>> round(float(feedback_fringe(0.0, 0.0, 5.0)), 12)
    0.0
    """
    c = np.asarray(parameter, dtype=float)
    _expect((c >= 0.0) & (c < 1.0), c, "feedback parameter", "within 0 to below 1, where the laser does not jump")
    alone, lean = np.asarray(solitary_phase, dtype=float), np.arctan(np.asarray(enhancement, dtype=float))
    low, high = alone - c, alone + c
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = middle + c * np.sin(middle + lean) > alone
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)


def _expect(holds: NDArray[np.bool_], value: Array, name: str, limits: str) -> None:
    if not np.all(holds):
        raise ValidityError(f"{name} {float(np.atleast_1d(value)[~np.atleast_1d(holds)][0]):.4g} is not {limits}")
