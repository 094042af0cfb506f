"""Simulated night of one refractometer path: air, phase, sensor readings.

Nothing of the reduction's formulas is used: the light takes 2 integral n ds / c, the phase is minus that many periods.
"""

import csv
import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from catseye.constants import PPM, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.simulator.night.air import NIGHT, AirConditions, TrueAir, group_refractivity_ppm
from catseye.simulator.night.faults import Streams

START_MJD_UTC = 52889.0
MODULATION_HZ = 1.5e9
STEPS = 400  # of the path, even: Simpson's rule
HEAD_HEIGHT, TARGET_HEIGHT, D0 = 1.6, 2.2, 0.180  # m


@dataclass(frozen=True)
class PathPlan:
    """Plan of the night; offsets are positive for readings too high.

    path_length          m, D - D0
    hours, interval_s    length of the night, and time between readings
    thermometers         spread evenly along the path
    u_thermometer_c, u_barometer_hpa, u_hygrometer_percent   spread of the sensors' offsets
    noise_c, eddies_c    of a thermometer's reading: white, and correlated over `eddy_s`
    noise_hpa, noise_percent   of the others
    phase_noise          rad
    walk_mrad_per_root_hour, drift_mrad_per_hour   of the electronics
    swing_c, patch_c     daily swing of the air's temperature; a warm section in the middle fifth of the path
    strays               share of phases with a stray reflection in the return; and of wrong weather readings
    jumps                time (h) -> m that the target moved away
    gaps                 from and to (h): no readings
    weather_gaps         from and to (h): phases only
    """

    path_length: float = 100.0
    hours: float = 8.0
    interval_s: float = 60.0
    thermometers: int = 5
    u_thermometer_c: float = 0.03
    u_barometer_hpa: float = 0.1
    u_hygrometer_percent: float = 1.5
    noise_c: float = 0.10
    eddies_c: float = 0.15
    eddy_s: float = 120.0
    noise_hpa: float = 0.03
    noise_percent: float = 0.5
    phase_noise: float = 0.0007
    walk_mrad_per_root_hour: float = 0.5
    drift_mrad_per_hour: float = 0.0
    swing_c: float = 3.0
    patch_c: float = 0.3
    strays: float = 0.0
    jumps: dict[float, float] = field(default_factory=dict)
    gaps: tuple[tuple[float, float], ...] = ()
    weather_gaps: tuple[tuple[float, float], ...] = ()
    conditions: AirConditions = NIGHT


@dataclass(frozen=True, eq=False)
class PathNight:
    """File contents, m readings, and the truth.

    phase           (m,) rad in [0, 2 pi)
    temperature_c   (m, k); nan where no weather was read, as in the next two
    index           (m,) true group refractivity, mean over the path
    electronics     (m,) rad, added by the electronics
    offsets_c       (k,) of the thermometers
    wrong_phase, wrong_weather   (m,) bool: planted
    """

    plan: PathPlan
    mjd_utc: np.ndarray
    phase: np.ndarray
    temperature_c: np.ndarray
    pressure_hpa: np.ndarray
    humidity_percent: np.ndarray
    index: np.ndarray
    electronics: np.ndarray
    offsets_c: np.ndarray
    wrong_phase: np.ndarray
    wrong_weather: np.ndarray

    def write(self, file: Path, **sheet: object) -> Path:
        """Write FILE.csv and FILE.toml; `sheet` changes or adds keys of the latter."""
        plan = self.plan
        names = [f"temperature_{k + 1}_c" for k in range(plan.thermometers)]
        with file.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(["mjd_utc", "phase_rad", *names, "pressure_hpa", "humidity_percent"])
            weather = np.column_stack([self.temperature_c, self.pressure_hpa, self.humidity_percent])
            for mjd, phase, row in zip(self.mjd_utc, self.phase, weather, strict=True):
                cells = ["" if np.isnan(v) else f"{v:.2f}" for v in row]
                writer.writerow([f"{mjd:.8f}", f"{phase:.5f}", *cells])
        keys = {
            "path": "simulated",
            "path_length_m": round(plan.path_length, 3),
            "u_path_length_mm": 5.0,
            "air_model": "rueger1990",
            "u_temperature_c": plan.u_thermometer_c,
            "u_pressure_hpa": plan.u_barometer_hpa,
            "u_humidity_percent": plan.u_hygrometer_percent,
            "noise_temperature_c": round(float(np.hypot(plan.noise_c, plan.eddies_c)), 4),
            "noise_pressure_hpa": plan.noise_hpa,
            "noise_humidity_percent": plan.noise_percent,
            "u_phase_rad": plan.phase_noise,
            "drift_mrad_per_root_hour": plan.walk_mrad_per_root_hour,
        }
        text = [f"{k} = {json.dumps(v)}" for k, v in {**keys, **sheet}.items()]  # JSON's values are TOML's
        file.with_suffix(".toml").write_text("\n".join(text) + "\n", encoding="utf-8")
        return file


