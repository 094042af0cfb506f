"""Speed of sound as JSON and text, with other models."""

from typing import TYPE_CHECKING, Any

from catseye.atmosphere.sound.speed import MODELS, Sound
from catseye.errors import ValidityError
from catseye.gateways.air.objects import spread
from catseye.gateways.writers.passage import Passage

if TYPE_CHECKING:
    from collections.abc import Mapping

    from catseye.reduction.air.sound_speed import SoundSpeed, TemperatureBySound


def sound_object(found: "SoundSpeed") -> dict[str, Any]:
    """Object that `catseye sound --json` prints."""
    state = found.state
    slopes = state.sensitivity._asdict()
    if not MODELS[state.model].has_co2:
        del slopes["co2_ppm"]
    return {
        "verdict": found.verdict.to_object(),
        "model": state.model,
        "temperature_c": found.temperature_c,
        "pressure_hpa": found.pressure_hpa,
        "humidity_percent": found.humidity_percent,
        "u_temperature_c": found.u_temperature_c,
        "co2_ppm": found.co2_ppm if MODELS[state.model].has_co2 else None,
        "speed": state.speed,
        "dry_speed": state.dry_speed,
        "vapour_pressure_hpa": state.vapour_pressure_hpa,
        "sensitivity": slopes,
        "travel_time_per_m": state.travel_time_per_m,
        "travel_time_per_m_per_c": state.time_sensitivity.temperature_c,
        "standard_uncertainty": found.u,
        "formula_uncertainty": state.standard_uncertainty,
        "uncertainty_of": list(found.stated),
        "models": {name: _speed(each) for name, each in found.by_formula.items()},
        "notes_gamma_w": found.misprint._asdict(),
        "dispersion": [excess._asdict() for excess in found.dispersion],
        **({} if found.temperatures is None else {"temperatures": _temperatures(found.temperatures)}),
    }


def _temperatures(by_formula: "Mapping[str, TemperatureBySound | ValidityError]") -> dict[str, Any]:
    return {
        name: {"temperature_c": None, "u_temperature_c": None, "reason": str(each)}
        if isinstance(each, ValidityError)
        else each._asdict()
        for name, each in by_formula.items()
    }


def _speed(state: Sound | ValidityError) -> dict[str, Any]:
    if isinstance(state, ValidityError):
        return {"speed": None, "standard_uncertainty": None, "reason": str(state)}
    return {"speed": state.speed, "standard_uncertainty": state.standard_uncertainty}


def sound_passages(found: "SoundSpeed") -> list[Passage]:
    """Speed, slopes and other formulas as text; for many states, the range of values."""
    answer = sound_object(found)
    slope, cost, low = answer["sensitivity"], answer["notes_gamma_w"], answer["dispersion"][0]
    carbon = (
        f"{spread(slope['co2_ppm'], '+.5f', 100.0)} m/s per 100 ppm of carbon dioxide"
        if "co2_ppm" in slope
        else "carbon dioxide fixed by the formula"
    )
    alternatives = "; ".join(
        f"{name} {spread(item['speed'], '.3f')} ± {spread(item['standard_uncertainty'], '.2g')} m/s"
        if item["speed"] is not None
        else f"{name}: {item['reason']}"
        for name, item in answer["models"].items()
    )
    rows = {
        "speed": f"{spread(answer['speed'], '.3f')} m/s at zero frequency, dry air "
        f"{spread(answer['dry_speed'], '.3f')} m/s",
        "uncertainty": f"{spread(answer['standard_uncertainty'], '.2g')} m/s (1σ)",
        "per °C": f"{spread(slope['temperature_c'], '+.6f')} m/s",
        "per hPa": f"{spread(slope['pressure_hpa'], '+.6f')} m/s",
        "per %": f"{spread(slope['humidity_percent'], '+.6f')} m/s of relative humidity",
        "per hPa (e)": f"{spread(slope['vapour_pressure_hpa'], '+.6f')} m/s",
        "CO2": carbon,
        "time": f"{spread(answer['travel_time_per_m'], '.6f', 1e3)} ms/m, "
        f"{spread(answer['travel_time_per_m_per_c'], '+.4f', 1e6)} µs/m/°C",
        "vapour": f"{spread(answer['vapour_pressure_hpa'], '.3f')} hPa",
        "formula": answer["model"],
        "formulas": alternatives,
        "notes": f"γ_w = {cost['printed']} (4.3) is a misprint of {cost['right']:.2f}: slow by "
        f"{spread(cost['slow_by'], '.3f')} m/s, {spread(cost['temperature_read_high_by_c'], '.2f')} °C too warm in "
        "thermometry",
        "dispersion": f"at {low['frequency_hz']:g} Hz faster by {spread(low['phase_excess'], '.3f')} m/s",
    }
    if found.temperatures is not None:
        rows = {**_temperature_rows(answer, found.uncertainty_words), **rows}
    return [Passage(title, text) for title, text in rows.items()]


def _temperature_rows(answer: dict[str, Any], words: str) -> dict[str, str]:
    by_formula = "; ".join(
        f"{name} {spread(item['temperature_c'], '.3f')} ± {spread(item['u_temperature_c'], '.2g')} °C"
        if item["temperature_c"] is not None
        else f"{name}: {item['reason']}"
        for name, item in answer["temperatures"].items()
    )
    return {
        "temperature": f"{spread(answer['temperature_c'], '.4f')} ± {spread(answer['u_temperature_c'], '.2g')} °C by "
        f"{answer['model']} (1σ; {words})",
        "by formula": by_formula,
    }
