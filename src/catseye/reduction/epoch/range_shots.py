"""Ranges of an adjusted network, with corrections, residuals and tests."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit, LeastSquaresSolution
from catseye.reduction.epoch.lines.cycles import REQUIRED_SIGMAS
from catseye.reduction.epoch.lines.line_tests import LineTests
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.shots import ShotGroup, ShotParts
from catseye.reduction.epoch.unknowns import CampaignNetwork


@dataclass(frozen=True, eq=False)
class RangeShots:
    """Target shots that have a phase, one row per shot.

    Sorted by ranger; lengths in metres.

    shot              index into the campaign's shots
    ranger, target    names
    phase             rad, the target's phase after the electronics' at that instant, [0, 2 pi)
    electronics       rad, phase of the electronics at that instant
    cycles, margin    whole half wavelengths, and distance of the coarse length from another number
    refractivity      n_g - 1 along the path
    incidence         rad, on a prism's face; 0 for others
    glass, obliquity  Pc (with its estimated correction) and dPc, metres
    zero, leakage     estimated corrections to the range by the ranger's zero and its residual leakage
    moved             correction to the campaign's middle: the telescope's expansion and shift, and averages
                      of many shots that are allowed for
    head              correction for the mirror's axes, the coupling of amplitude to phase and cyclic terms
    range_            distance scan point to target by this shot, all corrections applied
    u_range           its standard uncertainty: noise, electronics and path; systematic parameters not counted
    residual          range_ minus the adjusted distance
    standardised      test statistic of the adjustment
    redundancy        of the adjustment
    detectable        smallest error that a test at the level 0.1 % finds four times in five, m; rejection at |w| = 3.5
                      asks for 5 % more
    used              True where the shot took part
    thin              cycles uncertain: the prediction of this range by all other lines and the records
                      misses it by so much, or is so uncertain, that misfit and five standard uncertainties reach a
                      quarter wavelength; repeats on one line share their cycles and do not check each other
    """

    shot: np.ndarray
    ranger: tuple[str, ...]
    target: tuple[str, ...]
    phase: np.ndarray
    electronics: np.ndarray
    cycles: np.ndarray
    margin: np.ndarray
    refractivity: np.ndarray
    incidence: np.ndarray
    glass: np.ndarray
    obliquity: np.ndarray
    zero: np.ndarray
    leakage: np.ndarray
    moved: np.ndarray
    head: np.ndarray
    range_: np.ndarray
    u_range: np.ndarray
    residual: np.ndarray
    standardised: np.ndarray
    redundancy: np.ndarray
    detectable: np.ndarray
    used: np.ndarray
    thin: np.ndarray

    @property
    def ill_fitting(self) -> dict[str, tuple[int, int]]:
        """Rangers most of whose shots do not fit: number of rejected shots, and of all."""
        ranger = np.array(self.ranger)
        counts = {n: (int((~self.used[ranger == n]).sum()), int((ranger == n).sum())) for n in sorted(set(self.ranger))}
        return {n: (rejected, fired) for n, (rejected, fired) in counts.items() if fired > 2 and 2 * rejected > fired}


def ranges_of(
    network: CampaignNetwork,
    solution: LeastSquaresSolution,
    shots: list[tuple[ShotGroup, ShotParts]],
    lines: Sequence[LineTests],
) -> RangeShots:
    x, layout, parts = solution.x, network.layout, [p for _, p in shots]
    fits = solution.fits[: len(parts)]
    zero, leakage, glass, range_, u_range, residual, detectable, thin, redundancy = [], [], [], [], [], [], [], [], []
    for (group, part), fit, tests in zip(shots, fits, lines, strict=True):
        n = 1.0 + part.refractivity
        quarter = 0.5 * network.campaign.half_wavelengths(part.electronics.shots)  # of the optical length, as the fits
        own_zero = np.full(len(n), x[layout.at[Parameter(ParameterKind.ZERO, part.name)]])
        at = x[layout.columns(part.name)]
        to = np.array([x[layout.columns(t)] for t in part.target])
        zero.append(own_zero)
        leakage.append(-np.sum(part.leakage_slope * x[part.leakage_columns], axis=1) / n)
        constants = [Parameter(ParameterKind.GLASS, t) for t in part.target]
        glass_correction = [x[layout.at[c]] if c in layout.at else 0.0 for c in constants]
        glass.append(part.glass + np.array(glass_correction))
        local_error = fit.residual + part.shared_error(x)
        residual.append(local_error / n)
        range_.append(np.linalg.norm(to - at, axis=1) + local_error / n)
        u_range.append(np.sqrt(part.variance) / n)
        redundancy.append(_redundancy(group, part, fit, solution))
        detectable.append(fit.detectable_error / n)
        alone = np.abs(fit.estimated_error) + REQUIRED_SIGMAS * fit.detectable_error / NONCENTRALITY >= quarter
        together = np.abs(tests.error) + REQUIRED_SIGMAS * tests.u
        uncertain = np.where(fit.active, together[tests.line] >= quarter, alone) if len(together) else alone
        cycles = network.phases.cycles
        thin.append(uncertain if cycles is None else uncertain & (cycles[part.electronics.shots] < 0))
    join = np.concatenate
    return RangeShots(
        shot=join([p.electronics.shots for p in parts]),
        ranger=tuple(p.name for p in parts for _ in p.target),
        target=tuple(t for p in parts for t in p.target),
        phase=join([p.phase for p in parts]),
        electronics=join([p.electronics.phase for p in parts]),
        cycles=join([p.cycles for p in parts]),
        margin=join([p.margin for p in parts]),
        refractivity=join([p.refractivity for p in parts]),
        incidence=join([p.incidence for p in parts]),
        glass=join(glass),
        obliquity=join([p.obliquity for p in parts]),
        zero=join(zero),
        leakage=join(leakage),
        moved=join([-p.lasting_error(x) / (1.0 + p.refractivity) for p in parts]),
        head=join([p.head.at(x) for p in parts]),
        range_=join(range_),
        u_range=join(u_range),
        residual=join(residual),
        standardised=join([f.standardised for f in fits]),
        redundancy=join(redundancy),
        detectable=join(detectable),
        used=join([f.active for f in fits]),
        thin=join(thin),
    )


def _redundancy(group: ShotGroup, part: ShotParts, fit: GroupFit, solution: LeastSquaresSolution) -> np.ndarray:
    """Redundancy numbers (m,) of ranges.

    Errors that they share with others count as theirs.

    With the shared errors B z as parameters, C = D + B S B' and P_v as it is without them, P_v C = P_v D + D^-1 A Q B':
    so 1 - a Q (a - b)' / D.
    """
    columns, _ = part.shared
    if not columns.shape[1]:
        return fit.redundancy
    jacobian = group.predict(solution.x)[1]
    without = jacobian.copy()
    without[:, -columns.shape[1] :] = 0.0
    spread = np.sum(solution.q.products(group.columns, jacobian) * without, axis=1)
    return np.where(fit.active, 1.0 - spread / group.covariance, 1.0)
