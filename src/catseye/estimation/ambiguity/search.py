"""Position of a point ranged modulo a half wavelength, from a prior known to decimetres.

Every set of whole cycles that the prior allows is tried: three integers by enumeration inside the prior's ellipsoid,
the others by prediction, with the exact geometry, not linearised. That is integer least squares ([TEUNISSEN95])
without its decorrelation: in space three integers fix a point, so the search tree is bushy for three levels only.
A station whose position is known to decimetres is the same problem with the targets in the stations' place.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from catseye.errors import InputError, ValidityError
from catseye.estimation.ambiguity.tree import CycleCandidates, Ranged, expanded, trunk

SURE = 5.7e-7  # accepted error probability if all ranges are good: five standard deviations of a normal variable
SURE_OF_ALL = 1e-3  # accepted total error probability, one wrong range considered


class AmbiguityStatus(IntEnum):
    """Status of the search; only FOUND is a usable result."""

    FOUND = 0
    AMBIGUOUS = 1
    TOO_FEW = 2
    MISFIT = 3
    TOO_MANY = 4
    REFUSED = 5


TEXTS = {
    AmbiguityStatus.FOUND: "found",
    AmbiguityStatus.AMBIGUOUS: "of {candidates} sets of whole cycles the second best, {apart:.3f} m away, is only "
    "{sigmas:.1f} sigma worse; range it from more stations, or survey it better",
    AmbiguityStatus.TOO_FEW: "ranged from {ranges} stations only: four are needed for so uncertain a position; "
    "range it from more, or survey it better",
    AmbiguityStatus.MISFIT: "no whole cycles fit its {ranges} ranges (chi-square {chi_square:.3g} at best); "
    "one of them or the position's uncertainty is wrong",
    AmbiguityStatus.TOO_MANY: "its position is too uncertain: more sets of whole cycles than can be tried; survey it",
    AmbiguityStatus.REFUSED: "a range, a station or an uncertainty of it is not a finite number, or not positive",
}


@dataclass(frozen=True, eq=False)
class Located:
    """Located point, with its cycles and their probability.

    x, covariance     (3,) m and (3, 3) m^2 of the best candidate; nan without one
    cycles            (r,) its whole half wavelengths
    chi_square        of prior and ranges together; degrees of freedom: the number of ranges used
    next_x            (3,) m, the second best candidate; nan if there is none
    discrimination    lower limit of the next candidate's excess in chi-square; infinite if there is none
    probability       of the best one being right, the prior's region and one wrong range considered
    candidates        number of sets of whole cycles tried
    left_out          index of the range left out, -1 for none
    status            `AmbiguityStatus`
    """

    x: np.ndarray
    covariance: np.ndarray
    cycles: np.ndarray
    chi_square: float
    next_x: np.ndarray
    discrimination: float
    probability: float
    candidates: int
    left_out: int
    status: AmbiguityStatus

    @property
    def text(self) -> str:
        """Status in one line, with the remedy."""
        apart = float(np.linalg.norm(self.next_x - self.x))
        return TEXTS[self.status].format(
            candidates=self.candidates,
            ranges=len(self.cycles),
            chi_square=self.chi_square,
            apart=apart,
            sigmas=max(self.discrimination, 0.0) ** 0.5,
        )


@dataclass(frozen=True)
class AmbiguityLimits:
    """Limits of `locate`.

    wrong   probability that a range is a stray reflection: any length of a period is then equally likely. 0 trusts
            all ranges; otherwise any one may be left out
    most    limit of candidates
    """

    wrong: float = 0.0
    most: int = 2_000_000


ALL_TRUSTED = AmbiguityLimits()


def locate(
    start: np.ndarray,
    prior_covariance: np.ndarray,
    stations: np.ndarray,
    *,
    lengths: np.ndarray,
    period: np.ndarray | float,
    covariance: np.ndarray,
    station_covariance: np.ndarray | None = None,
    limits: AmbiguityLimits = ALL_TRUSTED,
) -> Located:
    """Point and whole cycles that best fit a prior position and ranges modulo a half wavelength.

    start                (3,) m, approximate position
    prior_covariance     (3, 3) m^2 of it
    stations             (r, 3) m, stations of the ranges; repetitions allowed
    lengths              (r,) m, ranges modulo the period, all constants applied
    period               (r,) or one, m: the half wavelength in the air of each path
    covariance           (r, r) m^2 of the lengths, or (r,) variances: noise, constants, errors common to stations
    station_covariance   (r, 3, 3) m^2 or (3r, 3r) jointly; None if known or already in `covariance`
    limits               probability of a wrong range, and limit of candidates

    FOUND means: it fits (chi-square passes at 5.7e-7), and all others together are less probable than 5.7e-7, every set
    of whole cycles having the prior probability of its position. With `wrong`, candidates that fit with one range left
    out count too, at an added chi-square of 2 ln((1 - wrong)/wrong period/(sqrt(2 pi) u)); the total error probability
    may then be 1e-3. A wrong range can make a wrong set fit: if ranges may be wrong, set `wrong`. Two wrong ranges are
    not considered. Values raise no exception, see the status; InputError for inconsistent shapes, ValidityError for a
    `wrong` outside 0 to 0.5.

    Source: [TEUNISSEN95] section 2.2 for the principle; the nonlinear search and the probabilities are ours.

    >>> s = np.array([[60.0, 0, 0], [0, 60, 0], [-60, 0, 5], [0, -60, -5], [40, 40, 20]])
    >>> l = np.mod(np.linalg.norm(s - [1.0, 2.0, 30.0], axis=1), 0.1)
    >>> located = locate([1.2, 1.9, 30.2], 0.04 * np.eye(3), s, lengths=l, period=0.1, covariance=np.full(5, 1e-8))
    >>> located.status.name, located.x.round(6).tolist(), located.cycles[:3].tolist()
    ('FOUND', [1.0, 2.0, 30.0], [662, 653, 659])
    """
    ranged = _ranged(start, prior_covariance, stations, lengths, period, covariance, station_covariance)
    if ranged is None:
        return _unlocated(len(np.atleast_1d(lengths)), AmbiguityStatus.REFUSED)
    if not 0.0 <= limits.wrong < 0.5:
        raise ValidityError(f"wrong = {limits.wrong} (expected a probability of 0 to 0.5)")
    explanations = _explanations(ranged, limits.wrong, limits.most)
    if explanations is None:
        return _unlocated(len(ranged.lengths), AmbiguityStatus.TOO_MANY)
    return _judged(ranged, explanations)


def _ranged(
    start: np.ndarray,
    prior_covariance: np.ndarray,
    stations: np.ndarray,
    lengths: np.ndarray,
    period: np.ndarray | float,
    covariance: np.ndarray,
    station_covariance: np.ndarray | None,
) -> Ranged | None:
    """Problem with one covariance of all ranges; None for invalid values."""
    start, prior, stations, lengths, c = (
        np.asarray(v, dtype=float) for v in (start, prior_covariance, stations, lengths, covariance)
    )
    r = len(lengths) if lengths.ndim == 1 else -1
    if start.shape != (3,) or prior.shape != (3, 3) or stations.shape != (r, 3) or c.shape not in ((r,), (r, r)):
        raise InputError(
            f"start {start.shape}, prior_covariance {prior.shape}, stations {stations.shape}, lengths {lengths.shape}, "
            f"covariance {c.shape}: (3,), (3, 3), (r, 3), (r,) and (r,) or (r, r) with r >= 1 are expected"
        )
    periods = np.broadcast_to(np.asarray(period, dtype=float), (r,))
    c = np.diag(c) if c.ndim == 1 else c
    if station_covariance is not None:
        c = c + _of_stations(start, stations, np.asarray(station_covariance, dtype=float))
    if not all(np.isfinite(v).all() for v in (start, prior, stations, lengths, periods, c)) or np.any(periods <= 0.0):
        return None
    try:
        return Ranged(
            start=start,
            prior_root=np.linalg.cholesky(prior),
            stations=stations,
            lengths=lengths,
            periods=periods,
            root=np.linalg.cholesky(c),
        )
    except np.linalg.LinAlgError:
        return None


def _of_stations(start: np.ndarray, stations: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Covariance (r, r) of the ranges due to the stations, with directions constant within the prior."""
    r = len(stations)
    towards = stations - start
    e = towards / np.linalg.norm(towards, axis=1)[:, None]
    if covariance.shape == (r, 3, 3):
        return np.diag(np.einsum("ia,iab,ib->i", e, covariance, e))
    if covariance.shape == (3 * r, 3 * r):
        return np.einsum("ia,iajb,jb->ij", e, covariance.reshape(r, 3, r, 3), e)
    raise InputError(f"station_covariance has shape {covariance.shape}: ({r}, 3, 3) or ({3 * r}, {3 * r}) is expected")


