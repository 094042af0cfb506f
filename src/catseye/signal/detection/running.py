"""Phase of a moving target, from cycles corrected for motion.

A range rate v changes the phase by -4 pi f v / c a second. Over a buffer the plain mean is that of the
middle with sin(x)/x of the amplitude, x half the run; but the run looks like slow noise, and the leakage is
constant while the return turns. Both effects vanish where the run is known to a few per cent, as from the telescope's
drives.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.signal.detection.cycle_scatter import cycle_phasors, moments


@dataclass(frozen=True, eq=False)
class RunningPhasor:
    """Mean of a running return.

    phasor    V, complex, of the return at the buffer's middle, without leakage
    u_phasor  V, of each quadrature, both taken as equal; NaN for one cycle
    total, between   V^2, (3,), as `cycle_scatter.CycleScatter` has them
    """

    phasor: complex
    u_phasor: float
    total: NDArray[np.float64]
    between: NDArray[np.float64]


def running_phasor(
    samples: ArrayLike, samples_per_cycle: int, volts_per_code: float, *, run: float, leaked: complex = 0j
) -> RunningPhasor:
    """Phasor of one buffer whose phase changes linearly.

    samples             (m n,) codes
    samples_per_cycle   n
    volts_per_code      V
    run                 rad a cycle, below pi in size
    leaked              V, constant leakage in the samples

    Raises ValidityError: no whole cycles, or a run that the cycles do not resolve.

    Source: [PARKER04] eq. 5.1-5.3 for each cycle z, in which a phase that runs by p(j) leaves z = a A + b A*, a the
    mean of exp(ip) and b that of exp(-ip) exp(2i theta). Exact for an even run.

    >>> j = np.arange(640)
    >>> moving = 1000 * np.cos(2 * np.pi * j / 64 - 0.5 - 0.04 * (j - 319.5) / 64)
    >>> running = running_phasor(moving, 64, 1e-3, run=0.04)
    >>> round(abs(running.phasor), 12), round(float(np.angle(running.phasor)), 12)
    (1.0, 0.5)
    """
    if not abs(run) < np.pi:
        raise ValidityError(f"run {run} rad a cycle is not below pi: the cycles do not resolve it")
    cycles = cycle_phasors(samples, samples_per_cycle, volts_per_code) - leaked
    m, n = cycles.shape[-1], samples_per_cycle
    within = np.exp(1j * run * (np.arange(n) - 0.5 * (n - 1)) / n)
    direct = within.real.mean()
    image = np.mean(within.conj() * np.exp(4j * np.pi * np.arange(n) / n))
    cycles = (direct * cycles - image * cycles.conj()) / (direct**2 - abs(image) ** 2)
    still = cycles * np.exp(-1j * run * (np.arange(m) - 0.5 * (m - 1)))
    mean = still.mean()
    total, between = moments((still - mean)[None])
    u = float(np.sqrt((total[0, 0] + total[0, 1]) / (2.0 * (m - 1) * m))) if m > 1 else float("nan")
    return RunningPhasor(complex(mean), u, total[0], between[0])
