"""Registry of lies, and a night that lies."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.errors import InputError
from catseye.simulator.night.air import NIGHT, AirConditions
from catseye.simulator.night.faults import Faults, Planted, Streams
from catseye.simulator.night.lies import nature, records
from catseye.simulator.night.lies.nature import NightSetting
from catseye.simulator.night.movements import BODIES
from catseye.simulator.night.nature import CALM, Nature
from catseye.simulator.night.night import Night
from catseye.simulator.night.simulate import simulate_night

STATION, RANGER, BENCHMARK, TARGET = "WX1, WX2 or both", "a ranger", "a benchmark", "a single target"
RECEIVER = "a ranger or all"
GROUND_RANGER, TRIPLET, BODY = "a ranger on a monument", "a triplet or all", f"{', '.join(BODIES)}, or a ground ranger"
FAR = (30.0, 60.0, 120.0)
Change = Callable[[Any, str, tuple[float, ...], np.random.Generator], Any]


@dataclass(frozen=True)
class LieKind:
    """Kind of a lie.

    doc      what is wrong; a size is what the record states less the truth
    of       what is named; "" where nothing is
    unit     of its size; "" without one: the lie has no size
    usual    usual sizes
    parts    numbers that give a size by components instead, if there is a direction; 1 without
    record   changes the files of a night whose truth stays
    nature   changes what happens
    """

    doc: str
    of: str = ""
    unit: str = ""
    usual: tuple[float, ...] = ()
    parts: int = 1
    record: Change | None = None
    nature: Change | None = None

    @property
    def form(self) -> str:
        """Words after the kind's name, as people type them."""
        direction = f" (or {self.parts} components)" if self.parts > 1 else ""
        return " ".join(word for word in ("NAME" if self.of else "", f"{self.unit}{direction}") if word)


LIES: Mapping[str, LieKind] = {
    "target": LieKind("typed position of a target", TARGET, "mm", FAR, 3, record=records.target),
    "monument": LieKind("survey of a monument", GROUND_RANGER, "mm", (0.1, 0.3, 1.0, 3.0), 3, record=records.monument),
    "certificate": LieKind(
        "certified distance of a benchmark", BENCHMARK, "mm", (0.02, 0.1, 0.3, 1.0), record=records.certificate
    ),
    "d0": LieKind("reference distance of a head", RANGER, "mm", (0.01, 0.1, 0.3, 1.0), record=records.d0),
    "offset": LieKind("offset of a head's mirror", GROUND_RANGER, "mm", (0.05, 0.15, 1.0), 3, record=records.offset),
    "dz-sign": LieKind("sign of dz of a head's mirror", GROUND_RANGER, record=records.dz_sign),
    "h-corr": LieKind("height h_corr of triplets", TRIPLET, "mm", (0.02, 0.1, 0.3, 0.6), record=records.h_corr),
    "modulation": LieKind("modulation frequency of all", "", "ppm", (0.3, 1.0, 5.0, 10.0), record=records.modulation),
    "oscillator": LieKind("modulation of one ranger", RANGER, "ppm", (1.0, 5.0, 10.0), nature=nature.oscillator),
    "thermometer": LieKind("offset of a thermometer", STATION, "°C", (0.3, 1.0, 2.0, 9.0), record=records.thermometer),
    "stuck": LieKind(
        "thermometer repeats a reading for an hour while the air cools by so much an hour",
        STATION, "°C/h", (0.5, 2.0, 4.0), record=records.stuck, nature=nature.cooling,
    ),
    "spike": LieKind("one reading of a thermometer", STATION, "°C", (3.0, 10.0, 30.0), record=records.spike),
    "fahrenheit": LieKind("temperatures in °F", STATION, record=records.fahrenheit),
    "pressure": LieKind("offset of a barometer", STATION, "hPa", (0.3, 1.0, 3.0, 9.0), record=records.pressure),
    "sea-level": LieKind("pressures reduced to sea level", STATION, record=records.sea_level),
    "mmhg": LieKind("pressures in mmHg", STATION, record=records.mmhg),
    "inhg": LieKind("pressures in inHg", STATION, record=records.inhg),
    "humidity": LieKind("hygrometer, cut off at 0 and 100", STATION, "%", (-10.0, -100.0), record=records.humidity),
    "humidity-fraction": LieKind("humidities as a fraction of 1", STATION, record=records.humidity_fraction),
    "elevation": LieKind("elevation of the posture", "", "deg", (0.03, 0.1, 1.0), record=records.elevation),
    "azimuth": LieKind("azimuth of the posture", "", "deg", (0.03, 0.1, 1.0), record=records.azimuth),
    "posture-radians": LieKind("azimuth and elevation in radians", record=records.posture_radians),
    "posture-swapped": LieKind("azimuth and elevation exchanged", record=records.posture_swapped),
    "target-metres": LieKind("typed position of a target in m", TARGET, record=records.target_metres),
    "monument-metres": LieKind("survey of a monument in m", GROUND_RANGER, record=records.monument_metres),
    "certificate-metres": LieKind("certified distance in m", BENCHMARK, record=records.certificate_metres),
    "d0-metres": LieKind("reference distance of a head in m", RANGER, record=records.d0_metres),
    "clipped": LieKind("gain of a receiver too high by a factor", RECEIVER, "", (6.0,), record=records.clipped),
    "clock": LieKind("clock of a ranger", RANGER, "s", (-60.0, -600.0), record=records.clock),
    "gradient": LieKind("constant horizontal gradient", "", "°C/m", (0.005, 0.01, 0.02), 2, nature=nature.gradient),
    "sway": LieKind("each coordinate of a body, from shot to shot", BODY, "mm", (0.1, 0.3, 1.0), nature=nature.sway),
    "drift": LieKind("steady motion of a body", BODY, "mm/h", (0.3, 1.0, 3.0), 3, nature=nature.drift),
    "blocked": LieKind("shots without return", "", "%", (5.0, 15.0), nature=nature.blocked),
    "reflected": LieKind("shots with a stray reflection", "", "%", (5.0,), nature=nature.reflected),
}  # fmt: skip


