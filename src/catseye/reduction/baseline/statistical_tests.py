"""Tests of an EDM baseline: single shots and sets, and ISO 17123-4's."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.baseline.adjustment import BaselineSolution
from catseye.estimation.baseline.iso17123 import FullTest, is_nothing, same_precision, within_claim
from catseye.reduction.calibrations.check_outcome import CheckOutcome

if TYPE_CHECKING:
    from catseye.records.laboratory.baseline import Baseline
    from catseye.reduction.baseline.settings import BaselineSettings

FOLLOWS = "the light follows the weather as read"
ALIKE = 0.99  # correlation of standardised residuals that makes errors of two sets inseparable


@dataclass(frozen=True)
class SuspectShot:
    """Shot or set of shots that its test rejects.

    kind   "shot" or "set"
    rows   of the table, counted from 0
    w      standardised residual
    p      probability of such a value among all tests
    twins  rows of other suspects with the same effect: undecided which are wrong
    """

    kind: str
    rows: tuple[int, ...]
    w: float
    p: float
    twins: tuple[int, ...] = ()


def suspects_of(solution: BaselineSolution, rows: np.ndarray, level: float) -> tuple[SuspectShot, ...]:
    """Suspect shots and sets, least probable first.

    Shots against their set, sets against the baseline.

    solution   an adjustment
    rows       (m,) where its shots stand in the table
    level      of all tests together

    The components of the noise come from the same residuals, so w follows the tau distribution; where the maker's claim
    replaces them, those of sets follow the normal one.
    Source: [BAARDA68] data snooping; [POPE76] tau.
    """
    used = solution.used
    suspects = []
    several = np.flatnonzero(np.isfinite(solution.w_shot))
    tests = len(several) + len(solution.w_set)
    estimated = bool(np.isfinite(solution.u_noise[1:]).any())
    of_shots = _p_tau(solution.w_shot[several], solution.freedom_shots + (solution.freedom_sets if estimated else 0))
    for i, p in zip(several, tests * of_shots, strict=True):
        if p < level:
            pair = np.flatnonzero((used.set == used.set[i]) & (np.arange(len(used)) != i))
            twins = rows[pair] if len(pair) == 1 else rows[:0]
            suspects.append(
                SuspectShot("shot", (int(rows[i]),), float(solution.w_shot[i]), float(p), tuple(twins.tolist()))
            )
    of_sets = _p_tau(solution.w_set, solution.freedom_sets if estimated else np.inf)
    wrong = tests * of_sets < level
    for i in np.flatnonzero(wrong):
        twin = wrong & (np.abs(solution.alike[i]) > ALIKE) & (np.arange(len(wrong)) != i)
        its_rows, twin_rows = (tuple(rows[mask].tolist()) for mask in (used.set == i, twin[used.set]))
        suspects.append(SuspectShot("set", its_rows, float(solution.w_set[i]), float(tests * of_sets[i]), twin_rows))
    return tuple(sorted(suspects, key=lambda s: (s.p, -abs(s.w))))


def _p_tau(w: np.ndarray, freedom: float) -> np.ndarray:
    """Two-sided probability of a studentised residual at least so large.

    Of a normal one for infinite freedom.
    """
    from scipy.stats import norm, t

    if np.isinf(freedom):
        return 2.0 * norm.sf(np.abs(w))
    if freedom < 2:
        return np.ones(len(w))
    square = np.minimum(w**2, freedom * (1.0 - 1e-12))
    return 2.0 * t.sf(np.sqrt(square * (freedom - 1) / (freedom - square)), freedom - 1)


def decisions_of(
    solution: BaselineSolution,
    test: FullTest | str,
    settings: "BaselineSettings",
    *,
    claimed: FullTest | None,
    agreement: BaselineSolution | None,
    weather: tuple[float, float],
    against: "Baseline | None",
    suspects: tuple[SuspectShot, ...],
) -> tuple[CheckOutcome, ...]:
    """Every test with its outcome.

    solution    the adjustment
    test        the full test procedure, or the reason against it
    settings    level and claim
    claimed     the full test procedure weighted by the maker's claim
    agreement   the adjustment to the known pillars with the maker's claim as noise
    weather     share of the weather's changes in the lengths, and its u
    against     the known baseline
    suspects    shots and sets that their tests reject
    """
    level = settings.level
    return (
        *_standard(test, claimed, settings, against),
        _setups(solution, level),
        _weather(weather, solution.freedom_sets, level),
        *(_instrument(solution, agreement, level) if agreement is not None else ()),
        CheckOutcome(
            "outliers",
            float(len(suspects)),
            0.0,
            not suspects,
            "no shot and no set is suspect" if not suspects else _outliers(suspects),
        ),
    )


def _standard(
    test: FullTest | str, claimed: FullTest | None, settings: "BaselineSettings", against: "Baseline | None"
) -> list[CheckOutcome]:
    """Three questions of the standard.

    Sets, each one distance, are the sample.
    """
    if isinstance(test, str) or claimed is None:
        return [CheckOutcome(f"ISO 17123-4 {q}", float("nan"), float("nan"), None, str(test)) for q in "ac"]
    claim = within_claim(claimed.s**2, claimed.degrees_of_freedom, settings.level)
    words = f"{settings.specified_mm:g} mm + {settings.specified_ppm:g} ppm"
    text = f"sets scatter {'as' if claim.passed else 'more than'} specified ({words})"
    outcomes = [CheckOutcome("ISO 17123-4 a: s within the claim", claim.statistic, claim.limit, claim.passed, text)]
    if against is not None and against.s_mm is not None and against.degrees_of_freedom:
        precision_test = same_precision(
            test.s / MILLIMETRE,
            test.degrees_of_freedom,
            against.s_mm,
            before=against.degrees_of_freedom,
            level=settings.level,
        )
        text = (
            f"s {test.s / MILLIMETRE:.3f} mm here, {against.s_mm:.3f} mm at the known baseline; "
            f"the ratio of squares must be {precision_test.lower:.3g} at least, too"
        )
        outcomes.append(
            CheckOutcome(
                "ISO 17123-4 b: same s as before",
                precision_test.statistic,
                precision_test.limit,
                precision_test.passed,
                text,
            )
        )
    zero = is_nothing(test.zero, test.u_zero, test.degrees_of_freedom, level=settings.level)
    text = f"zero {test.zero / MILLIMETRE:+.3f} ± {test.u_zero / MILLIMETRE:.3f} mm is "
    text += "not significant" if zero.passed else "significant: correct for it"
    return [*outcomes, CheckOutcome("ISO 17123-4 c: zero", zero.statistic, zero.limit, zero.passed, text)]


def _setups(solution: BaselineSolution, level: float) -> CheckOutcome:
    """Test of the sets' scatter against their shots' repeatability.

    F of the means' squares over the shots'.
    """
    from scipy.stats import f

    name = "sets agree as their shots do"
    between, within = solution.freedom_sets, solution.freedom_shots
    if within < 1 or between < 1:
        return CheckOutcome(name, float("nan"), float("nan"), None, "no repeated shots: the test is not possible")
    squares = float(np.sum(solution.used.within**2)) / within
    means = float(np.sum(solution.used.shots * solution.residual**2)) / between
    ratio = means / squares if squares > 0.0 else float("inf")
    limit = float(f.ppf(1.0 - level, between, within))
    text = (
        "repeats show the total scatter"
        if ratio <= limit
        else "repeats hide most of it: pointing, centring and the air change from set to set"
    )
    return CheckOutcome(name, ratio, limit, ratio <= limit, text)


def _weather(weather: tuple[float, float], freedom: int, level: float) -> CheckOutcome:
    name = FOLLOWS
    share, u = weather
    if not np.isfinite(share):
        return CheckOutcome(name, float("nan"), float("nan"), None, "the weather changed too little, or too few sets")
    one = is_nothing(share - 1.0, u, max(freedom - 1, 1), level=level)
    text = f"lengths followed {share:.2f} ± {u:.2f} of the sensors' changes of index (1 expected)"
    if not one.passed and abs(share) < abs(share - 1.0):
        text += ": as if corrected in the field already, or thermometers not in the air of the path"
    return CheckOutcome(name, one.statistic, one.limit, one.passed, text)


def _instrument(solution: BaselineSolution, agreement: BaselineSolution, level: float) -> tuple[CheckOutcome, ...]:
    """Zero and scale against known pillars, and agreement of the sets.

    Agreement with the maker's claim.
    """
    outcomes = []
    for key, unit, scale in (("zero", "mm", MILLIMETRE), ("scale", "ppm", PPM)):
        value, u = solution.of(key)
        test = is_nothing(value, u, solution.freedom_of(key), level=level)
        text = f"{key} {value / scale:+.3f} ± {u / scale:.3f} {unit} against the known pillars"
        outcomes.append(
            CheckOutcome(f"{key} against the known baseline", test.statistic, test.limit, test.passed, text)
        )
    freedom = agreement.freedom_sets
    if freedom > 0:
        fit = within_claim(agreement.sets_squares / freedom, freedom, level)
        text = f"sets {'agree' if fit.passed else 'do not agree'} with the known pillars as well as is claimed for both"
        outcomes.append(CheckOutcome("agreement with the known baseline", fit.statistic, fit.limit, fit.passed, text))
    return tuple(outcomes)


def _outliers(suspects: tuple[SuspectShot, ...]) -> str:
    worst = suspects[0]
    rows = ", ".join(str(r + 1) for r in worst.rows)
    return f"{len(suspects)} suspect; worst: {worst.kind} of row {rows}, w = {worst.w:+.1f}, p = {worst.p:.2g}"
