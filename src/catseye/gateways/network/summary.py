"""Summary of an adjusted network in sentences: quality, worst observations, undetermined points."""

from typing import TYPE_CHECKING

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.quality.reliability import TOO_LARGE, TOO_SMALL, too_good
from catseye.gateways.network.findings import Findings
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import Verdict

if TYPE_CHECKING:
    from catseye.reduction.network import AdjustedNetwork

NAMED = 5  # most names in a sentence
UNIT = 300.0  # times too large: above the geometric mean of 100 and 1000, mm for m is the likely cause
WEAK = 5.0  # times the median uncertainty: weaker points are named


def quantity(value: float, unit: str) -> str:
    """Small value with three digits in a suitable unit: mm, arc seconds, or as it is.

    >>> quantity(0.000123456, "m"), quantity(1.5e-5, "rad"), quantity(2e-6, "1"), quantity(float("nan"), "m")
    ('0.123 mm', '3.09″', '2e-06', 'unknown')
    """
    if not np.isfinite(value):
        return "unknown"
    if unit == "m":
        return f"{value / MILLIMETRE:.3g} mm"
    return f"{value / ARCSECOND:.3g}″" if unit == "rad" else f"{value:.3g}"


def verdict(findings: Findings) -> Verdict:
    """Verdict on the adjustment, with reasons.

    findings   findings on a solution
    """
    status, overall = findings.solution.status, findings.global_test
    if not findings.answered:
        return Verdict("failed", f"no answer: {status}")
    if status != CONVERGED or findings.network.doubts:
        reasons = [*findings.network.doubts[:NAMED], *([status] if status != CONVERGED else [])]
        return Verdict("doubtful", "; ".join(reasons))
    sides = findings.solution.assumed if findings.network.points.fixed.any() else ()
    if sides:  # the side of a free network is a convention
        text = f"the side on which these points lie is undetermined; a mirror image fits as well: {_listed(sides)}"
        return Verdict("doubtful", f"{text}; give approximate coordinates, or measure a zenith angle or a height")
    if not np.isfinite(overall.p):
        return Verdict("doubtful", "unchecked: no redundancy, so no error would show")
    if overall.outcome == TOO_LARGE:
        more = 100.0 * (np.sqrt(overall.factor) - 1.0)
        text = f"the observations scatter {more:.0f} % more than their uncertainties claim"
        return Verdict("doubtful", f"{text}; {_suspects(findings) or 'no single observation stands out'}")
    if len(findings.suspects):
        text = "the network agrees overall with the claimed uncertainties, single observations do not"
        return Verdict("doubtful", f"{text}; {_suspects(findings)}")
    if too_good(overall.factor * findings.solution.degrees_of_freedom, findings.solution.degrees_of_freedom):
        return Verdict("doubtful", _too_good(findings))
    if overall.outcome == TOO_SMALL:
        less = 100.0 * (1.0 - np.sqrt(overall.factor))
        text = f"better than claimed: the observations scatter {less:.0f} % less than their uncertainties claim"
    else:
        text = "the observations agree with each other as their uncertainties claim"
    unchecked, out = int(np.sum(findings.table.active & ~findings.table.checked)), int(np.sum(~findings.table.active))
    text += f", {out} left out" if out else ""
    return Verdict("good", text + (f", but {unchecked} of them are not checked by others" if unchecked else ""))


def factor_words(factor: float) -> str:
    """Variance factor with three decimals, or three digits if small.

    >>> factor_words(1.01842), factor_words(2.24e-7)
    ('1.018', '2.24e-07')
    """
    return f"{factor:.3f}" if not 0.0 < factor < 0.01 else f"{factor:.3g}"


def _too_good(findings: Findings) -> str:
    """Explanation of a variance factor too small for chance, with the factor of the sigmas."""
    factor = findings.global_test.factor
    times = 1.0 / np.sqrt(factor) if factor > 0.0 else np.inf
    less = 100.0 * (1.0 - np.sqrt(factor))
    text = f"the observations scatter {less:.0f} % less than their uncertainties claim, too little for chance "
    text += f"(variance factor {factor:.3g}): the uncertainties are "
    text += f"about {times:.2g} times too large" if np.isfinite(times) else "not those of these observations"
    if times >= UNIT:
        return f"{text}; most likely their unit: sigmas in mm typed as m, or in the wrong column"
    return f"{text}; most likely their unit, or the claim of another instrument"


