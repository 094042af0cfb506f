"""Least-squares fit of a figure to ranges, and checks of its determinacy."""

from dataclasses import dataclass

import numpy as np

from catseye.estimation.network.unfolding.location import locate

FIT = 3.0  # limit of the rms residual in standard uncertainties, over the degrees of freedom
FLAT = 0.02  # smallest over middle extent of points, below which they may be coplanar


@dataclass(frozen=True, eq=False)
class FigureFit:
    """Fitted figure (s, d), (t, d), and rms over the degrees of freedom."""

    stations: np.ndarray
    targets: np.ndarray
    rms: float


def least_squares(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray) -> FigureFit:
    """Least-squares figure (s, d), (t, d), d = 3 or 2, of all ranges (s, t), from a start.

    Levenberg damping fixes the free motions; targets are eliminated one by one.
    """
    (s, t), d = ranges.shape, stations.shape[1]
    spare = max(int(np.isfinite(ranges).sum()) - d * (s + t) + d * (d + 1) // 2, 1)
    v, unit = _linear(stations, targets, ranges)
    cost, damping = float(np.sum(v**2)), 1e-3
    negligible = 1e-26 * float(np.nansum(ranges**2))
    for _ in range(200):
        _, step_s, step_t = _reduced(v, unit, damping)
        trial_v, trial_unit = _linear(stations + step_s, targets + step_t, ranges)
        trial = float(np.sum(trial_v**2))
        if trial < cost:
            settled = cost - trial <= 1e-8 * cost and damping <= 1e-9
            stations, targets, v, unit, cost = stations + step_s, targets + step_t, trial_v, trial_unit, trial
            damping = max(damping * 0.1, 1e-12)
        else:
            settled, damping = cost < negligible or damping > 1e6, damping * 10.0
        if settled:
            break
    return FigureFit(stations, targets, (cost / spare) ** 0.5)


def _linear(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (t, s) and unit vectors from stations to targets (t, s, d), zero if not measured."""
    along = targets[:, None] - stations
    distance = np.linalg.norm(along, axis=2)
    measured = np.isfinite(ranges).T
    residual = np.where(measured, np.nan_to_num(ranges.T) - distance, 0.0)
    return residual, along * (measured / np.maximum(distance, 1e-300))[..., None]


def _reduced(v: np.ndarray, unit: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stations' reduced normal matrix (targets eliminated), and steps of stations and targets."""
    t, s, d = unit.shape
    right = np.einsum("tsi,ts->ti", unit, v)
    normal = np.swapaxes(unit, 1, 2) @ unit + damping * np.eye(d)
    cross = -(unit[..., :, None] * unit[..., None, :]).transpose(0, 2, 1, 3).reshape(t, d, d * s)
    total = np.zeros((s, d, s, d))
    total[np.arange(s), :, np.arange(s)] = np.einsum("tsi,tsj->sij", unit, unit) + damping * np.eye(d)
    spread = np.linalg.solve(normal, np.concatenate([cross, right[..., None]], axis=2))
    flat = cross.reshape(d * t, d * s)
    reduced = total.reshape(d * s, d * s) - flat.T @ spread[..., :-1].reshape(d * t, d * s)
    pull = -np.einsum("tsi,ts->si", unit, v).ravel() - flat.T @ spread[..., -1].ravel()
    step = np.linalg.solve(reduced, pull)
    return reduced, step.reshape(s, d), spread[..., -1] - spread[..., :-1] @ step


def flattest(stations: np.ndarray, targets: np.ndarray, ranges: np.ndarray, *, sigma: float) -> FigureFit:
    """Best-fit figure; planar if that fits as well."""
    fit = least_squares(stations, targets, ranges)
    everything = np.vstack([fit.stations, fit.targets])
    mean = everything.mean(axis=0)
    _, extent, axes = np.linalg.svd(everything - mean, full_matrices=False)
    if extent[2] > 0.1 * extent[1]:
        return fit
    plane = least_squares((stations - mean) @ axes[:2].T, (targets - mean) @ axes[:2].T, ranges)
    return plane if plane.rms <= max(1.3 * fit.rms, 2 * sigma) else fit


def flattened(points: np.ndarray, table: np.ndarray, sigma: float) -> np.ndarray | None:
    """Points in their best plane if the ranges (t, s) to others, located again, allow it.

    None if they do not.
    """
    mean = points.mean(axis=0)
    _, extent, axes = np.linalg.svd(points - mean, full_matrices=False)
    if extent[-1] > FLAT * extent[1]:
        return None
    flat = points - np.outer((points - mean) @ axes[-1], axes[-1])
    rms, number = locate(flat, table)[1][:, 0], np.isfinite(table).sum(axis=1)
    return flat if np.nansum(number * rms**2) <= (FIT * sigma) ** 2 * number.sum() else None


def loose(fit: FigureFit, ranges: np.ndarray, sigma: float) -> bool:
    """True if more than the rigid motions is uncertain by a thirtieth of the figure's size.

    Possibly coplanar stations and targets are checked in their plane: heights due to noise determine nothing.
    """
    d = fit.stations.shape[1]
    size = float(np.linalg.norm(np.ptp(np.vstack([fit.stations, fit.targets]), axis=0)))
    figures = [(fit.stations, fit.targets)]
    if d == 3:
        if (flat := flattened(fit.stations, ranges.T, sigma)) is not None:
            figures.append((flat, fit.targets))
        if (flat := flattened(fit.targets, ranges, sigma)) is not None:
            figures.append((fit.stations, flat))
    for at, to in figures:
        normal = _reduced(*_linear(at, to, ranges), 1e-12)[0]
        if np.sum(np.linalg.eigvalsh(normal) < (30 * sigma / size) ** 2) > d * (d + 1) // 2:
            return True
    return False