def simulate_path_night(seed: int, plan: PathPlan | None = None) -> PathNight:
    """Simulate a night of one path from one seed.

    seed   of every random draw
    plan   plan of the night; by default an ordinary one
    """
    plan, streams = plan or PathPlan(), Streams(seed)
    seconds = np.arange(0.0, plan.hours * 3600.0, plan.interval_s)
    for start, end in plan.gaps:
        seconds = seconds[(seconds < start * 3600.0) | (seconds >= end * 3600.0)]
    hours = seconds / 3600.0
    place = np.linspace(0.0, 1.0, STEPS + 1)
    index = _air(plan, place, seconds, streams)[0]
    simpson = np.ones(STEPS + 1)
    simpson[1:-1:2], simpson[2:-1:2] = 4.0, 2.0
    mean = index @ simpson / (3.0 * STEPS)
    length = plan.path_length + D0 + sum(np.where(hours >= when, by, 0.0) for when, by in plan.jumps.items())
    flight = 2.0 * (1.0 + mean) * length / SPEED_OF_LIGHT
    cube = 2.0 * (1.0 + index[:, 0]) * D0 / SPEED_OF_LIGHT
    rng = streams("electronics")
    steps = np.sqrt(np.diff(hours, prepend=hours[0])) * rng.normal(size=len(hours))
    electronics = 1e-3 * (plan.walk_mrad_per_root_hour * np.cumsum(steps) + plan.drift_mrad_per_hour * hours)
    phase = -TWO_PI * MODULATION_HZ * (flight - cube) + electronics
    phase = phase + plan.phase_noise * streams("phases").normal(size=len(hours))
    wrong = streams("strays").uniform(size=(2, len(hours))) < plan.strays
    phase = phase + wrong[0] * streams("foreign").uniform(0.1, TWO_PI - 0.1, len(hours))
    temperature, pressure, humidity, offsets = _sensors(plan, seconds, wrong[1], streams)
    for start, end in plan.weather_gaps:
        blank = (hours >= start) & (hours < end)
        temperature[blank], pressure[blank], humidity[blank] = np.nan, np.nan, np.nan
    return PathNight(
        plan=plan,
        mjd_utc=START_MJD_UTC + seconds / SECONDS_PER_DAY,
        phase=np.mod(phase, TWO_PI),
        temperature_c=temperature,
        pressure_hpa=pressure,
        humidity_percent=humidity,
        index=mean,
        electronics=electronics,
        offsets_c=offsets,
        wrong_phase=wrong[0],
        wrong_weather=wrong[1],
    )


def _air(plan: PathPlan, place: np.ndarray, seconds: np.ndarray, streams: Streams) -> tuple[np.ndarray, ...]:
    """Refractivity, temperature, pressure (m, places) and humidity (m, 1) along the path."""
    air, z = TrueAir(plan.conditions), HEAD_HEIGHT + (TARGET_HEIGHT - HEAD_HEIGHT) * place
    when = seconds[:, None]
    turn = streams("swing").uniform(0.0, TWO_PI)
    swing = plan.swing_c * np.sin(TWO_PI * when / 86400.0 * 2.0 + turn)
    patch = plan.patch_c * np.exp(-0.5 * ((place - 0.5) / 0.1) ** 2)
    temperature = air.temperature_c(z, when) + swing + patch
    pressure, humidity = air.pressure_hpa(z, when), air.humidity_percent(when)
    return PPM * group_refractivity_ppm(temperature, pressure, humidity), temperature, pressure, humidity


def _sensors(
    plan: PathPlan, seconds: np.ndarray, wrong: np.ndarray, streams: Streams
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Readings of thermometers (m, k), barometer, hygrometer, and thermometer offsets."""
    place = (np.arange(plan.thermometers) + 0.5) / plan.thermometers
    _, temperature, pressure, humidity = _air(plan, place, seconds, streams)
    rng, k = streams("sensors"), plan.thermometers
    offsets = plan.u_thermometer_c * rng.normal(size=k)
    correlation = np.exp(-np.diff(seconds, prepend=seconds[0]) / plan.eddy_s)
    eddies = rng.normal(size=(len(seconds), k))
    for i in range(1, len(seconds)):
        eddies[i] = correlation[i] * eddies[i - 1] + np.sqrt(1.0 - correlation[i] ** 2) * eddies[i]
    read = temperature + offsets + plan.eddies_c * eddies + plan.noise_c * rng.normal(size=temperature.shape)
    read[wrong, rng.integers(0, k, len(seconds))[wrong]] += rng.choice((-10.0, 10.0, 1.5, -1.5), int(wrong.sum()))
    barometer = pressure.mean(axis=1) + plan.u_barometer_hpa * rng.normal()
    barometer = barometer + plan.noise_hpa * rng.normal(size=len(seconds))
    hygrometer = humidity[:, 0] + plan.u_hygrometer_percent * rng.normal()
    hygrometer = hygrometer + plan.noise_percent * rng.normal(size=len(seconds))
    return read, barometer, np.clip(hygrometer, 0.0, 100.0), offsets
