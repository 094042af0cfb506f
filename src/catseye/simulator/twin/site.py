"""Truth of a living site at any time: places, returns, readings.

A twin is a pure function of its arguments and of time: nothing is stepped or stored, so that processes which make the
same twin agree without talking. Only faults change, through the given board. Times are s since the start,
arrays (k,); places m, ground frame. Where its parts are:

    motion      where the telescope's axes turn          air        weather, index, dew
    telescope   its posture and bending                    stations   rangers and their mirrors
    targets     where everything truly rests             light      glass, acceptance, noise
    scene       all of these at a time                   returns    what comes back

Neglected, as below 1 um here: the time of flight (0.3 um at the rim in a slew), the bending of rays. Not included:
obstructions of a beam.
"""

from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_DAY, PER_SECOND
from catseye.ranger.head import SamplingSettings
from catseye.records.night.live import TICKS_PER_DAY, LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.head import VOLT_PER_CODE
from catseye.simulator.twin.air import LivingAir, station_places
from catseye.simulator.twin.conditions import LIVING_NIGHT, LivingConditions
from catseye.simulator.twin.converter import Converter
from catseye.simulator.twin.faults import FaultBoard
from catseye.simulator.twin.motion import AxisAngles, AxisMotion
from catseye.simulator.twin.returns import Returns
from catseye.simulator.twin.scene import Beam, StationFrame, TwinPlaces
from catseye.simulator.twin.telescope import TelescopeState, telescope
from catseye.simulator.twin.thermometers import thermometers

NS_PER_TICK = PER_DAY // TICKS_PER_DAY
READ_SCATTER = (0.05, 0.05, 0.5)  # °C, hPa, %: one sigma of a reading, as the night's stations have
POINTS, POINTS_A_SECOND = 17, 125.0  # points in a buffer for a shot's return: 8 ms apart
RATE_STEP = 1e-3  # s


class TwinDraws(TypedDict):
    """Random draws of all parts of a twin."""

    streams: Streams
    planted: Planted


