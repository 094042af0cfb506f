"""Campaigns into an archive: what it holds, twice, side by side, damaged, and back again byte for byte."""

import filecmp
import shutil

import numpy as np
import pytest

from archive_scene import flip
from catseye.errors import InputError
from catseye.gateways.archive.files import create_archive
from catseye.gateways.archive.restored import write_restored
from catseye.records.archive.provenance import read_provenance
from catseye.records.archive.reading import open_archive, read_table
from catseye.records.archive.samples import read_samples
from catseye.records.archive.verification import verify_archive
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.night.digest import digest
from catseye.service.archive.campaigns import archive_campaign
from catseye.service.archive.sources import archive_units
from journal_scene import NIGHT
from service.archive.adding_scene import added, campaign_copy


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """Archive with night-01, added in this process; to be read only."""
    directory = tmp_path_factory.mktemp("night") / "archive"
    create_archive(directory)
    value = archive_campaign(str(directory), str(NIGHT))
    return directory, value


def test_a_night_s_tables_hold_what_reduce_gives(night):
    directory, value = night
    archive, reduction = open_archive(directory), reduce_epoch(read_campaign(NIGHT))
    coordinates = reduction.coordinates
    assert (value["added"], value["digest"], value["points"]) == (True, digest(reduction), 130)
    points = read_table(archive, "points")
    order = np.argsort(coordinates.points)
    assert points["point"].tolist() == sorted(coordinates.points)
    assert np.array_equal(np.stack([points[axis] for axis in "xyz"], axis=1), coordinates.x[order])
    blocks = coordinates.joint.blocks[order]
    assert np.array_equal(points["xy"], blocks[:, 0, 1])
    assert np.array_equal(points["zz"], blocks[:, 2, 2])
    zeros = read_table(archive, "zeros", where={"parameter": "zero"})
    assert {n: (v, u) for n, v, u in zip(zeros["ranger"], zeros["value"], zeros["u"], strict=True)} == coordinates.zeros
    assert np.allclose(zeros["u_prior"], 10e-6)  # u_d0_mm = 0.01 of every sheet
    residuals = read_table(archive, "residuals")
    ranges = coordinates.ranges
    assert np.array_equal(residuals["w"][ranges.shot], ranges.standardised)
    assert np.isnan(np.delete(residuals["range"], ranges.shot)).all()
    pose = read_table(archive, "poses")
    expected = reduction.surface.pose()
    assert [pose[f"translation_{axis}"][0] for axis in "xyz"] == expected["translation"]
    assert pose["c45"][0] == expected["covariance"][3][4]
    weather = read_table(archive, "weather", where={"station": "WX1"})
    assert np.allclose(weather["t_error_c"], coordinates.air["WX1"][0], rtol=0)
    row = read_table(archive, "nights")
    assert (row["verdict"][0], row["rejected"][0]) == (reduction.verdict.word, len(reduction.rejected))


def test_certificates_name_the_sheets_with_value_and_hash(night):
    archive = open_archive(night[0])
    campaign = read_campaign(NIGHT)
    row = read_table(archive, "certificates", where={"instrument": "ZP103"})
    mirror = campaign.mirrors["ZP103"]
    assert (row["kind"][0], row["file"][0], row["ranger"][0]) == ("mirror", "mirrors/ZP103.toml", "ZY103")
    assert row["sha256"][0] == campaign.hashes["mirrors/ZP103.toml"]
    assert row["value"][0] == pytest.approx(1e-3 * mirror.d0_mm, abs=1e-12)
    kinds = read_table(archive, "certificates", ["kind"])["kind"].tolist()
    assert {kind: kinds.count(kind) for kind in kinds} == {"mirror": 18, "monument": 12, "triplet": 10, "site": 1}
    details = read_provenance(archive, "night").details
    assert details["settings"]["air_model"] == "rueger1990"
    assert set(details["certificates"]["mirrors/ZP103.toml"]) == {
        "serial",
        "measured_on",
        "valid_until",
        "by",
        "report",
    }


def test_samples_and_the_whole_campaign_come_back_byte_for_byte(night, tmp_path):
    archive = open_archive(night[0])
    assert np.array_equal(read_samples(archive, "night-01"), np.load(NIGHT / "frames.npy"))
    write_restored(archive, "night-01", tmp_path / "again")
    names = sorted(path.relative_to(NIGHT) for path in NIGHT.rglob("*") if path.is_file())
    assert sorted(p.relative_to(tmp_path / "again") for p in (tmp_path / "again").rglob("*") if p.is_file()) == names
    match, mismatch, errors = filecmp.cmpfiles(NIGHT, tmp_path / "again", names, shallow=False)
    assert (len(match), mismatch, errors) == (len(names), [], [])
    assert (night[0] / archive.entry("night-01").file("samples").path).stat().st_size < 0.75 * 12_435_456


def test_samples_by_columns_come_back_byte_for_byte(tmp_path):
    source = campaign_copy(tmp_path / "n")
    np.save(source / "frames.npy", np.asfortranarray(np.load(source / "frames.npy")))
    create_archive(tmp_path / "a")
    archive_campaign(str(tmp_path / "a"), str(source))
    write_restored(open_archive(tmp_path / "a"), "night-01", tmp_path / "again")
    assert (tmp_path / "again/frames.npy").read_bytes() == (source / "frames.npy").read_bytes()


