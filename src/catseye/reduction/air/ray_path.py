"""Air along a path between two points: profile in height, mean index, bent ray, with uncertainty."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.index.air import AirState, air
from catseye.atmosphere.path.air_profile import AirProfile, PathIndex, WeatherReadings
from catseye.atmosphere.path.bending import curvature, excess_bound, pointing_offset, sag
from catseye.atmosphere.path.ray import FOUND, BentRay, RayAir, bent_ray, layered
from catseye.constants import SECONDS_PER_DAY, SPEED_OF_LIGHT, ZERO_CELSIUS_K
from catseye.errors import ArgumentError
from catseye.records.laboratory.station_heights import StationHeights
from catseye.records.night.campaign import Campaign
from catseye.reduction.air.path_air import SCREEN, SiteAir, profile_notes, site_air
from catseye.reduction.air.routes import IndexFormula
from catseye.verdict import Verdict

LEVELS = 41  # heights of the profile
KNOTS = 33  # heights at which a ray's index is computed, dense near the ground
SIDE = 2.0  # m, of the ray's index beyond the path's ends
LONGEST = 2000.0  # m: layers are level planes, and over 2 km the Earth drops by 0.3 m
STEP = 0.01  # m, for the slope of the index


@dataclass(frozen=True, eq=False)
class AirLevels:
    """Smooth air at k heights at one time.

    z                        (k,) m
    temperature_c, u_temperature_c   (k,)
    pressure_hpa, humidity_percent   (k,)
    group_refractivity, u_group_refractivity   (k,) n_g - 1; u of the weather, without the formula's
    index_gradient           (k,) of the phase index upwards, 1/m
    """

    z: np.ndarray
    temperature_c: np.ndarray
    u_temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    group_refractivity: np.ndarray
    u_group_refractivity: np.ndarray
    index_gradient: np.ndarray


@dataclass(frozen=True, eq=False)
class AirPath:
    """Air between two points at one time.

    start, end     (3,) m
    mjd_utc        time; 0 where the readings have none
    site           air of the stations
    levels         profile
    mean           index along the chord
    ray            bent ray; `leaving`, `arriving`, `sag` along its axes
    gradient, u_gradient   of the phase index at the chord's middle, 1/m
    z_stations     (s,) m, heights of the stations
    hashes         SHA-256 of what was read
    """

    start: np.ndarray
    end: np.ndarray
    mjd_utc: float
    site: SiteAir
    levels: AirLevels
    mean: PathIndex
    ray: BentRay
    gradient: float
    u_gradient: float
    z_stations: np.ndarray
    hashes: dict[str, str]

    @property
    def length(self) -> float:
        """Straight distance between the ends, m."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def elevation(self) -> float:
        """Elevation of the chord, rad."""
        return float(np.arcsin((self.end[2] - self.start[2]) / self.length))

    @property
    def u_refractivity(self) -> float:
        """Standard uncertainty of the mean group refractivity, weather and formula."""
        return float(np.hypot(np.sqrt(self.mean.covariance[0, 0]), self.mean.u_formula))

    @property
    def arc_curvature(self) -> float:
        """Curvature of the arc by the gradient at the middle, 1/m; positive if concave to the ground."""
        return float(curvature(self.gradient, self.elevation, index=1.0 + float(self.mean.refractivity[0])))

    @property
    def u_curvature(self) -> float:
        """Standard uncertainty of the curvature, 1/m."""
        return self.u_gradient * float(np.cos(self.elevation))

    @property
    def arc_angle(self) -> float:
        """Angle of the arc at both ends, rad; aim so much above the end."""
        return float(pointing_offset(self.arc_curvature, self.length))

    @property
    def arc_sag(self) -> float:
        """Height of the arc above its chord in the middle, m."""
        return float(sag(self.arc_curvature, self.length))

    @property
    def bound(self) -> float:
        """Largest difference of optical paths that any air of the steepest gradient here allows, m."""
        z = np.sort([self.start[2], self.end[2]])
        adjacent = (self.levels.z >= z[0] - SIDE) & (self.levels.z <= z[1] + SIDE)
        steepest = float(np.abs(self.levels.index_gradient[adjacent]).max()) if adjacent.any() else abs(self.gradient)
        return float(excess_bound(max(steepest, abs(self.gradient)), self.length))

    @property
    def delay_difference_s(self) -> float:
        """Delay along the ray less that along the chord, s."""
        return float(self.ray.optical_excess[0]) / SPEED_OF_LIGHT

    @property
    def across(self) -> np.ndarray:
        """Unit vector across the chord, upwards; zero for a vertical chord, along which rays are straight."""
        up = np.array([0.0, 0.0, 1.0])
        along = (self.end - self.start) / self.length
        across = up - along * (up @ along)
        size = float(np.linalg.norm(across))
        return across / size if size > 1e-9 else np.zeros(3)

    @property
    def angles(self) -> tuple[float, float]:
        """Ray's elevation less the chord's at start and end, rad."""
        return float(self.ray.leaving[0] @ self.across), float(self.ray.arriving[0] @ self.across)

    @property
    def ray_sag(self) -> float:
        """Ray across the middle of its chord, upwards, m."""
        return float(self.ray.sag[0] @ self.across)

    @property
    def verdict(self) -> Verdict:
        """Verdict on the ray, the stations, and heights that they do not reach."""
        if self.ray.status[0] != FOUND:
            return Verdict("doubtful", f"the mean index holds, but the ray: {self.ray.status[0]}")
        low, high = sorted((float(self.start[2]), float(self.end[2])))
        beyond = max(high - float(self.z_stations.max()), float(self.z_stations.min()) - low)
        reach = f", {beyond:.0f} m beyond the stations" if beyond > SCREEN else ""
        good = Verdict(
            "good",
            f"{len(self.z_stations)} stations, path from {self.start[2]:.6g} to {self.end[2]:.6g} m{reach}; u includes "
            "stations, profile, local air and the formula",
        )
        return good.hearing(self.site.notes)


