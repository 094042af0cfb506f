"""Air temperature along a path from recordings or travel times.

A file is reduced by its sheet; files of one sheet are one path. A shot without a result has a status.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catseye.atmosphere.sound.speed import THERMOMETRY, sound
from catseye.constants import SECONDS_PER_DAY, TWO_PI, ZERO_CELSIUS_K
from catseye.errors import InputError, ValidityError
from catseye.names import AIR_MODEL
from catseye.records.files.refusal import refusal
from catseye.records.night.recording import AcousticSheet, Recording, TravelTimes, read_recording, read_sheet
from catseye.reduction.air.acoustic import PathTemperatures, PathWind, SoundLine, StationAir, path_temperatures
from catseye.reduction.air.sound_path import AcousticPath, AcousticReduction, ChannelTrace, SoundShots
from catseye.reduction.air.sound_weather import QUANTITIES, SoundWeather, sheet_readings
from catseye.signal.delay.arrival import DelayPlan, DelayStatus
from catseye.signal.delay.waveform import sampled

WARMER_C, WINDIER = 15.0, 15.0  # °C and m/s, deviations from the prediction within the default window
LOOP_WINDOW = 5e-3  # s, about the emission
MICROSECOND = 1e-6


def reduce_acoustic(
    files: Sequence[Path],
    sheet: Path | None = None,
    *,
    weather: SoundWeather | None = None,
    u_pressure_hpa: float | None = None,
    u_humidity_percent: float | None = None,
    model: str = THERMOMETRY,
    air_model: str = AIR_MODEL,
) -> AcousticReduction:
    """Temperatures of paths from files of sound or travel times.

    files       .wav or .csv
    sheet       of all of them; None: each file's own, its name with .toml
    weather     of all paths; None: the sheets', or the tables' columns
    u_pressure_hpa, u_humidity_percent   standard uncertainties of the weather; None: the weather's own, or the sheets'
    model       formula of the speed of sound, a name in `atmosphere.sound.speed.MODELS`
    air_model   formula of the index, a name in `atmosphere.index.air.MODELS`

    Raises InputError, one line with file, place, value and expectation; a bad shot is a status.
    """
    groups: dict[Path, tuple[Path, list[Path]]] = {}
    for file in files:
        sheet_path = sheet if sheet is not None else file.with_suffix(".toml")
        if sheet_path.resolve() == file.resolve():
            raise refusal(file.name, "is both recording and sheet (expected a sheet .toml)")
        groups.setdefault(sheet_path.resolve(), (sheet_path, []))[1].append(file)
    local = _Local(weather, u_pressure_hpa, u_humidity_percent)
    paths = (_path(sheet_path, members, local, model, air_model) for sheet_path, members in groups.values())
    return AcousticReduction(tuple(paths))


class _Local(NamedTuple):
    """Weather of all paths, with its standard uncertainties; None: of the files."""

    readings: SoundWeather | None
    u_pressure_hpa: float | None
    u_humidity_percent: float | None

    def u(self, readings: SoundWeather | None, sheet: AcousticSheet, sheet_file: str) -> tuple[float, float]:
        """Standard uncertainties of pressure and humidity; InputError where nothing states one."""
        values = []
        for name in ("u_pressure_hpa", "u_humidity_percent"):
            stated = (getattr(self, name), getattr(readings, name, None), getattr(sheet, name))
            value = next((item for item in stated if item is not None), None)
            if value is None:
                raise refusal(
                    sheet_file, f"{name} is missing (expected it in the sheet, the logger's, or as an option)"
                )
            values.append(value)
        return values[0], values[1]


def _path(sheet_path: Path, files: Sequence[Path], local: _Local, model: str, air_model: str) -> AcousticPath:
    sheet, digest = read_sheet(sheet_path)
    readings = local.readings or sheet_readings(sheet, sheet_path.name)
    hashes = {sheet_path.name: digest, **(readings.hashes if readings else {})}
    parts, columns = [], 0
    for path in files:
        read = read_recording(path, sheet)
        if read.file in hashes:
            raise refusal(read.file, "appears twice, or two files have that name (expected each once, different names)")
        hashes[read.file] = read.digest
        try:
            if isinstance(read, TravelTimes):
                columns += _require_one_weather(read, local.readings)
                parts.append(_timed(read, sheet, readings))
            else:
                parts.append(_recorded_shots(read, sheet, sheet_path.name, readings))
        except ValidityError as problem:
            raise refusal(read.file, str(problem)) from problem
    shots = _joined(parts, sheet_path.name)
    if shots.time_ba is None and sheet.u_wind_m_per_s is None:
        raise refusal(
            sheet_path.name,
            "u_wind_m_per_s is missing (expected wind_m_per_s and its u where one direction is measured)",
        )
    source = None if columns == len(parts) else readings
    u_weather = local.u(source, sheet, sheet_path.name)
    try:
        temperatures = _temperatures(shots, sheet, u_weather, model, air_model)
    except ValidityError as problem:
        raise refusal(sheet_path.name, str(problem)) from problem
    return AcousticPath(
        sheet=sheet,
        sheet_file=sheet_path.name,
        shots=shots,
        temperatures=temperatures,
        model=model,
        air_model=air_model,
        hashes=hashes,
        weather_of=source.source if source else "the table's columns",
        u_weather=u_weather,
        doubts=source.doubts_at(shots.mjd) if source else (),
    )


def _require_one_weather(times: TravelTimes, readings: SoundWeather | None) -> bool:
    """True for a table with pressure and humidity of its own; InputError where other readings contradict them."""
    complete = {"pressure_hpa", "humidity_percent"} <= times.weather.keys()
    if complete and readings is not None:
        raise refusal(
            times.file,
            f"has pressure_hpa and humidity_percent in its rows, and {readings.source} has others (expected one)",
        )
    return complete


def _recorded_shots(
    recording: Recording, sheet: AcousticSheet, sheet_file: str, readings: SoundWeather | None
) -> SoundShots:
    """Travel times of the shots in a recording."""
    sampling_hz = recording.sampling_hz or sheet.sampling_hz
    start = sheet.start_of(recording.file)
    for name, value in (("sampling_hz", sampling_hz), ("signal", sheet.signal)):
        if value is None:
            raise refusal(sheet_file, f"{name} is missing (expected a value, as {recording.file} holds samples)")
    if start is None:
        raise refusal(sheet_file, f"recordings does not name {recording.file!r} (expected its start_mjd_utc)")
    assert sampling_hz is not None
    assert sheet.signal is not None
    emission = sheet.emission_s + (sheet.interval_s or 0.0) * np.arange(sheet.shots)
    mjd = start + emission / SECONDS_PER_DAY
    if readings is None:
        raise refusal(
            sheet_file,
            "has no [[weather]] (expected it, a logger's table as weather, or temperature, pressure and humidity)",
        )
    weather = readings.at(mjd)
    flight = sheet.length_m / sound(*weather, model=THERMOMETRY, co2_ppm=sheet.co2_ppm).speed
    listener = _Listener(recording, sheet, sampling_hz, sampled(sheet.signal.kind, sampling_hz, **sheet.signal.values))
    sent, u_sent, loop = emission, np.zeros(len(mjd)), None
    if "loop" in recording.samples:
        loop = listener.arrivals("loop", emission, LOOP_WINDOW)
        two_way = {"ab", "ba"} <= recording.samples.keys()
        # one loop serves both directions: its noise does not average out, so it counts twice in squares
        sent, u_sent = loop.delay, loop.u_delay * (np.sqrt(2.0) if two_way else 1.0)
    window = listener.window(flight, weather[0])
    if sheet.interval_s is not None and sheet.shots > 1 and sheet.interval_s <= 2.0 * window:
        raise refusal(
            sheet_file,
            f"interval_s = {sheet.interval_s:g} is within the window of an arrival, {2e3 * window:.4g} ms wide: one "
            "arrival would count as several shots (expected a longer interval_s, or a narrower window_ms)",
        )
    offset = sheet.clock_offset_us * MICROSECOND
    delay = sheet.delay_us * MICROSECOND
    texts = [[] if loop is None else [f"loop: {text}"] for text in (loop.texts if loop else [""] * len(mjd))]
    times, u_times, snrs = {}, [], []
    for channel, sign in (("ab", 1.0), ("ba", -1.0)):
        if channel not in recording.samples:
            u_times.append(np.zeros(len(mjd)))
            snrs.append(np.full(len(mjd), np.nan))
            continue
        result = listener.arrivals(channel, emission + flight + delay + sign * offset, window)
        times[channel] = result.delay - sent - sign * offset
        u_times.append(np.sqrt(result.u_delay**2 + u_sent**2 + (sheet.u_time_us * MICROSECOND) ** 2))
        snrs.append(result.snr)
        for row, text in zip(texts, result.texts, strict=True):
            row.append(f"{channel}: {text}")
    if "ab" not in times:
        raise refusal(recording.file, "has no channel 'ab' (one direction is measured from ranger to target)")
    return SoundShots(
        mjd=mjd,
        time_ab=times["ab"],
        time_ba=times.get("ba"),
        u_time=np.array(u_times),
        snr=np.array(snrs),
        texts=tuple("; ".join(t) for t in texts),
        weather=weather,
        file=(recording.file,) * len(mjd),
        traces=tuple(listener.traces),
    )


@dataclass(frozen=True, eq=False)
class _Arrivals:
    """Arrivals of k shots in one channel.

    delay, u_delay   (k,) s, from the file's first sample; nan without one
    snr              (k,)
    texts            status of each
    """

    delay: np.ndarray
    u_delay: np.ndarray
    snr: np.ndarray
    texts: list[str]


class _Listener:
    """Search for the known signal in the channels of one recording."""

    def __init__(self, recording: Recording, sheet: AcousticSheet, sampling_hz: float, template: np.ndarray) -> None:
        self.recording, self.sheet, self.sampling_hz, self.template = recording, sheet, sampling_hz, template
        self.traces: list[ChannelTrace] = []

    def window(self, flight: np.ndarray, temperature_c: np.ndarray) -> float:
        if self.sheet.window_ms is not None:
            return self.sheet.window_ms * 1e-3
        share = 0.5 * WARMER_C / (ZERO_CELSIUS_K + temperature_c.min()) + WINDIER * flight.max() / self.sheet.length_m
        return float(max(share * flight.max(), 2.0 / self.sampling_hz))

    def arrivals(self, channel: str, expected: np.ndarray, window: float) -> _Arrivals:
        """Arrival of each shot, s from the file's first sample."""
        samples = self.recording.samples[channel]
        plan = DelayPlan(
            self.template, sampling_hz=self.sampling_hz, window=window,
            weighting="plain" if channel == "loop" else self.sheet.weighting, band_hz=self.sheet.band_hz,
            noise=self._quiet(samples, expected[0] - window), full_scale=self.recording.full_scale,
        )  # fmt: skip
        n, wide = len(samples), min(len(samples), plan.stretch + 2)
        first, last = expected.min() - window, expected.max() + window + (len(self.template) + 1) / self.sampling_hz
        if first < 0.0 or last > n / self.sampling_hz:
            raise refusal(
                self.recording.file,
                f"channel {channel!r}, arrivals are sought from {first:.4g} to {last:.4g} s "
                f"(expected within its {n / self.sampling_hz:.4g} s: check emission_s, interval_s, shots, window_ms)",
            )
        before = (plan.stretch - len(self.template)) // 2
        begin = np.clip(np.rint(expected * self.sampling_hz).astype(int) - before, 0, n - wide)
        rows = np.stack([samples[b : b + wide] for b in begin])
        at = begin / self.sampling_hz
        delays = plan(rows, expected - at)
        good = delays.status <= DelayStatus.ECHO
        delay = np.where(good, delays.delay + at, np.nan)
        lag, height = plan.correlation(np.nan_to_num(rows[0].astype(float)), float(expected[0] - at[0]))
        self.traces.append(
            ChannelTrace(
                channel=channel,
                file=self.recording.file,
                time=at[0] + np.arange(wide) / self.sampling_hz,
                samples=rows[0],
                lag=lag + at[0],
                correlation=height,
                arrival=float(delay[0]),
            )
        )
        texts = [delays.text(k) for k in range(len(at))]
        return _Arrivals(delay, np.where(good, delays.u_delay, np.nan), delays.snr, texts)

    def _quiet(self, samples: np.ndarray, until: float) -> np.ndarray | None:
        """Noise for the whitened weights, or None.

        After the near loudspeaker has ended, before the first arrival's window.
        """
        if self.sheet.weighting != "whitened":
            return None
        begin = self.sheet.emission_s + len(self.template) / self.sampling_hz + LOOP_WINDOW
        return samples[max(0, int(begin * self.sampling_hz)) : max(0, int(until * self.sampling_hz))]


