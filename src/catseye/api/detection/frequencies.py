"""`frequencies`: a ranger's frequencies, sidebands, sampling, and what disturbs its phase."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.names import NOTES_AIR_MODEL

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.detection.frequency_chain import FrequencyChain


@dataclass(frozen=True, eq=False, repr=False)
class FrequenciesResult(Result):
    """Frequencies of a ranger and the effects on its phase.

    modulation_hz         Hz, of the laser
    local_oscillator_hz   Hz
    half_wavelength       m, of the modulation in this air
    chain                 everything else: sidebands, sampling, disturbance
    """

    modulation_hz: float
    local_oscillator_hz: float
    half_wavelength: float
    chain: "FrequencyChain"

    def passages(self) -> "Sequence[Passage]":
        """Plan, sidebands, sampling and disturbance."""
        from catseye.gateways.detection.frequency_objects import frequency_passages

        return frequency_passages(self.chain)

    def rows(self) -> Iterator[str]:
        """Effects on phase and range as lines of text."""
        from catseye.gateways.detection.frequency_objects import frequency_rows

        return frequency_rows(self.chain)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye frequencies --json`."""
        from catseye.gateways.detection.frequency_objects import frequency_object

        return frequency_object(self.chain)

    def tables(self) -> "dict[str, QTable]":
        """`frequencies`: each by its name; `lines`: response to lines in the phase."""
        chain = self.chain
        frequencies = {
            "reference": chain.plan.reference_hz,
            "modulation": chain.plan.modulation_hz,
            "local oscillator": chain.local_oscillator_hz,
            "intermediate": chain.sampling.intermediate_hz,
            "sampling": chain.sampling.sample_rate_hz,
            "carrier": float(chain.bands.carrier_hz),
            "lower sideband": float(chain.bands.lower_hz),
            "upper sideband": float(chain.bands.upper_hz),
        }
        named = {"name": (list(frequencies), ""), "frequency": (list(frequencies.values()), "Hz")}
        lines = {"frequency": (list(chain.lines), "Hz"), "response": (list(chain.lines.values()), "")}
        return {"frequencies": quantities(named), "lines": quantities(lines)}

    def figures(self) -> "dict[str, Figure]":
        """Timing diagram of the converter."""
        from catseye.gateways.detection.frequency_objects import timing_figure

        return {"timing": timing_figure(self.chain)}


@with_units
def frequencies(
    *,
    reference_hz: Annotated[Any, In("Hz", one=True)] = 100e6,
    multiple: Annotated[Any, In("", whole=True)] = 15,
    oscillator: str = "above",
    intermediate_hz: Annotated[Any, In("Hz", one=True)] = 1000.0,
    samples_per_cycle: Annotated[Any, In("", whole=True)] = 64,
    cycles: Annotated[Any, In("", whole=True)] = 128,
    wavelength_um: Annotated[Any, In("um", one=True)] = 0.780,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = 20.0,
    pressure_hpa: Annotated[Any, In("hPa", one=True)] = 933.0,
    humidity_percent: Annotated[Any, In("percent", one=True)] = 50.0,
    air_model: str = NOTES_AIR_MODEL,
    disturbance: Annotated[Any, In("", one=True)] = 0.001,
    excess_path: Annotated[Any, In("m", one=True)] = None,
    range_rate: Annotated[Any, In("m / s", one=True)] = None,
) -> FrequenciesResult:
    """Frequency plan, sidebands, sampling and disturbances of a ranger.

    reference_hz, multiple   of the standard, Hz; the modulation is its multiple
    oscillator         local oscillator "above" or "below" the modulation
    intermediate_hz    at most 10 000 Hz
    samples_per_cycle, cycles   of a buffer: at most 65 536 samples, 100 000 a second
    wavelength_um      of the light in vacuum, µm
    temperature_c, pressure_hpa, humidity_percent   of the air, °C, hPa, %
    air_model          formula of the index: ciddor_hill1999, rueger1990, iag1999_closed or barrell_sears1963
    disturbance        signal of the modulation's frequency over the signal, 0 to 1, such as crosstalk
    excess_path        m, by which it travels farther, there and back; None: any phase
    range_rate         of a moving target, m/s

    Raises ArgumentError for a plan that converter or buffer cannot do; ValidityError outside the formulas' limits.

    >>> answer = frequencies(disturbance=0.001)
    >>> round(1e6 * answer.chain.disturbance.range_error, 1)
    15.9
    """
    from catseye.errors import ArgumentError
    from catseye.names import AIR_MODELS
    from catseye.reduction.detection.frequency_chain import frequency_chain

    if air_model not in AIR_MODELS:
        raise ArgumentError(f"air_model = {air_model!r} (expected one of {', '.join(AIR_MODELS)})", "air_model")
    side = {"above": "above", "below": "below"}.get(oscillator)
    if side is None:
        raise ArgumentError(f"oscillator = {oscillator!r} (expected above or below)", "oscillator")
    chain = frequency_chain(
        reference_hz=reference_hz,
        multiple=multiple,
        oscillator="above" if side == "above" else "below",
        intermediate_hz=intermediate_hz,
        samples_per_cycle=samples_per_cycle,
        cycles=cycles,
        wavelength_um=wavelength_um,
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        air_model=air_model,
        disturbance=disturbance,
        excess_path=excess_path,
        range_rate=range_rate,
    )
    return FrequenciesResult(
        verdict=chain.verdict,
        modulation_hz=chain.plan.modulation_hz,
        local_oscillator_hz=chain.local_oscillator_hz,
        half_wavelength=chain.half_wavelength,
        chain=chain,
    )
