"""Invalid campaigns are refused in one line: file, place, value, expectation."""

import io
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.names import SINGLE_RETROREFLECTORS
from catseye.records.night.campaign import read_campaign
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
SHOTS = 30
TEXT_FILES = (
    "site.toml",
    "monuments/ZY101.toml",
    "mirrors/ZP101.toml",
    "feedarm.toml",
    "targets.toml",
    "triplets/TR01.toml",
    "benchmarks.csv",
    "weather.csv",
    "shots.csv",
)
SINGLE_KINDS = " or ".join([", ".join(map(repr, SINGLE_RETROREFLECTORS[:-1])), repr(SINGLE_RETROREFLECTORS[-1])])
Damage = Callable[[Path], None]


def build_small(directory: Path) -> Path:
    """The example campaign with its first shots only."""
    shutil.copytree(NIGHT, directory, ignore=shutil.ignore_patterns("frames.npy", "README.md"))
    lines = (NIGHT / "shots.csv").read_bytes().splitlines(keepends=True)
    (directory / "shots.csv").write_bytes(b"".join(lines[: SHOTS + 1]))
    np.save(directory / "frames.npy", np.load(NIGHT / "frames.npy", mmap_mode="r", allow_pickle=False)[:SHOTS])
    return directory


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    return build_small(tmp_path_factory.mktemp("pristine") / "small")


@pytest.fixture
def small(pristine, tmp_path):
    return Path(shutil.copytree(pristine, tmp_path / "small"))


def swap(file: str, old: str, new: str) -> Damage:
    """Replace text that is there, once."""

    def damage(campaign: Path) -> None:
        raw = (campaign / file).read_bytes()
        assert old.encode() in raw
        (campaign / file).write_bytes(raw.replace(old.encode(), new.encode(), 1))

    return damage


def set_key(file: str, key: str, value: str) -> Damage:
    """Give the first such key another value."""

    def damage(campaign: Path) -> None:
        text = (campaign / file).read_text(encoding="utf-8")
        changed, count = re.subn(rf"(?m)^{key} = [^#\n]*", lambda _: f"{key} = {value}", text, count=1)
        assert count == 1
        (campaign / file).write_text(changed, encoding="utf-8")

    return damage


def set_cell(file: str, row: int, column: str, value: str) -> Damage:
    """Give a cell of a table another value; rows count from 1."""

    def damage(campaign: Path) -> None:
        rows = [line.split(",") for line in (campaign / file).read_text(encoding="utf-8").splitlines()]
        rows[row][rows[0].index(column)] = value
        (campaign / file).write_text("\n".join(",".join(cells) for cells in rows) + "\n", encoding="utf-8")

    return damage


def set_bytes(file: str, raw: bytes) -> Damage:
    return lambda campaign: (campaign / file).write_bytes(raw) and None


def drop_key(file: str, key: str) -> Damage:
    return swap(file, f"{key} = ", f"# {key} = ")


def cut(file: str, size: int) -> Damage:
    return lambda campaign: (campaign / file).write_bytes((campaign / file).read_bytes()[:size]) and None


def append(file: str, raw: bytes) -> Damage:
    return lambda campaign: (campaign / file).write_bytes((campaign / file).read_bytes() + raw) and None


def prepend(file: str, raw: bytes) -> Damage:
    return lambda campaign: (campaign / file).write_bytes(raw + (campaign / file).read_bytes()) and None


def remove(file: str) -> Damage:
    def damage(campaign: Path) -> None:
        shutil.rmtree(campaign / file) if (campaign / file).is_dir() else (campaign / file).unlink()

    return damage


def rename(file: str, to: str) -> Damage:
    return lambda campaign: (campaign / file).rename(campaign / to) and None


def save_array(array: np.ndarray, *, allow_pickle: bool = False) -> Damage:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=allow_pickle)
    return set_bytes("frames.npy", stream.getvalue())


def copy_row(file: str, row: int) -> Damage:
    """The row a second time, directly below."""

    def damage(campaign: Path) -> None:
        lines = (campaign / file).read_text(encoding="utf-8").splitlines(keepends=True)
        (campaign / file).write_text("".join([*lines[: row + 1], *lines[row:]]), encoding="utf-8")

    return damage


def as_directory(file: str) -> Damage:
    def damage(campaign: Path) -> None:
        (campaign / file).unlink()
        (campaign / file).mkdir()

    return damage


