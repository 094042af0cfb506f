"""Lies of records: files that state another value than the truth, which stays what it is.

A size is what the record states less the truth: positive where it states too much.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from catseye.constants import DEGREE, PPM
from catseye.errors import InputError
from catseye.simulator.night.lies.nature import directed
from catseye.simulator.night.night import Night
from catseye.simulator.night.stations import STATIONS, WeatherReading
from catseye.simulator.night.structure import TrueTarget
from catseye.simulator.night.truth import Truth
from catseye.simulator.night.world import TrueHead, TrueMonument

ALL, STATION_PAIR = "all", "both"
HPA_PER_MMHG, HPA_PER_INHG = 1.333224, 33.86389
STUCK_S = (300.0, 3900.0)  # s since the start: an hour of most of a small night
MM_PER_M = 1000.0
Numbers = tuple[float, ...]
T = TypeVar("T")


def _record(records: Mapping[str, T], name: str, what: str) -> T:
    """Record by its name.

    Raises InputError: there is none.
    """
    if name not in records:
        raise InputError(f"a lie about {name!r}: not a {what} (expected one of {', '.join(records)})")
    return records[name]


def _with_target(night: Night, name: str, changed: Callable[[TrueTarget], TrueTarget]) -> Night:
    _record({t.name: t for t in night.single_targets}, name, "single target")
    return replace(night, single_targets=[changed(t) if t.name == name else t for t in night.single_targets])


def _with_head(night: Night, ranger: str, changed: Callable[[TrueHead], TrueHead]) -> Night:
    head = _record(night.heads, ranger, "ranger")
    return replace(night, heads={**night.heads, ranger: changed(head)})


def _with_weather(night: Night, of: str, changed: Callable[[WeatherReading], WeatherReading]) -> Night:
    if of not in (STATION_PAIR, *STATIONS):
        raise InputError(f"a lie about {of!r}: not a station (expected {', '.join(STATIONS)} or {STATION_PAIR})")
    return replace(night, weather=[changed(w) if of in (STATION_PAIR, w.station) else w for w in night.weather])


def target(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Typed position of a single target, mm."""
    by = directed(numbers, rng, (True, True, True))
    return _with_target(night, name, lambda t: replace(t, position_mm=t.position_mm + by))


