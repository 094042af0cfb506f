"""Sound recordings: .wav and .csv files, tables of travel times, and their sheet.

WAVE files may be PCM of 16, 24 and 32 bits or floats of 32 and 64, with any number of channels. Rows of a table are
counted as in `columns`.
"""

import hashlib
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from catseye.errors import InputError
from catseye.records.files.columns import columns_of
from catseye.records.files.reading import Folder
from catseye.records.files.record import (
    EARLIEST_MJD,
    LATEST_MJD,
    Certificate,
    Mjd,
    Name,
    Record,
    Version,
    Within,
    broken_rule,
)
from catseye.records.files.refusal import refusal, shown, unreadable

CHANNELS = ("ab", "ba", "loop")
TIMES = ("mjd_utc", "time_ab_s", "time_ba_s")
BESIDES = ("u_time_us", "temperature_c", "pressure_hpa", "humidity_percent")
PCM, FLOAT, EXTENSIBLE = 1, 3, 0xFFFE
SPANS = {
    "time_ab_s": (1e-4, 20.0),
    "time_ba_s": (1e-4, 20.0),
    "u_time_us": (1e-4, 1e5),
    "temperature_c": (-60.0, 60.0),
    "pressure_hpa": (500.0, 1100.0),
    "humidity_percent": (0.0, 100.0),
}

Channel = Literal["ab", "ba", "loop", "unused"]
Hertz = Annotated[float, Within(1, 1e6)]
Microseconds = Annotated[float, Within(-1e6, 1e6)]
Wind = Annotated[float, Within(-60, 60)]
UWind = Annotated[float, Within(0, 30)]
Gradient = Annotated[float, Within(-10, 10)]
UMicroseconds = Annotated[float, Within(0, 1e5)]


class Signal(Record):
    """Reference signal, for `signal.delay.waveform`.

    kind                                      "chirp", "pulse" or "mls"
    start_hz, stop_hz                         first and last frequency of a chirp
    centre_hz                                 centre frequency of a pulse or a maximum length sequence
    duration_s                                duration of a chirp or a pulse
    taper                                     share of a chirp over which each end is faded
    order                                     order of a maximum length sequence, 2^order - 1 chips
    chip_hz                                   chip rate of a maximum length sequence
    """

    kind: Literal["chirp", "pulse", "mls"]
    start_hz: Hertz | None = None
    stop_hz: Hertz | None = None
    centre_hz: Hertz | None = None
    chip_hz: Hertz | None = None
    duration_s: Annotated[float, Within(1e-5, 10)] | None = None
    taper: Annotated[float, Within(0, 0.5)] | None = None
    order: Annotated[int, Within(3, 12)] | None = None

    @model_validator(mode="after")
    def _has_its_values(self) -> "Signal":
        needed = {
            "chirp": ("start_hz", "stop_hz", "duration_s"),
            "pulse": ("centre_hz", "duration_s"),
            "mls": ("order", "chip_hz"),
        }[self.kind]
        allowed = {"chirp": (*needed, "taper"), "pulse": needed, "mls": (*needed, "centre_hz")}[self.kind]
        for name, value in self:
            if name != "kind" and value is None and name in needed:
                raise broken_rule(f"{name} is missing (expected {', '.join(needed)} for kind = {self.kind!r})")
            if name != "kind" and value is not None and name not in allowed:
                raise broken_rule(f"{name} is not a value of kind = {self.kind!r} (expected {', '.join(allowed)})")
        return self

    @property
    def values(self) -> dict[str, float]:
        """Arguments of `signal.delay.waveform.sampled` other than the kind."""
        parameters = {"duration" if name == "duration_s" else name: value for name, value in self if name != "kind"}
        return {name: value for name, value in parameters.items() if value is not None}


class AcousticWeather(Record):
    """Weather reading near the path; temperature only predicts the arrival.

    mjd_utc            time
    temperature_c      temperature of the air
    pressure_hpa       pressure of the air
    humidity_percent   relative humidity
    """

    mjd_utc: Mjd
    temperature_c: Annotated[float, Within(-60, 60)]
    pressure_hpa: Annotated[float, Within(500, 1100)]
    humidity_percent: Annotated[float, Within(0, 100)]


class RecordingStart(Record):
    """Time of the first sample of a file.

    file            name of the file
    start_mjd_utc   time of its first sample
    """

    file: Annotated[str, Field(min_length=1)]
    start_mjd_utc: Mjd


