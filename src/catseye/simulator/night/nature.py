"""Natural effects of a night beyond a smooth, linear model, with strengths."""

from dataclasses import dataclass, field

import numpy as np

from catseye.constants import TWO_PI
from catseye.simulator.night.expansion import SteelExpansion
from catseye.simulator.night.faults import Streams
from catseye.simulator.night.fields import AirWave, Front, HorizontalGradient, PressureWave, Turbulence
from catseye.simulator.night.limits import require
from catseye.simulator.night.movements import BodyDrift, BodySway
from catseye.simulator.night.stations import STATIONS, USUAL_INTERVAL_S, ReadingGap, StationNature

STRONGEST = 10.0  # of `Nature.drawn`: waves of 4 degC
ABSENT = 0.2  # probability that a night lacks an effect: chosen
# Largest at strength 1. Sources: Stull (1988) is R. B. Stull, An Introduction to Boundary Layer Meteorology; WMO-8 the
# Guide to Instruments and Methods of Observation, part I ch. 2.
WAVES, WAVE_C, WAVE_PERIOD_S = 3, 0.4, (300.0, 5400.0)  # Stull (1988) ch. 12: from the buoyancy period, 4 min, upwards
WAVE_SPEED_M_S, WAVE_GROWTH_PER_M = (2.0, 10.0), (-0.003, 0.008)  # the same: slow; inversions differ with height
FRONT_C, FRONT_RISE_S = 1.5, (120.0, 900.0)  # drainage flows and outflows: Stull (1988) ch. 14
FRONT_SLOTS, FRONT_SLOT_S, FRONT_CHANCE = 6, 7200.0, 0.5  # at most one in two hours: chosen
EDDY_C, OUTER_SCALE_M = 0.15, (30.0, 200.0)  # Stull (1988) ch. 9: 1-2 times the surface layer's temperature scale
WIND_M_S = (0.5, 6.0)  # usual for rangers; a stable night has little
GRADIENT_C_PER_M, GRADIENT_TURN_S = 0.008, (3600.0, 7200.0)  # a valley's slope flows: 0.8 degC across the dish
PRESSURE_WAVES, PRESSURE_HPA, PRESSURE_PERIOD_S = 2, 0.5, (300.0, 3600.0)  # microbarograms: Stull (1988) ch. 12
PRESSURE_SPEED_M_S = (10.0, 30.0)  # ducted waves: the same
LAG_S = 120.0  # WMO-8 ch. 2: thermometers in screens, 20 s in wind to some minutes in still air
RADIATION_C = 0.5  # WMO-8 ch. 2: a naturally ventilated screen in sunshine and little wind; bad ones up to 2.5 degC
INTERVAL_S = (10.0, 600.0)  # how often weather stations are usually read
GAP_S, GAP_SLOTS, GAP_SLOT_S, GAP_CHANCE = 900.0, 10, 3600.0, 0.3  # a restarted logger: minutes, chosen
STEEL_LAG_S = (1800.0, 5400.0)  # 15-25 mm of steel, air on both sides: c rho d / (2 h), h 10-15 W/m2/K
DISH_SHARE, ARM_SHARE, ALIDADE_SHARE = 0.2, 0.1, 0.1  # dish and arm are thinner than the box girders under them: chosen


