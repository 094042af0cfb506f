"""Lines of sight in warm air, and acoustic measurements of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from catseye.constants import PPM, TWO_PI
from catseye.errors import InputError
from catseye.simulator.night.air import AirConditions, TrueAir, group_refractivity_ppm, saturation_hpa
from catseye.simulator.night.faults import Streams

SOUNDING_INTERVAL_S = 120.0
AT_POINT = (
    0.02  # m: radius of a plume's point for path ends; above the telescope's expansion, below the spacing of points
)


@dataclass(frozen=True)
class Sounding:
    """One line of path_temperatures.csv."""

    seconds: float
    ranger: str
    target: str
    temperature_c: float
    u_temperature_c: float


@dataclass(frozen=True)
class LineWarmth:
    """Lines in warmer air, and optional acoustic soundings.

    warmer_c    (ranger, target) -> °C, excess of the mean of that line
    u_sound_c   °C: these lines are sounded, each with a separate offset drawn from it, and noise of a fifth;
                None: no sound
    """

    warmer_c: Mapping[tuple[str, str], float] = field(default_factory=dict)
    u_sound_c: float | None = None


@dataclass(frozen=True)
class WarmLine:
    """Air with plumes on the lines to some points.

    plumes   (point (3,) m, °C, excess of the straight line's mean: twice that half-way, none at the ends)
    """

    air: TrueAir
    plumes: tuple[tuple[np.ndarray, float], ...] = ()

    @property
    def conditions(self) -> AirConditions:
        return self.air.conditions

    @property
    def neighbours(self) -> float:
        return self.air.neighbours

    def index_at(self, points, seconds):
        """Group index at the ends of lines, outside plumes."""
        return self.air.index_at(points, seconds)

    def path_index(self, start, end, seconds):
        """Mean group index as of `TrueAir`, through plumes by the midpoint rule.

        With 500 parts.
        """
        index = self.air.path_index(start, end, seconds)
        begins = np.broadcast_to(start, np.shape(end))
        for point, warmer in self.plumes:
            share = (np.arange(500) + 0.5) / 500
            plume = warmer * (1.0 - np.cos(TWO_PI * share))
            for i in np.flatnonzero(np.all(np.abs(np.asarray(end) - point) < AT_POINT, axis=-1)):
                on = begins[i] + (end[i] - begins[i]) * share[:, None]
                smooth_c, pressure_hpa, humidity_percent = self.air.weather_at(on, seconds[i])
                t = smooth_c + plume
                # the plume adds no vapour: relative humidity falls
                drier = saturation_hpa(smooth_c) / saturation_hpa(t)
                index[i] = 1.0 + PPM * group_refractivity_ppm(t, pressure_hpa, humidity_percent * drier).mean()
        return index


def air_of_rangers(
    rangers: Mapping[str, object], points: Mapping[str, np.ndarray], air: TrueAir, warmth: LineWarmth
) -> dict[str, TrueAir | WarmLine]:
    """Air of each ranger's lines.

    Raises InputError: a warm line with an unknown end.
    """
    for ranger, target in warmth.warmer_c:
        if ranger not in rangers or target not in points:
            raise InputError(f"a warm line {ranger} - {target}: unknown ends")
    plumes = {r: tuple((points[t], w) for (a, t), w in warmth.warmer_c.items() if a == r) for r in rangers}
    return {r: WarmLine(air, p) if p else air for r, p in plumes.items()}


def soundings(
    air: TrueAir, warmth: LineWarmth, points: Mapping[str, np.ndarray], *, streams: Streams, until_s: float
) -> tuple[Sounding, ...]:
    """Acoustic readings of the warm lines: true mean, a line's offset, noise."""
    u_sound_c = warmth.u_sound_c
    if u_sound_c is None:
        return ()
    rows = []
    for (ranger, target), warmer in warmth.warmer_c.items():
        rng = streams(f"sound/{ranger}/{target}")
        offset = u_sound_c * rng.normal()
        on = np.linspace(points[ranger], points[target], 2001)
        for seconds in np.arange(0.0, until_s + SOUNDING_INTERVAL_S, SOUNDING_INTERVAL_S):
            mean = float(np.mean(air.weather_at(on, seconds)[0])) + warmer
            read = mean + offset + 0.2 * u_sound_c * rng.normal()
            rows.append(Sounding(float(seconds), ranger, target, read, u_sound_c))
    return tuple(sorted(rows, key=lambda row: row.seconds))
