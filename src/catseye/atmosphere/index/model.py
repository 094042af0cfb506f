"""Model of the index of air: dispersion, density and limits.

Every model here has the form n - 1 = dry(wavelength) D_dry(weather) + vapour(wavelength) D_vapour(weather). A model's
file gives the two dispersion formulas and the two densities with their slopes; this file derives the phase
index, the group index n + sigma dn/dsigma, and all derivatives, for all models.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from catseye.atmosphere.limit import ValidInterval
from catseye.names import AirModelName

Kind = Literal["group", "phase"]
CO2_OF_TODAY_PPM = 450.0  # ppm, [CIDDOR96]: air for comparing models without carbon dioxide
CO2_SLOPE = 0.534e-6  # of the dry refractivity for each ppm, [CIDDOR96] eq. 2


class IndexSensitivity(NamedTuple):
    """Derivatives of an index at constant relative humidity.

    The one by vapour pressure is at constant temperature and total pressure.

    temperature_c         per °C
    pressure_hpa          per hPa
    humidity_percent      per % of relative humidity
    vapour_pressure_hpa   per hPa of vapour pressure, temperature and total pressure held
    co2_ppm               per ppm of carbon dioxide; zero in a model whose carbon dioxide is fixed
    wavelength_um         per um of vacuum wavelength
    """

    temperature_c: Any
    pressure_hpa: Any
    humidity_percent: Any
    vapour_pressure_hpa: Any
    co2_ppm: Any
    wavelength_um: Any


class Partials(NamedTuple):
    """Derivatives of an index at constant vapour pressure.

    For a dew-point or wet-bulb instrument.

    temperature_c         per °C
    pressure_hpa          per hPa of total pressure
    vapour_pressure_hpa   per hPa of vapour pressure
    co2_ppm               per ppm of carbon dioxide; zero in a model whose carbon dioxide is fixed
    wavelength_um         per um of vacuum wavelength
    """

    temperature_c: Any
    pressure_hpa: Any
    vapour_pressure_hpa: Any
    co2_ppm: Any
    wavelength_um: Any

    def at_constant_humidity(self, saturation, humidity_percent) -> IndexSensitivity:
        """Convert to constant relative humidity by the chain rule, with `saturation` and its slopes."""
        fraction = np.asarray(humidity_percent, float) / 100.0
        return IndexSensitivity(
            self.temperature_c + self.vapour_pressure_hpa * fraction * saturation.per_c,
            self.pressure_hpa + self.vapour_pressure_hpa * fraction * saturation.per_hpa,
            self.vapour_pressure_hpa * saturation.pressure_hpa / 100.0,
            self.vapour_pressure_hpa,
            self.co2_ppm,
            self.wavelength_um,
        )


class Gases(NamedTuple):
    """One quantity for each gas.

    dry      of dry air
    vapour   of water vapour
    """

    dry: Any
    vapour: Any


class DensitySlopes(NamedTuple):
    """Derivatives of a gas's density factor, in its unit.

    temperature_c         per °C
    pressure_hpa          per hPa of total pressure, vapour pressure held
    vapour_pressure_hpa   per hPa of vapour pressure, total pressure held
    """

    temperature_c: Any
    pressure_hpa: Any
    vapour_pressure_hpa: Any


@dataclass(frozen=True)
class RefractiveDispersion:
    """Phase refractivity per unit of density as a function of s = 1/wavelength².

    Poles k/(a - s) and powers of s.

    poles    pairs (k, a), um^-2
    powers   coefficients of 1, s, s², ...
    scale    factor on all of them
    """

    poles: tuple[tuple[float, float], ...] = ()
    powers: tuple[float, ...] = ()
    scale: float = 1.0

    def phase(self, wavelength_um):
        """Phase refractivity per unit of density, at a vacuum wavelength in um."""
        s = np.asarray(wavelength_um, float) ** -2.0
        return self.scale * (sum(k / (a - s) for k, a in self.poles) + sum(c * s**i for i, c in enumerate(self.powers)))

    def group(self, wavelength_um):
        """Group refractivity per unit of density: f + 2 s df/ds.

        This is n + sigma dn/dsigma of each term.
        """
        s = np.asarray(wavelength_um, float) ** -2.0
        poles = sum(k * (a + s) / (a - s) ** 2 for k, a in self.poles)
        return self.scale * (poles + sum((2 * i + 1) * c * s**i for i, c in enumerate(self.powers)))

    def phase_per_um(self, wavelength_um):
        """Derivative of the phase refractivity by wavelength: ds = -2 s/wavelength dwavelength."""
        wavelength = np.asarray(wavelength_um, float)
        s = wavelength**-2.0
        poles = sum(k / (a - s) ** 2 for k, a in self.poles)
        powers = sum(i * c * s ** (i - 1) for i, c in enumerate(self.powers) if i)
        return -2.0 * self.scale * s / wavelength * (poles + powers)

    def group_per_um(self, wavelength_um):
        """Derivative of the group refractivity by wavelength."""
        wavelength = np.asarray(wavelength_um, float)
        s = wavelength**-2.0
        poles = sum(k * (3.0 * a + s) / (a - s) ** 3 for k, a in self.poles)
        powers = sum((2 * i + 1) * i * c * s ** (i - 1) for i, c in enumerate(self.powers) if i)
        return -2.0 * self.scale * s / wavelength * (poles + powers)


@dataclass(frozen=True)
class IndexModel:
    """Model of the index of air.

    name                   as users write it, and the stem of its file
    label                  in figures
    source                 the bibliography's keys
    dispersion             of each gas
    densities              function of (temperature_c, pressure_hpa, vapour_pressure_hpa) giving each gas's factor
    density_unit           of those factors
    density_slopes         function of the same giving each factor's DensitySlopes
    vapour_formula         the saturation formula it goes with, a name in `atmosphere.weather.humidity.FORMULAS`
    standard_uncertainty   of the formula in the group index of dry air, exact weather; the minimum
    vapour_uncertainty     increase per hPa of vapour, added in squares; see `uncertainty`
    standard               the better model this one is compared with; None: there is none
    limits                 argument's name -> Limit
    co2_ppm                carbon dioxide for which `dispersion` holds
    co2_slope              relative change per further ppm of the dry air's refractivity; 0: no such term
    is_compiled            True if a compiled form, `NAME_kernel.py`, stands beside its file
    """

    name: AirModelName
    label: str
    source: str
    dispersion: Gases
    densities: Callable[..., Gases]
    density_slopes: Callable[..., Gases]
    vapour_formula: str
    standard_uncertainty: float
    limits: dict[str, ValidInterval]
    co2_ppm: float
    co2_slope: float = 0.0
    vapour_uncertainty: float = 0.0
    standard: "IndexModel | None" = None
    density_unit: str = "hPa/K"
    is_compiled: bool = False

    def check(self, **arguments) -> None:
        """Raise ValidityError for the first argument outside its limit."""
        for argument, value in arguments.items():
            self.limits[argument].check(value)

    def uncertainty(
        self, temperature_c, pressure_hpa, vapour_pressure_hpa, *, wavelength_um=0.780, co2_ppm=CO2_OF_TODAY_PPM
    ):
        """Standard uncertainty of the formula in the group index, exact weather.

        co2_ppm   carbon dioxide of the air: a model without it is biased by the difference

        With a standard: the difference of the two in this weather and the standard's uncertainty, in squares, but never
        less than `standard_uncertainty`, as a crossing of the two proves nothing. Nothing is checked.
        """
        weather, light = (temperature_c, pressure_hpa, vapour_pressure_hpa), {"wavelength_um": wavelength_um}
        if self.standard is not None:
            off = self.refractivity(*weather, **light, co2_ppm=self.co2_ppm)
            off = off - self.standard.refractivity(*weather, **light, co2_ppm=co2_ppm)
            return np.maximum(self.standard_uncertainty, np.hypot(self.standard.standard_uncertainty, off))
        least: Any = self.standard_uncertainty
        if self.vapour_uncertainty:
            least = np.hypot(least, self.vapour_uncertainty * np.asarray(vapour_pressure_hpa, float))
        if self.co2_slope or not np.any(np.asarray(co2_ppm) != CO2_OF_TODAY_PPM):
            return least
        lacking = CO2_SLOPE * (np.asarray(co2_ppm, float) - CO2_OF_TODAY_PPM)
        return np.hypot(least, lacking * self.refractivity(*weather, **light, co2_ppm=self.co2_ppm))

    def coefficients(self, wavelength_um, co2_ppm, kind: Kind = "group") -> Gases:
        """Refractivity of each gas per unit of its density factor."""
        dry, vapour = (getattr(gas, kind)(wavelength_um) for gas in self.dispersion)
        return Gases(dry * self._carbon_dioxide(co2_ppm), vapour)

    def refractivity(
        self, temperature_c, pressure_hpa, vapour_pressure_hpa, *, wavelength_um, co2_ppm, kind: Kind = "group"
    ):
        """Index of air minus one, without checks."""
        dry, vapour = self.coefficients(wavelength_um, co2_ppm, kind)
        density = self.densities(temperature_c, pressure_hpa, vapour_pressure_hpa)
        return dry * density.dry + vapour * density.vapour

    def partials(
        self, temperature_c, pressure_hpa, vapour_pressure_hpa, *, wavelength_um, co2_ppm, kind: Kind = "group"
    ) -> Partials:
        """Derivatives of the index at constant vapour pressure, without checks.

        Exact for the formula.
        """
        weather = (temperature_c, pressure_hpa, vapour_pressure_hpa)
        dry, vapour = self.coefficients(wavelength_um, co2_ppm, kind)
        per_um = Gases(*(getattr(gas, f"{kind}_per_um")(wavelength_um) for gas in self.dispersion))
        density, slopes = self.densities(*weather), self.density_slopes(*weather)
        carbon_dioxide = self._carbon_dioxide(co2_ppm)
        by_t, by_p, by_e = (dry * a + vapour * b for a, b in zip(slopes.dry, slopes.vapour, strict=True))
        return Partials(
            temperature_c=by_t,
            pressure_hpa=by_p,
            vapour_pressure_hpa=by_e,
            co2_ppm=self.co2_slope / carbon_dioxide * dry * density.dry,
            wavelength_um=per_um.dry * carbon_dioxide * density.dry + per_um.vapour * density.vapour,
        )

    def _carbon_dioxide(self, co2_ppm):
        return 1.0 + self.co2_slope * (np.asarray(co2_ppm, float) - self.co2_ppm)
