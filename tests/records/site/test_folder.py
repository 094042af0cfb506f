"""A site's folder: read, written, read again, and refused in one line."""

import dataclasses
import hashlib
import math
import shutil
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.records.files.reading import read_record
from catseye.records.files.toml_text import record_toml
from catseye.records.night.campaign import REFERENCE, Campaign
from catseye.records.site.folder import SiteFolder, read_site, site_files
from catseye.records.site.mirror import Mirror
from catseye.records.site.target import TargetRow, Targets
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
NIGHTLY = ("shots.csv", "frames.npy", "weather.csv", "README.md")
RECORDS = ("site", "monuments", "mirrors", "feedarm", "targets", "triplets", "benchmarks")


def written(files, directory):
    for file, text in files.items():
        (directory / file).parent.mkdir(parents=True, exist_ok=True)
        (directory / file).write_text(text, encoding="utf-8", newline="")
    return directory


@pytest.fixture
def folder(tmp_path):
    """A copy of the night's directory without its night."""
    return Path(shutil.copytree(NIGHT, tmp_path / "site", ignore=shutil.ignore_patterns(*NIGHTLY)))


def same(one, other):
    return all(getattr(one, name) == getattr(other, name) for name in RECORDS)


def test_a_campaign_without_its_night_is_a_site(folder, night_01):
    site = read_site(folder)
    assert type(site) is SiteFolder
    assert same(site, night_01)
    assert site.directory == folder
    assert (site.rangers, site.target_names) == (night_01.rangers, night_01.target_names)
    assert REFERENCE in site.target_names
    assert site.mirror_of("ZY113").zp == "ZP113"
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert len(files) == 4 + 12 + 18 + 10
    assert site.hashes == {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files
    }


def test_a_campaigns_directory_is_read_as_a_site_and_a_campaign_is_one(night_01):
    assert isinstance(night_01, Campaign)
    assert isinstance(night_01, SiteFolder)
    site = read_site(NIGHT)
    assert same(site, night_01)
    assert not {"shots.csv", "weather.csv", "frames.npy"} & set(site.hashes)
    assert site_files(site) == site_files(night_01)  # a campaign's night is left out


def test_a_site_written_and_read_is_equal_to_the_bit(folder, tmp_path):
    site = read_site(folder)
    again = read_site(written(site_files(site), tmp_path / "again"))
    assert same(again, site)
    assert list(again.targets) == list(site.targets)
    assert site_files(again) == site_files(site)


def test_every_optional_key_of_a_record_survives(night_01, tmp_path):
    mirror = night_01.mirrors["ZP101"].model_copy(
        update={
            "format": "catseye-mirror-1",
            "serial": 'a "quoted" \\ serial\nof two lines\x7f',
            "measured_on": date(2004, 4, 29),
            "na0": 5931.25,
            "azimuth_encoder_cosine_counts": (1.5, -0.25),
            "azimuth_encoder_sine_counts": (0.1, 1e-7),
            "u_encoder_counts": 0.5,
            "abv_0": 65_536,
        }
    )
    mirror = Mirror.model_validate(mirror.model_dump())  # a copy is not validated
    (tmp_path / "ZP101.toml").write_text(record_toml(mirror), encoding="utf-8", newline="")
    assert read_record(tmp_path / "ZP101.toml", Mirror) == mirror


@given(
    st.lists(st.floats(-5e6, 5e6), min_size=3, max_size=3).filter(lambda v: 500 <= math.hypot(*v) <= 1e7),
    st.floats(0, 1000, exclude_min=True) | st.none(),
)
def test_every_position_survives_the_file_to_the_last_bit(tmp_path_factory, position, u):
    target = TargetRow(name="T", type="hollow", frame="ground", position_mm=tuple(position), u_position_mm=u)
    path = tmp_path_factory.getbasetemp() / "one_target.toml"
    path.write_text(record_toml(Targets(target=(target,))), encoding="utf-8")
    back = read_record(path, Targets).target[0]
    assert back == target
    assert np.array(back.position_mm).tobytes() == np.array(target.position_mm).tobytes()  # the sign of zero too


def test_site_without_targets_is_valid(night_01, tmp_path):
    bare = dataclasses.replace(
        read_site(NIGHT), targets={}, triplets={}, benchmarks=(), monuments={}, mirrors=night_01.mirrors
    )
    files = site_files(bare)
    for directory in ("monuments", "triplets"):
        (tmp_path / directory).mkdir()
    again = read_site(written(files, tmp_path))
    assert same(again, bare)
    assert again.rangers == tuple(f"ZY{n}" for n in range(113, 119))


@pytest.mark.parametrize("file", ["site.toml", "feedarm.toml", "targets.toml", "benchmarks.csv", "monuments"])
def test_a_missing_part_is_named(folder, file):
    path = folder / file
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    with pytest.raises(InputError) as caught:
        read_site(folder)
    assert str(caught.value).startswith(f"{file}: missing in {folder}")


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("targets.toml", "[4238.4, 55311.1, 12822.0]", "[4.2384, 55.3111, 12.8220]", ("'DP001'", "looks like metres")),
        ("targets.toml", 'name = "DP002"', 'name = "DP001"', ("target = 'DP001'", "taken by target")),
        ("targets.toml", 'name = "DP002"', 'name = "ZRG"', ("target = 'ZRG'", "the internal reference cube")),
        ("targets.toml", "pc_mm = -33.3236", "pc_mm = 33.3236", ("pc_mm = 33.3236", "wrong sign")),
        ("mirrors/ZP101.toml", 'zp = "ZP101"', 'zp = "ZP102"', ("zp = 'ZP102'", "as the file's name")),
        ("feedarm.toml", 'zp = "ZP113"', 'zp = "ZP199"', ("ranger['ZY113'].zp = 'ZP199'", "mirrors/ZP199.toml")),
        ("feedarm.toml", 'zp = "ZP114"', 'zp = "ZP113"', ("zp = 'ZP113' is on ZY113 already",)),
        ("benchmarks.csv", "ZBM02", "ZBM77", ("row 2", "target = 'ZBM77' is not in targets.toml")),
        ("benchmarks.csv", "ZBM03,ZY106", "ZY106,ZY106", ("row 3", "the ranger itself")),
        ("benchmarks.csv", "ZBM01,ZY102", "ZRG,ZY102", ("row 1", "target = 'ZRG'")),
        ("triplets/TR01.toml", "d12_mm = 635.003", "d13_mm = 635.003", ("d13_mm", "perhaps d12_mm")),
        ("site.toml", "[campaign]", "[campaign", ("line 2", "is not TOML")),
    ],
)
def test_a_bad_site_is_refused_in_one_line(folder, file, old, new, words):
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_site(folder)
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert len(message.splitlines()) == 1
    assert [word for word in words if word not in message] == []


def test_site_that_is_not_a_directory_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"nowhere: missing \(expected a site directory\)"):
        read_site(tmp_path / "nowhere")
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"file: is not a directory \(expected a site directory\)"):
        read_site(tmp_path / "file")
