"""Rows of hostile nights: what lies, in which sizes, and by which words a reduction names it."""

import re
import zlib
from dataclasses import dataclass, field

import numpy as np

from catseye.simulator.night.lies.lie import LIES
from catseye.simulator.night.world import FEED_ARM_RANGERS, GROUND_RANGERS
from nature_scene import natural_setting

PRISMS, FIRST_SEED = 60, 7001
UNTRIED_SEED = 50001  # of make evidence alone: no threshold was chosen, and nothing mended, with these nights
STATIONS = ("WX1", "WX2")
STRUCTURAL, ON_ARM = ("ZEG41040L", "ZEG20440L", "ZAG731P", "ZAG731D"), ("ZEG41040L", "ZEG20440L")
BENCHMARKS = tuple(f"ZBM{k:02d}" for k in range(1, 7))
POOLS = {
    "STATION": STATIONS,
    "MONUMENT": GROUND_RANGERS,
    "RANGER": (*GROUND_RANGERS, *FEED_ARM_RANGERS),
    "BENCHMARK": BENCHMARKS,
    "STRUCTURAL": STRUCTURAL,
    "PRISM": tuple(f"DP{k:03d}" for k in range(1, PRISMS + 1)),
    "TRIPLET": tuple(f"TR{k:02d}" for k in range(1, 11)),
}


@dataclass(frozen=True)
class Row:
    """Kind of hostile night.

    lies     texts with names of `POOLS` and SIZE; a pool's name draws one member a night, PLACE2 another one
    named    patterns, one a lie, of a text or a candidate that names it; {} is the member
    sizes    of SIZE; (0,) without
    covers   whether points must be within their claim besides: naming does not help who uses a point 71 mm off
    shots    whether the reasons of rejected shots may name it
    """

    lies: tuple[str, ...]
    named: tuple[str, ...]
    sizes: tuple[float, ...] = (0.0,)
    covers: bool = False
    shots: bool = False


@dataclass(frozen=True)
class Case:
    """One night of a row: the lies as typed, and the pattern of each; `covers` and `shots` as of the row."""

    row: str
    seed: int
    size: float
    lies: tuple[str, ...]
    named: tuple[str, ...]
    covers: bool = False
    shots: bool = False
    setting: dict = field(default_factory=dict)


SCALE = r"modulation|common scale"
MONUMENT = r"(monument {0}|monuments/{0}|{0}.*(monument|survey))"
CERTIFICATE = r"({0}.*certificate|certificate.*{0}|benchmarks\.csv.*{0}|benchmark {0})"
BAROMETER = r"(pressure|barometer|hPa).*{0}|{0}.*(pressure|barometer|hPa)"
THERMOMETER = r"{0}.*(thermometer|temperature)|(thermometer|temperature).*{0}"
BOTH_PRESSURES = r"pressures?\b|barometers? of"
HUMIDITY = r"humidit|hygrometer"
ZERO = r"{0}'s zero|zero (of )?{0}|d0_mm of|mirrors/ZP{1}.*d0|{0}.*d0_mm"
OFFSET = r"{0}.*(offset|d[xyz]_mm)|mirrors/ZP{1}.*d[xyz]_mm|ZP{1}.*offset"
TYPED = r"{0}: its typed position|{0}: none of its|typed position of {0}|typed positions: .*{0}|target {0} by"
ALL_HEIGHTS = r"h_corr|triplet sheets: |heights of (all )?triplets"
ONE_HEIGHT = r"{0}.*h_corr|triplets/{0}|triplet {0} by|heights? of.*{0}"
CLIPPED = r"{0}.*(clip|\bgain\b)|(clip|\bgain\b).*{0}"
SWAY = r"\b(sway|moves from shot to shot|from shot to shot)"
DRIFT = r"\b(drift|moves|moved|movement)"

