"""Comparison of two records of one quantity.

Barometers, hygrometers, a typed distance and the coordinates of its ends. A disagreement accuses one of the two only
where something decides between them: a pressure that, reduced to sea level by the standard air, weather has never
reached.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from catseye.atmosphere.weather.barometer import carried_pressure
from catseye.atmosphere.weather.humidity import relative_humidity_percent, vapour_pressure_hpa
from catseye.constants import MILLIMETRE
from catseye.records.night.campaign import ObservedSite

SURE = 5.0  # standard uncertainties of a difference beyond which two records disagree
U_BAROMETER_HPA = 0.3  # chosen: an electronic barometer some years after its certificate
U_HYGROMETER_PERCENT = 3.0  # chosen: a capacitive sensor in the open
U_AIR_C, U_LAPSE_C_PER_M = 1.0, 0.02  # chosen: of the layer between two stations; a clear night's inversion
U_WAVE_HPA = 0.5  # amplitude of pressure waves that cross a site, the largest usual: Stull (1988) chapter 12
U_DEW_POINT_C = 1.0  # chosen: of the air at one station against another's, some 6.5 % of its vapour
VAPOUR_PER_C = 0.065  # relative change of saturation pressure a degree, near 15 °C
SEA_LEVEL_HPA = (870.0, 1085.0)  # lowest and highest observed pressure at sea level: [WMOARC25]
UNITS, NEAR = {"millimetres": 1e-3, "feet": 0.3048, "centimetres": 1e-2}, 0.01  # m; tolerance of a ratio
STANDARD_C, STANDARD_LAPSE = 15.0, 0.0065  # °C at sea level, °C/m: [ICAO93]


@dataclass(frozen=True, eq=False)
class StationSeries:
    """Readings of a weather station.

    elevation_m   above the sea, with u_elevation_m
    mjd           (n,) UTC, rising
    temperature_c, pressure_hpa, humidity_percent   (n,)
    u_pressure_hpa, u_humidity_percent   of the sensors' offsets
    """

    name: str
    elevation_m: float
    mjd: np.ndarray
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    u_elevation_m: float = 1.0
    u_pressure_hpa: float = U_BAROMETER_HPA
    u_humidity_percent: float = U_HYGROMETER_PERCENT


@dataclass(frozen=True)
class Disagreement:
    """Two records that cannot both be right.

    what          "barometers" and so on
    first, second   their names
    difference, u   first less second, in the unit
    unit          of both
    accused       the one that is wrong; "" where nothing decides
    reason        of the accusation, or of its absence
    """

    what: str
    first: str
    second: str
    difference: float
    u: float
    unit: str
    accused: str
    reason: str

    @property
    def text(self) -> str:
        """The disagreement as a note.

        >>> Disagreement("barometers", "WX1", "WX2", 86.04, 0.8, "hPa", "", "nothing decides").text
        'the barometers of WX1 and WX2 disagree by 86 hPa (u 0.8 hPa): nothing decides'
        """
        size = f"{abs(self.difference):.3g} {self.unit} (u {self.u:.2g} {self.unit})"
        return f"the {self.what} of {self.first} and {self.second} disagree by {size}: {self.reason}"


def station_series(campaign: ObservedSite) -> list[StationSeries]:
    """Readings of each of a campaign's stations that has any."""
    weather = campaign.weather
    names, series = np.array(weather.station), []
    for station in campaign.site.weather_station:
        rows = names == station.name
        if rows.any():
            series.append(
                StationSeries(
                    name=station.name,
                    elevation_m=station.elevation_m,
                    mjd=weather.mjd_utc[rows],
                    temperature_c=weather.temperature_c[rows],
                    pressure_hpa=weather.pressure_hpa[rows],
                    humidity_percent=weather.humidity_percent[rows],
                )
            )
    return series


def weather_disagreements(stations: Sequence[StationSeries]) -> tuple[Disagreement, ...]:
    """Contradictory barometers and hygrometers of each two stations.

    Over the time that both cover.
    """
    result = []
    for first, second in combinations(stations, 2):
        pair = simultaneous(first, second)
        if pair is not None:
            result += [conflict for conflict in (barometers(*pair), _hygrometers(*pair)) if conflict is not None]
    return tuple(result)


def distance_disagreement(
    names: tuple[str, str], typed: float, u_typed: float, *, ends: np.ndarray, covariance: np.ndarray
) -> Disagreement | None:
    """Contradiction of a typed distance and its ends' coordinates.

    None where both may be right.

    names        of the ends
    typed        m, with u_typed
    ends         (2, 3) m
    covariance   (6, 6) m², of both ends
    """
    span = np.asarray(ends[0], dtype=float) - np.asarray(ends[1], dtype=float)
    length = float(np.linalg.norm(span))
    along = np.concatenate([span, -span]) / length if length > 0.0 else np.zeros(6)
    u = float(np.sqrt(u_typed**2 + along @ covariance @ along))
    difference = typed - length
    if not abs(difference) > SURE * u:
        return None
    reason = _factor(typed / length if length > 0.0 else np.inf)
    first, second = names
    return Disagreement(
        what="typed distance and coordinates",
        first=first,
        second=second,
        difference=difference / MILLIMETRE,
        u=u / MILLIMETRE,
        unit="mm",
        accused="",
        reason=reason,
    )


