"""Pose, pointing and the laboratory from Python: the numbers of the commands, without files between."""

from dataclasses import replace

import numpy as np
import pytest

import catseye
from catseye.constants import MILLIMETRE
from catseye.errors import InputError

MONUMENT, MIRROR = "night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml"


@pytest.fixture(scope="module")
def night():
    return catseye.reduce("night-01")


@pytest.fixture(scope="module")
def written(night, tmp_path_factory):
    return catseye.save(night, tmp_path_factory.mktemp("night") / "out")


def test_a_night_and_what_it_wrote_give_one_pose(night, written):
    first, second = catseye.pose(night, site="night-01"), catseye.pose(written, site="night-01")
    np.testing.assert_allclose(first.translation, second.translation, rtol=0, atol=1e-9)
    np.testing.assert_allclose(first.covariance, second.covariance, rtol=1e-6)
    assert first.verdict.word == "good"
    assert first.frame == "ground"
    assert first.covariance.shape == (6, 6)
    assert len(first.to_table("points")) == len(first.names) == 90
    assert set(catseye.show(first)) == {"residuals"}


def test_the_beam_comes_with_a_pose_of_the_reflector(night):
    found = catseye.pose(night, site="night-01", pointing="prime")
    assert found.frame == "reflector"
    assert found.beam.shape == (3,)
    assert found.beam_covariance.shape == (3, 3)
    assert found.to_object()["status"] == found.status == "converged"


def test_a_group_that_does_not_move_as_one_is_doubtful_in_its_status_too(night):
    """One prism typed 50 mm off: the pose's own test rejects it, and the beam says so."""
    coordinates = night.reduction.coordinates
    x = coordinates.x.copy()
    x[night.names.index("DP001")] += 50.0 * MILLIMETRE
    bent = replace(night, reduction=replace(night.reduction, coordinates=replace(coordinates, x=x)))
    found = catseye.pose(bent, site="night-01", pointing="prime")
    assert found.verdict.word == "doubtful"
    assert "does not move as one" in found.to_object()["status"]
    assert "the beam that follows from it" in found.status


def test_counts_of_many_points_are_those_of_each():
    to = np.array([[0.0, 0.0, 50.0], [10.0, -20.0, 60.0], [0.0, 0.0, -400.0]])
    together = catseye.point(MONUMENT, MIRROR, to)
    for k, one in enumerate(to):
        np.testing.assert_array_equal(catseye.point(MONUMENT, MIRROR, one).counts[0], together.counts[k])
    assert len(together.to_object()) == len(together.to_table()) == 3
    assert all(item["verdict"]["word"] in ("good", "failed") for item in together.to_object())
    assert catseye.point(MONUMENT, MIRROR, to[0]).verdict.word == "good"
    with pytest.raises(InputError, match=r"points of shape \(1, 2\)"):
        catseye.point(MONUMENT, MIRROR, [0.0, 1.0])


def test_the_guard_s_word_on_the_sun_is_the_verdict():
    found = catseye.point(MONUMENT, MIRROR, [0.0, 0.0, 50.0], at_mjd=52892.58, longitude_deg=-79.84)
    assert found.sightings[0].sun is not None
    assert found.verdict.word == ("good" if found.sightings[0].sun.allowed else "failed")


def test_a_slewing_telescope_is_followed_and_one_that_stands_still_has_the_counts_of_a_point():
    went = catseye.track(MONUMENT, MIRROR, [0.0, 54.0, 12.0], start_deg=(145.0, 30.0), end_deg=(147.0, 31.0))
    assert went.status == ("followed",)
    assert went.counts.shape == (len(went.seconds), 1, 2)
    assert went.worst[0] < 1e-3
    here = catseye.point(MONUMENT, MIRROR, [0.0, 0.0, 50.0])
    still = catseye.track(
        MONUMENT, MIRROR, [0.0, 0.0, 50.0], frame="ground", start_deg=(145.0, 30.0), end_deg=(145.0, 30.0)
    )
    np.testing.assert_allclose(still.counts[0, 0], here.counts[0] if here.allowed[0] else here.prime[0], atol=1e-6)
    with pytest.raises(InputError, match="start_deg = 145, 200"):
        catseye.track(MONUMENT, MIRROR, [0.0, 0.0, 50.0], start_deg=(145.0, 200.0), end_deg=(145.0, 30.0))


def test_a_calibration_has_its_record_and_its_page(tmp_path):
    found = catseye.calibrate("linearity", "calibrations/linearity.csv")
    assert found.values.shape == found.u.shape == (len(found.keys),)
    where = catseye.save(found, tmp_path / "linearity")
    assert catseye.load(where / "record.toml").verdict == found.verdict.text
    page = (where / "certificate.html").read_text()
    assert page.index('class="verdict') < page.index(">Results<")
    assert len(repr(found)) < 1500


def test_a_certificate_whose_tests_failed_says_so_first_and_keeps_what_was_found(tmp_path):
    """The readings of the example, one of them far off and not rejected."""
    source = catseye.examples("calibrations/linearity.csv")
    lines = source.read_text().splitlines()
    head, cells = lines[0].split(","), lines[5].split(",")
    at = head.index("range_m")
    cells[at] = str(float(cells[at]) + 0.005)
    (tmp_path / "linearity.csv").write_text("\n".join([*lines[:5], ",".join(cells), *lines[6:]]))
    (tmp_path / "linearity.toml").write_text(source.with_suffix(".toml").read_text())
    found = catseye.calibrate("linearity", tmp_path / "linearity.csv")
    assert found.verdict.word == "failed"
    where = catseye.save(found, tmp_path / "out")
    kept = catseye.load(where / "record.toml")
    assert kept.verdict.startswith("Failed: ")
    assert [q.key for q in kept.quantity] == list(found.keys)
    page = (where / "certificate.html").read_text()
    assert page.index("Failed") < page.index(">Results<")


def test_triplets_and_a_baseline():
    units = catseye.triplet("triplets/TR01.toml", "triplets/TR02.toml")
    assert units.h_corr.shape == (2,)
    assert all(item["verdict"]["word"] in ("good", "doubtful", "failed") for item in units.to_object())
    assert len(units.to_table()) == 2
    line = "baselines/busselton/ts30-baseline-observations.csv"
    found = catseye.baseline(line, heights="baselines/busselton/pillar-heights.csv")
    assert found.x.shape == (len(found.pillars), 2)
    assert found.to_object()["verdict"]["word"] == found.verdict.word
    assert len(found.to_table("distances")) == len(found.pillars) * (len(found.pillars) - 1) // 2
