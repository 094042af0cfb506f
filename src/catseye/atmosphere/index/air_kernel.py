"""Shared parts of the compiled air models: saturation polynomial, blocks, threads.

Nothing is exponentiated in a kernel. Within a model's limits of temperature the saturation pressure is a polynomial,
interpolated at the Chebyshev points of that interval from the plain form in `atmosphere.weather.humidity` when a kernel
is imported: it follows that form, without constants of its own. The constants of the plain forms are passed as
arguments, so that a kernel cached by numba never holds older ones.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit

from catseye.atmosphere.index.model import IndexModel
from catseye.atmosphere.weather.humidity import saturation
from catseye.errors import ValidityError

DEGREE = 15  # odd; 6e-13 of saturation at 100 °C, 1e-14 at 50 °C: 1e-16 and 3e-19 in the index
BLOCK = 1024  # states between two checks of the limits; also the copies of a single value, which fit the cache
MOST_THREADS = 4
PARALLEL_FROM = 2_000_000  # states; below, starting the threads costs more than they save

compiled = njit(cache=True, error_model="numpy", fastmath={"contract"}, nogil=True)
inlined = njit(error_model="numpy", fastmath={"contract"})


class SaturationPolynomial(NamedTuple):
    """Temperature-dependent part of a saturation pressure, as a polynomial.

    middle   °C, of the interval
    per_c    1/°C: the variable is u = per_c (t - middle), from -1 to 1
    even     coefficients of even powers, highest first
    odd      of odd powers: two short sums are faster than a long one
    """

    middle: float
    per_c: float
    even: tuple[float, ...]
    odd: tuple[float, ...]


def limits_of(model: IndexModel) -> tuple[float, ...]:
    """Limits of a model for its kernel: lower and upper °C, hPa, %."""
    limits = (model.limits[name] for name in ("temperature_c", "pressure_hpa", "humidity_percent"))
    return tuple(end for limit in limits for end in (limit.lower, limit.upper))


def saturation_polynomial(model: IndexModel, factor: Callable) -> SaturationPolynomial:
    """Polynomial of the temperature-dependent part of a model's saturation pressure.

    It covers the model's limits of temperature.

    model    the model
    factor   function of (temperature_c, pressure_hpa): the other part, which the kernel computes

    >>> from catseye.atmosphere.weather.humidity import enhancement_factor
    >>> from catseye.atmosphere.index.ciddor_hill1999 import MODEL
    >>> fit = saturation_polynomial(MODEL, enhancement_factor)
    >>> round(float(saturation_value.py_func(20.0, fit.middle, fit.per_c, fit.even, fit.odd)), 4)  # hPa
    23.3916
    """
    limit, p = model.limits["temperature_c"], model.limits["pressure_hpa"].lower
    middle, half = 0.5 * (limit.lower + limit.upper), 0.5 * (limit.upper - limit.lower)

    def pure(u):
        t = middle + half * u
        return saturation(t, p, model.vapour_formula).pressure_hpa / factor(t, p)

    series = np.polynomial.Chebyshev.interpolate(pure, DEGREE).convert(kind=np.polynomial.Polynomial)
    powers = [float(c) for c in series.coef[::-1]]
    return SaturationPolynomial(middle, 1.0 / half, tuple(powers[1::2]), tuple(powers[0::2]))


@inlined
def saturation_value(t, middle, per_c, even, odd):
    """Value of a saturation polynomial at a temperature in °C."""
    u = per_c * (t - middle)
    square, a, b = u * u, 0.0, 0.0
    for c in even:
        a = a * square + c
    for c in odd:
        b = b * square + c
    return a + u * b


@inlined
def part(values, first, last, spare):
    """Block of an array; for one element its copies in `spare`."""
    return values[first:last] if len(values) > 1 else spare[: last - first]


def over_states(fill: Callable[..., bool], weather: tuple, constants: tuple) -> tuple[np.ndarray, bool]:
    """Values of a compiled formula for n states; True if all are within limits.

    fill        kernel: (temperature_c, pressure_hpa, humidity_percent, values, *constants) -> inside
    weather     three arrays, each of n elements or of one
    constants   further arguments of the kernel

    Raises ValidityError for arrays of other lengths. Threads from PARALLEL_FROM states, at most one a processor.
    """
    inputs = [np.ascontiguousarray(quantity, float).reshape(-1) for quantity in weather]
    lengths = {len(quantity) for quantity in inputs} - {1} or {1}
    if len(lengths) > 1:
        raise ValidityError(
            f"weather of {', '.join(str(len(quantity)) for quantity in inputs)} states (expected n or 1 each)"
        )
    values = np.empty(lengths.pop())
    if not len(values):
        return values, True
    threads = min(os.cpu_count() or 1, MOST_THREADS) if len(values) >= PARALLEL_FROM else 1
    if threads == 1:
        return values, fill(*inputs, values, *constants)
    ends = np.linspace(0, len(values), threads + 1).astype(int)
    with ThreadPoolExecutor(threads) as pool:  # the kernels hold no lock
        jobs = [
            pool.submit(fill, *(x if len(x) == 1 else x[a:b] for x in inputs), values[a:b], *constants)
            for a, b in pairwise(ends)
        ]
        return values, all(job.result() for job in jobs)
