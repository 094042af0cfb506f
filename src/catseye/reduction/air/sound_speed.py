"""Speed of sound by weather, beside the other formulas, the notes' misprint and dispersion."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from numpy.typing import ArrayLike

from catseye.atmosphere.sound import parker2004
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.speed import MODELS, Sound, sound
from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.errors import ValidityError
from catseye.reduction.air.stated import stated_inputs, uncertainty_words
from catseye.verdict import Verdict

FREQUENCIES_HZ = (1e3, 10e3)  # range of loudspeakers


class MisprintCost(NamedTuple):
    """Effect of the notes' misprinted ratio of specific heats of water.

    printed, right               the ratio
    slow_by                      of the speed, m/s
    temperature_read_high_by_c   of a thermometer by that speed, °C
    """

    printed: float
    right: float
    slow_by: ArrayLike
    temperature_read_high_by_c: ArrayLike


class FrequencyExcess(NamedTuple):
    """Speeds at a frequency above the one at zero frequency, m/s."""

    frequency_hz: float
    phase_excess: ArrayLike
    group_excess: ArrayLike


@dataclass(frozen=True, eq=False)
class SoundSpeed:
    """Speed of sound by weather; arrays have the inputs' broadcast shape.

    state      of the sound
    temperature_c, pressure_hpa, humidity_percent   the weather; relative humidity over liquid water
    co2_ppm    carbon dioxide, where the formula has it
    u          standard uncertainty of the speed, of formula and inputs, m/s
    stated     inputs whose uncertainty u includes, of `stated_inputs`
    """

    state: Sound
    temperature_c: ArrayLike
    pressure_hpa: ArrayLike
    humidity_percent: ArrayLike
    co2_ppm: ArrayLike
    u: ArrayLike
    stated: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """Verdict on the formula's limits, humidity and contributions of the uncertainty."""
        within = Verdict("good", f"within the limits of {self.state.model}; {uncertainty_words(self.stated)}")
        return within.hearing(humidity_doubts(self.humidity_percent))

    @cached_property
    def by_formula(self) -> Mapping[str, "Sound | ValidityError"]:
        """State by every formula, or the error outside its limits."""
        states: dict[str, Sound | ValidityError] = {}
        for name in MODELS:
            try:
                states[name] = sound(
                    self.temperature_c, self.pressure_hpa, self.humidity_percent, model=name, co2_ppm=self.co2_ppm
                )
            except ValidityError as problem:
                states[name] = problem
        return states

    @property
    def misprint(self) -> MisprintCost:
        """Effect of the notes' misprinted ratio of specific heats of water."""
        weather = (self.temperature_c, self.pressure_hpa, self.state.vapour_pressure_hpa)
        printed = parker2004.speed(*weather)
        right = parker2004.speed(*weather, gamma_water=parker2004.GAMMA_VAPOUR)
        per_c = parker2004.partials(*weather).temperature_c
        slow_by = right - printed
        return MisprintCost(parker2004.GAMMA_WATER, parker2004.GAMMA_VAPOUR, slow_by, slow_by / per_c)

    @property
    def dispersion(self) -> tuple[FrequencyExcess, ...]:
        """Speeds at the frequencies of loudspeakers above the one at zero frequency."""
        excesses = []
        for frequency in FREQUENCIES_HZ:
            share = dispersion(
                self.temperature_c, self.pressure_hpa, self.state.vapour_pressure_hpa, frequency_hz=frequency
            )
            excesses.append(FrequencyExcess(frequency, share.phase * self.state.speed, share.group * self.state.speed))
        return tuple(excesses)


def sound_by_weather(  # noqa: PLR0913 - a state with the uncertainty of each input
    temperature_c: ArrayLike,
    pressure_hpa: ArrayLike,
    humidity_percent: ArrayLike,
    *,
    model: str = "parker2004",
    co2_ppm: ArrayLike = 450.0,
    u_temperature_c: ArrayLike = 0.0,
    u_pressure_hpa: ArrayLike = 0.0,
    u_humidity_percent: ArrayLike = 0.0,
    u_co2_ppm: ArrayLike = 0.0,
) -> SoundSpeed:
    """Speed of sound by weather.

    temperature_c, pressure_hpa, humidity_percent   °C, hPa, % over liquid water
    model     a name in `atmosphere.sound.speed.MODELS`
    co2_ppm   carbon dioxide, ppm, where the model has it
    u_...     standard uncertainties

    Raises ValidityError where a value is outside the range of the formula.

    >>> round(float(sound_by_weather(20.0, 933.0, 50.0).state.speed), 3)
    343.577
    """
    state = sound(temperature_c, pressure_hpa, humidity_percent, model=model, co2_ppm=co2_ppm)
    return SoundSpeed(
        state=state,
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        co2_ppm=co2_ppm,
        u=state.combined_uncertainty(u_temperature_c, u_pressure_hpa, u_humidity_percent, u_co2_ppm),
        stated=stated_inputs(
            temperature=u_temperature_c, pressure=u_pressure_hpa, humidity=u_humidity_percent, carbon_dioxide=u_co2_ppm
        ),
    )