MIRROR, MONUMENT, TRIPLET = "mirrors/ZP103.toml", "monuments/ZY101.toml", "triplets/TR01.toml"
DAMAGES: dict[str, tuple[Damage, str]] = {
    # units and ranges
    "d0 in metres": (
        set_key(MIRROR, "d0_mm", "0.18"),
        "mirrors/ZP103.toml: d0_mm = 0.18 looks like metres (expected 50 to 1000)",
    ),
    "dy in metres": (set_key(MIRROR, "dy_mm", "0.2476"), "dy_mm = 0.2476 looks like metres (expected 50 to 1000)"),
    "beta in degrees": (set_key(MIRROR, "beta1_rad", "1.5"), "beta1_rad = 1.5 looks like degrees (expected -0.1 to"),
    "leakage in millivolts": (
        set_key(MIRROR, "leakage_amplitude_volt", "31.0"),
        "leakage_amplitude_volt = 31.0 looks like millivolts (expected 0 to 10)",
    ),
    "zero uncertainty": (set_key(MIRROR, "u_d0_mm", "0.0"), "u_d0_mm = 0.0 (expected above 0 to 100)"),
    "limits swapped": (set_key(MIRROR, "az_low_limit", "80000"), "az_low_limit = 80000 is not below az_high_limit"),
    "monument in metres": (
        lambda campaign: (
            [set_key(MONUMENT, key, value)(campaign) for key, value in (("x_mm", "29.5"), ("y_mm", "115.9"))] and None
        ),
        "monuments/ZY101.toml: x_mm, y_mm = 29.5, 115.9 looks like metres (expected",
    ),
    "azimuth against alpha1": (
        set_key(MONUMENT, "azimuth_deg", "194.382580"),
        "alpha1_rad = -0.249278 does not belong to azimuth_deg = 194.38258 (expected alpha1 = pi - azimuth = -0.25",
    ),
    "alpha2 too large": (set_key(MONUMENT, "alpha2_rad", "0.3"), "alpha2_rad = 0.3 looks like degrees"),
    "negative uncertainty": (set_key(MONUMENT, "u_x_mm", "-0.1"), "u_x_mm = -0.1 (expected 0 to 100)"),
    "elevation in millimetres": (
        set_key(MONUMENT, "elevation_m", "806569.0"),
        "elevation_m = 806569.0 looks like millimetres (expected -500 to 9000)",
    ),
    "target in metres": (
        set_key("targets.toml", "position_mm", "[4.2384, 55.3111, 12.822]"),
        "targets.toml: target['DP001'].position_mm = [4.2384, 55.3111, 12.822] has the length 56.9358 "
        "looks like metres (expected 500 to 10000000)",
    ),
    "normal too long": (
        set_key("targets.toml", "normal", "[0.0, 1.0, 1.0]"),
        "target['DP001'].normal = [0.0, 1.0, 1.0] has the length 1.41421 (expected 0.999 to 1.001)",
    ),
    "prism constant of the wrong sign": (
        set_key("targets.toml", "pc_mm", "33.3236"),
        "target['DP001'].pc_mm = 33.3236 has the wrong sign (expected -2000 to -1)",
    ),
    "ball constant of the wrong sign": (
        set_key(TRIPLET, "pc_b_mm", "173.7"),
        "triplets/TR01.toml: ball.pc_b_mm = 173.7 has the wrong sign",
    ),
    "reference point past the glass": (
        set_key(TRIPLET, "hrp_mm", "39.0"),
        "left_prism: hrp_mm = 39.0 reaches past height_mm = 38.453",
    ),
    "triplet axis along its normal": (
        set_key(TRIPLET, "axis", "[-0.51159, -0.81351, 0.27655]"),
        "have the cosine 1.000 (expected perpendicular",
    ),
    "ball radii swapped": (set_key(TRIPLET, "r1_mm", "200.0"), "ball: r2_mm = 96.51 is smaller than r1_mm = 200.0"),
    "focal length in metres": (
        set_key("site.toml", "focal_length_mm", "60.0"),
        "site.toml: paraboloid.focal_length_mm = 60.0 looks like metres",
    ),
    "modulation in megahertz": (
        set_key("site.toml", "modulation_hz", "1500.0"),
        "ranging.modulation_hz = 1500.0 looks like megahertz",
    ),
    "telescope under its horizon": (
        set_key("site.toml", "elevation_deg", "-30.0"),
        "site.toml: campaign.elevation_deg = -30.0 (expected -5 to 95)",
    ),
    "buffer too long": (set_key("site.toml", "cycles", "2048"), "adc: cycles * samples_per_cycle = 2048 * 64 = 131072"),
    "feed arm in metres": (
        set_key("feedarm.toml", "nominal_scan_point_mm", "[-8.9131, -3.0895, 60.8537]"),
        "feedarm.toml: ranger['ZY113'].nominal_scan_point_mm = [-8.9131, -3.0895, 60.8537]",
    ),
    "benchmark in metres": (
        set_cell("benchmarks.csv", 2, "certified_distance_mm", "77.058865"),
        "benchmarks.csv: row 2, certified_distance_mm = 77.058865 looks like metres",
    ),
    "humidity": (
        set_cell("weather.csv", 17, "humidity_pct", "-3"),
        "weather.csv: row 17, humidity_pct = -3 (expected 0 to 100)",
    ),
    "pressure in pascals": (
        set_cell("weather.csv", 3, "pressure_mb", "93086"),
        "weather.csv: row 3, pressure_mb = 93086 looks like pascals",
    ),
    "temperature in kelvin": (
        set_cell("weather.csv", 3, "temperature_c", "285.15"),
        "weather.csv: row 3, temperature_c = 285.15 looks like kelvin",
    ),
    "temperature in degrees Fahrenheit": (
        set_cell("weather.csv", 3, "temperature_c", "95.0"),
        "weather.csv: row 3, temperature_c = 95.0 looks like degrees Fahrenheit",
    ),
    "pressure in inches of mercury": (
        set_cell("weather.csv", 3, "pressure_mb", "27.49"),
        "weather.csv: row 3, pressure_mb = 27.49 looks like inches of mercury",
    ),
    "pressure in mmHg": (
        set_cell("weather.csv", 3, "pressure_mb", "432.0"),
        "weather.csv: row 3, pressure_mb = 432.0 looks like mmHg",
    ),
    "offset in inches": (set_key(MIRROR, "d0_mm", "7.11"), "d0_mm = 7.11 looks like inches"),
    # types and keys
    "text for a number": (set_key(MIRROR, "d0_mm", '"180.5"'), "d0_mm = '180.5' (expected a number)"),
    "boolean for a number": (set_key(MIRROR, "d0_mm", "true"), "d0_mm = True (expected a number)"),
    "nan": (set_key(MIRROR, "d0_mm", "nan"), "d0_mm = nan (expected a finite number)"),
    "infinity": (set_key(TRIPLET, "d12_mm", "-inf"), "triplets/TR01.toml: d12_mm = -inf (expected a finite number)"),
    "fraction for a whole number": (
        set_key(MIRROR, "az_low_limit", "-21309.5"),
        "az_low_limit = -21309.5 (expected a whole number)",
    ),
    "huge whole number": (set_key(MIRROR, "na0", "0x" + "f" * 9000), "na0 = a number of thousands of digits (expected"),
    "huge decimal number": (set_key(MIRROR, "na0", "9" * 9000), "mirrors/ZP103.toml: cannot be read as TOML"),
    "deeply nested": (set_key(MIRROR, "na0", "[" * 9000), "mirrors/ZP103.toml: cannot be read as TOML"),
    "number for text": (set_key(MIRROR, "zp", "103"), "zp = 103 (expected text)"),
    "missing key": (drop_key(MIRROR, "d0_mm"), "mirrors/ZP103.toml: d0_mm is missing (expected a value)"),
    "unknown key": (
        swap(MIRROR, "d0_mm", "d0_m"),
        "mirrors/ZP103.toml: d0_m = 180.534 is not a known key (expected perhaps d0_mm); "
        "also invalid or missing: d0_mm",
    ),
    "stray key": (swap(MIRROR, "zp =", "qqqq = 1\nzp ="), "qqqq = 1 is not a known key (expected no such key)"),
    "key with a line feed": (
        swap(MIRROR, "d0_mm", '"d0\\nmm"'),
        "mirrors/ZP103.toml: 'd0\\nmm' = 180.534 is not a known",
    ),
    "short vector": (set_key(TRIPLET, "normal", "[0.0, 1.0]"), "triplets/TR01.toml: normal[2] is missing"),
    "long vector": (
        set_key(TRIPLET, "normal", "[0.0, 1.0, 0.0, 0.0]"),
        "normal = [0.0, 1.0, 0.0, 0.0] has 4 values (expected 3)",
    ),
    "text in a vector": (set_key(TRIPLET, "normal", '[0.0, "x", 1.0]'), "normal[1] = 'x' (expected a number)"),
    "number for a table": (
        swap("feedarm.toml", "[aim_point]\nnominal_mm", "aim_point = 3 #"),
        "feedarm.toml: ranger['ZY118'].aim_point = 3 is not a known key",
    ),
    "no stations": (
        lambda campaign: (
            (campaign / "site.toml").write_text(
                "weather_station = []\n" + (campaign / "site.toml").read_text(encoding="utf-8").split("[[weather")[0],
                encoding="utf-8",
            )
            and None
        ),
        "site.toml: weather_station = [] has 0 values (expected 1)",
    ),
    "unknown frame": (
        set_key(TRIPLET, "frame", '"dish"'),
        "frame = 'dish' (expected 'ground', 'alidade' or 'reflector')",
    ),
    "unknown type of target": (
        set_key("targets.toml", "type", '"cube"'),
        f"target['DP001'].type = 'cube' (expected {SINGLE_KINDS})",
    ),
    "prism without a normal": (drop_key("targets.toml", "normal"), "target['DP001']: normal is missing (expected for"),
    "hollow with glass": (
        swap("targets.toml", 'type = "hollow"', 'type = "hollow"\nhrp_mm = 25.0'),
        "hrp_mm = 25.0 belongs to a prism (expected none for type = 'hollow')",
    ),
    "station given twice": (swap("site.toml", '"WX2"', '"WX1"'), "weather_station 'WX1' is given twice"),
    "next version": (
        swap(MIRROR, "zp =", "format = 2\nzp ="),
        "mirrors/ZP103.toml: format = 2 (expected 1 or 'catseye-mirror-1', the supported versions)",
    ),
    "bad date": (swap(MIRROR, "zp =", 'measured_on = "May"\nzp ='), "measured_on = 'May' (expected a date)"),
    # names
    "path in a name": (set_key(MIRROR, "zp", '"../ZP103"'), "zp = '../ZP103' (expected letters, digits, _ . - and no"),
    "dots in a name": (set_key(MIRROR, "zp", '"ZP..103"'), "zp = 'ZP..103' (expected letters"),
    "line feed in a name": (set_key(MIRROR, "zp", '"ZP103\\n"'), "zp = 'ZP103\\n' (expected letters"),
    "endless name": (set_key(MIRROR, "zp", f'"{"Z" * 500} "'), "zp = 'ZZZ"),
    "name against file": (
        rename(MIRROR, "mirrors/ZP199.toml"),
        "mirrors/ZP199.toml: zp = 'ZP103' (expected 'ZP199', as the file's name)",
    ),
    "same target twice": (swap("targets.toml", '"DP002"', '"DP001"'), "targets.toml: target = 'DP001' is a name taken"),
    "triplet's target twice": (
        swap("triplets/TR02.toml", '"TR02-L"', '"TR01-L"'),
        "triplets/TR02.toml: target = 'TR01-L' is a name taken by triplets/TR01.toml",
    ),
    "ranger on ground and arm": (
        swap("feedarm.toml", '"ZY113"', '"ZY101"'),
        "feedarm.toml: ranger = 'ZY101' is a name taken by monuments/ZY101.toml",
    ),
    "target called as a fixed point": (
        swap("targets.toml", '"DP001"', '"ZY101-F"'),
        "targets.toml: target = 'ZY101-F' is a name taken by monuments/ZY101.toml (expected unique names)",
    ),
    "target called ZRG": (swap("targets.toml", '"DP001"', '"ZRG"'), "target = 'ZRG' is a name taken by the internal"),
    # what belongs together
    "no mirror file": (
        remove(MIRROR),
        "monuments/ZY103.toml: zp = 'ZP103' has no calibration (expected a file mirrors/ZP103.toml)",
    ),
    "one mirror on two rangers": (
        swap("feedarm.toml", '"ZP113"', '"ZP101"'),
        "feedarm.toml: ranger['ZY113'].zp = 'ZP101' is on ZY101 already",
    ),
    "unknown ranger": (
        set_cell("shots.csv", 5, "ranger", "ZY199"),
        "shots.csv: row 5, ranger = 'ZY199' is not in monuments/ or feedarm.toml",
    ),
    "unknown target": (
        set_cell("shots.csv", 5, "target", "DP999"),
        "shots.csv: row 5, target = 'DP999' is not in targets.toml, triplets/, monuments/ or feedarm.toml",
    ),
    "ranger shoots itself": (
        set_cell("shots.csv", 2, "target", "ZY116"),
        "row 2, target = 'ZY116' is the ranger itself",
    ),
    "benchmark to a stranger": (
        set_cell("benchmarks.csv", 3, "target", "ZBM99"),
        "benchmarks.csv: row 3, target = 'ZBM99' is not in",
    ),
    "benchmark by a stranger": (
        set_cell("benchmarks.csv", 3, "ranger", "ZY199"),
        "benchmarks.csv: row 3, ranger = 'ZY199' is not in",
    ),
    "unknown station": (
        set_cell("weather.csv", 4, "station", "WX9"),
        "weather.csv: row 4, station = 'WX9' (expected one of WX1, WX2, as in site.toml)",
    ),
    "silent station": (
        append("site.toml", b'\n[[weather_station]]\nname = "WX3"\nelevation_m = 900.0\n'),
        "weather.csv: station = 'WX3' of site.toml has no row",
    ),
    # order and time
    "weather backwards": (
        set_cell("weather.csv", 5, "mjd_utc", "52889.12"),
        "weather.csv: row 5, mjd_utc = 52889.12 is not after 52889.12326389, WX1's last",
    ),
    "weather twice": (copy_row("weather.csv", 7), "weather.csv: row 8, mjd_utc = 52889.12395833 is not after"),
    "weather of another night": (
        lambda campaign: (
            (campaign / "weather.csv").write_text(
                (campaign / "weather.csv").read_text(encoding="utf-8").replace("52889.", "52890."), encoding="utf-8"
            )
            and None
        ),
        "shots.csv: row 1, mjd_utc = 52889.125342761 has no weather (weather.csv covers 52890.12291667 to",
    ),
    "shots backwards": (
        set_cell("shots.csv", 6, "mjd_utc", "52889.1253"),
        "shots.csv: row 6, mjd_utc = 52889.1253 is before 52889.126001806 (expected in order of time)",
    ),
    "two shots of a ranger at once": (
        set_cell("shots.csv", 2, "mjd_utc", "52889.125342761"),
        "shots.csv: row 2, mjd_utc = 52889.125342761 is also the time of ZY116's last shot",
    ),
    "another campaign's start": (
        set_key("site.toml", "start_mjd_utc", "52899.0"),
        "shots.csv: row 1, mjd_utc = 52889.125342761 (expected within 1 day of the campaign's start, 52899.0)",
    ),
    "a Julian Date": (
        set_cell("shots.csv", 1, "mjd_utc", "2452889.625"),
        "shots.csv: row 1, mjd_utc = 2452889.625 (expected 40000 to 100000)",
    ),
    "shot twice": (
        set_cell("shots.csv", 7, "shot", "3"),
        "shots.csv: row 7, shot = 3 is in row 3 already (expected each shot once)",
    ),
    "frame twice": (set_cell("shots.csv", 7, "frame", "2"), "shots.csv: row 7, frame = 2 is in row 3 already"),
    "frame past the last": (
        set_cell("shots.csv", 7, "frame", "30"),
        "shots.csv: row 7, frame = 30 is not in frames.npy (expected 0 to 29)",
    ),
    "negative frame": (set_cell("shots.csv", 7, "frame", "-1"), "shots.csv: row 7, frame = -1 (expected 0 to"),
    "more cycles than samples": (
        set_cell("shots.csv", 7, "cycles", "129"),
        "shots.csv: row 7, cycles * samples_per_cycle = 129 * 64 = 8256 (expected at most 8192)",
    ),
    "no cycles": (set_cell("shots.csv", 7, "cycles", "0"), "shots.csv: row 7, cycles = 0 (expected 1 to 65536)"),
    "two samples a cycle": (
        set_cell("shots.csv", 7, "samples_per_cycle", "2"),
        "row 7, samples_per_cycle = 2 (expected 3",
    ),
    # tables
    "no shots": (cut("shots.csv", 58), "shots.csv: row 1 is missing, 0 shots (expected at least one)"),
    "no weather": (cut("weather.csv", 55), "weather.csv: station = 'WX1' of site.toml has no row"),
    "ragged row": (
        swap("shots.csv", "ZY116,DP026,", "ZY116,"),
        "shots.csv: row 3, 6 fields = '3,52889.125671306,ZY116,",
    ),
    "nan in a table": (
        set_cell("weather.csv", 2, "temperature_c", "nan"),
        "weather.csv: row 2, temperature_c = 'nan' (expected a number)",
    ),
    "infinity in a table": (
        set_cell("weather.csv", 2, "temperature_c", "1e999"),
        "weather.csv: row 2, temperature_c = 1e999 (expected a finite number)",
    ),
    "text in a table": (
        set_cell("shots.csv", 2, "cycles", "many"),
        "shots.csv: row 2, cycles = 'many' (expected a whole number)",
    ),
    "empty cell": (set_cell("shots.csv", 2, "shot", ""), "shots.csv: row 2, shot = '' (expected a whole number)"),
    "underscore in a number": (set_cell("shots.csv", 2, "shot", "1_0"), "shots.csv: row 2, shot = '1_0' (expected"),
    "missing column": (
        swap("shots.csv", ",cycles,", ","),
        "shots.csv: header, column 'cycles' is missing (expected the header shot,mjd_utc,",
    ),
    "double column": (
        swap("shots.csv", ",cycles,", ",shot,"),
        "shots.csv: header, column 'shot' occurs 2 times",
    ),
    "unknown column": (
        swap("weather.csv", "pressure_mb", "pressure_hpa"),
        "weather.csv: header, column 'pressure_hpa' is unknown",
    ),
    "line feed in a cell": (
        set_cell("shots.csv", 2, "target", '"DP\n001"'),
        "shots.csv: row 2, target = 'DP\\n001' (expected letters",
    ),
    "open quote": (
        set_cell("shots.csv", 2, "target", '"DP001'),
        "shots.csv: line 31 is not CSV: unexpected end of data",
    ),
    # files
    "no weather file": (remove("weather.csv"), "weather.csv: missing in "),
    "no site": (remove("site.toml"), "site.toml: missing in "),
    "no samples": (remove("frames.npy"), "frames.npy: missing in "),
    "no monuments": (remove("monuments"), "monuments: missing in "),
    "directory for a file": (as_directory("shots.csv"), "shots.csv: is not a file in "),
    "empty table": (set_bytes("weather.csv", b""), "weather.csv: holds 0 bytes and no text: empty"),
    "empty record": (set_bytes("site.toml", b"\n"), "site.toml: holds 1 bytes and no text: empty"),
    "not UTF-8": (prepend("site.toml", b"# \xff"), "site.toml: byte 2 = 0xff is not UTF-8 (expected UTF-8 text)"),
    "Latin-1": (append("weather.csv", b"\xb0C"), "= 0xb0 is not UTF-8 (expected UTF-8 text)"),
    "bad TOML": (
        swap("site.toml", "elevation_deg = ", "elevation_deg "),
        "site.toml: line 6, column 15, 'elevation_deg 30.0         # elevation of the telescope (en",
    ),
    "TOML cut off": (cut(MIRROR, 60), "mirrors/ZP103.toml: line 3, column 5, 'leak' is not TOML"),
    "key twice": (swap(MIRROR, "zp =", "d0_mm = 3\nzp ="), "mirrors/ZP103.toml: line 7, column "),
    # samples
    "truncated samples": (
        cut("frames.npy", 12345 + 128),
        "frames.npy: holds 12345 bytes of data, its header promises 491520",
    ),
    "too many samples": (
        append("frames.npy", b"12"),
        "frames.npy: holds 491522 bytes of data, its header promises 491520",
    ),
    "empty samples": (set_bytes("frames.npy", b""), "frames.npy: holds 0 bytes: empty"),
    "header cut off": (
        cut("frames.npy", 40),
        "frames.npy: holds 30 bytes of header, its size field promises 118: trunc",
    ),
    "floating samples": (save_array(np.zeros((30, 64))), "frames.npy: header, descr = '<f8' (expected '<i2', int16)"),
    "swapped bytes": (
        save_array(np.zeros((30, 64), ">i2")),
        "frames.npy: header, descr = '>i2' (expected '<i2', int16)",
    ),
    "flat samples": (save_array(np.zeros(30, "<i2")), "frames.npy: header, shape = (30,) (expected (buffers, samples)"),
    "no buffers": (save_array(np.zeros((0, 64), "<i2")), "frames.npy: header, shape = (0, 64) (expected"),
    "pickled samples": (
        save_array(np.array([[{}]], dtype=object), allow_pickle=True),
        "frames.npy: header, descr = '|O' holds pickled objects, never read",
    ),
    "a pickle": (
        set_bytes("frames.npy", b"\x80\x04cos\nsystem\n."),
        "frames.npy: starts with b'\\x80\\x04cos\\nsy' (exp",
    ),
}