ROWS = {
    "structural target typed off": Row(("target STRUCTURAL SIZE",), (TYPED,), (30.0, 60.0, 90.0, 120.0), covers=True),
    "dish prism typed off": Row(("target PRISM SIZE",), (TYPED,), (60.0, 120.0), covers=True),
    "pressure at sea level, one station": Row(("sea-level STATION",), (BAROMETER,)),
    "pressure at sea level, both": Row(("sea-level both",), (BOTH_PRESSURES,)),
    "barometer of one station": Row(("pressure STATION SIZE",), (BAROMETER,), (1.0, 3.0, 9.0)),
    "pressure in mmHg, both": Row(("mmhg both",), (r"mmHg|millimetres of mercury",)),
    "pressure in mmHg, one station": Row(("mmhg STATION",), (r"mmHg|millimetres of mercury|" + BAROMETER,)),
    "pressure in inHg": Row(("inhg both",), (r"pressure",)),
    "temperature in °F": Row(("fahrenheit both",), (r"°F|[Ff]ahrenheit|temperature_c",)),
    "humidity 0 at both": Row(("humidity both -100",), (HUMIDITY,)),
    "humidity as a fraction": Row(("humidity-fraction both",), (HUMIDITY,)),
    "thermometer of one station": Row(("thermometer STATION SIZE",), (THERMOMETER,), (1.0, 3.0, 9.0)),
    "both thermometers": Row(("thermometer both SIZE",), (r"thermometer|temperature",), (1.0, 2.0, 4.0)),
    "stuck thermometer": Row(("stuck STATION SIZE",), (THERMOMETER,), (1.0, 2.0, 4.0)),
    "spike of a thermometer": Row(("spike STATION SIZE",), (THERMOMETER,), (3.0, 10.0, 30.0)),
    "modulation, all": Row(("modulation SIZE",), (SCALE,), (1.0, 5.0, -5.0, 10.0)),
    "modulation, one ranger": Row(
        ("oscillator RANGER SIZE",), (r"{0}.*(modulation|scale|oscillator)|(modulation|scale|oscillator).*{0}",),
        (1.0, 5.0, -5.0, 10.0),
    ),
    "certificate": Row(("certificate BENCHMARK SIZE",), (CERTIFICATE,), (0.1, 0.3, -0.6, 1.0)),
    "monument": Row(("monument MONUMENT SIZE",), (MONUMENT,), (0.3, 1.0, 3.0)),
    "two monuments": Row(("monument MONUMENT SIZE", "monument MONUMENT2 SIZE"), (MONUMENT, MONUMENT), (1.0, 3.0)),
    "d0": Row(("d0 RANGER SIZE",), (ZERO,), (0.1, -0.3, 1.0)),
    "dz sign": Row(("dz-sign MONUMENT",), (OFFSET,)),
    "mirror offset": Row(("offset MONUMENT SIZE",), (OFFSET,), (0.05, 0.15, 1.0)),
    "heights of all triplets": Row(("h-corr all SIZE",), (ALL_HEIGHTS,), (0.1, 0.3, 0.6)),
    "height of one triplet": Row(("h-corr TRIPLET SIZE",), (ONE_HEIGHT,), (0.1, 0.3, 0.6)),
    "elevation of the posture": Row(("elevation SIZE",), (r"elevation|posture",), (0.03, -0.1, 1.0)),
    "posture in radians": Row(("posture-radians",), (r"radians|elevation|posture",)),
    "all samples clipped": Row(("clipped all 6",), (r"clip|\bgain\b",), shots=True),
    "one ranger's samples clipped": Row(("clipped RANGER 6",), (CLIPPED,), shots=True),
    "clock of a ranger": Row(("clock RANGER SIZE",), (r"{0}.*(clock|time)|(clock|times?\b).*{0}",), (-60.0, -600.0)),
    "monument in metres": Row(("monument-metres MONUMENT",), (MONUMENT,)),
    "d0 in metres": Row(("d0-metres RANGER",), (ZERO,)),
    "certificate in metres": Row(("certificate-metres BENCHMARK",), (CERTIFICATE + "|certified_distance_mm",)),
    "horizontal gradient": Row(("gradient SIZE",), (r"gradient",), (0.005, 0.01, 0.02)),
    "sway of the feed arm": Row(("sway arm SIZE",), (SWAY,), (0.1, 0.3)),
    "sway of the telescope": Row(("sway telescope SIZE",), (SWAY,), (0.1, 0.3)),
    "drift of the telescope": Row(("drift telescope SIZE",), (DRIFT,), (0.3, 1.0, 3.0)),
    "drift of the feed arm": Row(("drift arm SIZE",), (DRIFT,), (0.3, 1.0, 3.0)),
    "drift of a monument": Row(("drift MONUMENT SIZE",), (DRIFT,), (1.0, 3.0)),
    "blocked and reflected": Row(("blocked 15", "reflected 5"), (r"blocked|were rejected, over",) * 2, covers=True),
}  # fmt: skip
SINGLES = tuple(ROWS)
MIXED = (  # of which two are drawn at a time
    "structural target typed off", "barometer of one station", "thermometer of one station", "modulation, one ranger",
    "certificate", "monument", "d0", "mirror offset", "height of one triplet", "sway of the feed arm",
    "drift of the telescope", "horizontal gradient", "humidity 0 at both",
)  # fmt: skip
TWO, HONEST = "two at once", "honest"
NAMES = (*SINGLES, TWO, HONEST)


def _filled(row: Row, size: float, rng: np.random.Generator) -> tuple[list[str], list[str]]:
    """Lies and patterns of one night, with members and size filled in."""
    lies, named, drawn = [], [], []
    for line, pattern in zip(row.lies, row.named, strict=True):
        text, member = line, ""
        for pool, members in POOLS.items():
            if re.search(rf"\b{pool}2?\b", text):
                member = str(rng.choice([m for m in members if m not in drawn]))
                drawn.append(member)
                text = re.sub(rf"\b{pool}2?\b", member, text)
        lies.append(re.sub(r"\bSIZE\b", f"{size:g}", text))
        named.append(pattern.replace("{0}", re.escape(member)).replace("{1}", re.escape(member[2:])))
    return lies, named


def sizes_of(name: str) -> tuple[float, ...]:
    """Sizes of a row."""
    return ROWS[name].sizes if name in ROWS else (0.0,)


def unit_of(name: str) -> str:
    """Unit of a row's sizes; "" without sizes."""
    return next(
        (LIES[text.split()[0]].unit for text in (ROWS[name].lies if name in ROWS else ()) if "SIZE" in text), ""
    )


def case(name: str, seed: int, size: float) -> Case:
    """Night of a row; the members are drawn from row and seed."""
    setting = natural_setting(seed, PRISMS)
    rng = np.random.default_rng([45, seed, zlib.crc32(name.encode())])
    if name == HONEST:
        return Case(name, seed, size, (), (), setting=setting)
    if name == TWO:
        some = [ROWS[MIXED[k]] for k in rng.choice(len(MIXED), 2, replace=False)]
        rows = [(row, float(rng.choice(row.sizes[1:] or row.sizes))) for row in some]
    else:
        rows = [(ROWS[name], size)]
    filled = [_filled(row, own, rng) for row, own in rows]
    return Case(
        row=name,
        seed=seed,
        size=size,
        lies=tuple(text for lies, _ in filled for text in lies),
        named=tuple(pattern for _, named in filled for pattern in named),
        covers=any(row.covers for row, _ in rows),
        shots=any(row.shots for row, _ in rows),
        setting=setting,
    )
