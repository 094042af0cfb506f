"""Planted faults, and sources of randomness."""

import zlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from catseye.errors import InputError

EFFECTS = (
    "calibration",  # D0, mirror offsets, monuments, heights, radii, leakage: truth minus sheet
    "drift",  # random walk of the electronic phase
    "feed_arm",  # deflection of the feed arm against the dish
    "h_corr",  # height of the ball centre above the prism mid-point
    "index_fluctuation",  # refractivity of one path against smooth air
    "lateral",  # ball centre aside of the prism mid-point
    "leakage",  # crosstalk phasor of a head
    "mirror_offset",  # dx, dy, dz of a ground head
    "noise",  # of the samples
    "normals",  # true normals and axes against the typed ones
    "obliquity",  # delay of a prism at its incidence angle, against straight entry
    "posture",  # rigid offset of the telescope
    "scintillation",  # amplitude from shot to shot
    "stratification",  # temperature and pressure changing with height
    "surface",  # normal deviations of the dish
    "thermometer_offsets",  # fixed offsets of the station thermometers
    "typing",  # errors of the approximate positions
    "warm_up",  # exponential transient of the electronic phase
    "weather_scatter",  # of the readings
)


@dataclass(frozen=True)
class Faults:
    """Faults of the night; the defaults are like night-01.

    fraction_blocked     shots without return, 0 to 1 (never reference shots)
    fraction_reflected   shots with a stray reflection, 0 to 1
    weak_ranger          a feed-arm ranger that receives `weak_amplitude` of the usual, or None
    wrong_position_mm    error of one approximate position, as a typing error
    lying_thermometer_c  added to the readings of `lying_station` on top of its ordinary offset
    """

    fraction_blocked: float = 0.0125
    fraction_reflected: float = 0.0125
    weak_ranger: str | None = "ZY116"
    weak_amplitude: float = 0.2
    wrong_position_mm: float = 30.0
    lying_thermometer_c: float = 0.0
    lying_station: str = "WX2"

    def __post_init__(self):
        if (
            min(self.fraction_blocked, self.fraction_reflected) < 0
            or self.fraction_blocked + self.fraction_reflected > 1
        ):
            raise InputError(
                f"fraction_blocked = {self.fraction_blocked} and fraction_reflected = {self.fraction_reflected}: "
                "expected shares of the shots, together at most 1"
            )
        if self.lying_station not in ("WX1", "WX2"):
            raise InputError(f"lying_station = {self.lying_station!r}: expected WX1 or WX2")


@dataclass(frozen=True)
class Planted:
    """Changes of the truth unknown to the files; other draws are unchanged.

    shifts        name of a point -> (x, y, z), metres, ground frame, added to its true position
    signs         effect -> factor on it, such as -1
    ignore        effects that do not happen
    d0_error_mm   ranger -> true D0 minus typed D0, on top of the calibration's own uncertainty
    modulation_ppm   ranger -> its true modulation frequency minus the site's, ppm
    """

    shifts: Mapping[str, Sequence[float]] = field(default_factory=dict)
    signs: Mapping[str, float] = field(default_factory=dict)
    ignore: Collection[str] = frozenset()
    d0_error_mm: Mapping[str, float] = field(default_factory=dict)
    modulation_ppm: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self):
        for effect in (*self.signs, *self.ignore):
            if effect not in EFFECTS:
                raise InputError(f"unknown effect {effect!r}: expected one of {', '.join(EFFECTS)}")

    def gain(self, effect: str) -> float:
        """Factor on an effect: 0 when ignored, its planted sign, otherwise 1."""
        return 0.0 if effect in self.ignore else float(self.signs.get(effect, 1.0))


NIGHTLY = ("samples/", "returns/", "path/", "path noise/", "electronics", "weather/", "sound/", "air/", "nature/")


@dataclass(frozen=True)
class Streams:
    """Independent random generators by purpose, so that draws do not interact.

    night   another one at the same site: nightly draws differ, site draws do not
    """

    seed: int
    night: int = 0

    def __call__(self, purpose: str) -> np.random.Generator:
        key = zlib.crc32(purpose.encode())
        keys = (key, self.night) if self.night and purpose.startswith(NIGHTLY) else (key,)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=keys))
