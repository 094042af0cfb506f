"""Which reference shots are believed: a warm-up moves the ends of a ranger's block, inside only its bend counts.

The scene is still: references every two minutes that read one phase, but for what a test turns. The electronics' walk
of 10 mrad per root hour (site.toml) explains 9 mrad at an end, where one neighbour predicts over 126 s, and 7 mrad
between two, at five standard uncertainties. So of 20 mrad a walk explains nowhere enough.
"""

import dataclasses

import numpy as np
import pytest

from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.campaign import REFERENCE
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.settings import ReductionSettings

RANGER = "ZY114"  # twelve references
BETWEEN = 0.020  # rad: a third of the heads warm up by 10 to 30 mrad at the ends; inside none bends so much


@pytest.fixture(scope="module")
def phases(night_01):
    return measure_phases(night_01, ReductionSettings())


def references(campaign):
    shots = campaign.shots
    return [k for k in range(len(shots)) if (shots.ranger[k], shots.target[k]) == (RANGER, REFERENCE)]


def rejected(campaign, phases, offsets):
    """Which of the ranger's references (0, 1, ...) are left out when they read offsets (r,), rad; their reasons."""
    mine = references(campaign)
    phasor = phases.phasor.copy()
    phasor[mine] = phases.amplitude[mine] * np.exp(1j * np.asarray(offsets))
    _, wrong = follow_electronics(campaign, dataclasses.replace(phases, phasor=phasor))
    return {mine.index(k): reason for k, reason in wrong.items()}


def one(which, by):
    offsets = np.zeros(12)
    offsets[which] = by
    return offsets


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("end", [0, -1])
def test_a_reference_at_an_end_may_be_off_as_a_head_that_warms_up_is(night_01, phases, end, sign):
    assert rejected(night_01, phases, one(end, sign * BETWEEN)) == {}


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("inside", [1, 5, 10])
def test_the_same_inside_is_a_bad_reference_as_no_warm_up_bends_so_much(night_01, phases, inside, sign):
    wrong = rejected(night_01, phases, one(inside, sign * BETWEEN))
    assert list(wrong) == [inside]
    assert f"phase {sign * BETWEEN:+.4f} rad off the prediction by the neighbouring references" in wrong[inside]


@pytest.mark.parametrize("end", [0, -1])
def test_what_no_warm_up_explains_is_a_bad_reference_at_an_end_too(night_01, phases, end):
    """Sixty milliradians, a millimetre: twice the largest warm-up, and six times what the walk leaves."""
    assert list(rejected(night_01, phases, one(end, 0.060))) == [end % 12]


def test_the_largest_warm_up_of_all_costs_no_reference(night_01, phases):
    """30 mrad that fade in 300 s, the sources' transient: 10 mrad at the first, 2 mrad of bend at the second."""
    seconds = night_01.shots.mjd_utc[references(night_01)] * SECONDS_PER_DAY
    fading = 0.030 * np.exp(-(seconds - seconds[0]) / 300.0)
    assert fading[0] - fading[1] > 0.009
    assert rejected(night_01, phases, fading) == {}
