"""The example campaign, field by field."""

import hashlib
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from pydantic import ValidationError

from catseye.errors import InputError
from catseye.records.night.campaign import read_campaign, refuse_times
from catseye.records.night.shot import ShotRow
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


@pytest.fixture(scope="module")
def night():
    return read_campaign(NIGHT)


def test_the_site_is_read(night):
    site = night.site
    assert (site.campaign.name, site.campaign.start_mjd_utc) == ("night-01", 52889.125)
    assert (site.campaign.azimuth_deg, site.campaign.elevation_deg) == (145.3, 30.0)
    assert site.site.elevation_of_z0_m == 806.42
    assert site.frames.reflector.reflector_to_elevation_mm == (0.0, -54839.108, 4999.99)
    assert site.paraboloid.focal_length_mm == 60000.0
    assert site.ranging.modulation_hz == 1.5e9
    assert (site.adc.cycles, site.adc.samples_per_cycle, site.adc.full_scale_volt) == (128, 64, 10.0)
    assert [station.name for station in site.weather_station] == ["WX1", "WX2"]


def test_rangers_and_their_mirrors_are_read(night):
    assert night.rangers == tuple(f"ZY{number}" for number in range(101, 119))
    assert len(night.monuments) == 12
    assert night.monuments["ZY103"].u_z_mm == 0.0
    assert night.monuments["ZY101"].alpha1_rad == -0.2492780
    assert night.mirror_of("ZY113") is night.mirrors["ZP113"]
    assert night.mirrors["ZP103"].d0_mm == 180.534
    assert night.mirrors["ZP103"].serial is None
    assert night.feedarm.ranger[0].nominal_scan_point_mm == (-8913.1, -3089.5, 60853.7)
    assert night.feedarm.aim_point.nominal_mm == (10.2, -5985.2, 55949.2)
    with pytest.raises(InputError, match=r"'ZY199' is not in monuments/ or feedarm\.toml"):
        night.mirror_of("ZY199")


def test_targets_triplets_and_benchmarks_are_read(night):
    assert len(night.targets) == 70
    assert night.targets["DP001"].pc_mm == -33.3236
    assert night.targets["ZBM01"].normal is None
    assert night.triplets["TR10"].targets == ("TR10-L", "TR10-R", "TR10-B")
    assert night.triplets["TR01"].right_prism.hrp_mm == 25.123
    assert night.benchmarks[5].certified_distance_mm == 139951.717
    names = night.target_names
    assert len(names) == 70 + 3 * 10 + 18 + 1 == len(set(names))
    assert {"DP001", "TR01-B", "ZY114", "ZRG"} <= set(names)
    assert list(names) == sorted(names)


def test_weather_shots_and_samples_are_read(night):
    weather, shots = night.weather, night.shots
    assert len(weather) == len(weather.mjd_utc) == len(weather.pressure_hpa)
    assert (weather.station[0], weather.temperature_c[0], weather.pressure_hpa[0]) == ("WX1", 11.45, 930.86)
    assert weather.humidity_percent[1] == 70.8
    assert len(shots) == 759
    assert (shots.shot[1], shots.mjd_utc[1], shots.ranger[1], shots.target[1]) == (2, 52889.125514335, "ZY116", "ZY114")
    assert {array.dtype for array in (shots.shot, shots.cycles, shots.samples_per_cycle, shots.frame)} == {
        np.dtype(np.int64)
    }
    assert night.frames.shape == (759, 8192)
    assert night.frames.dtype == np.int16
    np.testing.assert_array_equal(night.frames, np.load(NIGHT / "frames.npy", allow_pickle=False))


def test_a_campaign_cannot_be_changed(night):
    with pytest.raises(FrozenInstanceError):
        night.site = None
    with pytest.raises(ValidationError, match="frozen"):
        night.mirrors["ZP103"].d0_mm = 1.0
    for column in (night.shots.mjd_utc, night.weather.temperature_c, night.frames):
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 0


def test_every_input_file_is_hashed(night):
    files = {path.relative_to(NIGHT).as_posix() for path in NIGHT.rglob("*") if path.is_file()} - {"README.md"}
    expected = {file: hashlib.sha256((NIGHT / file).read_bytes()).hexdigest() for file in sorted(files)}
    assert night.hashes == expected
    assert list(night.hashes) == sorted(files)
    assert read_campaign(NIGHT).hashes == night.hashes


def test_records_survive_the_round_trip(night):
    records = [night.site, night.feedarm, *night.monuments.values(), *night.mirrors.values()]
    records += [*night.targets.values(), *night.triplets.values(), *night.benchmarks]
    for record in records:
        assert type(record).model_validate(record.model_dump()) == record
        assert type(record).model_validate_json(record.model_dump_json()) == record


def test_the_schema_states_the_ranges(night):
    schema = type(night.mirrors["ZP101"]).model_json_schema()["properties"]
    assert (schema["d0_mm"]["minimum"], schema["d0_mm"]["maximum"]) == (50, 1000)
    assert schema["u_d0_mm"]["exclusiveMinimum"] == 0
    assert schema["format"]["enum"] == [1, "catseye-mirror-1"]


@pytest.mark.parametrize(("late", "taken"), [(3599.0, True), (3601.0, False), (-3599.0, True), (-3601.0, False)])
def test_a_shot_is_refused_from_an_hour_beside_the_weather(night, late, taken):
    """Late after the last reading of any station, or before the first: s. Until then the air there is carried on."""
    mjd = night.weather.mjd_utc
    when = float(mjd.max() if late > 0.0 else mjd.min()) + late / 86_400.0
    shot = ShotRow(shot=1, mjd_utc=when, ranger="ZY101", target="ZRG", cycles=128, samples_per_cycle=64, frame=0)
    if taken:
        refuse_times(night, [shot])
    else:
        with pytest.raises(InputError, match=r"shots\.csv: row 1, mjd_utc = .* has no weather .*expected within 1 h"):
            refuse_times(night, [shot])
