"""A length from phases at several modulation frequencies, without a coarse length: the joint search and the cascade.

The group index of air belongs to the carrier, 780 nm; it is the same for every modulation frequency, so that one
optical length n L carries all phases: n L = (N_k - phi_k/2 pi) c / 2 f_k. The electronics do have a phase of their own
at every frequency: each phase_fraction must have been taken after a reference shot at the same frequency.

The joint search is the better one: it weighs all phases at once and is exact. The cascade steps from the longest beat
to the carrier; each step rests on the difference of two phases only, sqrt 2 noisier, so it slips first. It is kept
because it shows in which step the margin is lost.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.signal.cycles.frequencies import modulation_set
from catseye.signal.cycles.sets import SURE, beyond, checked_frequencies, checked_u_phase, cycle_sets

HOPELESS = 1.0  # standard uncertainties of the phases that turn one length into another: then no shot is worth a search
ROOM = 2_000_000  # lengths that are compared at once: some 100 MB


class JointStatus(IntEnum):
    """What came of one shot: FOUND, AMBIGUOUS (another length fits nearly as well), MISFIT (none fits), UNKNOWN."""

    FOUND = 0
    AMBIGUOUS = 1
    MISFIT = 2
    UNKNOWN = 3


@dataclass(frozen=True, eq=False)
class JointLength:
    """Lengths from k phases each; arrays over the shots.

    length             m, in air: approximate distance - D0 - Pc - dPc in the sense of `whole_cycles`; nan where unknown
    u_length           m, standard uncertainty if the whole cycles are right: phases only, the index is taken as exact
    cycles             (..., k) N of each frequency
    misfit             chi-square of the phases, k - 1 degrees of freedom
    next_length        m, the length that fits second best
    discrimination     by how much its chi-square is larger, at least
    slip_probability   that the cycles are others; every length within the limits is as likely before
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
    """The length that phases at several modulation frequencies have in common: exact search of all whole cycles.

    phase_fractions   (..., k) rad, from `fraction`, each against the reference at its own frequency
    frequencies_hz    (k,) two or more different, above 0
    u_phase           rad, above 0, of each phase fraction; broadcasts to (..., k)
    within            m, the smallest and the largest length that is possible
    group_index       (...) mean along each path, at the carrier

    Each length within the limits gives one set of nearest whole cycles; between two neighbouring turns of one of them
    the set is the same and chi-square a parabola. So every set that can be best is compared. AMBIGUOUS where the next
    one is not SURE standard uncertainties worse, MISFIT where the best misses its phases by more than SURE. A shot with
    an input that is not finite is UNKNOWN. Raises ValidityError for values outside those limits, and for frequencies
    with which one standard uncertainty of phase turns a length within the limits into another, even at the smallest
    u_phase.

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
    known = np.isfinite(flat).all(axis=1) & np.isfinite(n) & np.isfinite(u_all).all(axis=1)
    if np.any(n[known] <= 0.0):
        raise ValidityError(f"group index {float(n[known].min())} is not above 0")
    half = SPEED_OF_LIGHT / (2.0 * f)
    out = _Answer.empty(len(flat), len(f))
    if known.any():
        _refuse_alias(f, u_all[known].min(axis=0), high - low, float(n[known].max()))
        rows = np.flatnonzero(known)
        size = max(1, int(ROOM / (np.sum((high - low) * n[known].max() / half + 3) * len(f))))
        for start in range(0, len(rows), size):
            part = rows[start : start + size]
            out.fill(part, flat[part], half, u_all[part] * half / TWO_PI, n[part], (low, high))
    return out.shaped(phase.shape[:-1])


@dataclass(frozen=True, eq=False)
class _Answer:
    """The columns of `JointLength`, one row a shot, filled block by block."""

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
        """The best and the next set of some shots; u are the phases' standard uncertainties as lengths."""
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
        others = np.sum(chance, axis=1)
        slip = others / (1.0 + others)
        square[at, first] = np.inf
        second = np.argmin(square, axis=1)
        whole = 0.25 * np.min((half / u) ** 2, axis=1)  # a set that is nowhere nearest misses one phase by half a turn
        apart = np.minimum(square[at, second], np.maximum(whole, best)) - best
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
        sure = slip <= 2.0 * float(beyond(SURE))
        self.status[rows] = np.where(
            ~fits, JointStatus.MISFIT, np.where(sure, JointStatus.FOUND, JointStatus.AMBIGUOUS)
        )

    def shaped(self, shape: tuple[int, ...]) -> JointLength:
        length, u_length, misfit, following, apart, slip = (v.reshape(shape) for v in self.floats)
        cycles = self.cycles.reshape(*shape, self.cycles.shape[1])
        return JointLength(length, u_length, cycles, misfit, following, apart, slip, self.status.reshape(shape))


def _refuse_alias(f: NDArray[np.float64], u_phase: NDArray[np.float64], span: float, group_index: float) -> None:
    plan = modulation_set(f, u_phase=u_phase, span=span, group_index=group_index)
    if plan.separation < 2.0 * HOPELESS:
        raise ValidityError(
            f"frequencies {', '.join(f'{v / 1e6:.9g}' for v in f)} MHz do not tell lengths {plan.nearest:.3f} m apart: "
            f"{plan.separation / 2:.1f} standard uncertainties of phase (limit {HOPELESS:g}) turn one into the other; "
            f"bring limits closer than the {span:g} m given, or choose with choose_frequencies"
        )


def _misfit_limit(degrees: int) -> float:
    """Chi-square that good phases pass once in as many times as a normal variable passes SURE either way."""
    from scipy.special import chdtri

    return float(chdtri(degrees, 2.0 * float(beyond(SURE))))