def _timed(times: TravelTimes, sheet: AcousticSheet, readings: SoundWeather | None) -> SoundShots:
    """Rows of a table of travel times, with the readings' weather where it has none.

    Without any temperature it is nan: of travel times it is shown beside the result, and not used.
    """
    absent = [name for name in QUANTITIES[1:] if name not in times.weather]
    if readings is None and absent:
        raise refusal(
            times.file,
            f"has no column {absent[0]}, and its sheet no [[weather]] (expected {' and '.join(QUANTITIES[1:])} in the "
            "table, [[weather]], a logger's table as weather, or temperature, pressure and humidity)",
        )
    needed = readings is not None and any(name not in times.weather for name in QUANTITIES)
    local = readings.at(times.mjd) if readings is not None and needed else (np.full(len(times.mjd), np.nan),) * 3
    t, p, h = (times.weather.get(name, value) for name, value in zip(QUANTITIES, local, strict=True))
    offset, count = sheet.clock_offset_us * MICROSECOND, len(times.mjd)
    u = np.zeros(count) if times.u_time is None else times.u_time
    u = np.hypot(u, sheet.u_time_us * MICROSECOND)
    if not (u > 0.0).all():
        raise InputError(
            f"{times.file}: its times have no standard uncertainty (expected u_time_us, a column or in the sheet)"
        )
    return SoundShots(
        mjd=times.mjd,
        time_ab=times.time_ab - offset,
        time_ba=None if times.time_ba is None else times.time_ba + offset,
        u_time=np.stack([u, u]),
        snr=np.full((2, count), np.nan),
        texts=("",) * count,
        weather=(t, p, h),
        file=(times.file,) * count,
    )