def _suspects(findings: Findings) -> str:
    count = len(findings.suspects)
    if not count:
        return ""
    noun = "observation is" if count == 1 else "observations are"
    return f"{count} {noun} suspect, first {observation_words(findings, int(findings.suspects[0]))}"


def observation_words(findings: Findings, row: int) -> str:
    """Observation, residual and test in words.

    findings   findings on a solution
    row        row of its table
    """
    table, unit = findings.table, str(findings.table.unit[row])
    words = f"{findings.label(row)}: residual {quantity(table.residual[row], unit)}"
    if np.isfinite(findings.statistic[row]):
        words += f", {abs(findings.statistic[row]):.2f} of its standard uncertainties"
        words += f", as if it were wrong by {quantity(table.estimated_error[row], unit)}"
    return words


def passages(findings: Findings) -> list[Passage]:
    """Passages on network, points, observations and unchecked parts, after the verdict.

    findings   findings on a solution
    """
    passages = [Passage("The network", _network(findings))]
    if findings.answered:
        passages += [
            Passage("The points", _points(findings)),
            Passage("The fit", _observations(findings)),
            Passage("The checks", _checks(findings)),
        ]
    return passages


def treatment_passages(treated: "AdjustedNetwork", findings: Findings) -> list[Passage]:
    """Passages on rows left out or down-weighted, and on estimated uncertainties.

    treated    treatment of the observations
    findings   findings on the solution
    """
    passages = []
    rejected, undecided = (np.flatnonzero(findings.in_table(part)) for part in (treated.rejected, treated.undecided))
    if treated.treatment != "plain":
        how = (
            "Left out" if treated.treatment == "rejected" else f"Robust weights ({treated.treatment}); weight near zero"
        )
        text = (
            f"{how}: {_listed([findings.label(int(i)) for i in rejected[:NAMED]], len(rejected)) or 'no observation'}."
        )
        if len(undecided):
            names = _listed([findings.label(int(i)) for i in undecided[:NAMED]], len(undecided))
            text += f" In contradiction with others, cause undetermined: {names}."
        passages.append(Passage("Treatment", text))
    if treated.components is not None:
        passages.append(Passage("Variance components", _claims(treated)))
    return passages + ([Passage("Notes", "; ".join(treated.notes) + ".")] if treated.notes else [])


def _claims(treated: "AdjustedNetwork") -> str:
    """Estimated variance components; those of rangers are squares of a constant, m, and of a ratio."""
    components = treated.components
    assert components is not None
    roots, u = components.roots()
    words = []
    for name, variance, root, u_root in zip(components.names, components.values, roots, u, strict=True):
        if "^2 of " not in name:
            words.append(f"{name} {variance:.3g} times the claimed variance")
            continue
        scale, unit = (1e6, "µm") if name.startswith("constant") else (1e6, "ppm")
        spread = f" (u {u_root * scale:.2g})" if np.isfinite(u_root) else ""
        words.append(f"{name.replace('^2 of', ' of').replace('  ', ' ')} {root * scale:.3g} {unit}{spread}")
    return f"Estimated from the observations: {_listed(words)}."


def _network(findings: Findings) -> str:
    solution, table = findings.solution, findings.table
    stations, total = int(findings.stations.sum()), len(findings.names)
    counts = np.bincount(table.kind, minlength=len(table.kinds))
    kinds = ", ".join(f"{k.replace('_', ' ')} {n}" for k, n in zip(table.kinds, counts, strict=True))
    text = f"{total} points, stations among them: {stations}. {len(table)} observations: {kinds or 'none'}."
    out = int(np.sum(~table.active))
    text += f" {out} {'was' if out == 1 else 'were'} left out." if out else ""
    if findings.answered:
        text += f" Datum: {solution.datum}."
    if solution.approximate:
        text += f" Approximate coordinates were computed for {_listed(solution.approximate)}."
    if solution.assumed:
        text += f" The side of these is undetermined and was assumed: {_listed(solution.assumed)}."
    if solution.replaced:
        named = _listed(solution.replaced)
        text += f" Given coordinates in gross contradiction to the observations were not used as a start: {named}."
    text += "".join(f" {note[0].upper()}{note[1:]}." for note in findings.network.notes)
    lonely = [findings.names[i] for i in np.flatnonzero(findings.observation_counts == 0)]
    return text + (f" Not observed at all: {_listed(lonely)}." if lonely else "")


