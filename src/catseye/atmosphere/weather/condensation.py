"""Dew or frost on retroreflectors and mirrors: margin and probability.

A surface collects water when the air at its temperature would be more than saturated: over liquid water at or above
0 °C, over ice below. Air whose dew point is above 0 °C leaves dew first; drier air leaves frost, and does so earlier
than its dew point says, for the frost point is the higher of the two. Clean glass may stay clear some kelvin below the
frost point for lack of nuclei: this is the temperature at which a deposit becomes possible, a conservative limit.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catseye.atmosphere.limit import ValidInterval
from catseye.atmosphere.weather import humidity
from catseye.constants import ZERO_CELSIUS_K
from catseye.errors import ValidityError

STEFAN_BOLTZMANN = 5.670_374_419e-8  # W/(m² K⁴), exact in the SI to these digits
# [BERDAHL84]: emissivity of a clear sky by dew point over 100 °C, then its swing about midnight and with the pressure
SKY = (0.711, 0.56, 0.73)
SKY_MIDNIGHT, SKY_PER_HPA = 0.013, 0.00012
STILL_AIR, PER_WIND = 2.8, 3.0  # [WATMUFF77]: W/(m² K), and per m/s of wind
SURFACE = ValidInterval("surface temperature", "°C", -100.0, 100.0, "saturation over water and ice")
WIND = ValidInterval("wind", "m/s", 0.0, 7.0, "[WATMUFF77]")
SKY_EMISSIVITY = ValidInterval("emissivity of the sky", "(ratio)", 0.0, 1.0, "[BERDAHL84]")
EMISSIVITY = ValidInterval("emissivity", "(ratio)", 0.0, 1.0, "the definition of emissivity")
SKY_VIEW = ValidInterval("view of the sky", "(ratio)", 0.0, 1.0, "the definition of a share")
STEPS = 20


class Condensation(NamedTuple):
    """Condensation on surfaces.

    margin_k         surface less threshold, K: below zero a deposit grows; inf in perfectly dry air
    threshold_c      dew point, or frost point where frost comes first, °C; nan in perfectly dry air
    threat           which deposit the surface would collect first on cooling: "dew", "frost" or "none" (dry air)
    deposit          which it collects now: "none", "dew", or below 0 °C "frost"
    u_margin_k       standard uncertainty of the margin, K
    probability      that the margin is below zero
    """

    margin_k: Any
    threshold_c: Any
    threat: Any
    deposit: Any
    u_margin_k: Any
    probability: Any

    def lines(self) -> list[str]:
        """Text lines, one a surface, in the order of the arrays."""
        columns = (np.atleast_1d(value).ravel() for value in self)
        return [_line(*(value.item() for value in row)) for row in zip(*columns, strict=True)]


@dataclass(frozen=True, eq=False)
class CondensationSpread:
    """Standard uncertainties of the inputs of condensation; numbers or arrays.

    surface_c          of the surface's temperature, °C
    temperature_c      of the air's, °C
    humidity_percent   of the relative humidity, %
    covariance_c2      covariance of both temperatures, °C²: temperature_c² where the surface was taken as the air's
                       temperature plus an offset
    """

    surface_c: ArrayLike = 0.0
    temperature_c: ArrayLike = 0.0
    humidity_percent: ArrayLike = 0.0
    covariance_c2: ArrayLike = 0.0


EXACT = CondensationSpread()


def condensation(surface_c, temperature_c, pressure_hpa, *, humidity_percent, u=EXACT, formula="buck") -> Condensation:
    """Margin of surfaces to dew or frost point, with probability of deposit.

    surface_c            temperature of the surface, -100 to 100 °C
    temperature_c        air temperature, -100 to 100 °C
    pressure_hpa         total pressure, 100 to 1400 hPa
    humidity_percent     relative humidity over liquid water, 0 to 100 %
    u                    standard uncertainties, a `CondensationSpread`
    formula              of saturation, `buck` or `iapws`

    The margin is taken to be normal: with u of humidity below a third of the humidity the probability is within
    0.02 of a Monte Carlo. Where the dew point is 0 °C u_margin_k is up to 6 % too large: a frost point moves a tenth
    less with humidity. Without uncertainties the probability is 0 or 1.
    Raises ValidityError outside these limits, for an uncertainty below zero, and for a covariance above u u.
    Source: [PARKER04] section 1.4.1 with eqs. 1.3, 1.4, 1.7; [JCGM100] eq. 13.

    >>> risk = condensation(5.0, 10.0, 933.0, humidity_percent=75.0, u=CondensationSpread(surface_c=0.5))
    >>> round(float(risk.margin_k), 2), str(risk.deposit), round(float(risk.probability), 2)
    (-0.78, 'dew', 0.94)
    """
    SURFACE.check(surface_c)
    humidity.AIR_TEMPERATURE.check(temperature_c)
    humidity.PRESSURE.check(pressure_hpa)
    humidity.HUMIDITY.check(humidity_percent)
    u_s, u_t, u_h, covariance = (
        np.asarray(v, float) for v in (u.surface_c, u.temperature_c, u.humidity_percent, u.covariance_c2)
    )
    _refuse_uncertainties(u_s, u_t, u_h, covariance)
    surface, p = np.asarray(surface_c, float), np.asarray(pressure_hpa, float)
    air, share = humidity.saturation(temperature_c, p, formula), np.asarray(humidity_percent, float) / 100.0
    e = share * air.pressure_hpa
    dew, frost = humidity.dew_point_c(e, p, formula), humidity.frost_point_c(e, p, formula)
    threshold = np.where(dew >= 0.0, dew, frost)
    dry = np.isnan(threshold)
    margin = np.where(dry, np.inf, surface - threshold)
    slope = _slope_hpa_per_c(np.where(dry, 0.0, threshold), dew >= 0.0, p, formula)
    per_t, per_h = share * air.per_c / slope, air.pressure_hpa / 100.0 / slope
    variance = u_s**2 + (per_t * u_t) ** 2 + (per_h * u_h) ** 2 - 2.0 * per_t * covariance
    u_margin = np.sqrt(np.maximum(np.where(dry, 0.0, variance), 0.0))  # rounding: a full correlation may give -1e-17
    threat = np.where(dry, "none", np.where(dew >= 0.0, "dew", "frost"))
    deposit = np.where(margin < 0.0, np.where(surface < 0.0, "frost", "dew"), "none")
    answer = np.broadcast_arrays(margin, threshold, threat, deposit, u_margin, _below_zero(margin, u_margin))
    return Condensation(*(column[()] for column in answer))


def radiative_depression_k(temperature_c, dew_point_c, pressure_hpa=1000.0, *, wind=1.0, emissivity=0.9, sky_view=1.0):
    """Radiative cooling of a surface below the air, K, under clear midnight sky.

    An estimate for planning.

    temperature_c   air temperature, -40 to 50 °C
    dew_point_c     dew point over water, -40 °C to the air's temperature; the sky was fitted from -13 to 24 °C, and
                    where the fit passes a black body's emissivity (34 °C at 1000 hPa) it is refused
    pressure_hpa    total pressure, 100 to 1400 hPa
    wind            along the surface, 0 to 7 m/s
    emissivity      of the surface in the thermal infrared: 0.9 for glass, 0.03 for bare gold
    sky_view        share of the hemisphere that is sky, 0 to 1; the rest is taken to be as warm as the air

    Radiation lost equals heat gained from the air: eps V sigma (T_s⁴ - eps_sky T_a⁴) + eps (1 - V) sigma (T_s⁴ - T_a⁴)
    = h (T_a - T_s). Heat conducted by the mount and the heat of the deposit itself warm the surface further: a thin,
    insulated plate is this cold, a heavy prism in a housing is not. Good to a third of itself at best. Not valid by day
    and under cloud.
    Raises ValidityError outside these limits. Newton's method, at most 20 steps.
    Source: [BERDAHL84] (clear sky), [WATMUFF77] (h = 2.8 + 3.0 wind).

    >>> round(float(radiative_depression_k(10.0, 5.0, 933.0, wind=1.0)), 1)
    8.1
    """
    t, dew = np.asarray(temperature_c, float), np.asarray(dew_point_c, float)
    ValidInterval("temperature", "°C", -40.0, 50.0, "[BERDAHL84]").check(t)
    ValidInterval("dew point", "°C", -40.0, 50.0, "[BERDAHL84]").check(dew)
    humidity.PRESSURE.check(pressure_hpa)
    WIND.check(wind)
    EMISSIVITY.check(emissivity)
    SKY_VIEW.check(sky_view)
    if np.any(dew > t):
        raise ValidityError(
            f"dew point {float(np.max(dew - t)):g} °C above the air's temperature; the air is at most saturated"
        )
    kelvin, share = t + ZERO_CELSIUS_K, dew / 100.0
    sky = SKY[0] + SKY[1] * share + SKY[2] * share**2 + SKY_MIDNIGHT + SKY_PER_HPA * (np.asarray(pressure_hpa) - 1000.0)
    SKY_EMISSIVITY.check(sky)
    received = kelvin**4 * (sky_view * sky + (1.0 - np.asarray(sky_view, float)))
    radiates = np.asarray(emissivity, float) * STEFAN_BOLTZMANN
    h = STILL_AIR + PER_WIND * np.asarray(wind, float)
    surface = kelvin + 0.0 * (received + h + radiates)
    for _ in range(STEPS):
        # the loss rises and bends upwards with the surface's temperature, so that Newton comes down on the root
        loss = radiates * (surface**4 - received) - h * (kelvin - surface)
        surface = surface - loss / (4.0 * radiates * surface**3 + h)
    return kelvin - surface


def _slope_hpa_per_c(threshold_c, dew, p, formula):
    over_ice = humidity.ICE_FORMULAS[formula](np.minimum(threshold_c, humidity.MELTING_C), p).per_c
    return np.where(dew, humidity.saturation(threshold_c, p, formula).per_c, over_ice)


def _below_zero(margin, u):
    """Probability that a normal margin is below zero; a step where u is 0."""
    from scipy.special import ndtr

    exact = u == 0.0
    ratio = np.where(exact, np.where(margin < 0.0, np.inf, -np.inf), -margin / np.where(exact, 1.0, u))
    return ndtr(ratio)


def _refuse_uncertainties(u_surface, u_temperature, u_humidity, covariance) -> None:
    named = {"u_surface_c": u_surface, "u_temperature_c": u_temperature, "u_humidity_percent": u_humidity}
    for name, u in named.items():
        if not np.all(u >= 0.0) or not np.all(np.isfinite(u)):
            raise ValidityError(f"{name} = {float(np.min(u)):g} is invalid as a standard uncertainty; give 0 or more")
    if not np.all(np.abs(covariance) <= u_surface * u_temperature * (1.0 + 1e-12)):
        raise ValidityError("covariance_c2 is larger than u_surface_c u_temperature_c; no correlation exceeds 1")


def _line(margin, threshold, threat, deposit, u, probability) -> str:
    if threat == "none":
        return "clear: the air has no vapour"
    point = f"the {threat} point, {threshold:.1f} °C"
    if u > 0.0:
        point = f"{point}, ± {u:.{'1f' if u >= 0.1 else '1g'}} K; {100.0 * probability:.0f} % probable"
    side = "below" if margin < 0.0 else "above"
    return f"{'clear' if deposit == 'none' else deposit}: {abs(margin):.1f} K {side} {point}"