class Twin:
    """Living site.

    site         its records, about which the truth is drawn
    seed         of every draw
    start_mjd    UTC, where its seconds begin
    motion       of the telescope
    conditions   of the weather
    faults       faults with times; may change while it runs
    planted      changes of the truth: shifts, D0, effects omitted (`LivingPlanted` has all of them)

    Raises InputError: a motion impossible at this latitude, an unknown planted name.
    """

    def __init__(
        self,
        site: SiteFolder,
        *,
        seed: int,
        start_mjd: float,
        motion: AxisMotion,
        conditions: LivingConditions = LIVING_NIGHT,
        faults: FaultBoard | None = None,
        planted: Planted | None = None,
    ):
        self.site, self.seed = site, seed
        self.faults = FaultBoard() if faults is None else faults
        drawn: TwinDraws = {"streams": Streams(seed), "planted": Planted() if planted is None else planted}
        self._streams, self._planted = drawn["streams"], drawn["planted"]
        self._start_ns = round(start_mjd * PER_DAY)
        local_conditions = conditions.at(site.site.site.elevation_of_z0_m)
        self.air = LivingAir.of(site, local_conditions, start_mjd, **drawn)
        self.telescope = telescope(site, motion, start_mjd, air=self.air, **drawn)
        self.telescope.angles(np.zeros(1))  # refuses an impossible motion
        self.scene = TwinPlaces(site, **drawn)
        self.returns = Returns(self.scene, self.air, site.site.ranging, faults=self.faults, **drawn)
        self._converters = {name: Converter.of(name, seed) for name in self.scene.stations}
        self._weather_at = station_places(site, self._streams)
        self.thermometers = thermometers(site, self.air, start_mjd, places=self._weather_at, **drawn)

    # Time -----------------------------------------------------------------------------------------------------------

    def seconds(self, ns: int, /) -> float:
        """Seconds since the start, of nanoseconds since MJD 0."""
        return (ns - self._start_ns) / PER_SECOND

    def seconds_of_ticks(self, ticks: int) -> float:
        """Seconds since the start, of ticks since MJD 0."""
        return self.seconds(ticks * NS_PER_TICK)

    def ticks(self, seconds: float) -> int:
        """Nearest tick to a time, since MJD 0."""
        ns = self._start_ns + round(seconds * PER_SECOND)
        return (2 * ns + NS_PER_TICK) // (2 * NS_PER_TICK)

    # Places ---------------------------------------------------------------------------------------------------------

    def posture(self, seconds: ArrayLike) -> AxisAngles:
        """Encoder angles (k,), rad, and rates (k,), rad/s, of the telescope."""
        return self.telescope.encoder_angles(_times(seconds))

    def live_posture(self, ticks: int) -> LivePosture:
        """Posture at one instant, as sent by the site's feed."""
        return LivePosture(ticks, *(float(values[0]) for values in self.posture(self.seconds_of_ticks(ticks))))

    def standing(self, seconds: ArrayLike) -> TelescopeState:
        """State of the telescope's bodies."""
        return self.telescope.standing(_times(seconds))

    def point(self, name: str, seconds: ArrayLike) -> Array:
        """True place (k, 3) of a target, triplet part, scan point or Kelvin point.

        A Kelvin point is named as "ZY105-F".
        """
        t = _times(seconds)
        return self.scene.point(name, t, self.telescope.standing(t))

    def points(self, names: list[str] | tuple[str, ...], seconds: ArrayLike) -> Array:
        """True places (k, n, 3) of many points."""
        t = _times(seconds)
        return self.scene.points(names, t, self.telescope.standing(t))

    def truth(self, names: list[str] | tuple[str, ...], seconds: float) -> dict[str, Array]:
        """True places (3,) of points at one time, by name, for comparison."""
        return dict(zip(names, self.points(names, seconds)[0], strict=True))

    def rate(self, name: str, seconds: ArrayLike) -> Array:
        """True velocity (k, 3), m/s, of a point, good to 0.1 um/s.

        By a difference over 2 ms.
        """
        t = _times(seconds)
        return (self.point(name, t + RATE_STEP) - self.point(name, t - RATE_STEP)) / (2.0 * RATE_STEP)

    # Mirrors and light ----------------------------------------------------------------------------------------------

    def station_frame(self, ranger: str, seconds: ArrayLike) -> StationFrame:
        """True scan point and axes of a ranger's mirror."""
        t = _times(seconds)
        return self.scene.frame(ranger, t, self.telescope.standing(t))

    def counts(self, ranger: str, name: str, seconds: ArrayLike) -> Array:
        """Encoder readings (k, 2), not rounded, when a beam truly meets a point.

        ZRG too; direct pointing.
        """
        t = _times(seconds)
        return self._counts(ranger, name, t, self.telescope.standing(t))

    def _counts(self, ranger: str, name: str, t: Array, state: TelescopeState) -> Array:
        station = self.scene.station(ranger)
        if name == REFERENCE:
            return np.broadcast_to(station.zrg, (len(t), 2))
        if name == ranger:
            raise InputError(f"ranger {ranger} as its own target (expected another point of the site)")
        scan, turn = self.scene.frame(ranger, t, state)
        away = self.scene.point(name, t, state) - scan
        return station.counts((turn @ away[..., None])[..., 0])

    def beam(self, ranger: str, counts: ArrayLike, seconds: ArrayLike) -> Beam:
        """True beam at encoder readings (k, 2)."""
        t = _times(seconds)
        return self.returns.beam(ranger, _pairs(counts, t), t, self.telescope.standing(t))

    def lit(self, ranger: str, counts: ArrayLike, seconds: float) -> str | None:
        """Retroreflector (ZRG included) in a beam at counts (2,); None if none."""
        t = _times(seconds)
        return self.returns.lit(ranger, _pairs(counts, t), t, self.telescope.standing(t))

    def phasors(self, ranger: str, counts: ArrayLike, seconds: ArrayLike, /) -> NDArray[np.complex128]:
        """Return (k,), V, at counts (k, 2), times (k,), of all objects in the beam.

        With leakage.
        """
        t = _times(seconds)
        return self.returns.phasors(ranger, _pairs(counts, t), t, self.telescope.standing(t))

    # Readings -------------------------------------------------------------------------------------------------------

    def weather(self, station: str, seconds: float) -> LiveWeather:
        """Reading of a weather station with lag, errors and scatter; NaN while silent."""
        if station not in self._weather_at:
            raise InputError(
                f"weather station {station!r} is not at this site (expected {', '.join(self._weather_at)})"
            )
        ticks = self.ticks(seconds)
        if self.faults.active("silent-station", station, at=seconds) is not None:
            return LiveWeather(station, ticks, float("nan"), float("nan"), float("nan"))
        true = self.air.weather(self._weather_at[station][None, None], _times(seconds))
        scatter = self._planted.gain("weather_scatter") * self._streams(f"reading/{station}/{ticks}").normal(size=3)
        lie = self.faults.active("lying-station", station, at=seconds)
        read = float(self.thermometers[station].temperature_c(self.air, _times(seconds))[0])
        t, p, h = (
            v + s * u
            for v, s, u in zip((read, *(float(v[0, 0]) for v in true[1:])), scatter, READ_SCATTER, strict=True)
        )
        return LiveWeather(
            station,
            ticks,
            round(t + (0.0 if lie is None else lie.size), 3),
            round(p, 3),
            round(min(max(h, 0.0), 100.0), 2),
        )

    def shot(
        self, ranger: str, target: str, seconds: float, *, cycles: int = 128, samples: int = 64, if_hz: int = 1000
    ) -> LiveShot:
        """Full buffer of a ranger whose beam follows a target perfectly.

        Without servers and servos, for tests and scatter. The stamp is rounded to the nearest tick.
        """
        sampling = SamplingSettings(samples, cycles, if_hz)
        t = seconds + np.linspace(0.0, sampling.duration, max(POINTS, round(sampling.duration * POINTS_A_SECOND)))
        state = self.telescope.standing(t)
        aimed = self._counts(ranger, target, t, state)
        hot = self.faults.active("saturated-adc", ranger, at=seconds)
        ticks = self.ticks(seconds)
        codes = self._converters[ranger].codes(
            t - seconds,
            self.returns.phasors(ranger, aimed, t, state, among=(target,)),
            sampling=sampling,
            generator=self._streams(f"shot/{ranger}/{target}/{ticks}"),
            gain=1.0 if hot is None else hot.size,
        )
        return LiveShot(
            ranger=ranger,
            target=target,
            ticks=ticks,
            cycles=cycles,
            samples_per_cycle=samples,
            if_hz=if_hz,
            volts_per_code=VOLT_PER_CODE,
            samples=codes,
        )


def _times(seconds: ArrayLike) -> Array:
    return np.atleast_1d(np.asarray(seconds, dtype=float))


def _pairs(counts: ArrayLike, t: Array) -> Array:
    return np.broadcast_to(np.asarray(counts, dtype=float), (len(t), 2))
