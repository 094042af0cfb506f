"""The group index of 10^7 states of air, beside what a user would write instead.

python benchmarks/bench_air.py [--quick]

Every contender makes its answer in new memory, but for the row that says so. Ours takes a thread a processor but where
said, the others and the limits one. The notes' model in float64 at 0.780 um; GeodePy has only Ciddor's, and is given
its vapour pressure by numpy where it runs over arrays, as its own takes one number at a time.
"""

import sys
from collections.abc import Callable, Iterator

import numpy as np
from numba import njit

from catseye.atmosphere.index import air, air_kernel, ciddor_hill1999_kernel, rueger1990_kernel
from catseye.atmosphere.index.air import MODELS
from catseye.atmosphere.weather import humidity
from harness import LIMIT, Contender, Row, main, missing, raced

STATES, SCALARS, PART, BLOCK = 10_000_000, 5_000, 1_000_000, 4096
WAVELENGTH_UM, CO2_PPM = 0.780, 450.0
WHAT = f"{STATES:.0e} states, each limit checked"


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


def geodepy_arrays(t: np.ndarray, p: np.ndarray, h: np.ndarray) -> np.ndarray:
    """GeodePy's group refractivity over arrays."""
    from geodepy.survey import group_refractivity

    kelvin = t + 273.15
    saturated = np.exp(1.2378847e-5 * kelvin * kelvin - 1.9121316e-2 * kelvin + 33.93711047 - 6.3431645e3 / kelvin)
    return 1e-8 * group_refractivity(WAVELENGTH_UM, t, p, h / 1e4 * saturated, CO2_PPM)


def geodepy_scalars(t: np.ndarray, p: np.ndarray, h: np.ndarray) -> np.ndarray:
    """GeodePy's group refractivity, a state at a time."""
    from geodepy.survey import group_refractivity, humidity2part_water_vapour_press

    return np.array([
        1e-8 * group_refractivity(WAVELENGTH_UM, a, b, humidity2part_water_vapour_press(c, a), CO2_PPM)
        for a, b, c in zip(t.tolist(), p.tolist(), h.tolist(), strict=True)
    ])  # fmt: skip


def rows(quick: bool) -> Iterator[Row]:
    """The notes' model and Ciddor's, each by its kernel and by the public function."""
    t, p, h = weather()
    own, other = np.zeros(STATES), np.zeros(STATES)
    light = {"wavelength_um": WAVELENGTH_UM, "co2_ppm": CO2_PPM}
    few, one = (t[:PART], p[:PART], h[:PART]), (t[:SCALARS], p[:SCALARS], h[:SCALARS])
    streamed = Contender(lambda: stream(t, p, h, np.empty(STATES)))
    absent = missing("geodepy")

    def apart(name: str, values: np.ndarray) -> str:
        return f"largest difference to the plain form {np.abs(values[:PART] - plain(name, *few)).max():.0e}"

    def part(work: Callable[[], np.ndarray], states: int) -> Contender:
        return Contender(work, states / STATES)

    yield raced(
        "index of air",
        WHAT,
        {
            "catseye": Contender(lambda: compiled(rueger1990_kernel, t, p, h)),
            "numpy in cache-sized blocks": part(lambda: blocked_numpy(*few), PART),
            "numpy, whole arrays": part(lambda: plain("rueger1990", *few), PART),
            LIMIT: streamed,
        },
        quick=quick,
        note=apart("rueger1990", compiled(rueger1990_kernel, t, p, h)),
    )
    yield raced(
        "index of air, one thread",
        "the same in memory that is there",
        {
            "catseye": Contender(lambda: kernel(t, p, h, own)),
            "numpy in cache-sized blocks": part(lambda: blocked_numpy(*few), PART),
            LIMIT: Contender(lambda: stream(t, p, h, other)),
        },
        quick=quick,
    )
    ciddor: dict[str, Contender] = {
        "catseye": Contender(lambda: compiled(ciddor_hill1999_kernel, t, p, h)),
        "numpy, whole arrays": part(lambda: plain("ciddor_hill1999", *few), PART),
    }
    if not absent:
        ciddor["GeodePy over arrays"] = part(lambda: geodepy_arrays(*few), PART)
        ciddor["GeodePy, a state at a time"] = part(lambda: geodepy_scalars(*one), SCALARS)
    yield raced(
        "index of air by Ciddor and Hill",
        WHAT,
        ciddor | {LIMIT: streamed},
        quick=quick,
        note=apart("ciddor_hill1999", compiled(ciddor_hill1999_kernel, t, p, h)),
        skipped=absent,
    )
    yield raced(
        "index of air, public function",
        WHAT,
        {
            "catseye": Contender(lambda: air.group_refractivity(t, p, h, model="rueger1990", **light)),
            "numpy in cache-sized blocks": part(lambda: blocked_numpy(*few), PART),
            LIMIT: streamed,
        },
        quick=quick,
    )


if __name__ == "__main__":
    main(rows)
