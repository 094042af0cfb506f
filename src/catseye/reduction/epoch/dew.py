"""Risk of dew or frost on retroreflectors and mirrors, by weather stations.

[PARKER04] section 1.4.1: dew on the retroreflectors reduces the reflected power. The temperature of the glass decides,
which under a clear sky is some kelvin below the air's and is in no weather file: it is an argument here, as measured
or as a difference to the air (`condensation.radiative_depression_k` gives a cautious estimate of it).
"""

from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.weather.condensation import Condensation, CondensationSpread, condensation
from catseye.constants import SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import utc_text
from catseye.records.night.campaign import ObservedSite

LONGEST_GAP = 900.0  # s, longest gap between joined readings of a surface, or between samples at risk of one spell
LEAST_PROBABILITY = 0.1  # of a deposit: the user should check


@dataclass(frozen=True, eq=False)
class SurfaceTemperature:
    """A surface's measured temperature.

    mjd_utc         (n,) rising
    temperature_c   (n,) °C
    """

    mjd_utc: np.ndarray
    temperature_c: np.ndarray


@dataclass(frozen=True)
class Spell:
    """Time at risk near one weather station.

    station           its name
    start_mjd_utc     first sample at risk
    end_mjd_utc       last sample at risk
    worst_mjd_utc     sample with the smallest margin
    margin_k          there: surface less dew or frost point, K
    u_margin_k        its standard uncertainty, K
    threshold_c       dew or frost point there, °C
    threat            "dew" or "frost"
    probability       largest during the spell, that a deposit forms
    """

    station: str
    start_mjd_utc: float
    end_mjd_utc: float
    worst_mjd_utc: float
    margin_k: float
    u_margin_k: float
    threshold_c: float
    threat: str
    probability: float

    def line(self) -> str:
        """Spell as one line of text."""
        side = "below" if self.margin_k < 0.0 else "above"
        worst = (
            f"{abs(self.margin_k):.1f} K {side} the {self.threat} point of {self.threshold_c:.1f} °C "
            f"(± {self.u_margin_k:.1f} K), probability up to {100.0 * self.probability:.0f} %"
        )
        start, end = utc_text(self.start_mjd_utc), utc_text(self.end_mjd_utc)
        if start == end:
            return f"{self.threat} on targets near {self.station} at {start}: {worst}"
        return (
            f"{self.threat} on targets near {self.station} from {start} to {end}: "
            f"at worst, {utc_text(self.worst_mjd_utc)}, {worst}"
        )


@dataclass(frozen=True, eq=False)
class DewRisk:
    """Margins of a surface at every weather sample, with notes.

    mjd_utc        (n,) time of the weather sample
    station        (n,) names
    condensation   effect of the air at the surface's temperature; margin and probability nan where that is unknown
    spells         times at risk, in order
    notes          one line per spell, and samples that could not be judged
    """

    mjd_utc: np.ndarray
    station: tuple[str, ...]
    condensation: Condensation
    spells: tuple[Spell, ...]
    notes: tuple[str, ...]


