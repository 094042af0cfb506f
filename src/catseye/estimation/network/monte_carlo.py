"""Monte Carlo simulation of a network: noise, air and blunders drawn, each run adjusted."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from catseye.constants import PPM
from catseye.errors import EstimationError
from catseye.estimation.least_squares.rows import variances
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, points_of
from catseye.estimation.observations.kinds import Distances, ZenithAngles

XY = np.arange(2)


@dataclass(frozen=True)
class Disturbance:
    """Disturbances in addition to the claimed noise.

    common_ppm    standard deviation of a scale error common to all ranges: the index of air
    station_ppm   standard deviation of a scale error per ranger: its own thermometer
    refraction    standard deviation of the coefficient k of vertical refraction, which bends all zenith angles
    blunders      share of observations with a gross error
    size          standard deviations of such an error, either sign
    """

    common_ppm: float = 0.0
    station_ppm: float = 0.0
    refraction: float = 0.0
    blunders: float = 0.0
    size: float = 20.0


@dataclass(frozen=True, eq=False)
class MonteCarloScatter:
    """Result of the runs.

    runs          that converged
    asked         runs requested
    rms           (n, 3) m, root mean square departure of each coordinate from the truth
    predicted     (n, 3) m, claimed standard uncertainties
    ratio         root mean square of departure over claim, all free coordinates: 1 when the claim holds
    found         share of the blunders that were rejected, nan without any
    false         share of the good observations that were rejected
    """

    runs: int
    asked: int
    rms: np.ndarray
    predicted: np.ndarray
    ratio: float
    found: float
    false: float


def measured(
    network: ObservationNetwork, truth: np.ndarray, generator: np.random.Generator, *, disturbance: Disturbance
) -> tuple[ObservationNetwork, list[np.ndarray]]:
    """Network with observations drawn about a truth, and masks (m,) of the blunders per group.

    truth   parameter vector: coordinates and other parameters
    """
    groups, wrong = [], []
    common = generator.standard_normal() * disturbance.common_ppm * PPM
    station_scale = generator.standard_normal(len(network.points.names)) * disturbance.station_ppm * PPM
    bend = generator.standard_normal() * disturbance.refraction
    for group in network.groups:
        values = group.predict(truth)[0]
        m = len(values)
        sigma = np.sqrt(variances(group))
        noise = generator.standard_normal(m)
        if group.covariance.ndim == 1:
            noise = noise * sigma
        else:
            b, r = (1, m) if group.covariance.ndim == 2 else group.covariance.shape[:2]
            factor = np.linalg.cholesky(group.covariance.reshape(b, r, r))
            noise = np.einsum("bij,bj->bi", factor, noise.reshape(b, r)).ravel()
        if isinstance(group, Distances):
            noise = noise + values * (common + station_scale[points_of(group)[0]])
        if isinstance(group, ZenithAngles):
            along = truth[group.target[:, None] + XY] - truth[group.origin[:, None] + XY]
            noise = noise - bend * np.hypot(*along.T) / (2.0 * group.radius)
        bad = generator.random(m) < disturbance.blunders
        noise = noise + bad * disturbance.size * sigma * generator.choice([-1.0, 1.0], m)
        groups.append(replace(group, observed=values + noise))  # type: ignore[type-var]
        wrong.append(bad)
    return replace(network, groups=tuple(groups)), wrong


def scatter(
    network: ObservationNetwork,
    solve: Callable[[ObservationNetwork], NetworkSolution],
    *,
    runs: int,
    seed: int,
    disturbance: Disturbance | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> MonteCarloScatter:
    """Scatter of a network simulated `runs` times, compared with the claimed uncertainties.

    network      its coordinates and parameters are the truth of every run
    solve        adjusts a network, rejection included
    runs, seed   number of runs, and seed of the generator
    disturbance  in addition to the claimed noise; none if None

    Parameters with priors are drawn from them in each run; so the claim includes them.
    Raises EstimationError when no run converges.
    """
    generator = np.random.default_rng(seed)
    applied = disturbance or Disturbance()
    starts = np.array([p.start for p in network.parameters])
    sigma = np.array([p.sigma if np.isfinite(p.sigma) else 0.0 for p in network.parameters])
    squares, normalised, claims, converged = 0.0, 0.0, 0.0, 0
    hit, blunders, false_rejections, good = 0, 0, 0, 0
    status, truth = "", np.where(network.points.absent, 0.0, network.points.xyz).ravel()
    for run in range(runs):
        if progress is not None:
            progress("Monte Carlo runs", run, runs)
        values = starts + sigma * generator.standard_normal(len(starts))
        drawn, wrong = measured(network, np.concatenate([truth, values]), generator, disturbance=applied)
        solution = solve(drawn)
        if not solution.status.usable:
            status = solution.status
            continue
        converged += 1
        departure = solution.x - network.points.xyz
        claim = np.einsum("nii->ni", solution.covariance)
        squares, claims = squares + departure**2, claims + claim
        certain = ~(claim > 0.0)  # or absent
        normalised += float(np.mean((departure**2 / np.where(certain, 1.0, claim))[~certain]))
        for fit, bad in zip(solution.fits, wrong, strict=True):
            hit, blunders = hit + int(np.sum(bad & ~fit.active)), blunders + int(bad.sum())
            false_rejections, good = false_rejections + int(np.sum(~bad & ~fit.active)), good + int(np.sum(~bad))
    if not converged:
        raise EstimationError(f"none of {runs} Monte Carlo runs converged: {status}")
    return MonteCarloScatter(
        runs=converged,
        asked=runs,
        rms=np.sqrt(squares / converged),
        predicted=np.sqrt(claims / converged),
        ratio=(normalised / converged) ** 0.5,
        found=hit / blunders if blunders else float("nan"),
        false=false_rejections / good if good else 0.0,
    )