def test_small_campaign_loads(small):
    assert len(read_campaign(small).shots) == SHOTS


@pytest.mark.parametrize("name", DAMAGES)
def test_invalid_campaign_is_refused_in_one_line_with_file_place_and_value(small, name):
    damage, expected = DAMAGES[name]
    damage(small)
    with pytest.raises(InputError) as refusal:
        read_campaign(small)
    text = str(refusal.value)
    assert expected in text
    assert text.isprintable()
    assert len(text) < 400 + len(str(small))
    assert re.match(r"[A-Za-z0-9/.]+: ", text)


def test_missing_directory_is_refused(tmp_path):
    for directory in (tmp_path / "nowhere", Path(__file__), tmp_path / "two\nlines", tmp_path / "nul\0l"):
        with pytest.raises(InputError, match="expected a campaign directory") as refusal:
            read_campaign(directory)
        assert str(refusal.value).isprintable()


def test_circular_link_is_refused(small):
    (small / "weather.csv").unlink()
    (small / "weather.csv").symlink_to("weather.csv")
    with pytest.raises(InputError, match=r"^weather\.csv: "):
        read_campaign(small)


@pytest.mark.parametrize("file", ["weather.csv", "frames.npy", "monuments"])
def test_unreadable_file_is_refused(small, monkeypatch, file):
    """Permissions do not bind the superuser, so the system's answer is put in its place."""

    def denied(path, *_, **__):
        raise PermissionError(13, "Permission denied", str(path))

    for call in ("is_file", "is_dir"):
        honest = getattr(Path, call)
        monkeypatch.setattr(Path, call, lambda path, honest=honest: (denied if path.name == file else honest)(path))
    with pytest.raises(InputError, match=rf"^{re.escape(file)}: cannot be read: Permission denied$"):
        read_campaign(small)