def dew_risk(
    campaign: ObservedSite,
    *,
    surface_minus_air_c: float | None = None,
    surface: SurfaceTemperature | None = None,
    u_surface_c: float = 1.0,
    u_temperature_c: float = 0.3,
    u_humidity_percent: float = 3.0,
    least_probability: float = LEAST_PROBABILITY,
) -> DewRisk:
    """Risk of dew and frost during a campaign.

    surface_minus_air_c   surface less air, °C; below zero under a clear night sky
    surface               or its measured temperature, interpolated between readings at most 900 s apart
    u_surface_c           standard uncertainty of the difference, or of the measured temperature, °C
    u_temperature_c       of a station's thermometer, °C: affects a surface typed as a difference, and the dew point
    u_humidity_percent    of a station's hygrometer, %
    least_probability     of a deposit above which a sample is at risk, 0 to 1

    Raises InputError unless exactly one of the two temperatures is present, and for readings out of order.
    Source: [PARKER04] section 1.4.1.
    """
    if (surface is None) == (surface_minus_air_c is None):
        raise InputError("dew: give either surface_minus_air_c or the measured surface temperature, and not both")
    weather = campaign.weather
    covariance = 0.0
    if surface is None:
        temperature = weather.temperature_c + surface_minus_air_c
        u_surface_c, covariance = float(np.hypot(u_surface_c, u_temperature_c)), u_temperature_c**2
    else:
        temperature = _between(surface, weather.mjd_utc)
    finite = np.isfinite(temperature)
    state = condensation(
        np.where(finite, temperature, weather.temperature_c),
        weather.temperature_c,
        weather.pressure_hpa,
        humidity_percent=weather.humidity_percent,
        u=CondensationSpread(
            surface_c=u_surface_c,
            temperature_c=u_temperature_c,
            humidity_percent=u_humidity_percent,
            covariance_c2=covariance,
        ),
    )
    state = state._replace(
        margin_k=np.where(finite, state.margin_k, np.nan),
        deposit=np.where(finite, state.deposit, "unknown"),
        probability=np.where(finite, state.probability, np.nan),
    )
    station = np.array(weather.station)
    at_risk = finite & (state.probability >= least_probability)
    spells = [
        _spell(name, rows, weather.mjd_utc, state)
        for name in sorted(set(weather.station))
        for rows in _stretches(np.flatnonzero((station == name) & at_risk), weather.mjd_utc)
    ]
    spells.sort(key=lambda spell: (spell.start_mjd_utc, spell.station))
    notes = [spell.line() for spell in spells]
    if not finite.all():
        notes.append(
            f"dew: surface temperature unknown at {np.count_nonzero(~finite)} of {len(finite)} weather samples "
            f"(readings over {LONGEST_GAP:.0f} s apart, or starting later or ending earlier); they are not judged"
        )
    return DewRisk(weather.mjd_utc, weather.station, state, tuple(spells), tuple(notes))


def _between(surface: SurfaceTemperature, mjd_utc: np.ndarray) -> np.ndarray:
    """Linear interpolation of the readings; nan outside them and in gaps."""
    when, values = np.asarray(surface.mjd_utc, float), np.asarray(surface.temperature_c, float)
    if when.ndim != 1 or when.shape != values.shape or len(when) == 0:
        raise InputError(f"dew: {when.shape} times and {values.shape} surface temperatures do not pair up")
    bad = np.flatnonzero(np.diff(when) <= 0.0)
    if len(bad):
        raise InputError(
            f"dew: reading {bad[0] + 2} of the surface is not after the one before (expected rising times)"
        )
    after = np.clip(np.searchsorted(when, mjd_utc), 0, len(when) - 1)
    before = np.where(when[after] == mjd_utc, after, np.maximum(after - 1, 0))
    inside = (when[0] <= mjd_utc) & (mjd_utc <= when[-1])
    close = (when[after] - when[before]) * SECONDS_PER_DAY <= LONGEST_GAP
    return np.where(inside & close, np.interp(mjd_utc, when, values), np.nan)


def _stretches(marked: np.ndarray, mjd_utc: np.ndarray) -> list[np.ndarray]:
    """Rows of one station at risk, split at long gaps.

    The scatter of readings makes no new spell.
    """
    if len(marked) == 0:
        return []
    return np.split(marked, np.flatnonzero(np.diff(mjd_utc[marked]) * SECONDS_PER_DAY > LONGEST_GAP) + 1)


def _spell(station: str, rows: np.ndarray, mjd_utc: np.ndarray, state: Condensation) -> Spell:
    worst = rows[np.argmin(state.margin_k[rows])]
    return Spell(
        station=station,
        start_mjd_utc=float(mjd_utc[rows[0]]),
        end_mjd_utc=float(mjd_utc[rows[-1]]),
        worst_mjd_utc=float(mjd_utc[worst]),
        margin_k=float(state.margin_k[worst]),
        u_margin_k=float(state.u_margin_k[worst]),
        threshold_c=float(state.threshold_c[worst]),
        threat=str(state.threat[worst]),
        probability=float(state.probability[rows].max()),
    )