def _unlocated(ranges: int, status: AmbiguityStatus) -> Located:
    nan = np.full(3, np.nan)
    square = np.full((3, 3), np.nan)
    no_cycles = np.zeros(ranges, dtype=np.int64)
    return Located(
        x=nan,
        covariance=square,
        cycles=no_cycles,
        chi_square=np.inf,
        next_x=nan,
        discrimination=0.0,
        probability=0.0,
        candidates=0,
        left_out=-1,
        status=status,
    )


@dataclass(frozen=True, eq=False)
class _Explanation:
    """All candidates with one range left out (-1: none), and its chi-square penalty."""

    left_out: int
    penalty: float
    candidates: CycleCandidates


def _explanations(ranged: Ranged, wrong: float, most: int) -> list[_Explanation] | None:
    """Searches with all ranges and, if they may be wrong, without each.

    None if a limit is reached.
    """
    everything = np.arange(len(ranged.lengths))
    base = trunk(ranged, everything, most)
    candidates = None if base is None else expanded(ranged, everything, base, most=most)
    if base is None or candidates is None:
        return None
    explanations = [_Explanation(-1, 0.0, candidates)]
    u = np.linalg.norm(ranged.root, axis=1)
    for i in everything if wrong > 0.0 and len(everything) > 1 else ():
        rows = np.delete(everything, i)
        branch_base = trunk(ranged, rows, most) if i in base.rows else base
        candidates = None if branch_base is None else expanded(ranged, rows, branch_base, most=most)
        if candidates is None:
            return None
        odds = (1.0 - wrong) / wrong * ranged.periods[i] / (np.sqrt(2.0 * np.pi) * u[i])
        explanations.append(_Explanation(int(i), float(2.0 * np.log(max(odds, 1.0))), candidates))
    return explanations


