"""Errors of records that no contradiction shows: those that the ranges lean to, and those that could hide.

The answer keeps to the records; what follows for its uncertainty, and for the points that rest on a record, is here.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from catseye.estimation.least_squares.adjustment import NONCENTRALITY, LeastSquaresSolution
from catseye.estimation.least_squares.covariance import Covariance, Widened
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.least_squares.patterns import PatternTests
from catseye.reduction.epoch.contradictions.contradiction import RecordGroup
from catseye.reduction.epoch.contradictions.hypotheses import BODIES, EVERYTHING, TELESCOPE, Hypothesis
from catseye.reduction.epoch.record_tests import EpochRecords, explanation_of, is_possible

FAR_REACHING, ALONE = 0.01, 0.001  # levels from which an error is allowed for; surveys and errors in common reach far
MOST_TOLD = 6  # errors told that the ranges lean to


@dataclass(frozen=True, eq=False)
class Leaning:
    """Errors of records that the ranges speak for, but not enough for a contradiction.

    texts   of the errors, with their sizes, likeliest first
    reach   (n, k) shift of the parameters if they are as large as found, and by what they are uncertain
    """

    texts: tuple[str, ...]
    reach: np.ndarray

    @property
    def note(self) -> str:
        """Sentence for the user, of the likeliest errors."""
        texts = list(self.texts[:MOST_TOLD])
        if len(self.texts) > MOST_TOLD:
            texts.append(f"of {len(self.texts) - MOST_TOLD} more")
        return f"the ranges lean to an error of {'; or '.join(texts)}, as chance may: the uncertainties include it"

    def considered(self, solution: LeastSquaresSolution) -> LeastSquaresSolution:
        """Solution with these errors in its covariance."""
        return replace(solution, q=Widened(solution.q, self.reach))


def leaning_of(records: EpochRecords) -> Leaning | None:
    """Errors that the ranges speak for a little, as chance may; None without one.

    An error that all rangers or stations share moves all points alike, and one of a survey its ranger by many u: of
    these one in a hundred matters, of other records one in a thousand. Any of them may be it, or none: the answer keeps
    to the records, as most such errors are chance and would pull it, and its covariance is to include each.

    Source: consider parameters, [SCHMIDT66].
    """
    hypotheses = records.suspected()
    influence, patterns = Influence(records.groups, records.solution), records.patterns(hypotheses)
    tests = PatternTests(influence, patterns)
    fits = [(i, fit) for i, fit in enumerate(tests.fits) if is_possible(hypotheses[i], fit)]
    rare = {i: fit.score for i, fit in fits if fit.gain > chdtri(fit.degrees, _level(hypotheses[i]))}
    if not rare:
        return None
    near = [(i, fit) for i, fit in fits if i in rare or fit.score > 0.5 * max(rare.values())]
    near.sort(key=lambda pair: -pair[1].score)
    moved = influence.moved(patterns.vectors)
    reach = [moved[:, patterns.columns(i)] @ fit.spread for i, fit in near]
    texts = tuple(explanation_of(hypotheses[i], fit).text for i, fit in near)
    return Leaning(texts, np.concatenate(reach, axis=1))


def _level(hypothesis: Hypothesis) -> float:
    group, of = hypothesis.key
    surveys = (RecordGroup.MONUMENTS, RecordGroup.OFFSETS)
    common = of in (EVERYTHING, TELESCOPE, *BODIES) or group is RecordGroup.THERMOMETERS
    return FAR_REACHING if common or group in surveys else ALONE


def hidden_shifts(records: EpochRecords, claimed: Covariance) -> dict[str, float]:
    """Largest shift of each point, in its u, by an error of one monument's survey that is found four times in five.

    claimed   covariance of the parameters, with all errors that their uncertainties include

    Infinite for the ranger of a survey of which no range tests a direction. Of all errors e of a survey with
    e'M e = 1, those found alike, the one that moves the point most is taken.

    Source: [BAARDA68], external reliability.
    """
    surveys = [h for h in records.of_priors if h.key.group is RecordGroup.MONUMENTS]
    names = list(records.network.places)
    if not surveys:
        return dict.fromkeys(names, 0.0)
    influence, patterns = Influence(records.groups, records.solution), records.patterns(surveys)
    tests = PatternTests(influence, patterns)
    first = np.array([records.network.layout.points[name] for name in names])
    weight = np.linalg.pinv(claimed.blocks(first), hermitian=True)
    moved = influence.moved(patterns.vectors)[first[:, None] + np.arange(3)]
    largest = np.zeros(len(names))
    for i, survey in enumerate(surveys):
        fit = tests.fit(i)
        by_one_u = moved[:, :, patterns.columns(i)] @ fit.spread[:, 1:]
        squares = np.linalg.eigvalsh(by_one_u.transpose(0, 2, 1) @ weight @ by_one_u)[:, -1]
        largest = np.maximum(largest, NONCENTRALITY * np.sqrt(np.maximum(squares, 0.0)))
        if fit.degrees < len(survey.parts):
            largest[names.index(survey.key.of)] = np.inf
    return dict(zip(names, largest.tolist(), strict=True))
