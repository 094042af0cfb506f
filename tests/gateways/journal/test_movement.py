"""Movement of a journal's answers in words and in JSON."""

import math

from catseye.coordinator.journal.movement import Furthest, Movement, Moving
from catseye.gateways.journal.movement import TITLES, UNITS, movement_object, movement_words

POINTS = Movement(
    count=10,
    rms=2e-4,
    largest=Furthest(1.5e-3, "ZEG1", 3),
    normalised=27,
    rms_u=0.04,
    largest_u=Furthest(0.5, "ZEG2", 4),
)
BARE = Movement(
    count=2, rms=1e-14, largest=Furthest(2e-14, "ZY1 to A", None), normalised=0, rms_u=math.nan, largest_u=None
)
STILL = Movement(count=2, rms=0.0, largest=Furthest(0.0, "WX1", 1), normalised=2, rms_u=0.0, largest_u=None)


def test_sizes_are_given_in_their_unit_and_in_u_with_the_place():
    assert movement_words({Moving.POINTS: POINTS, Moving.RANGES: BARE, Moving.THERMOMETERS: STILL}) == [
        (
            "Points",
            "moved by 0.200 mm rms, at most 1.500 mm (ZEG1, epoch 3), of 10 compared; "
            "in stored u 0.040 rms, at most 0.500 (ZEG2, epoch 4).",
        ),
        (
            "Ranges",
            "moved by 1.0e-11 mm rms, at most 2.0e-11 mm (ZY1 to A, after the last epoch), of 2 compared; "
            "no u is stored.",
        ),
    ]


def test_programs_read_the_same():
    found = movement_object({Moving.POINTS: POINTS, Moving.THERMOMETERS: STILL})
    assert found["points"] == {
        "compared": 10,
        "rms_mm": 0.2,
        "largest_mm": 1.5,
        "largest": {"name": "ZEG1", "epoch": 3},
        "with_u": 27,
        "rms_u": 0.04,
        "largest_u": 0.5,
        "largest_in_u": {"name": "ZEG2", "epoch": 4},
    }
    assert (found["thermometers"]["largest_c"], found["thermometers"]["largest_u"]) == (0.0, None)


def test_each_kind_has_its_title_and_unit():
    assert set(TITLES) == set(UNITS) == set(Moving)
