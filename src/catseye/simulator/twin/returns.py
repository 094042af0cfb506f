"""Returned phasors of a living site's rangers, from beam to retroreflector."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catseye.aliases import Array
from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.records.site.folder import REFERENCE
from catseye.records.site.site import Ranging
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.head import REFERENCE_VOLT
from catseye.simulator.twin.air import LivingAir
from catseye.simulator.twin.faults import FaultBoard
from catseye.simulator.twin.light import CUBE_RADIUS, SPOT, ElectronicsWalk, acceptance, glass_way, path_waves
from catseye.simulator.twin.scene import Beam, TwinPlaces
from catseye.simulator.twin.stations import TrueStation, reference_cube
from catseye.simulator.twin.telescope import TelescopeState
from catseye.simulator.twin.waves import Waves

Complex = NDArray[np.complex128]
FARTHEST = 200.0  # m: a beam that sweeps by more than `SWEEP` there is checked three times
SWEEP = 0.1  # m
MOST_PATHS = 1024  # paths with cached noise: a full dish has 40 000, of 12 kB each


LAYERS = 12  # terms of a series that falls by the square of their number


class Meeting(NamedTuple):
    """Beam and one retroreflector at k times.

    along, off   (k,) m: distance of its point along the beam, and off the beam
    cosine       (k,) of the angle off its axis
    """

    along: Array
    off: Array
    cosine: Array


class Returns:
    """Light of a living site.

    scene, air   places, and the air between them
    faults       blocked-beam, wrong-target, dew
    """

    def __init__(
        self,
        scene: TwinPlaces,
        air: LivingAir,
        ranging: Ranging,
        *,
        faults: FaultBoard,
        streams: Streams,
        planted: Planted,
    ):
        self._scene, self._air, self._faults, self._streams, self._planted = scene, air, faults, streams, planted
        self.radians_per_metre = 2.0 * TWO_PI * ranging.modulation_hz / SPEED_OF_LIGHT  # of one-way optical path
        self._group = ranging.bk7_to_air_group_index_ratio
        self._bending = ranging.bk7_to_air_phase_index_ratio or self._group
        self._index_ppm = air.conditions.turbulence * ranging.path_index_fluctuation_ppm
        self.electronics = {name: ElectronicsWalk(name, streams, planted) for name in scene.stations}
        self._cubes = {name: reference_cube(station) for name, station in scene.stations.items()}
        self._path = lru_cache(MOST_PATHS)(self._drawn_path)

    def lit(self, ranger: str, counts: Array, t: Array, state: TelescopeState) -> str | None:
        """Nearest retroreflector in a beam at counts (1, 2), one time (1,); None: none."""
        if self._off_cube(self._scene.station(ranger), counts)[0][0] < CUBE_RADIUS:
            return REFERENCE
        beam = self.beam(ranger, counts, t, state)
        distance: dict[str, float] = {}
        for name in self._scene.near(beam, state, 0):
            retro, meeting = self._scene.retros[name], self._meeting(name, beam, t, state)
            if meeting.off[0] < retro.radius and acceptance(retro, meeting.cosine)[0] > 0.0:
                distance[name] = float(meeting.off[0])
        return min(distance, key=lambda name: distance[name], default=None)

    def beam(self, ranger: str, counts: Array, t: Array, state: TelescopeState) -> Beam:
        """Beam at encoder readings (k, 2)."""
        return self._scene.beam(self._scene.frame(ranger, t, state), self._scene.station(ranger).ray(counts))

    def phasors(
        self, ranger: str, counts: Array, t: Array, state: TelescopeState, *, among: tuple[str, ...] | None = None
    ) -> Complex:
        """Return (k,), V, at counts (k, 2), times (k,), leakage included.

        among   names that the beam may fall on, if known; None: search
        """
        station = self._scene.station(ranger)
        turned = np.exp(1j * self.electronics[ranger](t))
        if among is None or REFERENCE in among:
            off, path = self._off_cube(station, counts)
            if np.any(off < CUBE_RADIUS):
                return station.leakage + turned * self._reference(ranger, off, path, t, state)
        beam = self.beam(ranger, counts, t, state)
        returned = np.zeros(len(t), dtype=complex)
        for name in self._near(beam, state) if among is None else among:
            returned = returned + self._return(ranger, name, beam, t, state)
        return station.leakage + turned * returned

    def _near(self, beam: Beam, state: TelescopeState) -> list[str]:
        """Names of retroreflectors possibly in the beam at any of its times."""
        last = len(beam.path) - 1
        sweep = FARTHEST * float(np.max(np.abs(beam.direction[-1] - beam.direction[0])))
        at = (last // 2,) if sweep < SWEEP else (0, last // 2, last)
        return list(dict.fromkeys(name for k in at for name in self._scene.near(beam, state, k)))

    def _meeting(self, name: str, beam: Beam, t: Array, state: TelescopeState) -> Meeting:
        sight = self._scene.point(name, t, state) - beam.origin
        along = np.einsum("ij,ij->i", sight, beam.direction)
        aside = sight - along[:, None] * beam.direction
        facing = self._scene.facing(name, state)
        cosine = np.ones(len(t)) if facing is None else -np.einsum("ij,ij->i", facing, beam.direction)
        return Meeting(along, np.sqrt(np.einsum("ij,ij->i", aside, aside)), cosine)

    def _return(self, ranger: str, name: str, beam: Beam, t: Array, state: TelescopeState) -> Complex:
        """Return of one retroreflector (k,), V, without the electronics' phase."""
        retro, at = self._scene.retros[name], float(t[len(t) // 2])
        met = self._meeting(name, beam, t, state)
        accepted = np.where(met.off < retro.radius, acceptance(retro, met.cosine), 0.0)
        if not accepted.any() or self._faults.active("blocked-beam", ranger, name, at=at) is not None:
            return np.zeros(len(t), dtype=complex)
        noise, draw = self._path(ranger, name)
        ppm, flicker = noise(t).T
        place = beam.origin + met.along[:, None] * beam.direction
        index, end_index, dry = self._air.along(beam.origin, place, t)
        usual = retro.volts[0] + (retro.volts[1] - retro.volts[0]) * draw
        dew = self._faults.active("dew", name, at=at)
        usual *= 1.0 if dew is None else dew.size
        volts = usual * accepted * (1.0 + flicker) * dry * np.exp(-0.5 * (met.off / SPOT) ** 2)
        obliquity = self._planted.gain("obliquity")
        glass = glass_way(retro, met.cosine, group=self._group, phase=self._bending, obliquity=obliquity)
        wrong = self._faults.active("wrong-target", ranger, name, at=at)
        length = beam.path + met.along + (0.0 if wrong is None else wrong.size)
        phase = -self.radians_per_metre * ((index + 1e-6 * ppm) * length + end_index * glass)
        station = self._scene.stations[ranger]
        light = volts * np.exp(1j * phase)
        if station.amplitude_to_phase:
            light = light * np.exp(1j * station.amplitude_to_phase * np.log(np.maximum(volts, 1e-6) / REFERENCE_VOLT))
        if station.cyclic.size or station.second_pass:
            after = phase + self._cube_phase(ranger, t, state)
            if station.cyclic.size:
                angle = after[:, None] * np.arange(1, station.cyclic.shape[1] + 1)
                long = np.cos(angle) @ station.cyclic[0] + np.sin(angle) @ station.cyclic[1]
                light = light * np.exp(-1j * self.radians_per_metre * long)
            # every pass of the light by the detector adds one that went the way once more
            light = light / (1.0 - volts * np.conj(station.second_pass) * np.exp(1j * after))
        return light * np.exp(1j * self._laser_turn(ranger, at)) * self._detected(ranger, at)

    def _cube_phase(self, ranger: str, t: Array, state: TelescopeState) -> Array:
        """Phase (k,), rad, by which the internal cube's return lags."""
        station = self._scene.stations[ranger]
        _, path = self._off_cube(station, station.zrg[None])
        return self.radians_per_metre * self._air.index(self._scene.point(ranger, t, state), t) * path

    def _laser_turn(self, ranger: str, at: float) -> float:
        """Phase, rad, of light back into the laser: another fringe each shot."""
        feedback = self._scene.stations[ranger].feedback
        if not feedback:
            return 0.0
        fringe = self._streams(f"feedback/{ranger}/{at:.3f}").uniform(0.0, TWO_PI)
        return feedback * math.sqrt(2.0) * math.cos(fringe)

    def _detected(self, ranger: str, at: float) -> complex:
        """Signal of a shot's image over that of an image in the mean place, where the cube's is."""
        station = self._scene.stations[ranger]
        place, scatter = station.image
        if not scatter:
            return 1.0
        aside, across = self._streams(f"image/{ranger}/{at:.3f}").normal(scale=scatter, size=2)
        away = math.hypot(place + aside, across)
        return reaching(station.lag, away) / reaching(station.lag, place) if away <= 1.0 else 0.0

    def _off_cube(self, station: TrueStation, counts: Array) -> tuple[Array, Array]:
        """Beam offset from the internal cube (k,), m, and path to it (k,), m."""
        ray, (cube, _) = station.ray(counts), self._cubes[station.name]
        sight = cube - ray.leaves
        along = np.einsum("ij,ij->i", sight, ray.direction)
        aside = sight - along[:, None] * ray.direction
        off = np.sqrt(np.einsum("ij,ij->i", aside, aside))
        return np.where(along > 0.0, off, np.inf), ray.path + along

    def _reference(self, ranger: str, off: Array, path: Array, t: Array, state: TelescopeState) -> Complex:
        """Return of the internal cube (k,), V, without electronics' phase.

        Nothing blocks or wets it.
        """
        volts = np.where(off < CUBE_RADIUS, REFERENCE_VOLT * np.exp(-0.5 * (off / SPOT) ** 2), 0.0)
        index = self._air.index(self._scene.point(ranger, t, state), t)
        return volts * np.exp(-1j * self.radians_per_metre * index * path)

    def _drawn_path(self, ranger: str, name: str) -> tuple[Waves, float]:
        """Noise of a path and its usual amplitude between limits, reproducibly."""
        noise = path_waves(ranger, name, index_ppm=self._index_ppm, streams=self._streams, planted=self._planted)
        return noise, float(self._streams(f"path/{ranger}/{name}").uniform())


def reaching(lag: float, away: float) -> complex:
    """Current through a resistive disc with capacitance that reaches its rim, against that put in at the centre.

    lag    rad, of the centre's, if small
    away   place over the radius, 0 to 1

    u'' + u'/r = 4 i lag u, in powers of r^2, which the reduction takes to the first.
    """
    term, total = 1.0 + 0.0j, 1.0 + 0.0j
    for k in range(1, LAYERS):
        term *= 1j * lag * away**2 / k**2
        total += term
    return total
