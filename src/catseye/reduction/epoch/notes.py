"""Notes of an adjustment on records and shots, one line each."""

from collections import Counter
from collections.abc import Collection, Mapping

import numpy as np
from scipy.stats import binom

from catseye.constants import MILLIMETRE
from catseye.estimation.least_squares.adjustment import (
    LeastSquaresSolution,
)
from catseye.records.site.folder import SiteFolder
from catseye.reduction.epoch.allowance import DOUBTED_C
from catseye.reduction.epoch.contradictions.contradiction import Contradiction, RecordGroup
from catseye.reduction.epoch.lines.cycles import MANY
from catseye.reduction.epoch.lines.independence import Independence
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.prior_names import SOUND
from catseye.reduction.epoch.range_shots import RangeShots
from catseye.reduction.epoch.unknowns import WEAK, CampaignNetwork
from catseye.reduction.site.agreement import distance_disagreement, station_series, weather_disagreements

BY_CHANCE = 0.01  # expected points of a night whose shots are lost by chance, below which a point is doubted


def cycle_notes(ranges: RangeShots) -> list[str]:
    """Points with uncertain whole cycles of used shots."""
    thin = {}
    for name, rows in _by_target(ranges):
        used = ranges.used[rows]
        doubtful = int((used & ranges.thin[rows]).sum())
        if doubtful:
            thin[name] = (
                f"{name}: the whole cycles of {doubtful} of its {used.sum()} shots are uncertain: without "
                "each, position and other shots do not predict its range to a quarter wavelength at five sigma"
            )
    what = "points have shots with uncertain whole cycles, not predicted otherwise to a quarter wavelength at 5 sigma"
    return _summarized(thin, what)


def _by_target(ranges: RangeShots) -> list[tuple[str, np.ndarray]]:
    """Each target with its rows, sorted by name."""
    names, number = np.unique(np.array(ranges.target), return_inverse=True)
    rows = np.split(np.argsort(number, kind="stable"), np.cumsum(np.bincount(number))[:-1])
    return list(zip(names.tolist(), rows, strict=True))


def _summarized(notes: Mapping[str, str], what: str) -> list[str]:
    """One note per point; a single line for many points."""
    if len(notes) <= MANY:
        return list(notes.values())
    return [f"{len(notes)} {what}: {', '.join(list(notes)[:MANY])} ..."]


def loss_notes(ranges: RangeShots, independence: Independence, critical: float) -> list[str]:
    """Targets without used or checked shots; rangers that lost most shots.

    critical   |w| above which a shot does not fit; others were left out because nothing decides between them
    """
    unmeasured, unchecked = {}, {}
    for name, mine in _by_target(ranges):
        used = ranges.used[mine]
        if not used.any():
            unmeasured[name] = (
                f"{name}: none of its {len(mine)} shots fits the others and its typed position: it is not among the "
                "results; check its typed position or give its uncertainty (u_position_mm)"
                if name in independence.unmeasured
                else f"{name}: none of its {len(mine)} shots fits: its coordinates follow from what else is known of it"
            )
        elif not used.all() and name not in independence.doubtful and independence.by_lines(name):
            lines = independence.lines[name]
            unchecked[name] = (
                f"{name}: {(~used).sum()} of its {len(mine)} shots are left out as they contradict others, and nothing "
                f"checks the {lines} {'line' if lines == 1 else 'lines'} left: its error may exceed its uncertainty; "
                "range it again"
            )
    notes = [
        *_summarized(
            unmeasured, "points have no shot that fits the others and their typed positions: not measured here"
        ),
        *_summarized(
            unchecked,
            "points lost shots that contradict others, and the lines left do not check each other: their errors may "
            "exceed their uncertainties; range them again",
        ),
    ]
    misfits = Counter(n for n, w in zip(ranges.ranger, ranges.standardised, strict=True) if abs(w) > critical)
    notes += [
        f"{name}: {rejected} of its {fired} shots do not fit: more likely its survey, mirror sheet or samples than a "
        "stray reflection"
        if 2 * misfits[name] > fired
        else f"{name}: {rejected} of its {fired} shots are left out, most as two contradict each other and nothing "
        "decides which is wrong: range its targets again"
        for name, (rejected, fired) in ranges.ill_fitting.items()
    ]
    return notes


