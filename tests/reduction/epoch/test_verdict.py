"""A night whose claims are far too wide is no good one, as a network's: an uncertainty in another unit, most likely."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.records.night.jitter import JitterRow, jitter_table
from catseye.reduction.epoch.contradictions.contradiction import ClassScatter
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.lines.independence import Independence
from catseye.reduction.epoch.motion.scatter import worst_class
from catseye.reduction.epoch.notes import loss_doubts, loss_notes

CRITICAL = 3.5  # |w|


def test_a_jitter_of_millimetres_typed_for_tenths_is_doubtful(night_01):
    """3 mm of sway that is not there: the variance factor is 0.23."""
    start = float(night_01.shots.mjd_utc[0])
    shaken = jitter_table([JitterRow(mjd_utc=start, body="arm", u_mm=3.0)])
    found = reduce_epoch(replace(night_01, jitter=shaken)).verdict
    assert found.word == "doubtful"
    assert "52 % less than their uncertainties claim" in found.why
    assert "check the units" in found.why
    assert reduce_epoch(night_01).verdict.word == "good"


def test_a_class_that_scatters_more_is_reported_where_all_together_do_not(reduced_night_01):
    """240 degrees of freedom: one in a thousand of four classes is beyond a variance factor of 1.35."""
    quiet = ClassScatter(name="dish", factor=1.1, shots=500, degrees=260.0)
    off = ClassScatter(name="feed arm", factor=1.44, shots=480, degrees=240.0)
    assert worst_class((quiet, off)) == off
    coordinates = replace(reduced_night_01.coordinates, scatter=(quiet, off))
    found = replace(reduced_night_01, coordinates=coordinates).verdict
    assert found.word == "doubtful"
    assert found.why.startswith("shots to or from the feed arm scatter 20 % more than their uncertainties claim")


def test_a_class_within_chance_or_hardly_off_is_as_claimed():
    few = ClassScatter(name="alidade", factor=2.2, shots=20, degrees=10.0)  # one in 70
    many = ClassScatter(name="dish", factor=1.1, shots=20_000, degrees=16_000.0)  # 5 % of uncertainty
    assert worst_class((few, many)) is None
    assert worst_class(()) is None


@pytest.mark.parametrize(("name", "by_mm"), [("ZEG41040L", (600.0, 0.0, 0.0)), ("ZAG731D", (0.0, 560.0, 0.0))])
def test_a_target_typed_half_a_metre_off_is_named(night_01, name, by_mm):
    """Wrong whole cycles of a few of its lines agree with the wrong place; the others contradict them."""
    target = night_01.targets[name]
    typed = target.model_copy(update={"position_mm": tuple(np.add(target.position_mm, by_mm).tolist())})
    found = reduce_epoch(replace(night_01, targets={**night_01.targets, name: typed})).verdict
    assert found.word == "doubtful"
    assert found.why.startswith(f"{name}: ")
    assert "more than stray reflections explain" in found.why


def test_lost_shots_that_strays_explain_are_no_doubt(reduced_night_01):
    """17 of some 700 shots are strays: one or two of a point are chance, half of its shots are not.

    Shots that fit, and were left out because two contradict each other, say nothing.
    """
    ranges = reduced_night_01.coordinates.ranges
    mine = np.flatnonzero(np.array(ranges.target) == "ZEG41040L")
    independence = Independence({}, {}, {}, (), frozenset({"ZEG41040L"}))
    cases = ((0, 9.0, 0), (1, 9.0, 0), (2, 9.0, 0), (6, 9.0, 1), (6, 2.0, 0), (len(mine), 9.0, 0))
    for lost, w, doubts in cases:  # without any left there is no coordinate
        used = np.where(np.isin(np.arange(len(ranges.used)), mine), True, ranges.used)
        used[mine[:lost]] = False
        standardised = ranges.standardised.copy()
        standardised[mine[:lost]] = w
        said = loss_doubts(replace(ranges, used=used, standardised=standardised), independence, {}, CRITICAL)
        assert len(said) == doubts
        assert all(f"{lost} of its {len(mine)} shots" in text for text in said)
    assert loss_doubts(replace(ranges, used=used), Independence({}, {}, {}, (), frozenset()), {}, CRITICAL) == []


@pytest.mark.parametrize(("w", "said"), [(10.0, "more likely its survey"), (1.0, "nothing decides which is wrong")])
def test_a_ranger_is_not_blamed_for_shots_that_nothing_decides(reduced_night_01, w, said):
    coordinates = reduced_night_01.coordinates
    mine = np.array(coordinates.ranges.ranger) == "ZY105"
    ranges = replace(
        coordinates.ranges,
        used=coordinates.ranges.used & ~mine,
        standardised=np.where(mine, w, coordinates.ranges.standardised),
    )
    (note,) = (
        n for n in loss_notes(ranges, Independence({}, {}, {}, (), frozenset()), CRITICAL) if n.startswith("ZY105: ")
    )
    assert f"{mine.sum()} of its {mine.sum()} shots" in note
    assert said in note


def test_a_triplet_typed_half_a_metre_off_is_named_as_one(night_01):
    """Its prisms lose every shot and its ball a few: alone, the ball's would be chance."""
    unit = night_01.triplets["TR03"]
    where = tuple(np.add(unit.nominal_position_mm, (450.0, 0.0, 0.0)).tolist())
    typed = unit.model_copy(update={"nominal_position_mm": where})
    found = reduce_epoch(replace(night_01, triplets={**night_01.triplets, "TR03": typed})).verdict
    assert found.word == "doubtful"
    assert found.why.startswith("TR03: ")