def _judged(ranged: Ranged, explanations: list[_Explanation]) -> Located:
    """Best candidate of all explanations, and the probability of the others.

    Candidates of two explanations whose cycles differ at most in the left-out ranges are the same solution.
    """
    from scipy.special import chdtri

    lowest = [float(np.min(e.candidates.chi_square, initial=np.inf)) + e.penalty for e in explanations]
    chosen = explanations[int(np.argmin(lowest))]
    if not np.isfinite(min(lowest)):
        return _unlocated(len(ranged.lengths), AmbiguityStatus.MISFIT)
    best = int(np.argmin(chosen.candidates.chi_square))
    cycles, square = chosen.candidates.cycles[best], float(chosen.candidates.chi_square[best])
    doubts, rivals, nowhere = [], [], np.full((1, 3), np.nan)
    for e in explanations:
        common = np.ones(len(cycles), dtype=bool)
        common[[i for i in (e.left_out, chosen.left_out) if i >= 0]] = False
        different = np.any(e.candidates.cycles[:, common] != cycles[common], axis=1)
        costs = np.append(e.candidates.chi_square[different], e.candidates.floor) + e.penalty - min(lowest)
        doubts.append(float(np.sum(np.exp(-0.5 * np.clip(costs, -1400.0, 1400.0)))))
        rivals.append((costs, np.concatenate([e.candidates.x[different], nowhere])))
    costs, places = (np.concatenate(part) for part in zip(*rivals, strict=True))
    nearest = int(np.argmin(costs))
    listed = np.where(np.isfinite(places[:, 0]), costs, np.inf)
    doubt = sum(doubts)
    took_part = len(cycles) - (chosen.left_out >= 0)
    if square > float(chdtri(took_part, SURE)):
        status = AmbiguityStatus.MISFIT
    elif doubt / (1.0 + doubt) <= (SURE if len(explanations) == 1 else SURE_OF_ALL) and doubts[0] <= SURE * (1 + doubt):
        status = AmbiguityStatus.FOUND
    else:
        status = AmbiguityStatus.TOO_FEW if took_part < 4 else AmbiguityStatus.AMBIGUOUS
    return Located(
        x=chosen.candidates.x[best],
        covariance=chosen.candidates.covariance,
        cycles=cycles,
        chi_square=square,
        next_x=places[int(np.argmin(listed))] if np.isfinite(listed).any() else nowhere[0],
        discrimination=float(costs[nearest]),
        probability=1.0 / (1.0 + doubt),
        candidates=sum(e.candidates.tried for e in explanations),
        left_out=chosen.left_out,
        status=status,
    )