def loss_doubts(ranges: RangeShots, independence: Independence, units: Mapping[str, str], critical: float) -> list[str]:
    """Targets that lost more shots than stray reflections explain, and whose lines left do not check each other.

    units      target of a triplet: the triplet, which is one target here
    critical   |w| above which a shot does not fit; others were left out because nothing decides between them

    Strays hit each shot with the share that the other targets' shots were lost with, those of rangers most of whose
    shots do not fit aside. What is left of such a target may agree with a wrong typed position alone.
    """
    judged = ~np.isin(ranges.ranger, list(ranges.ill_fitting))
    misfits = ~ranges.used & (np.abs(ranges.standardised) > critical)
    lost, fired = int((judged & misfits).sum()), int(judged.sum())
    targets: dict[str, list[np.ndarray]] = {}
    unchecked = set()
    for name, rows in _by_target(ranges):
        unit = units.get(name, name)
        targets.setdefault(unit, []).append(rows[judged[rows]])
        if independence.by_lines(name):
            unchecked.add(unit)
    doubts = []
    for name in sorted(unchecked):
        mine = np.concatenate(targets[name])
        own = int(misfits[mine].sum())
        share = (lost - own + 1) / (fired - len(mine) + 2)
        chance = len(targets) * float(binom.sf(own - 1, len(mine), share))
        if 0 < own < len(mine) and chance < BY_CHANCE:
            doubts.append(
                f"{name}: {own} of its {len(mine)} shots contradict the rest, more than stray reflections explain, and "
                "nothing checks the lines left: check its typed position, range it again"
            )
    return doubts


def wrong_records(network: CampaignNetwork) -> list[str]:
    """Records contradicted by the ranges or by each other."""
    return [
        *disagreements(network),
        *(contradiction_text(c, network.campaign) for c in network.allowance.contradictions),
    ]


def contradiction_text(contradiction: Contradiction, site: SiteFolder) -> str:
    """A contradiction as a note; of a thermometer, a zero and a head with what an operator asks of them."""
    first, *others = contradiction.explanations
    if first.group is RecordGroup.HEADS:
        text = f"{first.record}: not the mirror sheet's, the ranges contradict it: check the sheet's value and u; "
        return text + "; or ".join(e.text for e in (first, *others))
    named = contradiction.named
    if named is None or not named.of or named.group not in (RecordGroup.THERMOMETERS, RecordGroup.ZEROS):
        return contradiction.text
    (error,), (u,) = named.errors, named.u
    if named.group is RecordGroup.THERMOMETERS:
        return f"{named.of}'s thermometer is biased by {error:+.2f} °C (u {u:.2f} °C)"
    mirror = site.mirror_of(named.of)
    return (
        f"{named.of}'s zero is not the sheet's: its ranges imply {-error:+.3f} mm, {abs(error) / mirror.u_d0_mm:.0f} "
        f"u_d0: see d0_mm of {mirror.zp}"
    )


def disagreements(network: CampaignNetwork) -> list[str]:
    """Stations or distances that contradict each other."""
    conflicts = list(weather_disagreements(station_series(network.campaign)))
    for mark in network.campaign.benchmarks:
        ends = [network.places[name] for name in (mark.ranger, mark.target) if name in network.places]
        if len(ends) == 2:
            u = np.repeat([end.u_typed(network.settings.u_position) for end in ends], 3)
            apart = distance_disagreement(
                (mark.ranger, mark.target),
                mark.certified_distance_mm * MILLIMETRE,
                mark.u_mm * MILLIMETRE,
                ends=np.array([end.start for end in ends]),
                covariance=np.diag(u**2),
            )
            conflicts += [] if apart is None else [apart]
    return [conflict.text for conflict in conflicts]


