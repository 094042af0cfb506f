"""Glass as JSON and text: indices, slopes, prism of it, comparison with other glasses."""

from typing import TYPE_CHECKING, Any

from catseye.optics.glass import GLASSES
from catseye.reduction.optics.glass import ALL_GLASSES

if TYPE_CHECKING:
    from catseye.reduction.optics.glass import GlassState


def glass_object(state: "GlassState") -> dict[str, Any]:
    """Object of one glass that `catseye glass NAME --json` prints."""
    glass = state.glass
    numbers = {key: value for key, value in vars(state).items() if isinstance(value, float)}
    return {
        "verdict": state.verdict.to_object(),
        "name": state.name,
        "what": glass.what,
        "formula": glass.formula,
        "source": glass.source,
        "limits_um": [glass.shortest_um, glass.longest_um],
        "reference_c": glass.reference_c,
        **numbers,
        "expansion_per_c": glass.expansion,
        "prism": dict(vars(state.prism)),
        "others": {name: None if cost is None else dict(vars(cost)) for name, cost in state.others.items()},
        "plate": None if state.plate is None else dict(vars(state.plate)),
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
                  f"{body['range_constant'] * 1e3:.4f} mm ({body['range_constant_per_c'] * 1e6:+.2f} µm per °C), φ_ic "
                  f"{body['phase_offset']:.6f} rad at 1500 MHz, point "
                  f"{body['reference_depth'] * 1e3:.4f} mm below the face (a small turn about "
                  f"{body['flat_depth'] * 1e3:.4f} mm changes no range), "
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
    plate = answer["plate"]
    if plate is not None:
        text = (
            f"{plate['thickness'] * 1e3:g} mm from its face to the prism in its back: the face is "
            f"{plate['range_constant'] * 1e3:+.4f} mm from the measured length, "
            f"at 30° {plate['change_at_30_deg'] * 1e6:+.2f} µm more; by the notes "
            f"{plate['notes_range_constant'] * 1e3:+.4f} mm"
        )
        rows.append(("mirror", text))
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
        "verdict": ALL_GLASSES.to_object(),
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