def campaign_air(campaign: Campaign, formula: IndexFormula, ground_m: float | None) -> SiteAir:
    """Air of a campaign's own stations; the wavelength is the site's."""
    return site_air(campaign.site, campaign.weather, ground=ground_m, model=formula.model, co2_ppm=formula.co2_ppm)


def stations_air(stations: StationHeights, formula: IndexFormula, ground_m: float | None) -> SiteAir:
    """Air of stations at their heights.

    ground_m   height of the ground; None: 2 m below the lowest station

    Raises ValidityError for a station below the ground.
    """
    names = tuple(dict.fromkeys(stations.station))
    start = float(stations.mjd_utc.min())
    readings = WeatherReadings(
        seconds=(stations.mjd_utc - start) * SECONDS_PER_DAY,
        z=stations.z,
        station=np.array([names.index(name) for name in stations.station], dtype=int),
        temperature_c=stations.temperature_c,
        pressure_hpa=stations.pressure_hpa,
        humidity_percent=stations.humidity_percent,
        count=np.ones(len(stations.z), dtype=int),
    )
    profile = AirProfile.of(readings, ground=float(stations.z.min()) - SCREEN if ground_m is None else ground_m)
    return SiteAir(
        profile=profile,
        stations=names,
        start_mjd=start,
        block=0.0,
        wavelength_um=formula.wavelength_um,
        model=formula.model,
        co2_ppm=formula.co2_ppm,
        notes=profile_notes(profile, names, start),
    )


