"""The index of air as a plain object for JSON: SI units unless a key says otherwise."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from catseye.atmosphere.index.air import AirState


def air_object(air: "AirState", wavelength_um: float, u: Any) -> dict[str, Any]:
    """The air as `catseye air --json` gives it.

    u   standard uncertainty of the group index, formula and instruments
    """
    return {
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
        "formula_uncertainty": air.standard_uncertainty,
    }
