"""Speed of sound as JSON and text, with other models."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catseye.atmosphere.sound import parker2004 as sound_parker2004
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.speed import MODELS, Sound, sound
from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.errors import ValidityError
from catseye.gateways.air.objects import WEATHER as SENSED
from catseye.gateways.air.objects import spread, uncertainty_words
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import Verdict

Weather = tuple[Any, Any, Any]
FREQUENCIES_HZ = (1e3, 10e3)  # range of loudspeakers


def sound_object(
    state: Sound, weather: Weather, co2_ppm: Any, *, u: Any, stated: Sequence[str] | None = None
) -> dict[str, Any]:
    """Object that `catseye sound --json` prints.

    weather   temperature °C, pressure hPa, relative humidity %, numbers or arrays
    u         standard uncertainty of the speed, formula and inputs, m/s
    stated    inputs whose uncertainty it includes, from `stated_inputs`
    """
    slopes = state.sensitivity._asdict()
    if not MODELS[state.model].has_co2:
        del slopes["co2_ppm"]
    t, p, h = weather
    return {
        "verdict": sound_verdict(state, h, u, stated).to_object(),
        "model": state.model,
        "temperature_c": t,
        "pressure_hpa": p,
        "humidity_percent": h,
        "co2_ppm": co2_ppm if MODELS[state.model].has_co2 else None,
        "speed": state.speed,
        "dry_speed": state.dry_speed,
        "vapour_pressure_hpa": state.vapour_pressure_hpa,
        "sensitivity": slopes,
        "travel_time_per_m": state.travel_time_per_m,
        "travel_time_per_m_per_c": state.time_sensitivity.temperature_c,
        "standard_uncertainty": u,
        "formula_uncertainty": state.standard_uncertainty,
        "uncertainty_of": None if stated is None else list(stated),
        "models": {name: _speed_by(name, weather, co2_ppm) for name in MODELS},
        "notes_gamma_w": gamma_water_cost(state, weather),
        "dispersion": [_dispersed(state, weather, frequency) for frequency in FREQUENCIES_HZ],
    }


def gamma_water_cost(state: Sound, weather: Weather) -> dict[str, Any]:
    """Effect of the misprinted ratio of specific heats of water in the notes, at this weather."""
    t, p, _ = weather
    printed = sound_parker2004.speed(t, p, state.vapour_pressure_hpa)
    right = sound_parker2004.speed(t, p, state.vapour_pressure_hpa, gamma_water=sound_parker2004.GAMMA_VAPOUR)
    per_c = sound_parker2004.partials(t, p, state.vapour_pressure_hpa).temperature_c
    return {
        "printed": sound_parker2004.GAMMA_WATER,
        "right": sound_parker2004.GAMMA_VAPOUR,
        "slow_by": right - printed,
        "temperature_read_high_by_c": (right - printed) / per_c,
    }


def sound_verdict(state: Sound, humidity_percent: Any, u: Any, stated: Sequence[str] | None = None) -> Verdict:
    """Verdict on the speed: formula limits, humidity, contributions its u includes.

    u        standard uncertainty of the speed, m/s
    stated   inputs whose uncertainty it includes, from `stated_inputs`; None: all if it exceeds the formula's
    """
    if stated is None:
        stated = SENSED if np.any(np.asarray(u) > np.asarray(state.standard_uncertainty) * (1.0 + 1e-12)) else ()
    verdict = Verdict("good", f"within the limits of {state.model}; {uncertainty_words(stated)}")
    return verdict.hearing(humidity_doubts(humidity_percent))


def sound_passages(answer: dict[str, Any]) -> list[Passage]:
    """Speed, slopes and other formulas as text; for many states, the range of values.

    answer   from `sound_object`
    """
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
    return [Passage(title, text) for title, text in rows.items()]


def _speed_by(name: str, weather: Weather, co2_ppm: Any) -> dict[str, Any]:
    try:
        state = sound(*weather, model=name, co2_ppm=co2_ppm)
    except ValidityError as problem:
        return {"speed": None, "standard_uncertainty": None, "reason": str(problem)}
    return {"speed": state.speed, "standard_uncertainty": state.standard_uncertainty}


def _dispersed(state: Sound, weather: Weather, frequency: float) -> dict[str, Any]:
    share = dispersion(weather[0], weather[1], state.vapour_pressure_hpa, frequency_hz=frequency)
    return {
        "frequency_hz": frequency,
        "phase_excess": share.phase * state.speed,
        "group_excess": share.group * state.speed,
    }
