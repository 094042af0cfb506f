"""Notes of an adjustment on records and shots, one line each."""

from collections.abc import Collection, Mapping

import numpy as np

from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import MILLIMETRE
from catseye.estimation.least_squares.adjustment import (
    LeastSquaresSolution,
)
from catseye.estimation.least_squares.robust import CHECKED
from catseye.reduction.epoch.allowance import DOUBTED_C
from catseye.reduction.epoch.cycles import MANY
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.range_shots import RangeShots
from catseye.reduction.epoch.unknowns import (
    HEADS,
    SOUND,
    THERMOMETERS,
    WEAK,
    ZEROS,
    CampaignNetwork,
)
from catseye.reduction.site.agreement import StationSeries, distance_disagreement, weather_disagreements


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


def loss_notes(ranges: RangeShots) -> list[str]:
    """Targets without used or checked shots; rangers that lost most shots."""
    unmeasured, unchecked = {}, {}
    for name, mine in _by_target(ranges):
        used = ranges.used[mine]
        alone = used & (ranges.detectable[mine] >= CHECKED * ranges.u_range[mine])
        if not used.any():
            unmeasured[name] = (
                f"{name}: none of its {len(mine)} shots fits the others and its typed position: its coordinates here "
                "are not measured; check its typed position or give its uncertainty (u_position_mm)"
            )
        elif not used.all() and alone.any():
            unchecked[name] = (
                f"{name}: {(~used).sum()} of its {len(mine)} shots contradict the rest and nothing checks "
                f"{alone.sum()} of those left: its error may exceed its uncertainty; range it again"
            )
    notes = [
        *_summarized(
            unmeasured, "points have no shot that fits the others and their typed positions: not measured here"
        ),
        *_summarized(
            unchecked,
            "points lost shots that contradict the rest, and nothing checks those left: their errors may "
            "exceed their uncertainties; range them again",
        ),
    ]
    ranger = np.array(ranges.ranger)
    for name in sorted(set(ranges.ranger)):
        mine = ranger == name
        if mine.sum() > 2 and (mine & ~ranges.used).sum() > mine.sum() / 2:
            notes.append(
                f"{name}: {(mine & ~ranges.used).sum()} of its {mine.sum()} shots do not fit: more likely its survey, "
                "mirror sheet or samples than a stray reflection"
            )
    return notes


def wrong_records(
    network: CampaignNetwork, solution: LeastSquaresSolution, air: dict[str, tuple[float, float]]
) -> list[str]:
    """Records contradicted by the ranges or by each other.

    Thermometers, zeros, effects of heads, weather stations.

    air   estimate and standard uncertainty of each thermometer's offset, °C
    """
    notes = disagreements(network)
    for group, fit in zip(network.priors, solution.fits[-len(network.priors) :], strict=True):
        if fit.name in (THERMOMETERS, ZEROS):  # not of all, where earlier epochs determined some
            owners = [network.layout.parameters[c].of for c in np.ravel(group.columns).tolist()]
        if fit.name == THERMOMETERS:
            for station, active in zip(owners, fit.active, strict=True):
                value, u = air[station]
                if not active:
                    notes.append(f"{station}'s thermometer is biased by {value:+.2f} °C (u {u:.2f} °C)")
        if fit.name == ZEROS:
            for ranger, active, off, u in zip(owners, fit.active, fit.residual, fit.sigma, strict=True):
                if not active:
                    notes.append(
                        f"{ranger}'s zero is not the sheet's: its ranges imply {-off / MILLIMETRE:+.3f} mm, "
                        f"{abs(off) / u:.0f} u_d0: see d0_mm of {network.campaign.mirror_of(ranger).zp}"
                    )
        if fit.name == HEADS and np.any(np.abs(fit.standardised) > network.settings.critical):
            worst = int(np.argmax(np.abs(fit.standardised)))
            called = network.layout.parameters[int(np.ravel(group.columns)[worst])]
            notes.append(
                f"{called}: not the mirror sheet's, the ranges contradict it (w {fit.standardised[worst]:.1f}, limit "
                f"{network.settings.critical}); check the sheet's value and u"
            )
    return notes


def disagreements(network: CampaignNetwork) -> list[str]:
    """Records that cannot be right.

    Humidity typed as a fraction, stations or distances that contradict each other.
    """
    weather = network.campaign.weather
    names, series = np.array(weather.station), []
    for station in network.campaign.site.weather_station:
        rows = names == station.name
        series.append(
            StationSeries(
                name=station.name,
                elevation_m=station.elevation_m,
                mjd=weather.mjd_utc[rows],
                temperature_c=weather.temperature_c[rows],
                pressure_hpa=weather.pressure_hpa[rows],
                humidity_percent=weather.humidity_percent[rows],
            )
        )
    conflicts = list(weather_disagreements([s for s in series if len(s.mjd)]))
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
    fractions = [f"weather.csv: {s.name}: {text}" for s in series for text in humidity_doubts(s.humidity_percent)]
    return [*fractions, *(conflict.text for conflict in conflicts)]


def record_notes(
    network: CampaignNetwork, solution: LeastSquaresSolution, contradicted: list[str], count: dict[str, int]
) -> list[str]:
    """Notes on the records, one line each.

    contradicted   result of `wrong_records`
    count          used shots at each point
    """
    notes = list(contradicted)
    notes += network.allowance.texts
    left_out = max((states.neglected for states in network.states.values()), default=0.0)
    if left_out > WEAK:
        notes.append(
            f"with so many shots, weak modes of the electronics count as the shots' own errors, the strongest with "
            f"{100.0 * left_out:.0f} % of their variance, which shots between the same two references share"
        )
    typed = [n for n, p in sorted(network.places.items()) if p.typed and count[n] >= 3]  # fewer do not place a point
    moved = np.array([np.linalg.norm(solution.x[network.layout.columns(n)] - network.places[n].start) for n in typed])
    unit = {t: triplet.triplet for triplet in network.campaign.triplets.values() for t in triplet.targets}
    usual = float(np.median(moved)) / 1.538 if len(moved) > 5 else np.inf  # median of chi with 3 degrees of freedom
    wrong = {
        unit.get(n, n): d
        for n, d in zip(typed, moved, strict=True)
        if d > 4.0 * max(usual, network.places[n].u_start or 0.0)
    }
    notes += [
        f"{n}: its typed position is {d / MILLIMETRE:.0f} mm off, the others' some {np.median(moved) / MILLIMETRE:.0f}"
        for n, d in wrong.items()
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
    doubts = [*wrong, *network.allowance.texts]
    air = network.field
    sigmas = network.allowance.sigmas(air)
    named = {*refuted, *(reason.subject for reason in network.allowance.reasons)}
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