def _joined(parts: Sequence[SoundShots], sheet_file: str) -> SoundShots:
    """Files of a path joined in order of time."""
    one_way = {part.time_ba is None for part in parts}
    if len(one_way) > 1:
        raise refusal(sheet_file, "some files have both directions and some one (expected the same in all of a path)")
    order = np.argsort(np.concatenate([part.mjd for part in parts]), kind="stable")

    def column(values: Sequence[np.ndarray]) -> np.ndarray:
        return np.concatenate(values, axis=-1)[..., order]

    temperature, pressure, humidity = (column([part.weather[i] for part in parts]) for i in range(3))
    texts, files = ([item for part in parts for item in getattr(part, name)] for name in ("texts", "file"))
    both = [part.time_ba for part in parts if part.time_ba is not None]
    return SoundShots(
        mjd=column([part.mjd for part in parts]),
        time_ab=column([part.time_ab for part in parts]),
        time_ba=None if one_way == {True} else column(both),
        u_time=column([part.u_time for part in parts]),
        snr=column([part.snr for part in parts]),
        texts=tuple(texts[i] for i in order),
        weather=(temperature, pressure, humidity),
        file=tuple(files[i] for i in order),
        traces=parts[0].traces,
    )


def frequency_hz(sheet: AcousticSheet) -> float:
    """Frequency for the air's dispersion, Hz.

    The sheet's, else the root mean square of the signal's.
    """
    if sheet.frequency_hz is not None:
        return sheet.frequency_hz
    if sheet.signal is None:
        raise ValidityError(
            "frequency_hz is missing (expected the sound's where there is no [signal]: the air's dispersion is 0.03 C "
            "in moist air, 0.2 C in dry; 0 for a speed at zero frequency)"
        )
    sampling_hz = sheet.sampling_hz or 192e3
    samples = sampled(sheet.signal.kind, sampling_hz, **sheet.signal.values)
    return DelayPlan(samples, sampling_hz=sampling_hz, window=1e-3).bandwidth / TWO_PI


