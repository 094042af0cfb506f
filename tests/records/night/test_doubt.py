"""doubts.csv: what was not believed while a night was measured does not count when it is reduced."""

import shutil

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.reason import ShotStatus
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
HEAD = "what,name,mjd_utc,why\n"


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(NIGHT, tmp_path / "night")
    return tmp_path / "night"


def weather_rows(folder):
    head, *rows = (folder / "weather.csv").read_text().splitlines()
    return head, [row.split(",") for row in rows]


def judged(folder, lines):
    (folder / "doubts.csv").write_text(HEAD + "".join(f"{line}\n" for line in lines))
    return read_campaign(folder)


def test_rejected_reading_counts_as_missing(folder, tmp_path):
    """Ten minutes of a station that lies by 5 °C, once named by doubts.csv, once not in weather.csv at all."""
    head, rows = weather_rows(folder)
    own = [row for row in rows if row[1] == "WX2"]
    lies = own[40:60]
    without = tmp_path / "without"
    shutil.copytree(folder, without)
    (without / "weather.csv").write_text("\n".join([head, *(",".join(row) for row in rows if row not in lies)]) + "\n")
    named = [f'weather,{row[1]},{row[0]},"WX2 reads 16.2 C, +5.0 C off"' for row in lies]
    for row in lies:
        row[2] = f"{float(row[2]) + 5.0:.2f}"
    (folder / "weather.csv").write_text("\n".join([head, *map(",".join, rows)]) + "\n")
    campaign, plain = judged(folder, named), read_campaign(without)
    assert np.array_equal(campaign.weather.temperature_c, plain.weather.temperature_c)
    told, untold = reduce_epoch(campaign), reduce_epoch(plain)
    assert np.array_equal(told.coordinates.x, untold.coordinates.x)
    assert np.array_equal(told.coordinates.covariance, untold.coordinates.covariance)
    assert told.notes[0] == (
        "WX2 was rejected during the measurement (WX2 reads 16.2 C, +5.0 C off): 20 of its readings are left out, "
        "by doubts.csv"
    )
    assert told.notes[1:] == untold.notes


def test_station_without_trusted_readings_for_long_is_excluded(folder):
    _, rows = weather_rows(folder)
    lies = [row for row in rows if row[1] == "WX1"][30:]
    campaign = judged(folder, [f"weather,{row[1]},{row[0]},it lies" for row in lies])
    assert [station.name for station in campaign.site.weather_station] == ["WX2"]
    assert set(campaign.weather.station) == {"WX2"}
    assert campaign.doubt_notes[0].endswith("the station is left out, by doubts.csv")
    assert reduce_epoch(campaign).coordinates.variance_factor < 1.3


def test_rejected_shot_is_excluded_with_its_reason(folder, night_01, reduced_night_01):
    used = [k for k, status in enumerate(reduced_night_01.status) if status is ShotStatus.USED][100]
    number, mjd = int(night_01.shots.shot[used]), float(night_01.shots.mjd_utc[used])
    reduction = reduce_epoch(judged(folder, [f"shot,{number},{mjd!r},reflected: 3 mm too long"]))
    assert reduction.status[used] is ShotStatus.DOUBTED
    assert reduction.rejected[number] == "doubted: reflected: 3 mm too long"
    assert len(reduction.rejected) == len(reduced_night_01.rejected) + 1
    assert len(reduction.coordinates.ranges.shot) == len(reduced_night_01.coordinates.ranges.shot) - 1


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("shot,1,52889.2,x", r"doubts\.csv: row 1, shot '1' at 52889\.2 is not in shots\.csv"),
        ("shot,999999,52889.2,x", "is not in shots"),
        ("weather,WX9,52889.2,x", "is not in weather"),
        ("mood,WX1,52889.2,x", "what"),
        ("weather,WX1,52889.2,", "why"),
    ],
)
def test_a_verdict_of_nothing_is_refused(folder, line, said):
    with pytest.raises(InputError, match=said):
        judged(folder, [line])


def test_one_thing_has_one_verdict_and_some_weather_must_be_left(folder):
    _, rows = weather_rows(folder)
    lines = [f"weather,{row[1]},{row[0]},no" for row in rows]
    with pytest.raises(InputError, match=r"doubts.csv: row 2, weather WX1 has a doubt in row 1 \(expected one\)"):
        judged(folder, [lines[0], lines[0]])
    with pytest.raises(InputError, match=r"doubts\.csv: leaves no weather reading"):
        judged(folder, lines)


def with_wx2(folder, column, value):
    """The campaign with one value in all readings of WX2."""
    head, rows = weather_rows(folder)
    for row in rows:
        if row[1] == "WX2":
            row[column] = value
    (folder / "weather.csv").write_text("\n".join([head, *map(",".join, rows)]) + "\n")
    return read_campaign(folder)


def test_impossible_air_is_refused_with_station_file_and_time(folder):
    """Each reading could be; what the paths make of both stations could not."""
    with pytest.raises(InputError, match=r"^weather\.csv: at 52889\.1\d{4} the stations read WX1 1") as caught:
        reduce_epoch(with_wx2(folder, 2, "-59.5"))
    assert "; WX2 -59.5" in str(caught.value)
    assert "element" not in str(caught.value)


@pytest.mark.parametrize(("column", "value"), [(2, "59.0"), (3, "505.0")])
def test_air_that_one_station_alone_makes_impossible_is_left_out(folder, column, value):
    reduction = reduce_epoch(with_wx2(folder, column, value))
    (record,) = reduction.implausible
    assert record.owners == ("WX2",)
    assert "left out" in reduction.verdict.why