@dataclass(frozen=True)
class Lie:
    """Lie as people type it: kind, what it is about, numbers.

    >>> str(Lie.of_text("monument ZY103 1"))
    'monument ZY103 1'
    """

    kind: str
    of: str
    numbers: tuple[float, ...]

    @classmethod
    def of_text(cls, text: str) -> "Lie":
        """Lie of a text such as "monument ZY103 1.0".

        Raises InputError: unknown kind, missing name, invalid number.
        """
        kind, *words = text.split() or [""]
        if kind not in LIES:
            raise InputError(f"lie {text!r}: unknown kind (expected one of {', '.join(LIES)})")
        rule = LIES[kind]
        expected = f"lie {text!r} (expected {' '.join([kind, *([rule.of] if rule.of else [])])}"
        expected += f" and a number{' in ' * bool(rule.unit)}{rule.unit}" * bool(rule.usual)
        expected += f", or {rule.parts} components)" if rule.parts > 1 else ")"
        if len(words) < bool(rule.of):
            raise InputError(expected)
        of, numbers = (words[0], words[1:]) if rule.of else ("", words)
        try:
            values = tuple(float(number) for number in numbers)
        except ValueError:
            raise InputError(expected) from None
        if len(values) not in ({1, rule.parts} if rule.usual else {0}) or not np.all(np.isfinite(values)):
            raise InputError(expected)
        return cls(kind, of, values)

    def __str__(self) -> str:
        return " ".join(word for word in (self.kind, self.of, *(f"{v:g}" for v in self.numbers)) if word)

    def rng(self, seed: int) -> np.random.Generator:
        """Generator of what the lie leaves open, such as a direction."""
        return Streams(seed)(f"lie/{self.kind}/{self.of}")


def lying_night(
    seed: int,
    lies: Iterable[str],
    *,
    conditions: AirConditions = NIGHT,
    faults: Faults | None = None,
    planted: Planted | None = None,
    nature: Nature | None = None,
    **others: Any,
) -> Night:
    """Simulated night with lies of nature and of its records.

    seed     of the night, and of what a lie leaves open
    lies     such as "monument ZY103 1.0": the names and sizes of `LIES`
    others   arguments of `simulate_night`, as are those that are named

    Raises InputError: a lie is unknown, or about something that the night does not have.
    """
    setting = NightSetting(conditions, faults or Faults(), planted or Planted(), nature or CALM)
    typed = [Lie.of_text(text) for text in lies]
    for lie in typed:
        if (change := LIES[lie.kind].nature) is not None:
            setting = change(setting, lie.of, lie.numbers, lie.rng(seed))
    night = simulate_night(
        seed,
        conditions=setting.conditions,
        faults=setting.faults,
        planted=setting.planted,
        nature=setting.nature,
        **others,
    )
    for lie in typed:
        if (change := LIES[lie.kind].record) is not None:
            night = change(night, lie.of, lie.numbers, lie.rng(seed))
    return replace(night, lies=tuple(str(lie) for lie in typed))
