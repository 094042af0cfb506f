"""Length from phases at several frequencies, without a coarse length.

The group index of air belongs to the carrier, 780 nm; it is the same for every modulation frequency, so that one
optical length n L carries all phases: n L = (N_k - phi_k/2 pi) c / 2 f_k. The electronics have a different phase
at each frequency: each phase_fraction must have been taken after a reference shot at the same frequency.

The joint search is better: it weights all phases at once and is exact. The cascade steps from the longest beat
to the carrier; each step rests on the difference of two phases only, sqrt 2 noisier, so it slips first. It is kept
to show in which step the margin is lost.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.signal.cycles.frequencies import modulation_set
from catseye.signal.cycles.sets import SURE, checked_frequencies, checked_u_phase, cycle_sets, upper_tail

HOPELESS = 1.0  # standard uncertainties of phase that separate two lengths: below it a search is pointless
ROOM = 2_000_000  # lengths compared at once: some 100 MB


class JointStatus(IntEnum):
    """Result of one shot.

    FOUND; AMBIGUOUS: another length fits nearly as well; MISFIT: none fits; UNKNOWN: input not finite.
    """

    FOUND = 0
    AMBIGUOUS = 1
    MISFIT = 2
    UNKNOWN = 3


@dataclass(frozen=True, eq=False)
class JointLength:
    """Lengths from k phases each; arrays over the shots.

    length             m, in air: approximate distance - D0 - Pc - dPc in the sense of `whole_cycles`; nan where unknown
    u_length           m, standard uncertainty if the whole cycles are right: from the phases only, index taken as exact
    cycles             (..., k) N of each frequency
    misfit             chi-square of the phases, k - 1 degrees of freedom
    next_length        m, the length that fits second best
    discrimination     chi-square of that length less that of the best, at least
    slip_probability   probability of wrong cycles; all lengths within the limits are equally likely a priori
    status             int8 of `JointStatus`
    """

    length: NDArray[np.float64]
    u_length: NDArray[np.float64]
    cycles: NDArray[np.int64]
    misfit: NDArray[np.float64]
    next_length: NDArray[np.float64]
    discrimination: NDArray[np.float64]
    slip_probability: NDArray[np.float64]
    status: NDArray[np.int8]


def joint_length(
    phase_fractions: ArrayLike,
    frequencies_hz: ArrayLike,
    *,
    u_phase: ArrayLike,
    within: tuple[float, float],
    group_index: ArrayLike = 1.0,
) -> JointLength:
    """Length common to phases at several frequencies, by exact search.

    phase_fractions   (..., k) rad, from `fraction`, each against the reference at its own frequency
    frequencies_hz    (k,) two or more different, above 0
    u_phase           rad, above 0, of each phase fraction; broadcasts to (..., k)
    within            m, smallest and largest possible length
    group_index       (...) mean along each path, at the carrier

    Each length within the limits gives one set of nearest whole cycles; between two neighbouring changes of one
    of them the set is constant and chi-square a parabola. So every set that can be best is compared. AMBIGUOUS where
    the next one is worse by less than SURE standard uncertainties, MISFIT where the best misses its phases by more than
    SURE. A shot with an input that is not finite is UNKNOWN. Raises ValidityError for values outside those limits, and
    for frequencies with which one standard uncertainty of phase confuses two lengths within the limits, even at the
    smallest u_phase.

    Source: [PARKER04] eq. 5.18 for each frequency; [LOEFDAHL01] for the problem, the exact search is ours.

    >>> f = np.array([1500e6, 1500.5e6, 1510e6])
    >>> phases = np.mod(-4 * np.pi * f * 1.000253 * 123.456789 / 299792458.0, 2 * np.pi)
    >>> joint = joint_length(phases, f, u_phase=1e-3, within=(5.0, 200.0), group_index=1.000253)
    >>> round(float(joint.length), 9), JointStatus(int(joint.status)).name
    (123.456789, 'FOUND')
    """
    f = checked_frequencies(frequencies_hz)
    low, high = (float(v) for v in within)
    phase = np.asarray(phase_fractions, dtype=float)
    if phase.shape[-1:] != f.shape:
        raise ValidityError(
            f"phase_fractions of shape {phase.shape} for {len(f)} frequencies: (..., {len(f)}) is expected"
        )
    if not (np.isfinite(high) and np.isfinite(low) and low < high):
        raise ValidityError(f"limits {low} to {high} m: the second is larger, both are finite")
    n = np.broadcast_to(np.asarray(group_index, dtype=float), phase.shape[:-1]).ravel()
    u_all = np.broadcast_to(checked_u_phase(u_phase, f), phase.shape).reshape(-1, len(f))
    flat = phase.reshape(-1, len(f))
    finite = np.isfinite(flat).all(axis=1) & np.isfinite(n) & np.isfinite(u_all).all(axis=1)
    if np.any(n[finite] <= 0.0):
        raise ValidityError(f"group index {float(n[finite].min())} is not above 0")
    half = SPEED_OF_LIGHT / (2.0 * f)
    out = _Answer.empty(len(flat), len(f))
    if finite.any():
        _refuse_alias(f, u_all[finite].min(axis=0), high - low, float(n[finite].max()))
        rows = np.flatnonzero(finite)
        size = max(1, int(ROOM / (np.sum((high - low) * n[finite].max() / half + 3) * len(f))))
        for start in range(0, len(rows), size):
            part = rows[start : start + size]
            out.fill(part, flat[part], half, u_all[part] * half / TWO_PI, n[part], (low, high))
    return out.shaped(phase.shape[:-1])


@dataclass(frozen=True, eq=False)
class _Answer:
    """Columns of `JointLength`, one row a shot."""

    floats: NDArray[np.float64]  # length, u_length, misfit, next_length, discrimination, slip_probability
    cycles: NDArray[np.int64]
    status: NDArray[np.int8]

    @classmethod
    def empty(cls, shots: int, frequencies: int) -> "_Answer":
        unknown = np.full(shots, int(JointStatus.UNKNOWN), dtype=np.int8)
        return cls(np.full((6, shots), np.nan), np.zeros((shots, frequencies), dtype=np.int64), unknown)

    def fill(
        self,
        rows: NDArray[np.int64],
        phase: NDArray[np.float64],
        half: NDArray[np.float64],
        u: NDArray[np.float64],
        n: NDArray[np.float64],
        within: tuple[float, float],
    ) -> None:
        """Write the best and second best set of some shots.

        u are the phases' standard uncertainties as lengths.
        """
        low, high = within
        sets = cycle_sets(
            phase, half, u**-2.0, limits=(min(low * n.min(), low * n.max()), max(high * n.min(), high * n.max()))
        )
        u_length = np.sum(u**-2.0, axis=1) ** -0.5
        slack = SURE * u_length[:, None]
        inside = sets.inside & (sets.length >= low * n[:, None] - slack) & (sets.length <= high * n[:, None] + slack)
        square = np.where(inside, sets.misfit, np.inf)
        at, first = np.arange(len(rows)), np.argmin(square, axis=1)
        best = square[at, first]
        some = np.isfinite(best)
        with np.errstate(invalid="ignore"):
            chance = np.exp(-0.5 * (square - best[:, None]))
        chance[at, first] = 0.0
        chance_sum = np.sum(chance, axis=1)
        slip = chance_sum / (1.0 + chance_sum)
        square[at, first] = np.inf
        second = np.argmin(square, axis=1)
        least_misfit = 0.25 * np.min((half / u) ** 2, axis=1)  # a set never nearest misses one phase by half a turn
        apart = np.minimum(square[at, second], np.maximum(least_misfit, best)) - best
        known_next = np.isfinite(square[at, second])
        self.floats[:, rows] = np.where(
            some,
            [
                sets.length[at, first] / n,
                u_length / n,
                best,
                np.where(known_next, sets.length[at, second] / n, np.nan),
                apart,
                slip,
            ],
            np.nan,
        )
        self.cycles[rows] = np.where(some[:, None], sets.cycles[at, first], 0.0).astype(np.int64)
        fits = some & (best <= _misfit_limit(len(half) - 1))
        sure = slip <= 2.0 * float(upper_tail(SURE))
        self.status[rows] = np.where(
            ~fits, JointStatus.MISFIT, np.where(sure, JointStatus.FOUND, JointStatus.AMBIGUOUS)
        )

    def shaped(self, shape: tuple[int, ...]) -> JointLength:
        length, u_length, misfit, following, apart, slip = (v.reshape(shape) for v in self.floats)
        cycles = self.cycles.reshape(*shape, self.cycles.shape[1])
        return JointLength(
            length=length,
            u_length=u_length,
            cycles=cycles,
            misfit=misfit,
            next_length=following,
            discrimination=apart,
            slip_probability=slip,
            status=self.status.reshape(shape),
        )


def _refuse_alias(f: NDArray[np.float64], u_phase: NDArray[np.float64], span: float, group_index: float) -> None:
    plan = modulation_set(f, u_phase=u_phase, span=span, group_index=group_index)
    if plan.separation < 2.0 * HOPELESS:
        raise ValidityError(
            f"frequencies {', '.join(f'{v / 1e6:.9g}' for v in f)} MHz confuse lengths {plan.nearest:.3f} m apart: "
            f"{plan.separation / 2:.1f} standard uncertainties of phase between them (limit {HOPELESS:g}); "
            f"bring limits closer than the {span:g} m given, or choose with choose_frequencies"
        )


def _misfit_limit(degrees: int) -> float:
    """Chi-square limit with the two-sided probability of SURE standard deviations."""
    from scipy.special import chdtri

    return float(chdtri(degrees, 2.0 * float(upper_tail(SURE))))
