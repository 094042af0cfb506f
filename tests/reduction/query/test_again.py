"""A night again: the same bits with its own records, and with others how far each point moves, with its claim."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import catseye
from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.gateways.archive.content import NightContent
from catseye.gateways.archive.files import create_archive, sole_writer
from catseye.gateways.archive.writer import write_night
from catseye.gateways.epoch.tables import kinds_of
from catseye.records.archive.reading import open_archive
from catseye.records.night.campaign import read_campaign
from catseye.records.site.folder import site_files
from catseye.reduction.epoch.prior_names import BENCHMARKS, MONUMENTS, OFFSETS, ZEROS
from catseye.reduction.query.again import archived_points, reduced_again
from catseye.reduction.query.renewed import calibrated_anew, changed_records, with_records
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
AXES = "xyz"


@cache
def reduced():
    return catseye.reduce(NIGHT)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Night-01 in an archive with its inputs and samples."""
    place = tmp_path_factory.mktemp("archive") / "years"
    result, night = reduced(), "night-01-0badcafe"
    campaign, blocks = result.reduction.campaign, result.reduction.coordinates.joint.blocks
    order = np.argsort(campaign.shots.frame)
    common = {"night": night, "mjd": float(campaign.shots.mjd_utc.mean())}
    count = len(result.names)
    tables = {
        "nights": {**common, "name": "night-01", "source": "campaign", "points": count, "version": "0.2.0",
                   "air_model": result.reduction.settings.air_model, "verdict": "good", "why": "all fits"},
        "points": {**common, "point": result.names, "body": list(kinds_of(result.reduction).values()),
                   **{axis: result.x[:, i] for i, axis in enumerate(AXES)},
                   **{f"{AXES[i]}{AXES[j]}": blocks[:, i, j] for i in range(3) for j in range(i, 3)}},
    }  # fmt: skip
    rows = {"nights": 1, "points": count}
    create_archive(place)
    with sole_writer(place):
        write_night(
            place,
            NightContent(
                night=night,
                first=common["mjd"],
                last=common["mjd"],
                source="campaign",
                inputs_sha256="0" * 64,
                provenance={},
                tables={
                    kind: {name: np.broadcast_to(np.asarray(each), (rows[kind],)) for name, each in columns.items()}
                    for kind, columns in tables.items()
                },
                directory=NIGHT,
                inputs=sorted(str(path.relative_to(NIGHT)) for path in NIGHT.rglob("*") if path.is_file()),
                samples="frames.npy",
                periods=campaign.shots.samples_per_cycle[order],
                cycles=campaign.shots.cycles[order],
            ),
        )
    return open_archive(place)


def with_zeros(campaign, shifts):
    """Campaign whose heads were calibrated anew: D0 of some rangers shifted, mm."""
    mirrors = dict(campaign.mirrors)
    for ranger, shift in shifts.items():
        mirror = campaign.mirror_of(ranger)
        mirrors[mirror.zp] = mirror.model_copy(update={"d0_mm": mirror.d0_mm + shift})
    return replace(campaign, mirrors=mirrors)


def test_a_restored_night_gives_the_same_bits(archive):
    result = catseye.query(archive.directory, again="night-01")
    assert (result.verdict.word, result.answer.largest) == ("good", 0.0)
    assert "the same to the last bit" in result.verdict.why
    assert len(result.answer.point) == len(reduced().names)
    assert not result.answer.u_change.any()
    assert np.array_equal(result.answer.x, reduced().x)


def test_one_zero_moves_each_point_as_its_covariance_says(archive, tmp_path):
    """A shift of one u of the calibration moves a point by the root of half of what two calibrations scatter."""
    campaign = read_campaign(NIGHT)
    ranger = "ZY101"
    u = campaign.mirror_of(ranger).u_d0_mm
    found = reduced_again(archived_points(archive, "night-01"), campaign, with_zeros(campaign, {ranger: u}))
    assert found.changed == (f"mirror of {ranger}",)
    assert found.verdict.word == "good"
    assert found.selection == 0
    expected = 2.0 * np.einsum("ni,nj->nij", found.change, found.change)
    scale = np.abs(found.covariance).max()
    assert scale > (1e-3 * MILLIMETRE) ** 2
    assert np.abs(found.covariance - expected).max() < 0.05 * scale
    for name, text in site_files(with_zeros(campaign, {ranger: u})).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    result = catseye.query(archive.directory, again="night-01", calibrations=tmp_path)
    assert np.array_equal(result.answer.change, found.change)
    assert result.to_object()["calibrations"] == str(tmp_path)
    assert len(result.tables()["again"]) == len(found.point)
    assert list(result.figures()) == ["differences"]
    assert any("mirror of ZY101" in passage.text for passage in result.passages())


def test_records_that_are_the_same_change_nothing():
    campaign = read_campaign(NIGHT)
    assert changed_records(campaign, with_records(campaign, campaign)) == ()
    assert not any(calibrated_anew(campaign, campaign).values())


def test_each_effect_of_a_sheet_counts_by_itself():
    campaign = read_campaign(NIGHT)
    zp = campaign.mirror_of("ZY101").zp
    moved = campaign.mirrors[zp].model_copy(update={"dx_mm": campaign.mirrors[zp].dx_mm + 0.01})
    place = campaign.monuments["ZY102"].model_copy(update={"x_mm": campaign.monuments["ZY102"].x_mm + 0.1})
    other = replace(
        campaign,
        mirrors={**campaign.mirrors, zp: moved},
        monuments={**campaign.monuments, "ZY102": place},
        benchmarks=campaign.benchmarks[1:],
    )
    anew = {group: names for group, names in calibrated_anew(campaign, other).items() if names}
    assert anew == {OFFSETS: {"ZY101"}, MONUMENTS: {"ZY102"}, BENCHMARKS: {campaign.benchmarks[0].target}}
    assert calibrated_anew(campaign, with_zeros(campaign, {"ZY103": 0.01}))[ZEROS] == {"ZY103"}


def test_records_that_do_not_fit_the_night_are_refused():
    campaign = read_campaign(NIGHT)
    name = next(iter(set(campaign.shots.target) & set(campaign.targets)))
    targets = {key: value for key, value in campaign.targets.items() if key != name}
    with pytest.raises(InputError, match=f"do not fit the night: .*{name}"):
        with_records(campaign, replace(campaign, targets=targets))
    none = campaign.site.model_copy(update={"weather_station": campaign.site.weather_station[1:]})
    with pytest.raises(InputError, match=r"weather_station .* is missing"):
        with_records(campaign, replace(campaign, site=none))


@pytest.mark.slow
def test_the_claim_of_a_change_is_its_scatter(archive):
    """All zeros calibrated anew, thirty times: errors of old and new are independent, a shift has their sum."""
    campaign, archived, rng = read_campaign(NIGHT), archived_points(archive, "night-01"), np.random.default_rng(5)
    z = []
    for _ in range(30):
        u = {name: campaign.mirror_of(name).u_d0_mm for name in campaign.rangers}
        shifts = {name: 2**0.5 * each * rng.standard_normal() for name, each in u.items()}
        found = reduced_again(archived, campaign, with_zeros(campaign, shifts))
        moving = found.u_change.min(axis=1) > 1e-7
        z.append(np.mean((found.change[moving] / found.u_change[moving]) ** 2))
    assert abs(np.mean(z) - 1.0) < 4.0 * np.std(z) / np.sqrt(len(z))
    assert np.std(z) / np.sqrt(len(z)) < 0.12
