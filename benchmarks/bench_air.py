"""The group index of 10^7 states of air, beside what a user would write instead.

Medians of interleaved rounds; who takes less than half a second runs three times in each and the last counts, as in a
loop. Every contender makes its answer in new memory, but for those that say so. Ours takes a thread a processor but
where said, the others one. The notes' model in float64 at 0.780 um; GeodePy has only Ciddor's, and is given its vapour
pressure by numpy where it runs over arrays, as its own takes one number at a time. `pip install geodepy` to see it;
without it those lines are left out.
python benchmarks/bench_air.py
"""

import os
import statistics
import sys
import time
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numba import njit

from catseye.atmosphere.index import air, air_kernel, ciddor_hill1999_kernel, rueger1990_kernel
from catseye.atmosphere.index.air import MODELS
from catseye.atmosphere.weather import humidity

ROUNDS, STATES, SCALARS, BLOCK = 5, 10_000_000, 20_000, 4096
REPEATS, SHORT = 3, 0.5
WAVELENGTH_UM, CO2_PPM = 0.780, 450.0
Contender = tuple[Callable[[], np.ndarray], int]


def weather() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Temperatures, pressures, humidities all over the ground's weather."""
    rng = np.random.default_rng(6)
    return rng.uniform(-20.0, 45.0, STATES), rng.uniform(600.0, 1100.0, STATES), rng.uniform(0.0, 100.0, STATES)


