"""Glass as JSON and text: indices, slopes, prism of it, comparison with other glasses."""

from typing import Any

from catseye.atmosphere.index.air import air
from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import ValidityError
from catseye.gateways.writers.verdict import Verdict
from catseye.names import NOTES_AIR_MODEL
from catseye.optics.glass import (
    GLASSES,
    absolute_index,
    glass_named,
    group_index,
    group_wavelength,
    phase_index,
    reference_air,
    slopes,
    temperature_slopes,
    wavelength_in_air_um,
)
from catseye.optics.retroreflector import prism
from catseye.optics.retroreflector.warm_prism import EXPANSION_C, warm_prism, warm_prism_slopes

MODULATION_HZ = 1.5e9  # the GBT's
AIR = (20.0, 933.0, 50.0)  # °C, hPa, %: of the notes' example, [PARKER04] eq. 1.49, by their model
OBLIQUE = 30.0 * DEGREE  # incidence of the reported range change


def glass_object(name: str, wavelength_um: float, temperature_c: float, *, height_mm: float) -> dict[str, Any]:
    """Object of one glass that `catseye glass NAME --json` prints.

    name            in GLASSES
    wavelength_um   in vacuum, um
    temperature_c   °C, of the glass
    height_mm       height of a prism at 20 °C, mm, above 0
    """
    glass = glass_named(name)
    vacuum = absolute_index(wavelength_um, name, temperature_c)
    wavelength = float(wavelength_in_air_um(wavelength_um, name))
    by_wavelength, by_temperature = slopes(wavelength, name), temperature_slopes(wavelength_um, name, temperature_c)
    return {
        "verdict": glass_verdict(name, temperature_c).to_object(),
        "name": name,
        "what": glass.what,
        "formula": glass.formula,
        "source": glass.source,
        "limits_um": [glass.shortest_um, glass.longest_um],
        "reference_c": glass.reference_c,
        "wavelength_um": wavelength_um,
        "wavelength_in_air_um": wavelength,
        "temperature_c": temperature_c,
        "phase_index": phase_index(wavelength, name),
        "group_index": group_index(wavelength, name),
        "phase_index_per_um": by_wavelength.phase,
        "group_index_per_um": by_wavelength.group,
        "group_wavelength": group_wavelength(MODULATION_HZ, wavelength, name),
        "notes_phase_index": phase_index(wavelength_um, name),
        "notes_group_index": group_index(wavelength_um, name),
        "notes_group_wavelength": group_wavelength(MODULATION_HZ, wavelength_um, name),
        "absolute_phase_index": vacuum.phase,
        "absolute_group_index": vacuum.group,
        "absolute_phase_index_per_c": by_temperature.phase,
        "absolute_group_index_per_c": by_temperature.group,
        "expansion_per_c": glass.expansion,
        **_in_air(name, wavelength_um, temperature_c, height_mm * MILLIMETRE),
    }


def glass_verdict(name: str, temperature_c: float) -> Verdict:
    """Verdict: good within the formulas' limits, doubtful beyond those of the expansion."""
    glass = glass_named(name)
    if not EXPANSION_C[0] <= temperature_c <= EXPANSION_C[1]:
        low, high = EXPANSION_C
        why = f"{temperature_c:g} °C is outside {low:g} to {high:g} °C, for which the expansion of {name} is stated"
        return Verdict("doubtful", why)
    return Verdict("good", f"within the limits of {name}'s dispersion formula, {glass.source}")


def _air_about(wavelength_um: float) -> tuple[str, dict[str, float]]:
    """Air of the notes' example, in words and indices.

    The makers' reference air is taken where the notes' model is not valid.
    """
    try:
        about = air(*AIR, wavelength_um=wavelength_um, model=NOTES_AIR_MODEL)
    except ValidityError:
        phase, group = reference_air(wavelength_um, AIR[0])
        return "20 °C, 1013.25 hPa, dry", {"air_phase": float(phase), "air_group": float(group)}
    return "20 °C, 933 hPa, 50 %", {"air_phase": float(about.phase_index), "air_group": float(about.group_index)}


def _in_air(name: str, wavelength_um: float, temperature_c: float, height: float) -> dict[str, Any]:
    """Prism of the glass in the surrounding air, and the errors of assuming another glass."""
    about, index = _air_about(wavelength_um)
    prism_state = (height, name, wavelength_um, temperature_c)
    return {
        "prism": {"air": about, **index_keys(index), **_prism_object(prism_state, index)},
        "others": {
            glass: _exchange(glass, name, wavelength_um, height, index["air_group"])
            for glass in GLASSES
            if glass != name
        },
    }


def index_keys(index: dict[str, float]) -> dict[str, float]:
    """Indices of the air by their names in JSON."""
    return {f"{key}_index": value for key, value in index.items()}


def _prism_object(prism_state: tuple[float, str, float, float], index: dict[str, float]) -> dict[str, Any]:
    """Prism at its temperature in the surrounding air.

    prism_state: height at 20 °C, glass, vacuum wavelength um, temperature °C.
    """
    height, name, wavelength_um, _ = prism_state
    phase, group = index["air_phase"], index["air_group"]
    state = warm_prism(*prism_state, air_phase=phase, air_group=group)
    per_c = warm_prism_slopes(*prism_state, air_phase=phase, air_group=group)
    notes = float(group_index(wavelength_um, name)) / index["air_group"]
    return {
        "height": height,
        "height_at_temperature": state.height,
        "phase_index_over_air": state.phase,
        "group_index_over_air": state.group,
        "notes_group_index_over_air": notes,
        "range_constant": state.range_constant,
        "range_constant_per_c": per_c.range_constant,
        "reference_depth": state.reference_depth,
        "reference_depth_per_c": per_c.reference_depth,
        "range_change_at_30_deg": prism.oblique_change(state.height, OBLIQUE, group=state.group, phase=state.phase),
        "notes_range_constant": prism.range_constant(height, notes),
    }