def record_notes(
    network: CampaignNetwork,
    solution: LeastSquaresSolution,
    contradicted: list[str],
    count: dict[str, int],
    independence: Independence,
) -> list[str]:
    """Notes on the records, one line each.

    contradicted   result of `wrong_records`
    count          used shots at each point
    independence   of the lines at each point: those that check nothing may be wrong as well as a typed position
    """
    notes = list(contradicted)
    notes += network.allowance.texts
    left_out = max((states.neglected for states in network.states.values()), default=0.0)
    if left_out > WEAK:
        notes.append(
            f"with so many shots, weak modes of the electronics count as the shots' own errors, the strongest with "
            f"{100.0 * left_out:.0f} % of their variance, which shots between the same two references share"
        )
    typed = [
        n for n, p in sorted(network.places.items()) if p.typed and count.get(n, 0) >= 3
    ]  # fewer do not place a point
    moved = np.array([np.linalg.norm(solution.x[network.layout.columns(n)] - network.places[n].start) for n in typed])
    unit = network.campaign.triplet_of
    usual = float(np.median(moved)) / 1.538 if len(moved) > 5 else np.inf  # median of chi with 3 degrees of freedom
    far = {
        unit.get(n, n): (d / MILLIMETRE, independence.by_lines(n))
        for n, d in zip(typed, moved, strict=True)
        if d > 4.0 * max(usual, network.places[n].u_start or 0.0)
    }
    others = np.median(moved) / MILLIMETRE if far else 0.0
    notes += [
        f"{n}: {d:.0f} mm from its typed position, the others some {others:.0f}, by lines that do not check each "
        "other: either may be wrong"
        if unchecked
        else f"{n}: its typed position is {d:.0f} mm off, the others' some {others:.0f}"
        for n, (d, unchecked) in far.items()
    ]
    return notes


def doubts_of(
    network: CampaignNetwork, solution: LeastSquaresSolution, wrong: list[str], refuted: Collection[Parameter]
) -> tuple[str, ...]:
    """Reasons against a good verdict.

    Wrong records, allowances, thermometers at the end of their priors.

    wrong     result of `wrong_records`
    refuted   parameters whose priors were left out, which `wrong` names
    """
    resting = network.motion is None  # while it runs, an unusual gradient is an alarm: somebody can look
    doubts = [*wrong, *(network.allowance.doubts if resting else network.allowance.texts)]
    air = network.field
    sigmas = network.allowance.sigmas(air)
    named = {*refuted, *(reason.subject for reason in network.allowance.reasons)}
    # where one is one of several explanations, the others follow it
    if any(key.group is RecordGroup.THERMOMETERS for key in network.allowance.errors):
        named |= {Parameter(ParameterKind.THERMOMETER, station) for station in air.stations}
    for station, column, sigma in zip(air.stations, network.layout.air, sigmas, strict=False):
        value = float(solution.x[column])
        if abs(value) > DOUBTED_C * sigma and Parameter(ParameterKind.THERMOMETER, station) not in named:
            doubts.append(f"{station}'s thermometer is biased by {value:+.2f} °C, {abs(value) / sigma:.1f} of its u")
    return tuple(doubts)


def sound_notes(
    network: CampaignNetwork, solution: LeastSquaresSolution, ranges: RangeShots, sound: dict[str, tuple[float, float]]
) -> list[str]:
    """Effect of each sounded line, and the ranges' test of it."""
    w = next((f.standardised for f in solution.fits if f.name == SOUND), np.zeros(0))
    mjd = network.campaign.shots.mjd_utc[ranges.shot]
    pairs = [frozenset(pair) for pair in zip(ranges.ranger, ranges.target, strict=True)]
    return [
        line.note(mjd[[pair == line.ends for pair in pairs]], sound[line.name], w_line, network.settings.critical)
        for line, w_line in zip(network.field.lines, w, strict=True)
    ]
