"""Index of air as JSON (SI units) and text, with its verdict."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import Verdict

if TYPE_CHECKING:
    from catseye.atmosphere.index.air import AirState

FORMULA_ALONE = "u is that of the formula only; those of the sensors are not given"
WEATHER = ("temperature", "pressure", "humidity")  # inputs of every index and every speed of sound


def stated_inputs(**u: Any) -> tuple[str, ...]:
    """Names of the inputs with an uncertainty above zero, in the order given.

    >>> stated_inputs(temperature=0.1, pressure=0.0, humidity=[0.0, 2.0])
    ('temperature', 'humidity')
    """
    return tuple(name for name, value in u.items() if np.any(np.asarray(value, dtype=float) > 0.0))


def uncertainty_words(stated: Sequence[str]) -> str:
    """Sentence on the contributions that an uncertainty includes.

    stated   of `stated_inputs`

    >>> uncertainty_words(("temperature",))
    'u includes the formula and temperature; not given: pressure, humidity'
    """
    missing = [name for name in WEATHER if name not in stated]
    if not stated:
        return FORMULA_ALONE
    if not missing:
        return "u includes the formula and the sensors"
    return f"u includes the formula and {', '.join(stated)}; not given: {', '.join(missing)}"


def air_verdict(air: "AirState", u: Any, stated: Sequence[str] | None = None) -> Verdict:
    """Verdict on the air: formula limits, and the contributions its uncertainty includes.

    u        standard uncertainty of the group index
    stated   inputs whose uncertainty it includes, from `stated_inputs`; None: all if it exceeds the formula's
    """
    if stated is None:
        stated = WEATHER if np.any(np.asarray(u) > np.asarray(air.standard_uncertainty) * (1.0 + 1e-12)) else ()
    verdict = Verdict("good", f"within the limits of {air.model}; {uncertainty_words(stated)}")
    return verdict.hearing(humidity_doubts(air.humidity_percent))


def air_object(
    air: "AirState",
    wavelength_um: Any,
    u: Any,
    *,
    verdict: Verdict,
    stated: Sequence[str] | None = None,
    u_formula: Any = None,
) -> dict[str, Any]:
    """Object that `catseye air --json` prints.

    u           standard uncertainty of the group index, formula and instruments
    stated      inputs whose uncertainty it includes, from `stated_inputs`
    u_formula   its part from formulas; None: that of the index formula only
    """
    alone = air.standard_uncertainty if u_formula is None else u_formula
    return {
        "verdict": verdict.to_object(),
        "model": air.model,
        "wavelength_um": wavelength_um,
        "temperature_c": air.temperature_c,
        "pressure_hpa": air.pressure_hpa,
        "humidity_percent": air.humidity_percent,
        "co2_ppm": air.co2_ppm,
        "group_index": air.group_index,
        "phase_index": air.phase_index,
        "vapour_pressure_hpa": air.vapour_pressure_hpa,
        "dew_point_c": air.dew_point_c,
        "group_wavelength": air.group_wavelength,
        "sensitivity": air.sensitivity._asdict(),
        "phase_sensitivity": air.phase_sensitivity._asdict(),
        "standard_uncertainty": u,
        "formula_uncertainty": alone,
        "uncertainty_of": None if stated is None else list(stated),
    }


def air_passages(answer: dict[str, Any]) -> list[Passage]:
    """Index, uncertainty and slopes as text; for many states, the range of values.

    answer   from `air_object`
    """
    slope = answer["sensitivity"]
    carbon = (
        f"{spread(slope['co2_ppm'], '+.4f', 1e8)} ppm per 100 ppm of carbon dioxide"
        if np.any(slope["co2_ppm"])
        else f"the formula's air has {spread(answer['co2_ppm'], '.0f')} ppm of carbon dioxide"
    )
    stated = answer["uncertainty_of"]
    if stated is None:
        stated = () if np.array_equal(answer["standard_uncertainty"], answer["formula_uncertainty"]) else WEATHER
    whose = uncertainty_words(stated).removeprefix("u is ").removeprefix("u ")
    dew_point = spread(answer["dew_point_c"], ".2f")
    rows = {
        "group index": spread(answer["group_index"], ".9f"),
        "phase index": spread(answer["phase_index"], ".9f"),
        "uncertainty": f"{spread(answer['standard_uncertainty'], '.2g')} (of the group index, 1σ; {whose})",
        "per °C": f"{spread(slope['temperature_c'], '+.4f', 1e6)} ppm",
        "per hPa": f"{spread(slope['pressure_hpa'], '+.4f', 1e6)} ppm",
        "per %": f"{spread(slope['humidity_percent'], '+.4f', 1e6)} ppm of relative humidity",
        "per nm": f"{spread(slope['wavelength_um'], '+.4f', 1e3)} ppm of wavelength",
        "CO2": carbon,
        "pressure": f"{spread(answer['pressure_hpa'], '.3f')} hPa",
        "vapour": f"{spread(answer['vapour_pressure_hpa'], '.3f')} hPa, {spread(answer['humidity_percent'], '.2f')} %, "
        f"dew point {dew_point}{'' if dew_point == 'none' else ' °C'}",
        "modulation": f"{spread(answer['group_wavelength'], '.9f')} m a wavelength at 1500 MHz",
        "formula": f"{answer['model']}, {spread(answer['wavelength_um'], 'g')} µm",
    }
    return [Passage(title, text) for title, text in rows.items()]


def spread(values: Any, form: str, factor: float = 1.0) -> str:
    """Number, or the smallest and the largest of several; "none" if empty.

    >>> spread(1.5, ".2f"), spread([1.0, 3.0, 2.0], "g"), spread(float("nan"), "g")
    ('1.50', '1 to 3', 'none')
    """
    finite = np.asarray(values, dtype=float)[np.isfinite(values)] * factor
    if not finite.size:
        return "none"
    low, high = (format(float(v), form) for v in (finite.min(), finite.max()))
    return low if low == high else f"{low} to {high}"