def _exchange(assumed: str, name: str, wavelength_um: float, height: float, air_group: float) -> dict[str, Any] | None:
    """Errors of assuming another glass; None where its formula is not valid."""
    glass = GLASSES[assumed]
    in_air = {which: float(wavelength_in_air_um(wavelength_um, which)) for which in (name, assumed)}
    if not glass.shortest_um <= in_air[assumed] <= glass.longest_um:
        return None
    n, m = (float(group_index(um, which)) / air_group for which, um in in_air.items())
    wrong = prism.wrong_glass(height, assumed=n, true=m)
    return {
        "phase_index": phase_index(in_air[assumed], assumed) - phase_index(in_air[name], name),
        "group_index": group_index(in_air[assumed], assumed) - group_index(in_air[name], name),
        "range_too_long_about_point": wrong.about_point,
        "range_too_long_about_face": wrong.about_face,
    }


def glass_rows(answer: dict[str, Any]) -> list[tuple[str, str]]:
    """Title and text of each line for a terminal."""
    body = answer["prism"]
    rows = [
        (answer["name"], f"{answer['what']}; {answer['source']}, {_limits(answer)}"),
        ("air", f"phase index {answer['phase_index']:.8f}, group index {answer['group_index']:.8f} at "
                f"{answer['wavelength_in_air_um']:.6g} µm in air, {answer['wavelength_um']:g} µm in vacuum"),
        ("slopes", f"{answer['phase_index_per_um']:+.5f} and {answer['group_index_per_um']:+.5f} per µm"),
        ("modulation", f"{answer['group_wavelength'] * 1e3:.6f} mm at 1500 MHz, half of it "
                       f"{answer['group_wavelength'] * 5e2:.6f} mm"),
        ("vacuum", f"phase index {answer['absolute_phase_index']:.6f}, group index "
                   f"{answer['absolute_group_index']:.6f} at {answer['temperature_c']:g} °C; "
                   f"{answer['absolute_phase_index_per_c'] * 1e6:+.2f} and "
                   f"{answer['absolute_group_index_per_c'] * 1e6:+.2f} ppm per °C"),
        ("expansion", f"{answer['expansion_per_c'] * 1e6:.1f} ppm per °C"),
        ("prism", f"{body['height'] * 1e3:g} mm high at 20 °C, here at {answer['temperature_c']:g} °C in air of "
                  f"{body['air']}: range constant "
                  f"{body['range_constant'] * 1e3:.4f} mm ({body['range_constant_per_c'] * 1e6:+.2f} µm per °C), point "
                  f"{body['reference_depth'] * 1e3:.4f} mm below the face, "
                  f"{body['range_change_at_30_deg'] * 1e6:+.2f} µm more at 30°"),
        ("the notes", f"take {answer['wavelength_um']:g} µm as in air: phase index {answer['notes_phase_index']:.8f}, "
                      f"group index {answer['notes_group_index']:.8f}, modulation "
                      f"{answer['notes_group_wavelength'] * 1e3:.6f} mm, half of it "
                      f"{answer['notes_group_wavelength'] * 5e2:.6f} mm"),
        ("", f"and the index as relative to vacuum: n = {body['notes_group_index_over_air']:.6f} instead of "
                      f"{body['group_index_over_air']:.6f}, range constant "
                      f"{body['notes_range_constant'] * 1e3:.4f} mm, "
                      f"{(body['notes_range_constant'] - body['range_constant']) * 1e6:+.1f} µm"),
    ]  # fmt: skip
    for glass, cost in answer["others"].items():
        text = "formula not valid at this wavelength"
        if cost is not None:
            text = (
                f"group index {cost['group_index']:+.2e}; mistaken for {answer['name']}, a range is "
                f"{cost['range_too_long_about_point'] * 1e6:.2f} µm too long "
                f"({cost['range_too_long_about_face'] * 1e6:.2f} µm about the face)"
            )
        rows.append((glass, text))
    return rows


def table_object() -> dict[str, Any]:
    """Object of all glasses that `catseye glass --json` prints."""
    return {
        "verdict": Verdict("good", "the makers' formulas, each with its source and limits").to_object(),
        "glasses": {
            name: {
                "what": glass.what,
                "formula": glass.formula,
                "source": glass.source,
                "limits_um": [glass.shortest_um, glass.longest_um],
                "reference_c": glass.reference_c,
                "thermal_source": glass.thermal.source,
                "expansion_per_c": glass.expansion,
            }
            for name, glass in GLASSES.items()
        },
    }


def _limits(answer: dict[str, Any]) -> str:
    shortest, longest = answer["limits_um"]
    return f"{shortest:g} to {longest:g} µm"


def table_rows() -> list[tuple[str, str]]:
    """Lines of the table for a terminal."""
    table = table_object()["glasses"]
    return [(name, f"{entry['what']}; {entry['source']}, {_limits(entry)}") for name, entry in table.items()]