def plain(name: str, t: np.ndarray, p: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Catseye's plain form, whole arrays, nothing checked."""
    e = humidity.vapour_pressure_hpa(t, p, h, MODELS[name].vapour_formula)
    return MODELS[name].refractivity(t, p, e, wavelength_um=WAVELENGTH_UM, co2_ppm=CO2_PPM)


def blocked_numpy(t: np.ndarray, p: np.ndarray, h: np.ndarray) -> np.ndarray:
    """The notes' formula as well as numpy can: blocks that stay in the cache, every step in place, one 1/T."""
    dry, vapour = MODELS["rueger1990"].coefficients(WAVELENGTH_UM, CO2_PPM)
    out = np.empty_like(t)
    spare = np.empty((4, BLOCK))
    for first in range(0, len(t), BLOCK):
        last = min(first + BLOCK, len(t))
        e, r, s, b = spare[:, : last - first]
        ti, pi, o = t[first:last], p[first:last], out[first:last]
        np.add(ti, 240.97, out=r)
        np.divide(ti, r, out=e)
        np.multiply(e, 17.502, out=e)
        np.exp(e, out=e)
        np.multiply(pi, 0.061121 * 3.46e-6, out=s)
        np.add(s, 0.061121 * 1.0007, out=s)
        np.multiply(e, s, out=e)
        np.multiply(e, h[first:last], out=e)  # vapour pressure
        np.add(ti, 273.15, out=r)
        np.divide(1.0, r, out=r)
        np.subtract(pi, e, out=s)  # dry air's
        np.multiply(r, 0.25844, out=b)
        np.add(b, -9.3250e-4, out=b)
        np.multiply(b, r, out=b)
        np.add(b, 57.90e-8, out=b)
        np.multiply(b, s, out=b)
        np.add(b, 1.0, out=b)
        np.multiply(b, s, out=b)
        np.multiply(b, float(dry), out=o)
        np.multiply(r, 7.75141e4, out=b)
        for coefficient in (-710.792, 2.23366):
            np.add(b, coefficient, out=b)
            np.multiply(b, r, out=b)
        np.add(b, -2.37321e-3, out=b)
        np.multiply(b, e, out=b)
        np.multiply(e, 3.7e-4, out=s)
        np.add(s, 1.0, out=s)
        np.multiply(b, s, out=b)
        np.add(b, 1.0, out=b)
        np.multiply(b, e, out=b)
        np.multiply(b, float(vapour), out=b)
        np.add(o, b, out=o)
        np.multiply(o, r, out=o)
    return out


@njit(cache=True, error_model="numpy", nogil=True)
def _stream(t, p, h, out):
    """The machine's limit for the same bytes: three arrays read, one written, next to nothing computed."""
    for i in range(len(out)):
        out[i] = t[i] + p[i] + h[i]


def stream(t: np.ndarray, p: np.ndarray, h: np.ndarray, out: np.ndarray) -> np.ndarray:
    _stream(t, p, h, out)
    return out


def kernel(t: np.ndarray, p: np.ndarray, h: np.ndarray, out: np.ndarray) -> np.ndarray:
    """The notes' kernel alone, one thread, into memory that is there already."""
    model = rueger1990_kernel.MODEL
    coefficients = tuple(float(c) for c in model.coefficients(WAVELENGTH_UM, CO2_PPM))
    constants = (air_kernel.limits_of(model), tuple(rueger1990_kernel.SATURATION), rueger1990_kernel.DENSITY)
    if not rueger1990_kernel._fill(t, p, h, out, coefficients, *constants):
        sys.exit("the weather lies outside the model")
    return out


def compiled(module, t: np.ndarray, p: np.ndarray, h: np.ndarray) -> np.ndarray:
    values, inside = module.refractivity(t, p, h, *module.MODEL.coefficients(WAVELENGTH_UM, CO2_PPM))
    if not inside:
        sys.exit("the weather lies outside the model")
    return values


def geodepy(t: np.ndarray, p: np.ndarray, h: np.ndarray) -> dict[str, Contender]:
    """GeodePy's group refractivity over arrays and one state at a time, where it is installed."""
    try:
        from geodepy.survey import group_refractivity, humidity2part_water_vapour_press
    except ImportError:
        sys.stdout.write("GeodePy is not installed: no line for it\n")
        return {}

    def arrays() -> np.ndarray:
        kelvin = t + 273.15
        saturated = np.exp(1.2378847e-5 * kelvin * kelvin - 1.9121316e-2 * kelvin + 33.93711047 - 6.3431645e3 / kelvin)
        return 1e-8 * group_refractivity(WAVELENGTH_UM, t, p, h / 1e4 * saturated, CO2_PPM)

    def scalars() -> np.ndarray:
        states = zip(t[:SCALARS].tolist(), p[:SCALARS].tolist(), h[:SCALARS].tolist(), strict=True)
        return np.array([
            1e-8 * group_refractivity(WAVELENGTH_UM, a, b, humidity2part_water_vapour_press(c, a), CO2_PPM)
            for a, b, c in states
        ])  # fmt: skip

    return {
        "GeodePy over arrays (Ciddor)": (arrays, STATES),
        "GeodePy, a state at a time (Ciddor)": (scalars, SCALARS),
    }


def contenders(t: np.ndarray, p: np.ndarray, h: np.ndarray) -> dict[str, Contender]:
    own, other = np.zeros(STATES), np.zeros(STATES)
    light = {"wavelength_um": WAVELENGTH_UM, "co2_ppm": CO2_PPM}
    return {
        "catseye, compiled": (lambda: compiled(rueger1990_kernel, t, p, h), STATES),
        "  in memory that is there, one thread": (lambda: kernel(t, p, h, own), STATES),
        "  the public function with its checks": (
            lambda: air.group_refractivity(t, p, h, model="rueger1990", **light), STATES,
        ),
        "limit: the same bytes, new memory": (lambda: stream(t, p, h, np.empty(STATES)), STATES),
        "limit: in memory that is there": (lambda: stream(t, p, h, other), STATES),
        "numpy in blocks": (lambda: blocked_numpy(t, p, h), STATES),
        "catseye's plain form (numpy)": (lambda: plain("rueger1990", t, p, h), STATES),
        "Ciddor-Hill, compiled": (lambda: compiled(ciddor_hill1999_kernel, t, p, h), STATES),
        "  the public function with its checks ": (lambda: air.group_refractivity(t, p, h, **light), STATES),
        "Ciddor-Hill, plain form (numpy)": (lambda: plain("ciddor_hill1999", t, p, h), STATES),
        **geodepy(t, p, h),
    }  # fmt: skip


def _last(job: Callable[[], np.ndarray]) -> float:
    """Seconds of a run, of the third where runs are short."""
    took = 0.0
    for _ in range(REPEATS):
        start = time.perf_counter()
        job()
        took = time.perf_counter() - start
        if took > SHORT:
            break
    return took


def main() -> None:
    t, p, h = weather()
    jobs = contenders(t, p, h)
    exact = {name: plain(name, t, p, h) for name in ("rueger1990", "ciddor_hill1999")}
    apart: dict[str, str] = {}
    for name, (job, count) in jobs.items():  # also compiles
        model = "ciddor_hill1999" if "Ciddor" in name or name.endswith(" ") else "rueger1990"
        same = float(np.max(np.abs(job() - exact[model][:count])))
        apart[name] = "" if name.startswith("limit") else f"   apart {same:.0e}"
    spent: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(ROUNDS):
        for name, (job, count) in jobs.items():
            spent[name].append(_last(job) / count)
    ours = statistics.median(spent["catseye, compiled"])
    sys.stdout.write(f"{STATES:.0e} states, the notes' model but where said\n")
    for name, times in spent.items():
        took = statistics.median(times)
        sys.stdout.write(f"  {name:<42}{1e-6 / took:8.2f} M/s  {took / ours:8.2f} x ours{apart[name]}\n")


if __name__ == "__main__":
    main()
