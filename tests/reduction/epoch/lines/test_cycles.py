"""Points typed to decimetres in night-01 or a part of it: found where they were, or refused; nothing else changes."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.site.target import TargetRow
from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.lines.cycles import doubtful_points, resolve_cycles
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.unknowns import build_network
from catseye.reduction.site.places import places_of

WRONG = np.array([180.0, -240.0, 0.0])  # mm, 0.3 m in space


def target_off(campaign, name, by=WRONG, u=300.0):
    t = campaign.targets[name]
    moved = t.model_copy(update={"position_mm": tuple(np.add(t.position_mm, by)), "u_position_mm": u})
    return dataclasses.replace(campaign, targets={**campaign.targets, name: moved})


def arm_off(campaign, name, by=WRONG, u=300.0):
    rangers = tuple(
        r.model_copy(update={"nominal_scan_point_mm": tuple(np.add(r.nominal_scan_point_mm, by)), "u_position_mm": u})
        if r.name == name
        else r
        for r in campaign.feedarm.ranger
    )
    return dataclasses.replace(campaign, feedarm=campaign.feedarm.model_copy(update={"ranger": rangers}))


def triplet_off(campaign, name, by=WRONG, u=300.0):
    t = campaign.triplets[name]
    moved = t.model_copy(update={"nominal_position_mm": tuple(np.add(t.nominal_position_mm, by)), "u_position_mm": u})
    return dataclasses.replace(campaign, triplets={**campaign.triplets, name: moved})


def adjusting(reduction):
    """Function campaign -> coordinates, from the phases of a reduction."""
    r = reduction
    return lambda campaign, settings=None: adjust_coordinates(
        campaign, r.phases, r.electronics, settings=settings or r.settings
    )


@pytest.fixture(scope="module")
def adjusted(reduced_night_01):
    return adjusting(reduced_night_01)


@pytest.fixture(scope="module")
def few_adjusted(reduced_few_01):
    return adjusting(reduced_few_01)


def compare(one, other):
    """Largest shift of a coordinate, m; cycles of every shot must agree."""
    assert one.points == other.points
    np.testing.assert_array_equal(one.ranges.shot, other.ranges.shot)
    np.testing.assert_array_equal(one.ranges.cycles, other.ranges.cycles)
    np.testing.assert_array_equal(one.ranges.used, other.ranges.used)
    return np.abs(one.x - other.x).max()


def test_a_target_typed_three_decimetres_off_comes_out_where_it_was(few_01, reduced_few_01, few_adjusted):
    found = few_adjusted(target_off(few_01, "DP050"))
    assert compare(found, reduced_few_01.coordinates) < 1e-6
    notes = [n for n in found.notes if n.startswith("DP050")]
    assert len(notes) == 1
    assert notes[0].startswith("DP050: position uncertain by 300 mm; whole cycles found jointly from 6 shots, next")
    assert not found.unresolved
    assert not found.ranges.thin.any()
    assert found.variance_factor == pytest.approx(reduced_few_01.coordinates.variance_factor, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["DP012", "DP029", "DP047", "ZAG731P"])
def test_only_the_weight_of_the_typed_position_makes_a_difference(night_01, adjusted, name):
    # the usual prior moves a point by some (u / 10 mm)^2 of its typed error, 1.7 um for DP012; a loose one does not
    right = adjusted(target_off(night_01, name, by=np.zeros(3)))
    found = adjusted(target_off(night_01, name))
    assert compare(found, right) < 1e-7


def test_a_ranger_on_the_feed_arm_typed_three_decimetres_off_comes_out_where_it_was(
    few_01, reduced_few_01, few_adjusted
):
    found = few_adjusted(arm_off(few_01, "ZY113"))
    assert compare(found, reduced_few_01.coordinates) < 1e-6
    assert any(n.startswith("ZY113: position uncertain by 300 mm; whole cycles found jointly") for n in found.notes)


@pytest.mark.slow
def test_a_triplet_typed_three_decimetres_off_is_found_by_its_prisms_and_their_plate(
    night_01, reduced_night_01, adjusted
):
    # the ball alone, from four rangers, is ambiguous: the data sheet hands it the prisms' places
    found = adjusted(triplet_off(night_01, "TR05"))
    assert compare(found, reduced_night_01.coordinates) < 1e-6
    assert [n.partition(":")[0] for n in found.notes if "found jointly" in n] == ["TR05-L", "TR05-R"]
    assert not found.unresolved


def test_cycles_undecided_by_four_rangers_are_rejected_with_a_reason(few_01, reduced_few_01):
    reduction = reduce_epoch(target_off(few_01, "DP005"))
    before = reduced_few_01.status
    mine = [k for k, t in enumerate(few_01.shots.target) if t == "DP005" and before[k] == "used"]
    assert len(mine) == 4
    for k in mine:
        assert reduction.status[k] == "whole cycles unknown"
        reason = reduction.rejected[int(few_01.shots.shot[k])]
        assert reason.startswith("whole cycles unknown: typed position of DP005 is uncertain by 300 mm; of ")
        assert "range it from more stations" in reason
    assert "DP005" not in reduction.coordinates.points
    assert len(reduction.rejected) == len(reduced_few_01.rejected) + 4


@pytest.mark.slow
def test_a_whole_night_typed_to_two_centimetres_is_found_step_by_step(night_01, reduced_night_01, adjusted):
    found = adjusted(night_01, ReductionSettings(u_position=0.02))
    before = reduced_night_01.coordinates
    both = np.isin(before.ranges.shot, found.ranges.shot)
    np.testing.assert_array_equal(before.ranges.cycles[both], found.ranges.cycles)
    assert len(found.unresolved) <= 12
    assert any("points too uncertain for the nearest integer: whole cycles found jointly" in n for n in found.notes)


def test_a_certified_distance_is_as_good_as_a_position(few_01, reduced_few_01):
    # one ranger sees ZBM02, at a distance known to some hundredths of a millimetre
    r = reduced_few_01
    resolved = resolve_cycles(build_network(target_off(few_01, "ZBM02"), r.phases, r.electronics, settings=r.settings))
    assert (resolved.rejected, resolved.notes) == ({}, ())
    (certified,) = (b for b in few_01.benchmarks if b.target == "ZBM02")
    ranger = r.coordinates.x[r.coordinates.index(certified.ranger)]
    distance = np.linalg.norm(resolved.starts["ZBM02"] - ranger)
    assert distance == pytest.approx(certified.certified_distance_mm * 1e-3, abs=2e-4)


def test_night_01_itself_needs_no_search(night_01, reduced_night_01):
    r = reduced_night_01
    resolved = resolve_cycles(build_network(night_01, r.phases, r.electronics, settings=r.settings))
    assert (resolved.starts, resolved.rejected, resolved.notes) == ({}, {}, ())
    assert not r.coordinates.unresolved
    assert not r.coordinates.ranges.thin.any()


def test_points_are_doubtful_by_their_own_uncertainty_before_the_settings(night_01, reduced_night_01):
    r = reduced_night_01

    def doubtful(campaign, **settings):
        return doubtful_points(build_network(campaign, r.phases, r.electronics, settings=ReductionSettings(**settings)))

    assert doubtful(night_01) == set()  # 10 mm, the layout's
    assert doubtful(target_off(night_01, "DP005", u=9.0)) == set()
    assert doubtful(target_off(night_01, "DP005", u=10.5)) == {"DP005"}
    typed = {n for n, p in places_of(night_01).items() if p.typed}
    assert doubtful(night_01, u_position=0.0105) == typed
    assert doubtful(target_off(night_01, "DP005", u=2.0), u_position=0.0105) == typed - {"DP005"}


def test_a_record_states_its_position_uncertainty_in_millimetres(night_01):
    places = places_of(triplet_off(arm_off(target_off(night_01, "DP005"), "ZY113", u=25.0), "TR05", u=40.0))
    assert places["DP005"].u_start == pytest.approx(0.3)
    assert places["ZY113"].u_start == pytest.approx(0.025)
    assert [places[n].u_start for n in ("TR05-L", "TR05-R", "TR05-B")] == pytest.approx([0.04] * 3)
    assert places["DP006"].u_start is None
    fields = night_01.targets["DP005"].model_dump()
    for bad in (0.0, -1.0, 2000.1):
        with pytest.raises(ValueError, match="u_position_mm"):
            TargetRow.model_validate(fields | {"u_position_mm": bad})


def test_a_shot_whose_cycles_depend_on_a_typed_position_is_thin(few_01, reduced_few_01, part, few_targets, few_rangers):
    # one ranger only: nothing but the typed 10 mm predicts its range, and five of them reach a quarter wavelength
    r = reduced_few_01
    drop = (few_targets == "DP050") & (few_rangers != "ZY113")
    reduction = reduce_epoch(part(few_01, ~drop))
    ranges = reduction.coordinates.ranges
    mine = np.array(ranges.target) == "DP050"
    assert mine.sum() == 1
    assert ranges.thin[mine].all()
    assert not ranges.thin[~mine].any()
    assert any(n.startswith("DP050: the whole cycles of 1 of its 1 shots") for n in reduction.notes)
    assert not any("the whole cycles of" in n for n in r.notes)


def test_a_campaign_with_only_unknown_cycles_is_refused_with_a_reason(
    few_01, reduced_few_01, part, few_targets, few_references
):
    only = part(target_off(few_01, "DP005"), (few_targets == "DP005") | few_references)
    with pytest.raises(
        InputError,
        match=r"^shots\.csv: whole cycles unknown: typed position of DP005 is uncertain .*; nothing to adjust$",
    ):
        reduce_epoch(only)


def test_repeats_on_one_line_do_not_vouch_for_each_others_cycles(few_01, part, few_targets, few_rangers):
    reduction = reduce_epoch(part(few_01, ~((few_targets == "ZAG731P") & (few_rangers != "ZY101"))))
    ranges = reduction.coordinates.ranges
    mine = np.array(ranges.target) == "ZAG731P"
    assert mine.sum() == 2  # from one coarse length, good to the typed 10 mm
    assert ranges.thin[mine].all()
    assert not ranges.thin[~mine].any()


def test_a_point_with_some_shots_safe_and_some_unknown_starts_where_the_safe_ones_put_it(
    few_01, reduced_few_01, few_adjusted
):
    # ZBM01: certified from ZY102, four shots; ZY103's two alone would not place it. The night must not notice
    found, before = few_adjusted(target_off(few_01, "ZBM01")), reduced_few_01.coordinates
    assert len(found.unresolved) == 2
    assert {few_01.shots.ranger[k] for k in found.unresolved} == {"ZY103"}
    both = np.isin(before.ranges.shot, found.ranges.shot)
    np.testing.assert_array_equal(before.ranges.cycles[both], found.ranges.cycles)
    np.testing.assert_array_equal(before.ranges.used[both], found.ranges.used)
    others = np.repeat(np.array(before.points) != "ZBM01", 3).reshape(-1, 3)
    assert np.abs(found.x - before.x)[others].max() < 5e-6  # two shots fewer


def test_a_certified_distance_overrules_a_typed_position_that_contradicts_it(few_01, reduced_few_01, few_adjusted):
    # 0.3 m off and claiming 10 mm: four shots, alike by the same wrong cycles, used to outvote the certificate
    found, before = few_adjusted(target_off(few_01, "ZBM02", u=None)), reduced_few_01.coordinates
    np.testing.assert_array_equal(before.ranges.cycles, found.ranges.cycles)
    np.testing.assert_array_equal(before.ranges.used, found.ranges.used)
    assert any(n.startswith("ZBM02: its typed position is") for n in found.notes)


def test_a_point_none_of_whose_shots_fits_is_named(few_01, few_adjusted):
    found = few_adjusted(target_off(few_01, "DP012", u=None))
    mine = np.array(found.ranges.target) == "DP012"
    assert not found.ranges.used[mine].any()
    assert any(n.startswith(f"DP012: none of its {mine.sum()} shots fits") for n in found.notes)
