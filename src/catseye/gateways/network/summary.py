"""Summary of an adjusted network in sentences: quality, worst observations, undetermined points."""

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.gateways.writers.passage import Passage
from catseye.names import counted
from catseye.reduction.network.adjusted import AdjustedNetwork, observation_words, suspects_words
from catseye.reduction.network.treatment import Treatment
from catseye.reduction.network.words import NAMED, listed, quantity

FEW = 40  # points that a terminal lists one by one
MOST_PARAMETERS = 12  # in a sentence
SMALL_RATIO = 1e-3  # below it a ratio is said in ppm
WEAK = 5.0  # times the median uncertainty: weaker points are named


def factor_words(factor: float) -> str:
    """Variance factor with three decimals, or three digits if small.

    >>> factor_words(1.01842), factor_words(2.24e-7)
    ('1.018', '2.24e-07')
    """
    return f"{factor:.3f}" if not 0.0 < factor < 0.01 else f"{factor:.3g}"


def passages(adjusted: AdjustedNetwork) -> list[Passage]:
    """Passages on network, points, observations and unchecked parts, after the verdict.

    adjusted   network
    """
    passages = [Passage("The network", _network(adjusted))]
    if adjusted.answered:
        passages += [
            Passage("The points", _points(adjusted)),
            *_velocity(adjusted),
            *_parameters(adjusted),
            Passage("The fit", _observations(adjusted)),
            Passage("The checks", _checks(adjusted)),
        ]
    return passages


def point_rows(adjusted: AdjustedNetwork) -> list[str]:
    """Coordinates of a small network, a line a point; none for a large one.

    adjusted   network
    """
    if len(adjusted.names) > FEW:
        return []
    axes = adjusted.network.axis_names
    return [
        f"{'':<14}{name:<10} "
        + "  ".join(f"{axis} {v:12.5f}" if known else f"{'':14}" for axis, v, known in zip(axes, x, has, strict=True))
        + f"   u {', '.join(f'{v * 1e3:.3f}' for v in u[has])} mm"
        for name, x, u, has in zip(adjusted.names, adjusted.x, adjusted.u, adjusted.coordinates, strict=True)
    ]


def _velocity(adjusted: AdjustedNetwork) -> list[Passage]:
    """Passage on the first velocity corrections; none without them."""
    velocity = adjusted.table.velocity[np.isfinite(adjusted.table.velocity)] / MILLIMETRE
    if not len(velocity):
        return []
    text = f"First velocity correction of {counted(len(velocity), 'distance')}: "
    low, high = float(velocity.min()), float(velocity.max())
    text += f"{low:+.3f} mm" if len(velocity) == 1 else f"{low:+.3f} to {high:+.3f} mm"
    return [Passage("The air", f"{text}; of each in observations.csv.")]


def _parameters(adjusted: AdjustedNetwork) -> list[Passage]:
    """Passage on estimated zeros, scales and air; none without them. Orientations are of no interest by themselves."""
    solution = adjusted.solution
    words = []
    for p, value, u in zip(adjusted.network.parameters, solution.parameters, adjusted.u_parameters, strict=True):
        if p.sigma == 0.0 or p.unit == "rad":
            continue
        small = max(abs(value), u) < SMALL_RATIO
        size, unit = (1.0 / MILLIMETRE, " mm") if p.unit == "m" else (1e6, " ppm") if small else (1.0, "")
        words.append(f"{p.name} {value * size:+.4g}{unit} (u {u * size:.2g})")
    count = len(words)
    if count > MOST_PARAMETERS:
        words = [*words[:MOST_PARAMETERS], f"and {count - MOST_PARAMETERS} more"]
    return [Passage("Parameters", f"Estimated: {', '.join(words)}.")] if words else []


def treatment_passages(adjusted: AdjustedNetwork) -> list[Passage]:
    """Passages on rows left out or down-weighted, and on estimated uncertainties; none without a treatment.

    adjusted   network
    """
    passages: list[Passage] = []
    treatment = adjusted.treatment
    if treatment is None:
        return passages
    rejected, undecided = (
        np.flatnonzero(adjusted.in_table(part)) for part in (treatment.rejected, treatment.undecided)
    )
    if treatment.method != "plain":
        how = "Left out" if treatment.method == "rejected" else f"Robust weights ({treatment.method}); weight near zero"
        text = (
            f"{how}: {listed([adjusted.label(int(i)) for i in rejected[:NAMED]], len(rejected)) or 'no observation'}."
        )
        if len(undecided):
            names = listed([adjusted.label(int(i)) for i in undecided[:NAMED]], len(undecided))
            text += f" In contradiction with others, cause undetermined: {names}."
        passages.append(Passage("Treatment", text))
    if treatment.components is not None:
        passages.append(Passage("Variance components", _claims(treatment)))
    return passages + ([Passage("Notes", "; ".join(treatment.notes) + ".")] if treatment.notes else [])


def _claims(treatment: Treatment) -> str:
    """Estimated variance components; those of rangers are squares of a constant, m, and of a ratio."""
    components = treatment.components
    assert components is not None
    roots, u = components.roots()
    words = []
    columns = zip(components.names, components.values, roots, u, strict=True)
    for k, (name, variance, root, u_root) in enumerate(columns):
        if treatment.components_by == "groups":
            words.append(f"{name} {variance:.3g} times the claimed variance")
            continue
        scale, unit = 1e6, ("µm", "ppm")[k % 2]  # a constant and a scale of each ranger
        spread = f" (u {u_root * scale:.2g})" if np.isfinite(u_root) else ""
        words.append(f"{name.replace('^2 of', ' of')} {root * scale:.3g} {unit}{spread}")
    return f"Estimated from the observations: {listed(words)}."