@dataclass(frozen=True)
class Nature:
    """Effects of a night beyond `AirConditions`; none by default.

    wind_m_s        towards the east and the north; airs the thermometers
    batch_heights   common error of the glass heights of a batch of prisms, one sigma, in the sheet's u_height
    neighbours      share of a line's residual variance in common with neighbouring lines, 0 to 1
    movements       of bodies from shot to shot, or steadily

    >>> Nature(waves=(AirWave(amplitude_c=0.3, period_s=2100.0),)).calm
    False
    """

    waves: tuple[AirWave, ...] = ()
    fronts: tuple[Front, ...] = ()
    turbulence: Turbulence | None = None
    horizontal: HorizontalGradient | None = None
    pressure_waves: tuple[PressureWave, ...] = ()
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    stations: StationNature = field(default_factory=StationNature)
    expansion: SteelExpansion | None = None
    batch_heights: float = 0.0
    neighbours: float = 0.0
    movements: tuple[BodySway | BodyDrift, ...] = ()

    def __post_init__(self):
        require("wind_m_s", float(np.hypot(*self.wind_m_s)), 0.0, 60.0)
        require("batch_heights", self.batch_heights, 0.0, 100.0)
        require("neighbours", self.neighbours, 0.0, 1.0)

    @staticmethod
    def drawn(seed: int, strength: float = 1.0, *, night: int = 0) -> "Nature":
        """All effects in random strengths up to `strength` of their natural maximum.

        Some are absent.

        strength   0 to 10
        night      another one at the same site: its air is drawn anew, its stations, steel and glass are not
        """
        require("strength of nature", strength, 0.0, STRONGEST)
        return CALM if strength == 0.0 else _drawn(_Draw(Streams(seed, night), strength))

    @property
    def calm(self) -> bool:
        """True without any effect."""
        return self == CALM

    @property
    def common(self) -> tuple[AirWave | Front, ...]:
        """Temperature fields common to the whole site."""
        return (*self.waves, *self.fronts)

    @property
    def fields(self) -> tuple[AirWave | Front | HorizontalGradient | Turbulence, ...]:
        """All fields that change the temperature of the air."""
        some = (self.horizontal, self.turbulence)
        return (*self.common, *(part for part in some if part is not None))

    def temperature_c(self, points, seconds):
        """Change of the air's temperature at points (..., 3), times (...)."""
        return sum((part.temperature_c(points, seconds) for part in self.fields), np.zeros(()))

    def pressure_hpa(self, points, seconds):
        """Change of the air's pressure at points (..., 3), times (...)."""
        return sum((wave.pressure_hpa(points, seconds) for wave in self.pressure_waves), np.zeros(()))

    def common_c(self, point, seconds):
        """Temperature change by waves and fronts at a point (3,), times (...)."""
        return sum((part.temperature_c(point, seconds) for part in self.common), np.zeros(()))


CALM = Nature()


@dataclass(frozen=True)
class _Draw:
    """Draws of one nature.

    Purposes that begin with "nature/" are drawn anew each night, those with "site/" are not.
    """

    streams: Streams
    strength: float

    def level(self, purpose: str) -> float:
        """Strength of an effect: zero in some nights, else uniform.

        Between 0 and the strength of all.
        """
        absent, level = self.streams(f"{purpose}/level").uniform(size=2)
        return 0.0 if absent < ABSENT else self.strength * float(level)

    def rng(self, purpose: str) -> np.random.Generator:
        return self.streams(purpose)


def _drawn(draw: _Draw) -> Nature:
    """All effects, without those drawn as zero."""
    speed, towards = draw.rng("nature/wind").uniform((WIND_M_S[0], 0.0), (WIND_M_S[1], TWO_PI))
    wind = (float(speed * np.cos(towards)), float(speed * np.sin(towards)))
    named = (f"nature/wave {k}" for k in range(WAVES))
    waves = (air_wave(draw.rng(name), k, WAVE_C * draw.level(name)) for k, name in enumerate(named))
    named = (f"nature/pressure wave {k}" for k in range(PRESSURE_WAVES))
    pressure = (pressure_wave(draw.rng(name), PRESSURE_HPA * draw.level(name)) for name in named)
    expansion = _expansion(draw)
    turbulence, horizontal = _turbulence(draw, wind), _horizontal(draw)
    return Nature(
        waves=tuple(wave for wave in waves if wave.amplitude_c),
        fronts=_fronts(draw, wind),
        turbulence=turbulence if turbulence.rms_c else None,
        horizontal=horizontal if horizontal.turning_c_per_m else None,
        pressure_waves=tuple(wave for wave in pressure if wave.amplitude_hpa),
        wind_m_s=wind,
        stations=_stations(draw),
        expansion=expansion if expansion.share else None,
        batch_heights=draw.level("site/batches"),
        neighbours=min(draw.level("nature/neighbours"), 1.0),
    )


