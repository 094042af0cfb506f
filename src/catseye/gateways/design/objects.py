"""Design study as sentences and as JSON."""

from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.design.words import direction_of, quantity_of
from catseye.gateways.writers.objects import plain
from catseye.gateways.writers.passage import Passage
from catseye.reduction.design.study import DesignState, DesignStudy, ScatterCheck
from catseye.reduction.network.words import listed, quantity

FORMAT = "catseye-design-study-1"
NAMED = 4  # moves said


def design_passages(study: DesignStudy) -> list[Passage]:
    """Sentences on design, worst axis, moves, numbers, scatter, maps and search."""
    before, after, aim = study.before, study.after, study.aim
    posture = f", in the worst of {len(after.values)} postures" if len(after.values) > 1 else ""
    text = (
        f"The {quantity_of(aim)} of {len(aim.interest)} points falls from {quantity(before.u, 'm')} to "
        f"{quantity(after.u, 'm')}, by {100 * study.gain:.1f} %{posture}; "
        f"{len(after.scene.rangers)} rangers, {after.ranges} ranges."
    )
    passages = [Passage("The design", text)]
    if aim.name == "gain" and aim.frequency is not None:
        losses = [100.0 * aim.loss(state.u**2) for state in (before, after)]
        passages.append(
            Passage(
                "The gain",
                f"errors of the measurement that are set into the surface cost {losses[0]:.3g} % of the gain at "
                f"{aim.frequency / 1e9:g} GHz before, {losses[1]:.3g} % after (Ruze).",
            )
        )
    passages.append(Passage("The worst axis", f"{_worst(before)}; then {_worst(after)}."))
    if after.pose_u is not None:
        passages.append(Passage("The pose", f"{_pose(before)} before, {_pose(after)} after."))
    passages.append(Passage("The moves", _moves(study)))
    if study.numbers:
        rows = "; ".join(f"{n.number}: {quantity(n.u, 'm')}" for n in study.numbers)
        passages.append(Passage("The numbers", f"{rows}."))
    if study.scatter is not None:
        passages.append(Passage("The scatter", _scatter(*study.scatter)))
    passages += _map_passages(study)
    path = study.path
    passages.append(
        Passage(
            "The search",
            f"{path.evaluations} evaluations of the criterion with its exact derivative in {study.seconds:.1f} s, "
            f"{len(path.starts)} stages of descent and exchange.",
        )
    )
    return passages


def _worst(state: DesignState) -> str:
    name, axis = state.worst
    return f"{name}, {quantity(float(state.longest[0].max()), 'm')} {direction_of(axis)}"


def _pose(state: DesignState) -> str:
    assert state.pose_u is not None
    shift, turn = state.pose_u[:3] / MILLIMETRE, state.pose_u[3:] / ARCSECOND
    return f"{shift[0]:.3g}, {shift[1]:.3g}, {shift[2]:.3g} mm and {turn[0]:.2g}, {turn[1]:.2g}, {turn[2]:.2g}″"


def _moves(study: DesignStudy) -> str:
    moved = [move for move in study.moves if np.isfinite(move.distance)]
    new = [move.unit for move in study.moves if not np.isfinite(move.before[0])]
    less = [move.unit for move in study.moves if not np.isfinite(move.after[0])]
    first = ", ".join(f"{m.unit} {m.distance:.1f} m" for m in moved[:NAMED])
    parts = [f"{len(moved)} moved, farthest {first}" if moved else "none moved"]
    parts += [f"new: {listed(new)}"] if new else []
    parts += [f"left out: {listed(less)}"] if less else []
    return "; ".join(parts) + "."


def _scatter(before: ScatterCheck, after: ScatterCheck) -> str:
    fall = 1.0 - after.u / before.u
    u_fall = (after.u / before.u) * float(np.hypot(after.u_u / after.u, before.u_u / before.u))
    return (
        f"{before.runs} simulated measurements give {_measured(before)} before and {_measured(after)} after: "
        f"a fall of {100 * fall:.1f} ± {100 * u_fall:.1f} %."
    )


def _measured(check: ScatterCheck) -> str:
    u, u_u, predicted = (value / MILLIMETRE for value in (check.u, check.u_u, check.predicted))
    return f"{u:.4f} ± {u_u:.4f} mm (predicted {predicted:.4f})"


def _map_passages(study: DesignStudy) -> list[Passage]:
    """Best place of one more ranger, and of the one that varies."""
    passages = []
    for item in study.maps:
        if not np.isfinite(item.u).any():
            continue
        row, column = np.unravel_index(np.nanargmin(item.u), item.u.shape)
        at = f"x {item.x[column]:.0f} m, y {item.y[row]:.0f} m"
        best = quantity(float(item.u[row, column]), "m")
        if item.ranger:
            worst = quantity(float(np.nanmax(item.u)), "m")
            text = (
                f"with the others as designed, {item.ranger} would give {best} at {at}, and {worst} at the worst place."
            )
        else:
            text = f"one more ranger on the ground would give {best} at {at}."
        passages.append(Passage(f"The map of {item.ranger}" if item.ranger else "The map", text))
    return passages


def design_object(study: DesignStudy) -> dict[str, Any]:
    """JSON object of `catseye design --json`; metres."""
    aim = study.aim
    answer: dict[str, Any] = {
        "format": FORMAT,
        "verdict": study.verdict.to_object(),
        "name": study.after.scene.name,
        "criterion": aim.name,
        "frequency_hz": aim.frequency,
        "vary": [variation.text for variation in study.varied],
        "interest": list(aim.interest),
        "postures": list(study.after.scene.labels),
        "before": _state(study.before),
        "after": _state(study.after),
        "gain": study.gain,
        "moves": [
            {
                "unit": move.unit,
                "frame": move.frame,
                "before": list(move.before),
                "after": list(move.after),
                "distance": move.distance,
            }
            for move in study.moves
        ],
        "numbers": [{"number": n.number, "u": n.u, "change": n.change} for n in study.numbers],
        "scatter": None if study.scatter is None else [_check(check) for check in study.scatter],
        "maps": [
            {"ranger": item.ranger or None, "x": item.x.tolist(), "y": item.y.tolist(), "u": item.u.tolist()}
            for item in study.maps
        ],
        "search": {
            "seconds": study.seconds,
            "evaluations": study.path.evaluations,
            "u": study.path.values,
            "stages": [{"at": at, "what": what} for at, what in study.path.starts],
        },
    }
    return {key: plain(value) for key, value in answer.items()}


def _state(state: DesignState) -> dict[str, Any]:
    name, axis = state.worst
    sizes, axes = state.longest
    variance = state.u**2
    return {
        "u": state.u,
        "u_postures": [float(np.sqrt(value)) for value in state.values],
        "rangers": len(state.scene.rangers),
        "ranges": state.ranges,
        "worst_point": name,
        "worst_axis": axis.tolist(),
        "longest": dict(zip(state.aim.interest, sizes.tolist(), strict=True)),
        "axes": dict(zip(state.aim.interest, axes.tolist(), strict=True)),
        "pose_u": None if state.pose_u is None else state.pose_u.tolist(),
        "gain_loss": state.aim.loss(variance) if state.aim.frequency is not None else None,
    }


def _check(check: ScatterCheck) -> dict[str, Any]:
    return {
        "runs": check.runs,
        "predicted": check.predicted,
        "u": check.u,
        "u_u": check.u_u,
        "normalised": check.normalised,
        "u_normalised": check.u_normalised,
    }
