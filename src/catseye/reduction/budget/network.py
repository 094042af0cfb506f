"""Budget of a night's adjustment: share of each kind of input in the variance of functions of the coordinates.

The estimate is linear in its inputs near the solution, dx = Q A' C^-1 dl, for shots and records alike. With the weights
g = C^-1 A Q f an input kind with covariance C_k adds g' C_k g to the variance f' Q f of a function f of the parameters,
and an error e that many rows share, considered but not estimated, adds (g' e)^2. The parts add up to the claimed
variance.

Source: [JCGM102] eq. 3 for the propagation; [SCHMIDT66] for the errors that are considered.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from catseye.constants import PPM, TWO_PI
from catseye.estimation.least_squares.adjustment import LeastSquaresSolution
from catseye.estimation.least_squares.rows import ActiveRows
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.reduction.epoch.common_errors import common_errors, considered, reach_of
from catseye.reduction.epoch.head import head_noise
from catseye.reduction.epoch.prior_names import ELECTRONICS, REPEATS
from catseye.reduction.epoch.settling import SettledNetwork
from catseye.reduction.epoch.shots import ShotParts
from catseye.reduction.epoch.unknowns import CampaignNetwork

NOISE, EDDIES, WALK, FLUCTUATION = "noise of the samples", "turbulence", "walk of the electronics", "air of each line"
STATES = {ELECTRONICS: WALK, REPEATS: FLUCTUATION}  # of a large night: the same errors as parameters with priors
ALLOWANCE = "allowance for wrong records"


@dataclass(frozen=True, eq=False)
class NetworkBudget:
    """Variance of k functions of the coordinates by kind of input.

    sources    names of the s kinds: of the shots' errors, of the records, and of the errors in common
    variance   (s, k), parts of the variance
    total      (k,), variances that the adjustment claims
    """

    sources: tuple[str, ...]
    variance: np.ndarray
    total: np.ndarray

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (k,)."""
        return np.sqrt(self.total)

    @property
    def share(self) -> np.ndarray:
        """Shares (s, k) of the variance."""
        return self.variance / self.total


def point_functions(network: CampaignNetwork, points: tuple[str, ...], weights: np.ndarray) -> np.ndarray:
    """Functions (k, parameters) from weights (k, 3n) of the coordinates of n points."""
    columns = np.concatenate([network.layout.columns(name) for name in points])
    functions = np.zeros((len(weights), len(network.layout.parameters)))
    functions[:, columns] = weights
    return functions


def network_budget(settled: SettledNetwork, functions: np.ndarray) -> NetworkBudget:
    """Budget of functions (k, parameters) of a settled adjustment."""
    network, solution, shots = settled
    response = solution.q.solve(functions.T)
    parts: dict[str, np.ndarray] = {}

    def add(source: str, variance: np.ndarray) -> None:
        parts[source] = parts.get(source, np.zeros(len(functions))) + variance

    groups = [*(group for group, _ in shots), *network.priors]
    for i, (group, fit) in enumerate(zip(groups, solution.fits, strict=True)):
        gain = _gain(group, fit.active, solution, response)
        if i < len(shots):
            for source, covariance in _of_shots(network, group, shots[i][1]):
                add(source, _quadratic(covariance, gain))
        else:
            add(STATES.get(group.name, group.name), _quadratic(group.covariance, gain))
    errors = list(common_errors(network, solution.x, [part for _, part in shots]))
    for error, reach in zip(errors, reach_of(network, solution, shots, errors).T, strict=True):
        add(_common_source(network, error.name), (functions @ reach) ** 2)
    widened = considered(network, solution, shots)
    claimed = network.allowance.considered(network.field, widened, network.layout.air)
    total = _spread(claimed, functions)
    if claimed is not widened:
        add(ALLOWANCE, total - _spread(widened, functions))
    return NetworkBudget(tuple(parts), np.array(list(parts.values())), total)


def _spread(solution: LeastSquaresSolution, functions: np.ndarray) -> np.ndarray:
    """Variances (k,) of functions (k, parameters)."""
    return np.sum(functions * solution.q.solve(functions.T).T, axis=1)


def _common_source(network: CampaignNetwork, name: str) -> str:
    """Name of an error in common, without the ranger that it belongs to."""
    for ranger in network.rangers:
        name = name.partition(f" of {ranger}")[0]
    return f"{name}, in common"


def _gain(
    group: ObservationGroup, active: np.ndarray, solution: LeastSquaresSolution, response: np.ndarray
) -> np.ndarray:
    """Weights C^-1 A Q f (m, k) of a group's rows; zero for those left out."""
    rows, on = ActiveRows.of(group, active), active[:, None]
    slopes = rows.spread(np.where(on, group.predict(solution.x)[1], 0.0))
    at = rows.row_columns()
    slopes = np.where(at < 0, 0.0, slopes)
    reach = np.einsum("mw,mwk->mk", slopes, response[np.maximum(at, 0)])
    return np.where(on, rows.weigh(np.where(on, reach, 0.0)), 0.0)


def _of_shots(network: CampaignNetwork, group: ObservationGroup, part: ShotParts) -> Iterator[tuple[str, np.ndarray]]:
    """Parts of the covariance of one ranger's optical lengths.

    All that is neither noise of samples or head nor walk is the air of the line.
    """
    per_radian = network.campaign.half_wavelengths(part.electronics.shots) / TWO_PI
    noise = (per_radian * network.phases.u_phase[part.electronics.shots]) ** 2
    eddies = (network.strength.eddies_ppm * PPM * part.distance) ** 2
    sheet = head_noise(network.campaign.mirror_of(part.name))
    head = {source: np.full(len(noise), (per_radian * u) ** 2) for source, u in sheet.items()}
    if part.name in network.states:
        walk = per_radian**2 * network.states[part.name].own
    else:
        walk = np.outer(per_radian, per_radian) * part.electronics.covariance
    independent = sum(head.values(), noise + eddies)
    air = group.covariance - (independent + walk if walk.ndim == 1 else np.diag(independent) + walk)
    yield from ((NOISE, noise), *head.items(), (EDDIES, eddies), (WALK, walk), (FLUCTUATION, air))


def _quadratic(covariance: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """g' C g (k,) for gains (m, k) and variances (m,), a matrix (m, m) or blocks (b, r, r)."""
    if covariance.ndim == 1:
        return np.asarray(covariance @ gain**2)
    if covariance.ndim == 2:
        return np.sum(gain * (covariance @ gain), axis=0)
    blocks = gain.reshape(*covariance.shape[:2], -1)
    return np.einsum("brk,brs,bsk->k", blocks, covariance, blocks)