def _points(findings: Findings) -> str:
    axis = findings.ellipsoid.semi_axes[:, 0]
    positive = np.flatnonzero(np.isfinite(axis) & (axis > 0.0))
    if not len(positive):
        return "All points are held."
    usual, worst = float(np.median(axis[positive])), int(positive[np.argmax(axis[positive])])
    text = (
        f"Along the longest axis of its ellipsoid the median point has u {quantity(usual, 'm')} (1σ), the worst, "
        f"{findings.names[worst]}, to {quantity(axis[worst], 'm')}, {direction_words(findings, worst)}."
    )
    weak = positive[axis[positive] > WEAK * usual]
    weak = weak[np.argsort(-axis[weak], kind="stable")]
    if len(weak) > 1:
        named = _listed([findings.names[i] for i in weak])
        text += f" {len(weak)} points are over {WEAK:g} times worse than the median: {named}."
    for r in findings.relative:
        text += (
            f" {r.first} - {r.second}: {r.distance:.5f} m, u {quantity(r.u_distance, 'm')}; its relative ellipsoid has "
            f"the semi-axes {', '.join(quantity(float(v), 'm') for v in r.ellipsoid.semi_axes)}."
        )
    return text + (
        " The variance factor is applied."
        if findings.scaled
        else " These rest on the claimed uncertainties of the observations."
    )


def direction_words(findings: Findings, point: int) -> str:
    """Longest axis of a point's ellipsoid, in words.

    findings   findings on a solution
    point      row of the point
    """
    east, north, up = findings.network.axes @ findings.ellipsoid.directions[point, :, 0]
    steep = np.arcsin(min(abs(up), 1.0)) / DEGREE
    if steep > 60.0:
        return "mostly in height"
    azimuth = np.arctan2(east, north) / DEGREE % 180.0
    tilt = f", tilted {steep:.0f}°" if steep > 20.0 else ""
    return f"towards azimuth {azimuth:.0f}° and back{tilt}"


def _observations(findings: Findings) -> str:
    overall, table = findings.global_test, findings.table
    if not np.isfinite(overall.p):
        return "No redundancy to test them."
    text = (
        f"Variance factor {factor_words(overall.factor)} with {findings.solution.degrees_of_freedom:.0f} degrees of "
        f"freedom; expected between {overall.lower:.3f} and {overall.upper:.3f} (level {findings.level:g}): "
        f"{overall.outcome}."
    )
    text += f" {_suspects(findings)}." if len(findings.suspects) else ""
    if np.isfinite(table.standardised).any() and not len(findings.suspects):
        took_part = table.worst_first[table.active[table.worst_first]]
        text += f" No observation is suspect; the worst is {observation_words(findings, int(took_part[0]))}."
    return text


def _checks(findings: Findings) -> str:
    table = findings.table
    active = int(table.active.sum())
    unchecked = np.flatnonzero(table.active & ~table.checked)
    text = f"All {active} observations are checked by others." if not len(unchecked) else ""
    if len(unchecked):
        names = _listed([findings.label(int(i)) for i in unchecked[:NAMED]], len(unchecked))
        text = f"{len(unchecked)} of {active} observations are not checked by others, and an error would not show: "
        text += f"{names}."
    mdb = [
        f"{quantity(float(np.median(table.mdb[checked])), str(table.unit[np.argmax(checked)]))} of a "
        f"{kind.replace('_', ' ')}"
        for k, kind in enumerate(table.kinds)
        if (checked := (table.kind == k) & table.checked).any()
    ]
    if mdb:
        text += f" The smallest error that the test (0.1 %, power 80 %) usually finds: {', '.join(mdb)}."
    return text


def _listed(names: list[str] | tuple[str, ...], total: int | None = None) -> str:
    count = len(names) if total is None else total
    text = ", ".join(names[:NAMED])
    return text + (f" and {count - NAMED} more" if count > NAMED else "")