def test_a_damaged_input_is_not_restored(night, tmp_path):
    shutil.copytree(night[0], tmp_path / "a")
    archive = open_archive(tmp_path / "a")
    for kind in ("inputs", "samples", "provenance"):
        path = archive.directory / archive.entry("night-01").file(kind).path
        good = path.read_bytes()
        flip(path, len(good) // 2)
        with pytest.raises(InputError, match=f"{path.name}: differs from its SHA-256"):
            write_restored(archive, "night-01", tmp_path / "again")
        assert not (tmp_path / "again").exists()
        path.write_bytes(good)


def state(directory):
    return {
        path.relative_to(directory): (path.read_bytes(), path.stat().st_mtime_ns)
        for path in directory.rglob("*")
        if path.is_file() and path.name != "archive.lock"
    }


def test_adding_twice_changes_nothing(night, tmp_path):
    shutil.copytree(night[0], tmp_path / "a")
    before = state(tmp_path / "a")
    [outcome] = added(tmp_path / "a", NIGHT).outcomes
    assert (outcome.state, outcome.value["added"]) == ("done", False)
    assert state(tmp_path / "a") == before
    (source := campaign_copy(tmp_path / "elsewhere")).joinpath("NOTE.txt").write_text("not read by a reduction")
    assert archive_campaign(str(tmp_path / "a"), str(source))["added"] is False


@pytest.mark.parametrize("kind", ["points", "samples", "index"])
def test_a_damaged_night_is_written_again(night, tmp_path, kind):
    directory = tmp_path / "a"
    shutil.copytree(night[0], directory)
    [path] = (directory / kind).rglob("night-01*")
    flip(path, path.stat().st_size // 2)
    [problem] = verify_archive(directory).problems
    assert str(path) in problem
    assert archive_campaign(str(directory), str(NIGHT))["added"] is True
    assert verify_archive(directory).problems == ()


def test_nights_side_by_side_equal_nights_one_by_one(tmp_path):
    sources = [campaign_copy(tmp_path / f"night-{k}", samples=k) for k in (1, 2, 3)]
    change = added(tmp_path / "a", *sources, tmp_path / "night-1", processes=2)
    assert [outcome.state for outcome in change.outcomes] == ["done"] * 4
    assert sum(outcome.value["added"] for outcome in change.outcomes) >= 3  # the repeated one may run beside the first
    archive = open_archive(tmp_path / "a")
    assert len(archive.nights) == 3
    alone = tmp_path / "b"
    create_archive(alone)
    values = [archive_campaign(str(alone), str(source)) for source in sources]
    assert [value["night"] for value in values] == [outcome.value["night"] for outcome in change.outcomes[:3]]
    one, other = (read_table(open_archive(where), "points") for where in (tmp_path / "a", alone))
    assert all(np.array_equal(one[name], other[name]) for name in one)


def test_a_night_without_a_result_is_archived_with_the_reason(tmp_path):
    source = campaign_copy(tmp_path / "n")
    np.save(source / "frames.npy", np.zeros_like(np.load(source / "frames.npy")))
    create_archive(tmp_path / "a")
    value = archive_campaign(str(tmp_path / "a"), str(source))
    assert value["result"]["word"] == "failed"
    archive = open_archive(tmp_path / "a")
    assert read_table(archive, "nights", ["verdict", "why"])["why"].tolist() == [value["result"]["why"]]
    assert len(read_table(archive, "points")["x"]) == 0
    assert not read_samples(archive, "night-01").any()


def test_sources_that_cannot_be_used_are_refused_before_anything_is_written(tmp_path):
    with pytest.raises(InputError, match=r"none: missing \(expected a folder with shots.csv, or a journal\)"):
        added(tmp_path / "a", NIGHT, tmp_path / "none")
    assert not (tmp_path / "a").exists()
    with pytest.raises(InputError, match="is neither a campaign nor a journal"):
        added(tmp_path / "a", tmp_path)
    (tmp_path / "other").mkdir()
    (tmp_path / "other/thesis.tex").write_text("x")
    with pytest.raises(InputError, match="holds files and is no archive"):
        added(tmp_path / "other", NIGHT)


def test_a_bad_night_fails_alone(tmp_path):
    bad = campaign_copy(tmp_path / "bad")
    (bad / "weather.csv").write_text("nonsense\n")
    change = added(tmp_path / "a", bad, NIGHT, processes=1)
    assert [outcome.state for outcome in change.outcomes] == ["failed", "done"]
    assert "weather.csv" in change.outcomes[0].why
    assert len(open_archive(tmp_path / "a").nights) == 1
    check = verify_archive(tmp_path / "a")
    assert (check.problems, check.strangers) == ((), ())


def test_names_of_units_differ_where_sources_have_one_name(tmp_path):
    paths = [campaign_copy(tmp_path / place / "night") for place in ("a", "b")]
    assert [unit.name for unit in archive_units(tmp_path / "x", list(map(str, paths)))] == ["night", "night-2"]
