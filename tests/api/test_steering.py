"""`point` and `track` in Python: files or records, times as text, and arguments that do not fit refused by name."""

import tomllib

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError
from repository import ROOT

RECORDS = ROOT / "examples/night-01/monuments/ZY103.toml", ROOT / "examples/night-01/mirrors/ZP103.toml"
TO = [0.0, 0.0, 50.0]
PLACE = {"latitude_deg": 38.4, "longitude_deg": -79.84}


def test_a_time_is_a_text_or_an_mjd():
    text = catseye.point(*RECORDS, TO, at_mjd="2003-09-10T12:00:00Z", **PLACE)
    number = catseye.point(*RECORDS, TO, at_mjd=52892.5, **PLACE)
    assert str(text.to_object()) == str(number.to_object())
    assert text.sightings[0].mjd == 52892.5


def test_the_sun_s_cone_is_that_of_the_argument():
    seen = catseye.point(*RECORDS, TO, at_mjd=52892.58, **PLACE).sightings[0]
    separation = float(np.degrees(seen.separation))
    to = catseye.point(*RECORDS, TO).pointings.to[0]
    assert separation > 60.0
    assert seen.sun.allowed
    scan_point = np.array([tomllib.loads(RECORDS[0].read_text())[f"{axis}_mm"] for axis in "xyz"]) * 1e-3
    e, a = seen.altitude + np.radians(20.0), seen.azimuth
    to = scan_point + 200.0 * np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])
    words = [
        catseye.point(*RECORDS, to, at_mjd=52892.58, sun_cone_deg=cone, **PLACE).sightings[0].sun.allowed
        for cone in (10.0, 30.0)
    ]
    assert words == [True, False]


def test_boxes_and_solids_are_files_or_records():
    files = {"keep_out": ROOT / "examples/keep-out.toml", "solids": ROOT / "examples/solids.toml"}
    records = {name: catseye.load(path) for name, path in files.items()}
    more = {"reflector": "prism", "facing": [0.0, 0.0, -1.0], "posture_deg": (145.3, 30.0)}
    found = [catseye.point(*RECORDS, [TO, [60.0, 40.0, 20.0]], **each, **more) for each in (files, records)]
    assert str(found[0].to_object()) == str(found[1].to_object())
    assert {path.name for path in found[0].read} == {"ZY103.toml", "ZP103.toml", "keep-out.toml", "solids.toml"}


def test_counts_are_saved_as_a_file_and_as_a_directory(tmp_path):
    found = catseye.point(*RECORDS, [TO, [60.0, 40.0, 20.0]])
    found.save_counts(tmp_path / "output.dat")
    rows = [line.split() for line in (tmp_path / "output.dat").read_text().splitlines() if not line.startswith("#")]
    assert [float(v) for v in rows[1][:3]] == [60_000.0, 40_000.0, 20_000.0]
    where = catseye.save(found, tmp_path / "out")
    assert (where / "counts.csv").read_text().count("\n") == 3


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"sun_cone_deg": 7.0}, {"sun_cone_deg", "at_mjd"}),
        ({"longitude_deg": 7.0}, {"longitude_deg", "at_mjd"}),
        ({"posture_deg": (1.0, 2.0)}, {"posture_deg", "solids"}),
        ({"at_mjd": "yesterday"}, {"at_mjd"}),
        ({"at_mjd": 52892.5, "sun_cone_deg": 0.1}, {"sun_cone_deg"}),
        ({"facing": (0.0, 0.0, 0.0)}, {"facing"}),
        ({"solids": ROOT / "examples/solids.toml", "posture_deg": (0.0, 96.0)}, {"posture_deg"}),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.point(*RECORDS, TO, **arguments)
    assert set(refused.value.names) == names