def _even(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _even_in_ratio(rng: np.random.Generator, low: float, high: float) -> float:
    return float(low * (high / low) ** rng.uniform())


def _slowness(velocity_m_s) -> tuple[float, float]:
    """Slowness of a feature moving at (2,) m/s."""
    vx, vy = (float(v) for v in velocity_m_s)
    return vx / (vx * vx + vy * vy), vy / (vx * vx + vy * vy)


def _velocity(rng: np.random.Generator, speeds: tuple[float, float]) -> tuple[float, float]:
    speed, towards = _even(rng, *speeds), _even(rng, 0.0, TWO_PI)
    return float(speed * np.cos(towards)), float(speed * np.sin(towards))


def air_wave(rng: np.random.Generator, k: int, amplitude_c: float) -> AirWave:
    """The k-th of `WAVES` waves, with its own share of the periods."""
    edges = np.geomspace(*WAVE_PERIOD_S, WAVES + 1)
    return AirWave(
        amplitude_c,
        _even_in_ratio(rng, float(edges[k]), float(edges[k + 1])),
        _even(rng, 0.0, TWO_PI),
        _slowness(_velocity(rng, WAVE_SPEED_M_S)),
        _even(rng, *WAVE_GROWTH_PER_M),
    )


def pressure_wave(rng: np.random.Generator, amplitude_hpa: float) -> PressureWave:
    """Pressure wave with random period and direction."""
    return PressureWave(
        amplitude_hpa,
        _even_in_ratio(rng, *PRESSURE_PERIOD_S),
        _even(rng, 0.0, TWO_PI),
        _slowness(_velocity(rng, PRESSURE_SPEED_M_S)),
    )


def _fronts(draw: _Draw, wind: tuple[float, float]) -> tuple[Front, ...]:
    """Fronts that pass with the wind, at most one a slot."""
    fronts = []
    for k in range(FRONT_SLOTS):
        purpose = f"nature/front {k}"
        rng = draw.rng(purpose)
        comes, sign = rng.uniform() < FRONT_CHANCE, rng.choice((-1.0, 1.0))
        at, rise = _even(rng, k * FRONT_SLOT_S, (k + 1) * FRONT_SLOT_S), _even(rng, *FRONT_RISE_S)
        step = float(sign) * FRONT_C * draw.level(purpose)
        if comes and step:
            fronts.append(Front(step, at, rise, _slowness(wind)))
    return tuple(fronts)


def _turbulence(draw: _Draw, wind: tuple[float, float]) -> Turbulence:
    rng = draw.rng("nature/turbulence")
    outer, seed = _even_in_ratio(rng, *OUTER_SCALE_M), int(rng.integers(2**31))
    return Turbulence(EDDY_C * draw.level("nature/turbulence"), outer, wind, seed)


def _horizontal(draw: _Draw) -> HorizontalGradient:
    """Horizontal gradient; variance shared equally by constant and turning part.

    One sigma of each component.
    """
    rng, sigma = draw.rng("nature/horizontal"), GRADIENT_C_PER_M * draw.level("nature/horizontal")
    east, north = sigma / np.sqrt(2.0) * np.clip(rng.normal(size=2), -2.0, 2.0)
    period = _even(rng, *GRADIENT_TURN_S) * float(rng.choice((-1.0, 1.0)))
    return HorizontalGradient((float(east), float(north)), sigma, period, _even(rng, 0.0, TWO_PI))


def _stations(draw: _Draw) -> StationNature:
    """Station time constants, radiation errors, interval (site) and gaps (night)."""
    mild = min(draw.strength, 1.0)
    rng = draw.rng("site/readings")
    usual, interval = rng.uniform() < ABSENT, _even_in_ratio(rng, *INTERVAL_S)
    gaps = []
    for name in STATIONS:
        gap = draw.rng(f"nature/gaps/{name}")
        for k in range(GAP_SLOTS):
            comes, start, long = gap.uniform(size=3)
            if comes < GAP_CHANCE:
                begin = (k + float(start)) * GAP_SLOT_S
                gaps.append(ReadingGap(name, begin, begin + mild * GAP_S * float(long)))
    return StationNature(
        {name: LAG_S * draw.level(f"site/lag/{name}") for name in STATIONS},
        {name: RADIATION_C * draw.level(f"site/radiation/{name}") for name in STATIONS},
        USUAL_INTERVAL_S if usual else round(USUAL_INTERVAL_S * (interval / USUAL_INTERVAL_S) ** mild, -1),
        tuple(gaps),
    )


def _expansion(draw: _Draw) -> SteelExpansion:
    rng = draw.rng("site/steel")
    lag, dish, arm = _even(rng, *STEEL_LAG_S), _even(rng, -DISH_SHARE, DISH_SHARE), _even(rng, -ARM_SHARE, ARM_SHARE)
    return SteelExpansion(draw.level("site/steel"), lag, dish, arm, _even(rng, -ALIDADE_SHARE, ALIDADE_SHARE))