class AcousticSheet(Certificate):
    """Sheet of a recording: path, signal, electronics, weather. Defaults are zero effects.

    ranger, target         ends A and B: "ab" is the channel of the microphone at the target
    length_m, u_length_mm  distance from loudspeaker to microphone, equal in both directions
    channels               channels of a WAVE file, in order; a .csv names its own
    sampling_hz            sampling rate of the files
    recordings             start time of each file
    emission_s             time from a file's first sample to the first signal; further shots follow at interval_s
    window_ms              half width around the predicted arrival; by default for 15 °C and 15 m/s of wind
    delay_us, u_delay_us   delay of loudspeaker, microphone and parts outside the loop-back: equal in both directions
    clock_offset_us, u_clock_offset_us   lead of the clock of channel "ab" over that of the emission, and lag of
                           channel "ba", with two recorders; 0 with a common clock
    u_time_us              least standard uncertainty of a travel time: turbulence, converter
    u_pressure_hpa, u_humidity_percent   of the weather readings, common to all; if missing a logger's own
    crosswind_m_per_s, u_crosswind_m_per_s   wind across the path; without an anemometer 0 and the site's rms wind
    wind_m_per_s, u_wind_m_per_s   wind along a path measured one way only, positive from ranger to target
    speed_gradient_per_s, u_speed_gradient_per_s   change of the speed of sound across the path: rays bend
    frequency_hz           frequency of the sound, for the air's dispersion; by default the signal's; needed for a table
                           without `[signal]`, where 0 means a speed at zero frequency
    weighting              weighting of the correlation; "phat" is the phase transform
    band_hz                lowest and highest frequency used in the correlation
    interval_s             time between two signals, longer than the window
    shots                  number of signals in a file
    signal                 reference signal
    co2_ppm                carbon dioxide in the air
    wavelength_um          wavelength of the light, for the group refractivity of the path
    weather                readings near the path; if missing the table's columns, a logger's table or one reading
    """

    format: Annotated[int | str, Version("acoustic")] = 1
    ranger: Name
    target: Name
    length_m: Annotated[float, Within(0.3, 2000)]
    u_length_mm: Annotated[float, Within(0, 1000)]
    channels: Annotated[tuple[Channel, ...], Field(strict=False)] = ()
    sampling_hz: Annotated[float, Within(1000, 1e6)] | None = None
    recordings: Annotated[tuple[RecordingStart, ...], Field(strict=False)] = ()
    emission_s: Annotated[float, Within(-10, 3600)] = 0.0
    interval_s: Annotated[float, Within(0, 3600, above=True)] | None = None
    shots: Annotated[int, Within(1, 100_000)] = 1
    window_ms: Annotated[float, Within(0, 2000, above=True)] | None = None
    signal: Signal | None = None
    delay_us: Microseconds = 0.0
    u_delay_us: UMicroseconds = 0.0
    clock_offset_us: Microseconds = 0.0
    u_clock_offset_us: UMicroseconds = 0.0
    u_time_us: UMicroseconds = 0.0
    u_pressure_hpa: Annotated[float, Within(0, 50)] | None = None
    u_humidity_percent: Annotated[float, Within(0, 50)] | None = None
    crosswind_m_per_s: Wind = 0.0
    u_crosswind_m_per_s: UWind
    wind_m_per_s: Wind | None = None
    u_wind_m_per_s: UWind | None = None
    speed_gradient_per_s: Gradient = 0.0
    u_speed_gradient_per_s: Annotated[float, Within(0, 10)] = 0.0
    frequency_hz: Annotated[float, Within(0, 1e5)] | None = None
    co2_ppm: Annotated[float, Within(0, 2000)] = 450.0
    wavelength_um: Annotated[float, Within(0.3, 2.0)] = 0.780
    weighting: Literal["plain", "whitened", "phat"] = "plain"
    band_hz: Annotated[tuple[float, float], Field(strict=False)] | None = None
    weather: Annotated[tuple[AcousticWeather, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _belongs_together(self) -> "AcousticSheet":
        if self.ranger == self.target:
            raise broken_rule(f"target = {self.target!r} is also the ranger (expected the path's other end)")
        if (self.wind_m_per_s is None) != (self.u_wind_m_per_s is None):
            raise broken_rule("wind_m_per_s and u_wind_m_per_s belong together (expected both or none)")
        if self.shots > 1 and self.interval_s is None:
            raise broken_rule(f"interval_s is missing (expected a value for shots = {self.shots})")
        for name in CHANNELS:
            if self.channels.count(name) > 1:
                raise broken_rule(f"channels names {name!r} {self.channels.count(name)} times (expected once)")
        times = [reading.mjd_utc for reading in self.weather]
        if sorted(set(times)) != times:
            raise broken_rule("weather is not in order of mjd_utc (expected each reading later than the one before)")
        return self

    def start_of(self, file: str) -> float | None:
        """Start time of a file, MJD; None if not in the sheet."""
        return next((item.start_mjd_utc for item in self.recordings if item.file == file), None)


@dataclass(frozen=True, eq=False)
class Recording:
    """File of samples.

    file          file name
    samples       channel -> (n,) codes or volts
    sampling_hz   in the file, None for a .csv
    full_scale    magnitude at the converter's ends, None if unknown
    digest        SHA-256 of the file
    """

    file: str
    samples: dict[str, np.ndarray]
    sampling_hz: float | None
    full_scale: float | None
    digest: str


@dataclass(frozen=True, eq=False)
class TravelTimes:
    """Table of travel times, each column (k,).

    mjd            UTC
    time_ab        s, NaN for blank cells
    time_ba        s, likewise; None without the column
    u_time         s, of each; None without the column
    weather        column -> values, of the columns present
    """

    file: str
    mjd: np.ndarray
    time_ab: np.ndarray
    time_ba: np.ndarray | None
    u_time: np.ndarray | None
    weather: dict[str, np.ndarray]
    digest: str


def read_sheet(path: Path | str) -> tuple[AcousticSheet, str]:
    """Sheet and its SHA-256; InputError with file, place, value."""
    path = Path(path)
    folder = Folder(path.parent)
    sheet = folder.record(path.name, AcousticSheet)
    return sheet, folder.hashes[path.name]


def read_recording(path: Path | str, sheet: AcousticSheet) -> Recording | TravelTimes:
    """Samples of a .wav or .csv file, or travel times of a table.

    path    a .csv with the column mjd_utc holds travel times, others samples
    sheet   names the channels of a .wav

    Raises InputError for other files, or if channels or sampling differ from the sheet.
    """
    path = Path(path)
    raw = _bytes(path)
    digest = hashlib.sha256(raw).hexdigest()
    if raw[:4] in (b"RIFF", b"RF64", b"RIFX"):
        recording = _of_wav(raw, path.name, sheet, digest)
    else:
        text = Folder(path.parent).text(path.name)
        header = [name.strip() for name in text.split("\n", 1)[0].split(",")]
        if "mjd_utc" in header:
            return _travel_times(text, path.name, digest)
        if not set(header) & set(CHANNELS):
            raise refusal(
                path.name,
                f"line 1, {shown(','.join(header))} is neither a WAVE file nor a table (expected the columns "
                f"{','.join(TIMES)} of travel times, or {','.join(CHANNELS)} of samples)",
            )
        table = columns_of(text, path.name, (), optional=CHANNELS)
        samples: dict[str, np.ndarray] = {name: table.numbers(name) for name in table.cells}
        recording = Recording(path.name, samples, None, None, digest)
    if not set(recording.samples) & {"ab", "ba"}:
        raise refusal(path.name, "has no channel 'ab' or 'ba' (expected at least one direction of the path)")
    return recording


def wav_bytes(samples: np.ndarray, sampling_hz: int) -> bytes:
    """WAVE file of 16-bit samples (channels, n)."""
    codes = np.asarray(samples)
    if codes.ndim != 2 or codes.dtype != np.int16:
        raise InputError(f"samples {codes.dtype} of {codes.ndim} axes are no WAVE file (expected int16, channels by n)")
    body = codes.T.astype("<i2").tobytes()
    width = 2 * len(codes)
    form = struct.pack("<HHIIHH", PCM, len(codes), sampling_hz, sampling_hz * width, width, 16)
    chunks = b"WAVEfmt " + struct.pack("<I", len(form)) + form + b"data" + struct.pack("<I", len(body)) + body
    return b"RIFF" + struct.pack("<I", len(chunks)) + chunks


def _bytes(path: Path) -> bytes:
    Folder(path.parent).path(path.name)
    try:
        return path.read_bytes()
    except OSError as problem:
        raise unreadable(path.name, problem) from problem


def _of_wav(raw: bytes, file: str, sheet: AcousticSheet, digest: str) -> Recording:
    samples, sampling_hz, full_scale = wav_samples(raw, file)
    if not sheet.channels:
        raise refusal(file, "the sheet has no channels (expected e.g. channels = ['ab', 'ba'])")
    if len(samples) != len(sheet.channels):
        raise refusal(
            file, f"has {len(samples)} channels (expected {len(sheet.channels)}: {', '.join(sheet.channels)})"
        )
    if sheet.sampling_hz is not None and sheet.sampling_hz != sampling_hz:
        raise refusal(file, f"is sampled at {sampling_hz:g} Hz (expected sampling_hz = {sheet.sampling_hz:g})")
    named: dict[str, np.ndarray] = {name: samples[i] for i, name in enumerate(sheet.channels) if name != "unused"}
    return Recording(file, named, sampling_hz, full_scale, digest)


def wav_samples(raw: bytes, file: str) -> tuple[np.ndarray, float, float | None]:
    """Samples (channels, n) of a WAVE file, sampling in Hz, and full-scale magnitude.

    raw    content of the file
    file   file name, for messages

    Raises InputError for other kinds of WAVE file and truncated ones.
    """
    if raw[:4] != b"RIFF" or raw[8:12] != b"WAVE":
        raise refusal(file, f"starts with {shown(raw[:12])} (expected a RIFF WAVE file)")
    form, body, at = None, None, 12
    while at + 8 <= len(raw) and body is None:
        name, size = raw[at : at + 4], struct.unpack("<I", raw[at + 4 : at + 8])[0]
        content = raw[at + 8 : at + 8 + size]
        if name in (b"fmt ", b"data") and len(content) < size:
            raise refusal(file, f"is truncated: {len(content)} of {size} bytes of {shown(name)} are present")
        form = content if name == b"fmt " else form
        body = content if name == b"data" else body
        at += 8 + size + size % 2
    if form is None or body is None or len(form) < 16:
        raise refusal(file, "has no samples (expected the chunks 'fmt ' and 'data')")
    kind, channels, rate, _, _, bits = struct.unpack("<HHIIHH", form[:16])
    if kind == EXTENSIBLE and len(form) >= 26:
        kind = struct.unpack("<H", form[24:26])[0]
    codes, full_scale = _codes(body, kind, bits, file)
    if channels == 0 or rate == 0 or len(codes) < channels:
        raise refusal(file, f"holds {channels} channels, {len(codes)} samples at {rate} Hz (expected some of each)")
    n = len(codes) // channels
    return np.ascontiguousarray(codes[: n * channels].reshape(n, channels).T), float(rate), full_scale


def _codes(body: bytes, kind: int, bits: int, file: str) -> tuple[np.ndarray, float | None]:
    complete = len(body) - len(body) % max(1, bits // 8)
    if (kind, bits) == (PCM, 16):
        return np.frombuffer(body[:complete], "<i2"), 2.0**15 - 1.0
    if (kind, bits) == (PCM, 32):
        return np.frombuffer(body[:complete], "<i4"), 2.0**31 - 1.0
    if (kind, bits) == (PCM, 24):
        three = np.frombuffer(body[:complete], np.uint8).reshape(-1, 3)
        wide = np.zeros((len(three), 4), np.uint8)
        wide[:, 1:] = three
        return wide.view("<i4").ravel() >> 8, 2.0**23 - 1.0
    if kind == FLOAT and bits in (32, 64):
        return np.frombuffer(body[:complete], f"<f{bits // 8}"), 1.0
    raise refusal(file, f"holds samples of kind {kind}, {bits} bits (expected PCM of 16, 24, 32 bits or floats)")


def _travel_times(text: str, file: str, digest: str) -> TravelTimes:
    table = columns_of(text, file, TIMES[:2], optional=(TIMES[2], *BESIDES))
    mjd = table.numbers("mjd_utc")
    table.check("mjd_utc", (mjd >= EARLIEST_MJD) & (mjd <= LATEST_MJD), f"{EARLIEST_MJD:g} to {LATEST_MJD:g}")
    values = {}
    for name, (low, high) in SPANS.items():
        if name in table.cells:
            blank = np.nan if name.startswith("time_") else None
            values[name] = table.numbers(name, blank)
            good = np.isnan(values[name]) | ((values[name] >= low) & (values[name] <= high))
            table.check(name, good, f"{low:g} to {high:g}")
    return TravelTimes(
        file=file,
        mjd=mjd,
        time_ab=values["time_ab_s"],
        time_ba=values.get("time_ba_s"),
        u_time=values["u_time_us"] * 1e-6 if "u_time_us" in values else None,
        weather={name: values[name] for name in BESIDES[1:] if name in values},
        digest=digest,
    )
