"""Parameters of free text: lists, priorities, positions, boxes."""

import numpy as np
import pytest

from catseye.coordinator.control import texts
from catseye.errors import InputError
from coordinator.round_scene import gbt

NAMES = ("ZG11", "ZG12", "ZEG3", "DP001")


def test_scan_list_has_names_and_patterns():
    assert texts.scan_list("ALL", NAMES) is None
    assert texts.scan_list("zg1* DP001", NAMES) == {"ZG11", "ZG12", "DP001"}
    with pytest.raises(InputError, match=r"'ZX\*' fits none of 4 targets"):
        texts.scan_list("ZG11 ZX*", NAMES)


def test_last_priority_that_fits_counts():
    assert texts.priorities("*=2 ZG*=0.5 ZG12=8", NAMES) == {"DP001": 2.0, "ZEG3": 2.0, "ZG11": 0.5, "ZG12": 8.0}
    assert texts.priorities("none", NAMES) == {}
    assert texts.priorities("ZG* = 2  ZG12 =8", NAMES) == {"ZG11": 2.0, "ZG12": 8.0}
    with pytest.raises(InputError, match=r"'ZG\*' \(expected name=factor"):
        texts.priorities("ZG* 10", NAMES)
    for text in ("ZG11=0", "ZG11=1e9", "ZG11=much", "ZG11", "ZG11=nan"):
        with pytest.raises(InputError, match="priorities"):
            texts.priorities(text, NAMES)


def test_positions_are_near_their_records():
    targets = gbt().targets
    name, target = next((n, t) for n, t in targets.items() if not t.shapes_dish)
    x, y, z = target.position_mm
    positions = texts.positions_mm(f"{name.lower()} {x + 300} {y} {z}", targets)
    assert positions == {name: (x + 300, y, z)}
    assert texts.positions_mm(texts.positions_text(positions), targets) == positions
    with pytest.raises(InputError, match="is 1001 mm from its record \\(limit 1000"):
        texts.positions_mm(f"{name} {x} {y + 1001} {z}", targets)
    dish = next(n for n, t in targets.items() if t.shapes_dish)
    for text in (f"{dish} 0 0 0", "NOBODY 1 2 3", f"{name} 1 2", f"{name} 1 2 z", f"{name} nan 2 3"):
        with pytest.raises(InputError, match="target_positions"):
            texts.positions_mm(text, targets)


def test_boxes_hold_no_ranger_and_have_their_own_names():
    stands = {"ZY101": np.array([10.0, 0.0, 1.0])}
    (crane, _) = texts.boxes("crane 5 5 0 -5 -5 20; hut 20 20 0 22 22 3", ["house"], stands)
    np.testing.assert_allclose(crane.box().size, [10.0, 10.0, 20.0])
    np.testing.assert_allclose(crane.box().centre, [0.0, 0.0, 10.0])
    for text, words in (
        ("house 1 1 1 2 2 2", "a box 'house' already"),
        ("a 0 -1 0 20 1 2", "holds ZY101"),
        ("a 1 1 1 2 2", "expected name x1 y1 z1"),
        ("a 1 1 1 2 2 1", "is not below high_mm"),
        ("a 1 1 1 2 2 inf", "is not a number"),
    ):
        with pytest.raises(InputError, match=words):
            texts.boxes(text, ["house"], stands)