def target_metres(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Typed position of a single target in metres."""
    return _with_target(night, name, lambda t: replace(t, position_mm=t.position_mm / MM_PER_M))


def _with_survey(night: Night, name: str, changed: Callable[[TrueMonument], np.ndarray]) -> Night:
    """Another survey of a monument, beside latitude and height as they were."""
    mark = _record(night.monuments, name, "monument")
    survey = replace(mark, fixed_point_mm=changed(mark), levelled_mm=mark.fixed_point_mm)
    return replace(night, monuments={**night.monuments, name: survey})


def monument(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Survey of a monument, mm; a coordinate without uncertainty stays."""
    return _with_survey(night, name, lambda m: m.fixed_point_mm + directed(numbers, rng, m.u_mm > 0.0))


def monument_metres(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Survey of a monument in metres."""
    return _with_survey(night, name, lambda m: m.fixed_point_mm / MM_PER_M)


def certificate(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Certificate of a benchmark, mm."""
    _record({b.name: b for b in night.benchmarks}, name, "benchmark")
    marks = [replace(b, certified_mm=b.certified_mm + numbers[0]) if b.name == name else b for b in night.benchmarks]
    return replace(night, benchmarks=marks)


def certificate_metres(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Certificate of a benchmark in metres."""
    _record({b.name: b for b in night.benchmarks}, name, "benchmark")
    marks = [replace(b, certified_mm=b.certified_mm / MM_PER_M) if b.name == name else b for b in night.benchmarks]
    return replace(night, benchmarks=marks)


def d0(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Reference distance of a head, mm."""
    return _with_head(night, name, lambda h: replace(h, d0_mm=h.d0_mm + numbers[0]))


def d0_metres(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Reference distance of a head in metres."""
    return _with_head(night, name, lambda h: replace(h, d0_mm=h.d0_mm / MM_PER_M))


def offset(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Offset dx, dy, dz of a head's mirror, mm."""
    by = directed(numbers, rng, (True, True, True))
    return _with_head(night, name, lambda h: replace(h, offset_mm=h.offset_mm + by))


def dz_sign(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Sign of dz on a mirror sheet."""
    return _with_head(night, name, lambda h: replace(h, offset_mm=h.offset_mm * np.array([1.0, 1.0, -1.0])))


def h_corr(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Height of the ball over the prisms of one or all triplets, mm."""
    _record({ALL: None, **{t.name: None for t in night.telescope.triplets}}, name, "triplet")
    changed = [
        replace(t, h_corr_mm=t.h_corr_mm + numbers[0]) if name in (ALL, t.name) else t for t in night.telescope.triplets
    ]
    return replace(night, telescope=replace(night.telescope, triplets=changed))


def modulation(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Modulation frequency of the site, ppm."""
    return replace(night, modulation_hz=night.modulation_hz * (1.0 + numbers[0] * PPM))


def thermometer(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Thermometer of one or both stations, °C."""
    return _with_weather(night, of, lambda w: replace(w, temperature_c=w.temperature_c + numbers[0]))


def stuck(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Thermometer that repeats one reading for an hour."""
    begin, end = STUCK_S
    last: dict[str, float] = {}

    def repeated(w: WeatherReading) -> WeatherReading:
        if not begin <= w.seconds < end:
            last[w.station] = w.temperature_c
        return replace(w, temperature_c=last[w.station])

    return _with_weather(night, of, repeated)


def spike(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """One reading of a thermometer, in the middle of the shots, °C."""
    times = {w.seconds for w in night.weather if of in (STATION_PAIR, w.station)}
    middle = min(times, key=lambda s: abs(s - night.truth.reference_s), default=0.0)
    return _with_weather(
        night,
        of,
        lambda w: replace(w, temperature_c=w.temperature_c + numbers[0] * (w.seconds == middle)),
    )


def fahrenheit(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Temperatures of stations in °F."""
    return _with_weather(night, of, lambda w: replace(w, temperature_c=1.8 * w.temperature_c + 32.0))


def pressure(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Barometer of one or both stations, hPa."""
    return _with_weather(night, of, lambda w: replace(w, pressure_hpa=w.pressure_hpa + numbers[0]))


def sea_level(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Pressures reduced to sea level.

    Source: ICAO standard atmosphere, Doc 7488: p (1 - 0.0065 h / 288.15)^-5.2559.
    """

    def reduced(w: WeatherReading) -> WeatherReading:
        share = (1.0 - 0.0065 * STATIONS[w.station] / 288.15) ** 5.2559
        return replace(w, pressure_hpa=w.pressure_hpa / share)

    return _with_weather(night, of, reduced)


def mmhg(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Pressures in millimetres of mercury."""
    return _with_weather(night, of, lambda w: replace(w, pressure_hpa=w.pressure_hpa / HPA_PER_MMHG))


def inhg(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Pressures in inches of mercury."""
    return _with_weather(night, of, lambda w: replace(w, pressure_hpa=w.pressure_hpa / HPA_PER_INHG))


def humidity(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Hygrometer of one or both stations, %; readings end at 0 and 100."""

    def read(w: WeatherReading) -> WeatherReading:
        return replace(w, humidity_percent=min(max(w.humidity_percent + numbers[0], 0.0), 100.0))

    return _with_weather(night, of, read)


def humidity_fraction(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Humidities as fractions of 1."""
    return _with_weather(night, of, lambda w: replace(w, humidity_percent=w.humidity_percent / 100.0))


def elevation(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Elevation of the telescope, degrees."""
    return replace(night, elevation_deg=night.elevation_deg + numbers[0])


def azimuth(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Azimuth of the telescope, degrees."""
    return replace(night, azimuth_deg=(night.azimuth_deg + numbers[0]) % 360.0)


def posture_radians(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Azimuth and elevation in radians."""
    return replace(night, azimuth_deg=night.azimuth_deg * DEGREE, elevation_deg=night.elevation_deg * DEGREE)


def posture_swapped(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Azimuth and elevation exchanged."""
    return replace(night, azimuth_deg=night.elevation_deg, elevation_deg=night.azimuth_deg)


def clipped(night: Night, of: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Gain of the receivers of one or all rangers too high by a factor."""
    _record({ALL: None, **night.heads}, of, "ranger")
    mine = np.array([of in (ALL, s.ranger) for s in night.shots])
    frames = night.frames.copy()
    frames[mine] = np.clip(np.rint(frames[mine].astype(np.float32) * numbers[0]), -32768.0, 32767.0).astype(np.int16)
    return replace(night, frames=frames)


def clock(night: Night, name: str, numbers: Numbers, rng: np.random.Generator) -> Night:
    """Clock of one ranger, s: its shots' times, and so their rows' order and numbers."""
    _record(night.heads, name, "ranger")
    shots = [replace(s, seconds=s.seconds + numbers[0]) if s.ranger == name else s for s in night.shots]
    order = np.argsort([s.seconds for s in shots], kind="stable").tolist()
    return replace(
        night, shots=[shots[i] for i in order], frames=night.frames[order], truth=_renumbered(night.truth, order)
    )


def _renumbered(truth: Truth, order: list[int]) -> Truth:
    """Truth whose shots are numbered in another order."""
    old = {str(new + 1): str(i + 1) for new, i in enumerate(order)}

    def keyed(values: Mapping[str, T]) -> dict[str, T]:
        return {number: values[was] for number, was in old.items() if was in values}

    return replace(
        truth,
        shot_status=keyed(truth.shot_status),
        shot_ranges=keyed(truth.shot_ranges),
        shot_phase_errors=keyed(truth.shot_phase_errors),
        path_refractivity_ppm=keyed(truth.path_refractivity_ppm),
    )
