"""First-order lag of a signal behind a history."""

from collections.abc import Callable

import numpy as np

MEMORY = 16.0  # time constants before the first time: earlier values count 1e-7


def lagged(history: Callable[[np.ndarray], np.ndarray], seconds, *, time_constant_s: float, step_s: float):
    """Values at times (k,) that follow a history as dy/dt = (x - y) / T.

    history   of times (n,), before the first of `seconds` too
    step_s    interval of the linear interpolation of the history

    Exact for straight pieces: over a step h, y goes to e y + (f - e) x0 + (1 - f) x1, e = exp(-h / T),
    f = (1 - e) T / h. It begins in the steady state of the first step.
    """
    from scipy.signal import lfilter  # half a second to import

    times = np.asarray(seconds, dtype=float)
    if time_constant_s == 0.0:
        return history(times)
    first, last = times.min() - MEMORY * time_constant_s, times.max()
    grid = np.linspace(first, last, int(np.ceil((last - first) / step_s)) + 2)
    h, x = grid[1] - grid[0], history(grid)
    e = np.exp(-h / time_constant_s)
    f = (1.0 - e) * time_constant_s / h
    begin = x[0] - (x[1] - x[0]) / h * time_constant_s
    followed, _ = lfilter([1.0], [1.0, -e], (f - e) * x[:-1] + (1.0 - f) * x[1:], zi=[e * begin])
    # between two times of the grid as over a step of its own
    at = np.clip(np.searchsorted(grid, times, side="right") - 1, 0, len(grid) - 2)
    part = times - grid[at]
    share = part / h
    e, reached = np.exp(-part / time_constant_s), (1.0 - share) * x[at] + share * x[at + 1]
    safe = np.where(part > 0.0, part, 1.0)
    f = np.where(part > 0.0, (1.0 - e) * time_constant_s / safe, 1.0)
    return e * np.concatenate([[begin], followed])[at] + (f - e) * x[at] + (1.0 - f) * reached