def _network(adjusted: AdjustedNetwork) -> str:
    solution, table = adjusted.solution, adjusted.table
    stations, total = int(adjusted.stations.sum()), len(adjusted.names)
    counts = np.bincount(table.kind, minlength=len(table.kinds))
    kinds = ", ".join(f"{k.replace('_', ' ')} {n}" for k, n in zip(table.kinds, counts, strict=True))
    text = f"{total} points, stations among them: {stations}. {len(table)} observations: {kinds or 'none'}."
    out = int(np.sum(~table.active))
    text += f" {out} {'was' if out == 1 else 'were'} left out." if out else ""
    if adjusted.answered:
        text += f" Datum: {solution.datum}."
    if solution.approximate:
        text += f" Approximate coordinates were computed for {listed(solution.approximate)}."
    if solution.assumed:
        text += f" The side of these is undetermined and was assumed: {listed(solution.assumed)}."
    if solution.replaced:
        named = listed(solution.replaced)
        text += f" Given coordinates in gross contradiction to the observations were not used as a start: {named}."
    text += "".join(f" {note[0].upper()}{note[1:]}." for note in adjusted.network.notes)
    lonely = [adjusted.names[i] for i in np.flatnonzero(adjusted.observation_counts == 0)]
    return text + (f" Not observed at all: {listed(lonely)}." if lonely else "")


def _points(adjusted: AdjustedNetwork) -> str:
    axis = adjusted.ellipsoid.semi_axes[:, 0]
    positive = np.flatnonzero(np.isfinite(axis) & (axis > 0.0))
    if not len(positive):
        return "All points are held."
    usual, worst = float(np.median(axis[positive])), int(positive[np.argmax(axis[positive])])
    text = (
        f"Along the longest axis of its ellipsoid the median point has u {quantity(usual, 'm')} (1σ), the worst, "
        f"{adjusted.names[worst]}, to {quantity(axis[worst], 'm')}, {direction_words(adjusted, worst)}."
    )
    weak = positive[axis[positive] > WEAK * usual]
    weak = weak[np.argsort(-axis[weak], kind="stable")]
    if len(weak) > 1:
        named = listed([adjusted.names[i] for i in weak])
        text += f" {len(weak)} points are over {WEAK:g} times worse than the median: {named}."
    for r in adjusted.relative:
        text += (
            f" {r.first} - {r.second}: {r.distance:.5f} m, u {quantity(r.u_distance, 'm')}; its relative ellipsoid has "
            f"the semi-axes {', '.join(quantity(float(v), 'm') for v in r.ellipsoid.semi_axes)}."
        )
    return text + (
        " The variance factor is applied."
        if adjusted.scaled
        else " These rest on the claimed uncertainties of the observations."
    )


def direction_words(adjusted: AdjustedNetwork, point: int) -> str:
    """Longest axis of a point's ellipsoid, in words.

    adjusted   network
    point      row of the point
    """
    east, north, up = adjusted.network.axes @ adjusted.ellipsoid.directions[point, :, 0]
    steep = np.arcsin(min(abs(up), 1.0)) / DEGREE
    if steep > 60.0:
        return "mostly in height"
    azimuth = np.arctan2(east, north) / DEGREE % 180.0
    tilt = f", tilted {steep:.0f}°" if steep > 20.0 else ""
    return f"towards azimuth {azimuth:.0f}° and back{tilt}"


def _observations(adjusted: AdjustedNetwork) -> str:
    overall, table = adjusted.global_test, adjusted.table
    if not np.isfinite(overall.p):
        return "No redundancy to test them."
    text = (
        f"Variance factor {factor_words(overall.factor)} with {adjusted.solution.degrees_of_freedom:.0f} degrees of "
        f"freedom; expected between {overall.lower:.3f} and {overall.upper:.3f} (level {adjusted.level:g}): "
        f"{overall.outcome}."
    )
    text += f" {suspects_words(adjusted)}." if len(adjusted.suspects) else ""
    if np.isfinite(table.standardised).any() and not len(adjusted.suspects):
        took_part = table.worst_first[table.active[table.worst_first]]
        text += f" No observation is suspect; the worst is {observation_words(adjusted, int(took_part[0]))}."
    return text


def _checks(adjusted: AdjustedNetwork) -> str:
    table = adjusted.table
    active = int(table.active.sum())
    unchecked = np.flatnonzero(table.active & ~table.checked)
    text = f"All {active} observations are checked by others." if not len(unchecked) else ""
    if len(unchecked):
        names = listed([adjusted.label(int(i)) for i in unchecked[:NAMED]], len(unchecked))
        text = f"{len(unchecked)} of {active} observations are not checked by others, and an error would not show: "
        text += f"{names}."
    mdb = [
        f"{quantity(float(np.median(table.mdb[checked])), str(table.unit[np.argmax(checked)]))} of a "
        f"{'coordinate' if kind == 'coordinates' else kind.replace('_', ' ')}"
        for k, kind in enumerate(table.kinds)
        if (checked := (table.kind == k) & table.checked).any()
    ]
    if mdb:
        text += f" The smallest error that the test ({adjusted.detectability.words}) usually finds: {', '.join(mdb)}."
    return text