def _factor(ratio: float) -> str:
    """Likely cause of a ratio of two lengths, as a text."""
    for text, value in UNITS.items():
        if min(abs(ratio / value - 1.0), abs(ratio * value - 1.0)) < NEAR:
            return f"one looks like {text}, the other like metres"
    return "undecided which is wrong"


def simultaneous(first: StationSeries, second: StationSeries) -> tuple[StationSeries, StationSeries] | None:
    """Both series at the times of the first within the second's.

    None without such times.
    """
    inside = (first.mjd >= second.mjd.min()) & (first.mjd <= second.mjd.max())
    if not inside.any():
        return None
    when = first.mjd[inside]
    columns = ("temperature_c", "pressure_hpa", "humidity_percent")
    first_columns = {name: getattr(first, name)[inside] for name in columns}
    second_columns = {name: np.interp(when, second.mjd, getattr(second, name)) for name in columns}
    return replace(first, mjd=when, **first_columns), replace(second, mjd=when, **second_columns)


def barometers(first: StationSeries, second: StationSeries) -> Disagreement | None:
    """Contradiction of two barometers.

    The first's pressure reduced to the second's elevation, against its reading there.
    """
    reduced_pressure = carried_pressure(
        first.pressure_hpa, first.temperature_c, first.elevation_m, z_to=second.elevation_m,
        lapse_c_per_m=STANDARD_LAPSE,
    )  # fmt: skip
    u_rise = float(np.hypot(first.u_elevation_m, second.u_elevation_m))
    spread = reduced_pressure.standard_uncertainty_hpa(
        first.u_pressure_hpa, u_temperature_c=U_AIR_C, u_lapse=U_LAPSE_C_PER_M, u_rise=u_rise
    )
    u = float(np.sqrt(np.mean(spread**2) + second.u_pressure_hpa**2 + U_WAVE_HPA**2))
    difference = float(np.mean(reduced_pressure.pressure_hpa - second.pressure_hpa))
    if not abs(difference) > SURE * u:
        return None
    reduced = {
        station.name: sea_level_pressure(float(np.mean(station.pressure_hpa)), station.elevation_m)
        for station in (first, second)
    }
    impossible = [name for name, p in reduced.items() if not SEA_LEVEL_HPA[0] <= p <= SEA_LEVEL_HPA[1]]
    if len(impossible) == 1:
        reason = (
            f"{impossible[0]}'s is wrong, or its elevation: reduced to sea level it is "
            f"{reduced[impossible[0]]:.0f} hPa, outside the observed {SEA_LEVEL_HPA[0]:.0f} to {SEA_LEVEL_HPA[1]:.0f}"
        )
        return Disagreement(
            what="barometers",
            first=first.name,
            second=second.name,
            difference=difference,
            u=u,
            unit="hPa",
            accused=impossible[0],
            reason=reason,
        )
    reason = "their heights and standard air do not decide which is wrong"
    return Disagreement(
        what="barometers",
        first=first.name,
        second=second.name,
        difference=difference,
        u=u,
        unit="hPa",
        accused="",
        reason=reason,
    )


def sea_level_pressure(pressure_hpa: float, elevation_m: float) -> float:
    """Pressure reduced to sea level by the standard atmosphere, hPa.

    >>> round(sea_level_pressure(920.0, 804.0), 1)
    1012.9
    """
    here_c = STANDARD_C - STANDARD_LAPSE * elevation_m
    return float(carried_pressure(pressure_hpa, here_c, elevation_m, z_to=0.0).pressure_hpa)


def _hygrometers(first: StationSeries, second: StationSeries) -> Disagreement | None:
    """Contradiction of two hygrometers.

    The first's vapour, its share of the air kept, as relative humidity in the second's air.
    """
    vapour = vapour_pressure_hpa(first.temperature_c, first.pressure_hpa, first.humidity_percent)
    # by the standard air, not the barometers: they may be wrong themselves
    reduced_pressure = carried_pressure(
        first.pressure_hpa, first.temperature_c, first.elevation_m, z_to=second.elevation_m
    )
    vapour_at_second = vapour * reduced_pressure.pressure_hpa / first.pressure_hpa
    expected = relative_humidity_percent(vapour_at_second, second.temperature_c, reduced_pressure.pressure_hpa)
    gain = expected / np.maximum(first.humidity_percent, 1.0)
    natural = VAPOUR_PER_C * U_DEW_POINT_C * np.maximum(expected, second.humidity_percent)
    u = float(np.sqrt(np.mean((gain * first.u_humidity_percent) ** 2 + natural**2) + second.u_humidity_percent**2))
    difference = float(np.mean(expected - second.humidity_percent))
    if not abs(difference) > SURE * u:
        return None
    reason = "in the same air both cannot be right; undecided which is wrong"
    return Disagreement(
        what="hygrometers",
        first=first.name,
        second=second.name,
        difference=difference,
        u=u,
        unit="%",
        accused="",
        reason=reason,
    )
