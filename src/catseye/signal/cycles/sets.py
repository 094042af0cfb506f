"""All sets of whole cycles between two lengths at several frequencies."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import TWO_PI
from catseye.errors import ValidityError

SURE = 5.0  # standard uncertainties of phase that must not change one length into another


@dataclass(frozen=True, eq=False)
class CycleSets:
    """Sets of nearest whole cycles: cycles (s, c, k), length (s, c) m, misfit (s, c) chi-square, inside (s, c)."""

    cycles: NDArray[np.float64]
    length: NDArray[np.float64]
    misfit: NDArray[np.float64]
    inside: NDArray[np.bool_]


def cycle_sets(
    phase: NDArray[np.float64], half: NDArray[np.float64], weight: NDArray[np.float64], *, limits: tuple[float, float]
) -> CycleSets:
    """All sets for shots (s, k) between two optical lengths.

    Lengths are optical, misfits chi-square.
    """
    u_length = float(np.max(np.sum(weight, axis=1) ** -0.5))
    low, high = limits[0] - SURE * u_length, limits[1] + SURE * u_length
    turns = [
        (np.arange(np.floor(low / h) - 1, np.ceil(high / h) + 2) + 0.5 - phase[:, i : i + 1] / TWO_PI) * h
        for i, h in enumerate(half)
    ]
    edges = np.sort(np.clip(np.concatenate([*turns, np.full((len(phase), 1), low)], axis=1), low, high), axis=1)
    edges = np.append(edges, np.full((len(phase), 1), high), axis=1)
    middle, real = 0.5 * (edges[:, 1:] + edges[:, :-1]), np.diff(edges) > 0.0
    part = phase[:, None, :] / TWO_PI
    cycles = np.rint(middle[..., None] / half + part)
    lengths = (cycles - part) * half
    share = weight / np.sum(weight, axis=1, keepdims=True)
    length = np.einsum("sck,sk->sc", lengths, share)
    misfit = np.einsum("sck,sk->sc", (lengths - length[..., None]) ** 2, weight)
    return CycleSets(cycles, length, misfit, real & (length >= low) & (length <= high))


def checked_frequencies(frequencies_hz: ArrayLike) -> NDArray[np.float64]:
    f = np.asarray(frequencies_hz, dtype=float)
    if f.ndim != 1 or len(f) < 2 or not np.all(np.isfinite(f) & (f > 0.0)) or len(np.unique(f)) < len(f):
        raise ValidityError(f"frequencies {f.tolist()} Hz: two or more are expected, all different and above 0")
    return f


def checked_u_phase(u_phase: ArrayLike, f: NDArray[np.float64]) -> NDArray[np.float64]:
    u = np.asarray(u_phase, dtype=float)
    if np.any(u <= 0.0):
        raise ValidityError(f"u_phase {float(u.min())} rad is not above 0")
    return np.broadcast_to(u, np.broadcast_shapes(u.shape, f.shape))


def upper_tail(sigmas: ArrayLike) -> NDArray[np.float64]:
    """Probability that a normal variable exceeds so many standard deviations."""
    from scipy.special import ndtr

    return np.asarray(ndtr(-np.asarray(sigmas, dtype=float)))