def test_harmless_differences_are_accepted(small):
    """A byte order mark, other line ends, other order of columns, empty last lines, spare mirrors, stray files."""
    rows = [line.split(",") for line in (small / "weather.csv").read_text(encoding="utf-8").splitlines()]
    table = "\r\n".join(",".join(reversed(row)) for row in rows) + "\r\n\r\n"
    (small / "weather.csv").write_bytes(b"\xef\xbb\xbf" + table.encode())
    spare = (small / "mirrors/ZP101.toml").read_text(encoding="utf-8").replace("ZP101", "ZP-spare_1.b")
    (small / "mirrors/ZP-spare_1.b.toml").write_text(spare, encoding="utf-8")
    (small / "mirrors/notes.txt").write_text("x", encoding="utf-8")
    (small / "mirrors/.ZP101.toml").write_text("x", encoding="utf-8")
    campaign = read_campaign(small)
    assert campaign.weather.temperature_c[0] == 11.45
    assert "ZP-spare_1.b" in campaign.mirrors


@given(
    file=st.sampled_from(TEXT_FILES),
    edits=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 2), st.binary(max_size=3)), max_size=4),
)
@settings(max_examples=150, deadline=None)
def test_random_damage_to_a_text_file_is_refused_or_harmless(pristine, file, edits):
    original = (pristine / file).read_bytes()
    raw = original
    for where, width, patch in edits:
        at = int(where * len(raw))
        raw = raw[:at] + patch + raw[at + width :]
    try:
        (pristine / file).write_bytes(raw)
        try:
            read_campaign(pristine)
        except InputError as refusal:
            text = str(refusal)
            assert text.isprintable()
            assert ": " in text
    finally:
        (pristine / file).write_bytes(original)