def _temperatures(
    shots: SoundShots, sheet: AcousticSheet, u_weather: tuple[float, float], model: str, air_model: str
) -> PathTemperatures:
    one_way = shots.time_ba is None
    u_offset = sheet.u_clock_offset_us * MICROSECOND
    u_delay = sheet.u_delay_us * MICROSECOND

    line = SoundLine(
        length=sheet.length_m,
        u_length=sheet.u_length_mm * 1e-3,
        delay=sheet.delay_us * MICROSECOND,
        u_delay=float(np.hypot(u_delay, u_offset)) if one_way else u_delay,
        speed_gradient=sheet.speed_gradient_per_s,
        u_speed_gradient=sheet.u_speed_gradient_per_s,
        frequency_hz=frequency_hz(sheet),
        model=model,
    )
    station = StationAir(
        pressure_hpa=shots.weather[1],
        u_pressure_hpa=u_weather[0],
        humidity_percent=shots.weather[2],
        u_humidity_percent=u_weather[1],
        co2_ppm=sheet.co2_ppm,
    )
    wind = PathWind(
        crosswind=sheet.crosswind_m_per_s,
        u_crosswind=sheet.u_crosswind_m_per_s,
        wind=sheet.wind_m_per_s if one_way else None,
        u_wind=sheet.u_wind_m_per_s if one_way else None,
    )

    def at(shift: float) -> PathTemperatures:
        return path_temperatures(
            shots.time_ab - shift,
            None if shots.time_ba is None else shots.time_ba + shift,
            np.nan_to_num(shots.u_time),
            line=line,
            station=station,
            wind=wind,
            wavelength_um=sheet.wavelength_um,
            air_model=air_model,
        )

    temperatures = at(0.0)
    return temperatures if one_way or u_offset == 0.0 else _with_clock(temperatures, at(u_offset))


def _with_clock(temperatures: PathTemperatures, moved: PathTemperatures) -> PathTemperatures:
    """Temperatures with the clock offset's uncertainty added.

    Common to all: it affects the wind, hardly the temperature.

    moved   temperatures with the clock offset larger by its standard uncertainty
    """
    t, w = moved.temperature_c - temperatures.temperature_c, moved.wind - temperatures.wind
    n = moved.group_refractivity - temperatures.group_refractivity
    covariance, group = temperatures.covariance_c2 + np.outer(t, t), temperatures.covariance_group + np.outer(n, n)
    return replace(
        temperatures,
        covariance_c2=covariance,
        u_temperature_c=np.sqrt(np.diag(covariance)),
        u_wind=np.hypot(temperatures.u_wind, w),
        covariance_group=group,
        u_group_refractivity=np.sqrt(np.diag(group)),
        parts_c={**temperatures.parts_c, "clock": np.abs(t)},
    )