def air_path(
    site: SiteAir, start: np.ndarray, end: np.ndarray, *, mjd_utc: float | None = None, hashes: dict[str, str]
) -> AirPath:
    """Air between two points.

    site         of `campaign_air` or `stations_air`
    start, end   (3,) m, in the frame of the stations' heights, z up
    mjd_utc      time; None: the middle of the readings
    hashes       SHA-256 of what was read

    The ray is traced through level layers of the profile; u of its angles is that of the gradient at the middle.
    Raises ArgumentError for ends that are one point or more than 2 km apart, or a time outside the readings;
    ValidityError below the ground.
    """
    readings = site.profile.temperature.readings
    last = float(readings.seconds.max())
    seconds = 0.5 * last if mjd_utc is None else (mjd_utc - site.start_mjd) * SECONDS_PER_DAY
    if mjd_utc is not None and not -3600.0 <= seconds <= last + 3600.0:
        raise ArgumentError(
            f"mjd_utc = {mjd_utc!r} is more than an hour outside the readings, {site.start_mjd:.5f} to "
            f"{site.start_mjd + last / SECONDS_PER_DAY:.5f}",
            "mjd_utc",
        )
    if np.array_equal(start, end):
        raise ArgumentError("start and end are one point (expected two)", "start", "end")
    if (length := float(np.linalg.norm(end - start))) > LONGEST:
        raise ArgumentError(f"start and end are {length:.6g} m apart (expected at most {LONGEST:g} m)", "start", "end")
    when = site.start_mjd + seconds / SECONDS_PER_DAY
    mean = site.along(when, start[None], end[None])
    ground = site.profile.temperature.ground
    low, high = sorted((float(start[2]), float(end[2])))
    top = max(high + SIDE, float(readings.z.max()) + SIDE)
    levels = _levels(site, seconds, ground + np.geomspace(0.2, top - ground, LEVELS))
    ray = bent_ray(_layers(site, seconds, max(low - SIDE, ground + STEP), high + SIDE), start, end)
    middle = 0.5 * (low + high)
    gradient, u_gradient = _gradient(site, seconds, middle)
    return AirPath(
        start=start,
        end=end,
        mjd_utc=when,
        site=site,
        levels=levels,
        mean=mean,
        ray=ray,
        gradient=gradient,
        u_gradient=u_gradient,
        z_stations=np.unique(readings.z),
        hashes=hashes,
    )


def _state(site: SiteAir, seconds: float, z: np.ndarray) -> AirState:
    weather = [column[0] for column in site.profile.state(np.array([seconds]), z[None])]
    return air(*weather, wavelength_um=site.wavelength_um, model=site.model, co2_ppm=site.co2_ppm)


def _phase_slope(site: SiteAir, seconds: float, z: np.ndarray) -> np.ndarray:
    above, below = (_state(site, seconds, z + side * STEP).phase_refractivity for side in (0.5, -0.5))
    return np.asarray((above - below) / STEP)


def _levels(site: SiteAir, seconds: float, z: np.ndarray) -> AirLevels:
    state, profile = _state(site, seconds, z), site.profile
    times = np.full(len(z), seconds)
    slope = state.sensitivity
    u = {
        "temperature": profile.temperature.u_at(times, z),
        "humidity": profile.humidity.u_at(times, z),
        "pressure": profile.pressure.u_at(times, np.full(len(z), profile.z_pressure)),
    }
    parts = (
        slope.temperature_c * u["temperature"],
        slope.humidity_percent * u["humidity"],
        slope.pressure_hpa * u["pressure"],
    )
    return AirLevels(
        z=z,
        temperature_c=np.asarray(state.temperature_c),
        u_temperature_c=u["temperature"],
        pressure_hpa=np.asarray(state.pressure_hpa),
        humidity_percent=np.asarray(state.humidity_percent),
        group_refractivity=np.asarray(state.group_refractivity),
        u_group_refractivity=np.sqrt(sum(np.square(part) for part in parts)),
        index_gradient=_phase_slope(site, seconds, z),
    )


def _layers(site: SiteAir, seconds: float, low: float, high: float) -> Callable[[np.ndarray], RayAir]:
    """Level layers of the profile, splined over the logarithm of the height, for `bent_ray`."""
    from scipy.interpolate import CubicSpline

    ground = site.profile.temperature.ground
    first, last = np.log1p(low - ground), np.log1p(high - ground)
    z = ground + np.expm1(np.linspace(first, last, KNOTS))
    state = _state(site, seconds, z)
    phase, group = (CubicSpline(z, np.asarray(v)) for v in (state.phase_refractivity, state.group_refractivity))
    slope = phase.derivative()
    return layered(lambda at: (phase(at), slope(at)), group)


def _gradient(site: SiteAir, seconds: float, z: float) -> tuple[float, float]:
    """Gradient of the phase index at a height and its u, 1/m.

    u is that of the temperature's gradient: the index changes by (n - 1)/T a kelvin; humidity's adds a hundredth.
    """
    profile, at = site.profile.temperature, np.array([z])
    slope = (profile.basis(at + 0.5 * STEP) - profile.basis(at - 0.5 * STEP)) / STEP
    u_lapse = float(np.sqrt(profile.covariance(np.array([seconds]), slope)[0, 0]))
    state = _state(site, seconds, at)
    per_c = float(state.phase_refractivity[0]) / (float(state.temperature_c[0]) + ZERO_CELSIUS_K)
    return float(_phase_slope(site, seconds, at)[0]), per_c * u_lapse
