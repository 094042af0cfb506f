"""Whole cycles from several frequencies: truth recovered, wrong cycles as often as claimed, doubt said."""

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import ArgumentError
from catseye.records.night.phase_table import PhaseRow
from catseye.reduction.detection.cycle_lengths import cycle_lengths

THREE = (1.5e9, 1.500713e9, 1.505e9)
INDEX = 1.000253


def shots(lengths, frequencies, u, rng):
    """Phases of lengths in air, falling as they grow, with noise of u."""
    return {
        f"S{i}": [
            PhaseRow(
                shot=f"S{i}",
                modulation_hz=f,
                phase_rad=float(-4.0 * np.pi * f * INDEX * length / SPEED_OF_LIGHT + rng.normal(0.0, u)),
                u_phase_rad=u,
            )
            for f in frequencies
        ]
        for i, length in enumerate(lengths)
    }


def test_lengths_are_recovered_within_their_u():
    rng = np.random.default_rng(1)
    truth = rng.uniform(5.0, 200.0, 200)
    found = cycle_lengths(shots(truth, THREE, 1e-3, rng), shortest=5.0, longest=200.0, group_index=INDEX)
    assert found.verdict.word == "good"
    assert found.advice is None
    w = np.array([(s.length - t) / s.u_length for s, t in zip(found.shots, truth, strict=True)])
    assert np.max(np.abs(w)) < 4.5
    assert np.std(w) == pytest.approx(1.0, abs=0.15)  # 3 sigma of 200
    misfit = np.mean([s.misfit for s in found.shots])
    assert misfit == pytest.approx(2.0, abs=0.45)  # two degrees of freedom, 3 sigma of 200
    for s, t in zip(found.shots, truth, strict=True):
        assert s.cascade_thin or s.cascade_length == pytest.approx(t, abs=6e-5)


def test_wrong_cycles_are_as_many_as_their_probabilities_say():
    """Noise of 6 mrad, where neighbours are 2.7 standard uncertainties apart, and 50 shots of a quarter of it."""
    rng = np.random.default_rng(2)
    truth = rng.uniform(20.0, 60.0, 1500)
    noisy = shots(truth[:1450], THREE, 6e-3, rng)
    quiet = {f"Q{name}": rows for name, rows in shots(truth[1450:], THREE, 1.5e-3, rng).items()}
    found = cycle_lengths(noisy | quiet, shortest=20.0, longest=60.0, group_index=INDEX)
    wrong = np.array([abs(s.length - t) > 0.04 for s, t in zip(found.shots, truth, strict=True)])
    claimed = np.array([s.slip_probability for s in found.shots])
    assert claimed.sum() > 20
    assert wrong.sum() == pytest.approx(claimed.sum(), abs=4.0 * np.sqrt(np.sum(claimed * (1.0 - claimed))))
    sure = np.array([s.status == "found" for s in found.shots])
    assert sure[1450:].all()
    assert not wrong[sure].any()
    assert found.verdict.word == "doubtful"
    assert found.advice is not None
    assert found.advice.unambiguous


def test_each_set_of_frequencies_is_rated_and_used():
    rng = np.random.default_rng(3)
    rows = shots([30.0, 40.0], THREE, 1e-3, rng)
    rows |= {"four": shots([50.0], (*THREE, 1.55e9), 1e-3, rng)["S0"]}
    found = cycle_lengths(rows, shortest=5.0, longest=200.0, group_index=INDEX)
    assert [len(each.frequencies_hz) for each in found.sets] == [3, 4]
    assert [s.length for s in found.shots] == pytest.approx([30.0, 40.0, 50.0], abs=5e-5)


def test_a_wrong_phase_is_a_misfit():
    rng = np.random.default_rng(4)
    rows = shots([30.0], THREE, 1e-3, rng)
    rows["S0"][2] = rows["S0"][2].model_copy(update={"phase_rad": rows["S0"][2].phase_rad + 0.0105})
    found = cycle_lengths(rows, shortest=5.0, longest=200.0, group_index=INDEX)
    assert found.shots[0].status == "misfit"
    assert found.verdict.word == "failed"
    assert found.least_sure.shot == "S0"


def test_the_candidates_of_a_shot_hold_its_two_best():
    found = cycle_lengths(
        shots([77.0], THREE, 1e-3, np.random.default_rng(5)), shortest=5.0, longest=200.0, group_index=INDEX
    )
    length, square = found.candidates(found.shots[0])
    order = np.argsort(square)
    assert length[order[0]] == pytest.approx(found.shots[0].length, abs=1e-9)
    assert length[order[1]] == pytest.approx(found.shots[0].next_length, abs=1e-9)
    assert square[order[1]] - square[order[0]] == pytest.approx(found.shots[0].discrimination, rel=1e-9)


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"shortest": 50.0, "longest": 5.0}, "expected 0 or more"),
        ({"shortest": -1.0, "longest": 5.0}, "expected 0 or more"),
        ({"shortest": 5.0, "longest": 20_000.0}, "10000 m at most"),
        ({"shortest": 5.0, "longest": 200.0, "group_index": 1.5}, "group_index = 1.5"),
    ],
)
def test_what_cannot_be_searched_is_refused(limits, said):
    rows = shots([30.0], THREE, 1e-3, np.random.default_rng(6))
    with pytest.raises(ArgumentError, match=said):
        cycle_lengths(rows, **({"group_index": INDEX} | limits))


def test_two_close_frequencies_over_a_long_span_are_refused():
    """10 MHz apart repeat every 15 m: by hand c/(2 n 10 MHz)."""
    rows = shots([30.0], (1.5e9, 1.51e9), 1e-3, np.random.default_rng(7))
    with pytest.raises(ArgumentError, match=r"confuse lengths 14\.9.*, or measure at 1500, "):
        cycle_lengths(rows, shortest=5.0, longest=200.0, group_index=INDEX)
