"""Index of air as JSON (SI units) and text."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.gateways.writers.passage import Passage
from catseye.reduction.air.stated import contributions

if TYPE_CHECKING:
    from catseye.reduction.air.routes import MercuryColumn
    from catseye.reduction.air.weather_index import WeatherIndex


def air_object(found: "WeatherIndex") -> dict[str, Any]:
    """Object that `catseye air --json` prints."""
    state = found.state
    surface = {} if found.condensation is None else {"condensation": found.condensation._asdict()}
    cooling = {} if found.depression_k is None else {"radiative_depression_k": found.depression_k}
    barometer = {} if found.mercury is None else {"barometer": _barometer(found.mercury)}
    return {
        "verdict": found.verdict.to_object(),
        "model": state.model,
        "wavelength_um": found.wavelength_um,
        "temperature_c": state.temperature_c,
        "pressure_hpa": state.pressure_hpa,
        "humidity_percent": state.humidity_percent,
        "co2_ppm": state.co2_ppm,
        "group_index": state.group_index,
        "phase_index": state.phase_index,
        "vapour_pressure_hpa": state.vapour_pressure_hpa,
        "dew_point_c": state.dew_point_c,
        "frost_point_c": found.frost_point_c,
        "humidity_over_ice_percent": found.humidity_over_ice_percent,
        "density_factors": found.density_factors._asdict(),
        "density_unit": found.density_unit,
        "group_coefficients": found.group_coefficients._asdict(),
        "group_wavelength": state.group_wavelength,
        "sensitivity": state.sensitivity._asdict(),
        "phase_sensitivity": state.phase_sensitivity._asdict(),
        "standard_uncertainty": found.u,
        "formula_uncertainty": found.u_formula,
        "uncertainty_of": list(found.stated),
        **barometer,
        **surface,
        **cooling,
    }


def _barometer(mercury: "MercuryColumn") -> dict[str, Any]:
    return {
        "corrected_mmhg": mercury.corrected_mmhg,
        "gravity": mercury.gravity,
        "u_gravity": mercury.u_gravity,
        "gravity_of": mercury.of,
        "gravity_anomaly": mercury.anomaly,
    }


def air_passages(found: "WeatherIndex") -> list[Passage]:
    """Index, uncertainty, slopes and condensation as text; for many states, the range of values."""
    answer = air_object(found)
    slope = answer["sensitivity"]
    carbon = (
        f"{spread(slope['co2_ppm'], '+.4f', 1e8)} ppm per 100 ppm of carbon dioxide"
        if np.any(slope["co2_ppm"])
        else f"the formula's air has {spread(answer['co2_ppm'], '.0f')} ppm of carbon dioxide"
    )
    whose = contributions(found.stated)
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
        **_over_ice(answer),
        "gases": _gases(answer),
        "modulation": f"{spread(answer['group_wavelength'], '.9f')} m a wavelength at 1500 MHz",
        "formula": f"{answer['model']}, {spread(answer['wavelength_um'], 'g')} µm",
    }
    if found.mercury is not None:
        rows["mercury"] = _mercury(answer["barometer"])
    if found.depression_k is not None:
        rows["clear sky"] = f"cools the surface {spread(found.depression_k, '.1f')} K below the air, good to a third"
    if found.condensation is not None:
        rows["surface"] = found.condensation.lines()[0]
    return [Passage(title, text) for title, text in rows.items()]


def _over_ice(answer: dict[str, Any]) -> dict[str, str]:
    """Row of air at or below 0 °C."""
    over_ice = spread(answer["humidity_over_ice_percent"], ".2f")
    if over_ice == "none":
        return {}
    return {"over ice": f"{over_ice} %, frost point {spread(answer['frost_point_c'], '.2f')} °C"}


def _gases(answer: dict[str, Any]) -> str:
    """Parts of both gases in the group refractivity: density factor times coefficient, in the formula's unit."""
    density, coefficient = answer["density_factors"], answer["group_coefficients"]
    parts = [
        f"{gas} {spread(np.multiply(density[key], coefficient[key]), '.3f', 1e6)} ppm (density factor {name} "
        f"{spread(density[key], '.6g')} of {spread(coefficient[key], '.4f', 1e6)} ppm)"
        for key, gas, name in (("dry", "dry air", "D_s"), ("vapour", "vapour", "D_w"))
    ]
    return f"{', '.join(parts)}, factors in {answer['density_unit']}"


def _mercury(barometer: dict[str, Any]) -> str:
    anomaly = ""
    if barometer["gravity_anomaly"] is not None:
        anomaly = f", {spread(barometer['gravity_anomaly'], '+.1f', 1e5)} mgal of anomaly"
    return (
        f"{spread(barometer['corrected_mmhg'], '.2f')} mm at 0 °C; gravity {spread(barometer['gravity'], '.7f')} m/s² "
        f"by {barometer['gravity_of']}{anomaly}"
    )


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
