"""Range to a hollow target by itself, and the zero-distance phase from a known one.

With all light in air there is no glass constant: D = N h - (Phi - Phi_ZRG - Phi_Cal) h / 2 pi, h half a wavelength in
the air. The memo's 3.3 prints Phi_Cal where Phi_Cal/2 pi is right, and its rule by INT slips by a half wavelength
where coarse and true length straddle a multiple of it; N here is the nearest integer.
"""

import math
from dataclasses import dataclass

from catseye.atmosphere.index.air import group_refractivity
from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.signal.cycles.whole import fraction, memo_whole_cycles, unwrapped_length, whole_cycles
from catseye.verdict import Verdict

THIN = 5e-3  # m, of the margin: a coarse length good to 2 mm needs more


@dataclass(frozen=True)
class RangePhases:
    """Phases of a target and the ranger's reference, rad, 0 to 2 pi.

    target, reference   of the hollow target and of ZRG
    u                   standard uncertainty of each reading
    """

    target: float
    reference: float
    u: float = 0.0

    def __post_init__(self) -> None:
        for name in ("target", "reference"):
            require_phase(name, getattr(self, name))
        if not 0.0 <= self.u < 1.0:
            raise ValidityError(f"u = {self.u} rad of a phase (expected 0 to 1)")


@dataclass(frozen=True)
class HollowRange:
    """Range to a hollow target; metres, rad.

    distance, u_distance   scan point to corner; u by the phases alone
    zero_phase, u_zero_phase   Phi_Cal; u of 0 where it was given
    cycles, margin         whole half wavelengths, and the error of the coarse length at which they change
    memo_cycles            by INT and sign; None where the rule does not apply
    memo_distance          with them; nan without
    half                   half a wavelength in the air
    """

    distance: float
    u_distance: float
    zero_phase: float
    u_zero_phase: float
    cycles: int
    margin: float
    memo_cycles: int | None
    memo_distance: float
    half: float

    @property
    def verdict(self) -> Verdict:
        """Verdict by the margin of the whole cycles."""
        if self.margin < THIN:
            return Verdict(
                "doubtful", f"the margin of the whole cycles is {1e3 * self.margin:.1f} mm (expected 5 or more)"
            )
        return Verdict("good", f"margin of the whole cycles {1e3 * self.margin:.1f} mm")


def require_phase(name: str, value: float) -> None:
    """Raise ValidityError for a phase outside 0 to 2 pi."""
    if not 0.0 <= value < TWO_PI:
        raise ValidityError(f"{name} = {value} rad (expected 0 to below 2 pi)")


def half_in_air(
    temperature_c: float,
    pressure_hpa: float,
    humidity_percent: float,
    *,
    modulation_hz: float,
    wavelength_um: float,
    model: str,
) -> float:
    """Half a wavelength of the modulation in air, m.

    temperature_c, pressure_hpa, humidity_percent   of the air
    modulation_hz, wavelength_um, model             of the ranger; formula of the index

    Source: [GOLDMAN00] section 3.4, HWLA.
    """  # fmt: skip
    if not 1e6 <= modulation_hz <= 1e11:
        raise ValidityError(f"modulation {modulation_hz:g} Hz (expected 1e6 to 1e11)")
    air = group_refractivity(temperature_c, pressure_hpa, humidity_percent, wavelength_um=wavelength_um, model=model)
    return 0.5 * SPEED_OF_LIGHT / modulation_hz / (1.0 + float(air))


def hollow_range(phases: RangePhases, coarse: float, zero_phase: float, half: float) -> HollowRange:
    """Distance to a hollow target from its phase and a coarse length.

    phases       of target and reference
    coarse       m, good to the margin: up to a quarter wavelength
    zero_phase   rad, Phi_Cal of the ranger
    half         m, half a wavelength in the air

    Source: [GOLDMAN00] eqs. 3.2, 3.6 and 3.7, N by the nearest integer.

    >>> round(hollow_range(RangePhases(2.0, 1.0), 18.2, 0.5, 0.0999).distance, 6)
    18.17385
    """
    require_phase("zero_phase", zero_phase)
    if not 0.0 < coarse < 1e5:
        raise ValidityError(f"coarse length {coarse:g} m (expected above 0)")
    part = fraction(phases.target, phases.reference + zero_phase)
    cycles, margin = whole_cycles(coarse, part, half)
    after = phases.target - phases.reference - zero_phase
    by_memo = int(memo_whole_cycles(coarse, after, half)) if abs(after) < TWO_PI else None
    return HollowRange(
        distance=float(unwrapped_length(cycles, part, half)),
        u_distance=math.sqrt(2.0) * phases.u * half / TWO_PI,
        zero_phase=zero_phase,
        u_zero_phase=0.0,
        cycles=int(cycles),
        margin=float(margin),
        memo_cycles=by_memo,
        memo_distance=math.nan if by_memo is None else (by_memo - after / TWO_PI) * half,
        half=half,
    )


def zero_phase_of(phases: RangePhases, distance: float, u_distance: float, half: float) -> HollowRange:
    """Zero-distance phase Phi_Cal from a hollow target at a known distance.

    phases       of target and reference
    distance     m, from scan point to corner, and its standard uncertainty
    u_distance   m
    half         m, half a wavelength in the air

    Source: [GOLDMAN00] eq. 3.3, with Phi_Cal/2 pi in place of its Phi_Cal.

    >>> round(zero_phase_of(RangePhases(2.0, 1.0), 18.17385021, 0.0, 0.0999).zero_phase, 5)
    0.5
    """
    if not (0.0 < distance < 1e5 and u_distance >= 0.0):
        raise ValidityError(f"distance {distance:g} m with u {u_distance:g} m (expected above 0, and 0 or more)")
    zero = float(fraction(phases.target - phases.reference + TWO_PI * distance / half, 0.0))
    known = hollow_range(phases, distance, zero, half)
    u = math.hypot(math.sqrt(2.0) * phases.u, TWO_PI * u_distance / half)
    return HollowRange(
        distance=distance,
        u_distance=u_distance,
        zero_phase=zero,
        u_zero_phase=u,
        cycles=known.cycles,
        margin=known.margin,
        memo_cycles=known.memo_cycles,
        memo_distance=known.memo_distance,
        half=half,
    )
