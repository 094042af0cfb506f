"""Nights whose records or nature lie: the lie is named, its error is within the claim, or the points are listed.

Rows, members and seeds are fixed beforehand (tests/hostile); bounds are of issue 45. Every night has all of nature in
random strengths, and the usual faults: blocked and reflected shots, one position typed 30 mm off, a weak ranger.
"""

import re
from collections import defaultdict

import numpy as np
import pytest
from scipy.stats import chi2

from hostile.outcome import COVERED, DOUBTFUL, MOST, NAMED, RARE, SILENT, UNCHECKED, UNSURE, outcome, rarity
from hostile.rows import FIRST_SEED, HONEST, SINGLES, TWO, case
from hostile.run import cases, outcomes, row_of

LEAST_ANSWERED, MOST_ACCUSED, MOST_ALARMED = 0.95, 0.01, 0.02  # shares of nights
FEW_LINES, MOST_LISTED = 4, 0.05  # of a listed honest point; share of listed honest points
MOST_S = 60.0  # of the processor for a night of 60 prisms: bounded work, ten times the median
QUICK = (
    "structural target typed off", "pressure at sea level, both", "barometer of one station", "pressure in mmHg, both",
    "humidity 0 at both", "modulation, all", "modulation, one ranger", "certificate", "monument", "two monuments",
    "dz sign", "heights of all triplets", "horizontal gradient", "sway of the feed arm", "drift of the telescope",
    "blocked and reflected",
)  # fmt: skip
SEEDS, PAIRS, INNOCENT = 9, 40, 200  # nights of each of 40 rows, nights with two lies, honest nights


@pytest.fixture(scope="module", params=["some", pytest.param("400", marks=pytest.mark.slow)])
def hostile(request):
    """Outcomes of hostile nights."""
    if request.param == "some":
        return list(outcomes([c for k, name in enumerate(QUICK) for c in cases([name], [FIRST_SEED + k], cycle=True)]))
    seeds = range(FIRST_SEED, FIRST_SEED + SEEDS)
    some = [*cases(SINGLES, seeds, cycle=True), *cases([TWO], range(FIRST_SEED, FIRST_SEED + PAIRS))]
    assert len(some) == 400
    return list(outcomes(some, jobs=2))


@pytest.fixture(scope="module", params=["some", pytest.param("200", marks=pytest.mark.slow)])
def honest(request):
    """Outcomes of honest nights."""
    count, jobs = (12, 1) if request.param == "some" else (INNOCENT, 2)
    return list(outcomes(cases([HONEST], range(FIRST_SEED, FIRST_SEED + count)), jobs=jobs))


def text_of(nights):
    """Nights for a failure's message."""
    return "; ".join(
        f"{o.case.seed} {', '.join(o.case.lies) or HONEST}: {o.word} {o.accused or o.alarms}" for o in nights
    )


def test_none_is_silently_wrong(hostile):
    silent = [o for o in hostile if o.word == SILENT]
    assert not silent, text_of(silent)


def test_nearly_all_are_named_covered_or_listed(hostile):
    others = [o for o in hostile if o.word not in (NAMED, COVERED, UNCHECKED)]
    assert len(others) <= (1.0 - LEAST_ANSWERED) * len(hostile), text_of(others)


def test_the_others_are_doubtful_with_candidates(hostile):
    bare = [o for o in hostile if o.word == DOUBTFUL and not (o.candidates or o.refused)]
    assert not bare, text_of(bare)


def test_what_is_not_named_scatters_as_claimed(hostile):
    """The mean of each class of a row's nights, unless chance has as large a one in 1000 suites.

    Without the points that an unchecked night lists: of these the list is the answer.
    """
    rows = defaultdict(list)
    for o in hostile:
        if o.claimed is not None and o.word in (COVERED, UNCHECKED):
            rows[o.case.row].append(o.claimed)
    wide = []
    for name, nights in rows.items():
        for kind in sorted({k for errors in nights for k in errors.mean}):
            pairs = [(errors.mean[kind], errors.freedom[kind]) for errors in nights if kind in errors.mean]
            mean, freedom = float(np.mean([m for m, _ in pairs])), sum(f for _, f in pairs)
            chance = chi2.isf(RARE / (8 * len(rows)), freedom) / freedom  # eight classes
            if mean >= max(MOST, chance):
                wide.append(f"{name}, {kind}: {mean:.1f}")
    assert not wide, wide


def test_hardly_an_innocent_record_is_named_alone(hostile):
    accused = [o for o in hostile if o.accused]
    assert len(accused) <= MOST_ACCUSED * len(hostile), text_of(accused)


def test_the_work_is_bounded(hostile, honest):
    slow = [f"{o.case.lies}: {o.seconds:.0f} s" for o in (*hostile, *honest) if o.seconds > MOST_S]
    assert not slow


def test_honest_nights_raise_no_alarm(honest):
    alarmed = [o for o in honest if o.alarms or o.accused]
    assert len(alarmed) <= MOST_ALARMED * len(honest), text_of(alarmed)


def test_honest_nights_are_within_their_claim(honest):
    """By the same count as hostile ones: one night in 500 has a point or class beyond by chance."""
    far = [o for o in honest if o.errors.far]
    assert len(far) <= max(0, int(np.ceil(4.0 * 2.0 * RARE * len(honest))) - 1), text_of(far)


def test_what_is_listed_of_an_honest_night_has_too_few_lines(honest):
    """Four at most, or none within 60° of one direction."""
    listed = [(o.case.seed, name, lines, o.across[name]) for o in honest for name, lines in o.listed.items()]
    assert all(lines <= FEW_LINES or across == 0 for _, _, lines, across in listed), listed
    assert sum(len(o.listed) for o in honest) <= MOST_LISTED * sum(o.places for o in honest)


def test_no_words_of_honest_nights_name_a_lie(honest):
    """Or an outcome would count as named whatever is said."""
    for o in honest:
        texts = [text for text in o.texts if not text.startswith(f"{o.faulty}: its typed position is")]
        for name in SINGLES:
            wrong = case(name, o.case.seed, 1.0)
            found = [text for text in texts if text in o.alarms or not text.startswith(UNSURE)]
            said = [text for text in found for pattern in wrong.named if re.search(pattern, text)]
            assert not said, f"{o.case.seed}, {name}: {said}"


def test_an_outcome_is_judged_by_what_is_said_and_by_the_truth():
    """A night of a lie whose answer is known, and the same night with other words."""
    named = outcome(case("thermometer of one station", FIRST_SEED, 9.0))
    assert (named.word, named.accused) == (NAMED, ())
    assert row_of("x", [named])["named"] == 1
    assert named.errors is not None
    assert rarity(3.0 * 40.0, np.ones(3)) < 1e-20


def test_the_rarity_of_correlated_squares_is_that_of_draws():
    rng = np.random.default_rng(45)
    weights = np.array([6.0, 2.0, 1.0, 0.5, 0.1])
    draws = rng.normal(size=(400_000, 5)) ** 2 @ weights
    for square in (20.0, 40.0, 60.0):
        share = float(np.mean(draws > square))
        assert rarity(square, weights) == pytest.approx(share, rel=0.15)
