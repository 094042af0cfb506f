"""Points typed 60 to 120 mm off that claim 10 mm: found where their lines meet, or listed; never wrong in silence."""

import dataclasses

import numpy as np
import pytest

from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.lines.cycles import without_shots
from catseye.reduction.epoch.lines.mistyped import FARTHER, with_uncertain_positions

OFF = {"east": (100.0, 0.0, 0.0), "up": (0.0, 0.0, 100.0), "aslant": (60.0, 60.0, 0.0), "down": (0.0, 0.0, -120.0)}


def mistyped(campaign, name, by):
    target = campaign.targets[name]
    moved = target.model_copy(update={"position_mm": tuple(np.add(target.position_mm, by))})
    return dataclasses.replace(campaign, targets={**campaign.targets, name: moved})


def adjusted(campaign, reduction):
    return adjust_coordinates(campaign, reduction.phases, reduction.electronics, settings=reduction.settings)


@pytest.mark.parametrize("by", OFF.values(), ids=OFF)
def test_a_structural_target_comes_out_where_it_was(few_01, reduced_few_01, by):
    found, before = adjusted(mistyped(few_01, "ZEG41040L", by), reduced_few_01), reduced_few_01.coordinates
    np.testing.assert_array_equal(found.ranges.cycles, before.ranges.cycles)
    np.testing.assert_array_equal(found.ranges.used, before.ranges.used)
    assert found.points == before.points
    # the 10 mm of the typed position moved it by some micrometres, the wider ones do not
    assert np.abs(found.x - before.x).max() < 5e-6
    assert found.unchecked == before.unchecked
    (note,) = (n for n in found.notes if n.startswith("ZEG41040L"))
    assert "whole cycles found jointly from 6 lines, next candidate at least" in note
    stated = float(note.split()[5])  # with the 10 mm of the night's own typing
    assert stated == pytest.approx(float(np.linalg.norm(by)), abs=20.0)


@pytest.mark.parametrize("lines", [3, 4])
def test_a_target_with_too_few_lines_for_a_search_is_listed(few_01, reduced_few_01, lines):
    ranges, before = reduced_few_01.coordinates.ranges, reduced_few_01.coordinates
    rows = list(zip(ranges.shot.tolist(), ranges.ranger, ranges.target, strict=True))
    out = sorted({ranger for _, ranger, target in rows if target == "ZEG41040L"})[lines:]
    shots = {k for k, ranger, target in rows if target == "ZEG41040L" and ranger in out}
    electronics = without_shots(reduced_few_01.electronics, shots)
    campaign = mistyped(few_01, "ZEG41040L", OFF["east"])
    found = adjust_coordinates(campaign, reduced_few_01.phases, electronics, settings=reduced_few_01.settings)
    assert "ZEG41040L" in {*found.unchecked, *found.unmeasured}
    others = [n for n in before.points if n != "ZEG41040L"]
    rows = found.rows(others)
    assert (
        np.abs(found.x[rows] - before.x[before.rows(others)]) <= found.u[rows]
    ).all()  # some lines fewer; the datum is held


@pytest.mark.parametrize("name", ["DP001", "DP010", "DP020", "DP050"])
def test_a_prism_of_the_dish_is_right_or_listed(few_01, reduced_few_01, name):
    found, before = adjusted(mistyped(few_01, name, OFF["east"]), reduced_few_01), reduced_few_01.coordinates
    listed = {*found.unchecked, *found.unmeasured}
    if name not in listed:
        row = found.index(name)
        off, pulled = found.x[row] - before.x[before.index(name)], (found.u[row].max() / 0.01) ** 2 * 0.1
        assert np.abs(off).max() < 2.0 * pulled  # by the 10 mm that the typed position claims
    assert any(n.startswith((f"{name}: its typed position", f"{name}: none")) for n in found.notes)


def test_a_triplet_is_uncertain_as_a_whole(night_01):
    wide = with_uncertain_positions(night_01, {"TR05-L", "ZY113", "DP005"})
    uncertain = {
        *(t.triplet for t in wide.triplets.values() if t.u_position_mm is not None),
        *(r.name for r in wide.feedarm.ranger if r.u_position_mm is not None),
        *(t.name for t in wide.targets.values() if t.u_position_mm is not None),
    }
    assert uncertain == {"TR05", "ZY113", "DP005"}
    assert wide.triplets["TR05"].u_position_mm == pytest.approx(1e3 * FARTHER)
