"""Choose modulation frequencies that separate lengths; rate a set."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.signal.cycles.sets import SURE, checked_frequencies, checked_u_phase, cycle_sets, upper_tail


@dataclass(frozen=True)
class ModulationSet:
    """Set of modulation frequencies, with the lengths it can separate.

    frequencies_hz     (k,) the lowest first
    span               m, width of the limits within which lengths are separated
    separation         least distance between the phases of two lengths, in standard uncertainties of the phases: a slip
                       takes noise of half of it
    nearest            m, difference of those two lengths
    first_alias        m, shortest difference not separated by 2 SURE standard uncertainties; None if there is none
    u_length           m, standard uncertainty of a length
    slip_probability   bound on the probability of a slip, all other lengths within the span together
    """

    frequencies_hz: tuple[float, ...]
    span: float
    separation: float
    nearest: float
    first_alias: float | None
    u_length: float
    slip_probability: float

    @property
    def unambiguous(self) -> bool:
        """True if slips need phase errors above SURE standard uncertainties."""
        return self.separation >= 2.0 * SURE


def modulation_set(
    frequencies_hz: ArrayLike, *, u_phase: ArrayLike, span: float, group_index: float = 1.0
) -> ModulationSet:
    """Rate a set of frequencies by the lengths it separates.

    frequencies_hz   (k,) two or more different modulation frequencies, above 0
    u_phase          rad, above 0, of each phase fraction: one for all, or (k,)
    span             m, above 0: largest minus smallest length in question
    group_index      of the air at the carrier

    All lengths up to the span whose phases come near those of length zero are compared, without exception.
    Raises ValidityError for values outside those limits.

    Source: [LOEFDAHL01] for the problem; the exact search is ours: chi-square is quadratic between the lengths at
    which one of the whole cycles changes.

    >>> plan = modulation_set([1500e6, 1500.5e6, 1510e6], u_phase=1e-3, span=200.0)
    >>> plan.unambiguous, round(plan.separation, 1), round(1e6 * plan.u_length, 1)
    (True, 33.3, 9.2)
    """
    f = checked_frequencies(frequencies_hz)
    if not (np.isfinite(span) and span > 0.0 and group_index > 0.0):
        raise ValidityError(f"span {span} m and group index {group_index}: both are above 0")
    half = SPEED_OF_LIGHT / (2.0 * f)
    u = checked_u_phase(u_phase, f) * half / TWO_PI
    if not np.isfinite(u).all():
        raise ValidityError(f"u_phase {u_phase!r} rad is not finite")
    candidates = cycle_sets(np.zeros((1, len(f))), half, 1.0 / u[None] ** 2, limits=(0.0, span * group_index))
    aliases = np.any(candidates.cycles[0] != 0, axis=-1) & candidates.inside[0]
    lengths, square = candidates.length[0, aliases] / group_index, candidates.misfit[0, aliases]
    u_length = float(np.sum(u**-2.0) ** -0.5) / group_index
    least_square = 0.25 * float(np.min((half / u) ** 2))  # all sets not compared miss one phase by half a turn or more
    if not len(lengths) or float(square.min()) > least_square:
        lengths, square = np.append(lengths, np.nan), np.append(square, least_square)
    near = np.sqrt(square)
    alias = lengths[near < 2.0 * SURE]
    return ModulationSet(
        frequencies_hz=tuple(float(v) for v in f),
        span=float(span),
        separation=float(near.min()),
        nearest=float(lengths[np.argmax(near <= near.min() + 1e-6)]),
        first_alias=float(alias.min()) if len(alias) else None,
        u_length=u_length,
        slip_probability=float(min(1.0, np.sum(2.0 * upper_tail(0.5 * near)))),
    )


def choose_frequencies(
    span: float,
    *,
    u_phase: float,
    lowest_hz: float = 1.5e9,
    widest_hz: float = 50e6,
    step_hz: float = 1e3,
    most: int = 6,
    group_index: float = 1.0,
) -> ModulationSet:
    """Fewest modulation frequencies that resolve lengths within a span.

    span          m, above 0: largest minus smallest length in question
    u_phase       rad, above 0, of each phase fraction
    lowest_hz     the lowest frequency
    widest_hz     largest offset above it: the band of laser, detector and retroreflector mount
    step_hz       raster of the synthesiser
    most          frequencies at most
    group_index   of the air at the carrier

    The first offset has a beat longer than the span, the others follow in geometric progression up to the widest; the
    result is checked by `modulation_set`, not by this rule alone. Raises ValidityError where no such plan with `most`
    frequencies is good for SURE standard uncertainties.

    >>> choose_frequencies(200.0, u_phase=1e-3).frequencies_hz
    (1500000000.0, 1500713000.0, 1505000000.0)
    """
    if not (span > 0.0 and u_phase > 0.0 and step_hz > 0.0):
        raise ValidityError(f"span {span} m, u_phase {u_phase} rad and step {step_hz} Hz: all are above 0")
    first = np.floor(SPEED_OF_LIGHT / (2.0 * group_index * span * 1.05) / step_hz) * step_hz
    if not step_hz <= first <= widest_hz:
        raise ValidityError(
            f"span {span} m needs frequencies {first} Hz apart: expected between the step, {step_hz} Hz, "
            f"and the widest, {widest_hz} Hz"
        )
    best = 0.0
    for count in range(2, most + 1):
        for share in np.linspace(0.1, 1.0, 19) if count > 2 else (1.0,):  # commensurate offsets can be bad: try others
            ratio = (share * widest_hz / first) ** (1.0 / max(count - 2, 1))
            if count > 2 and ratio <= 1.5:
                continue
            offsets = first * ratio ** np.arange(count - 1)
            f = lowest_hz + np.append(0.0, np.round(offsets / step_hz) * step_hz)
            plan = modulation_set(f, u_phase=u_phase, span=span, group_index=group_index)
            if plan.unambiguous:
                return plan
            best = max(best, plan.separation)
    raise ValidityError(
        f"no {most} frequencies within {widest_hz / 1e6:g} MHz tell {span} m apart at {u_phase} rad: the best reach "
        f"{best / 2:.1f} standard uncertainties (limit {SURE:g}); widen the band or average longer"
    )
