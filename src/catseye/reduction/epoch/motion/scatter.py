"""Scatter of the shots of each class of points against their claim, with the sway of the telescope's bodies."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from catseye.constants import MILLIMETRE
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, GroupFit
from catseye.reduction.epoch.contradictions.contradiction import ClassScatter
from catseye.reduction.site.places import RangedPoint

BODIES = ("arm", "dish", "alidade")
TELESCOPE = "telescope"  # all bodies as one
SWAYING = (*BODIES, TELESCOPE)
RARE = 1e-3  # probability, of an honest campaign, that one of its classes is off by chance
LARGE_FACTOR = 1.2  # variance factor of a class from which its uncertainties are 10 % too small
LEAST_DEGREES = 1.0  # of freedom, of a variance factor
CLASSES = {"": "ground", "alidade": "alidade", "dish": "dish", "arm": "feed arm"}  # of points, by their body


class ShotEnds(NamedTuple):
    """Bodies and lengths of one ranger's m shots.

    body       of the ranger; "" on the ground
    bodies     (m,) of the targets
    distance   (m,) m
    """

    body: str
    bodies: np.ndarray
    distance: np.ndarray


def shot_ends(
    places: Mapping[str, RangedPoint], lines: Sequence[tuple[str, Sequence[str], np.ndarray]]
) -> list[ShotEnds]:
    """Ends of each ranger's shots.

    lines   of each ranger: name, targets and distances (m,) m
    """
    return [
        ShotEnds(places[name].body, np.array([places[t].body for t in targets], dtype=str), distance)
        for name, targets, distance in lines
    ]


def exposed(body: str, bodies: Sequence[str] | np.ndarray) -> np.ndarray:
    """Shots (m, 4) of a ranger that the sway of each of `SWAYING` reaches: 1, or 0.

    body, bodies   of the ranger and its targets; "" on the ground

    A sway reaches the shots with one end on the body: what carries both ends changes no length.
    """
    far = np.array(bodies, dtype=str)
    single = [(body == name) != (far == name) for name in BODIES]
    return np.stack([*single, (body == "") != (far == "")], axis=1).astype(float)


def sway_variance(body: str, bodies: Sequence[str], sway: Mapping[str, float]) -> np.ndarray:
    """Variance (m,), m^2, of a ranger's distances by the sway of bodies, m.

    >>> sway_variance("", ["dish", "arm"], {"arm": 3e-4}).round(9).tolist()
    [0.0, 9e-08]
    """
    return np.asarray(exposed(body, bodies) @ np.array([sway.get(name, 0.0) ** 2 for name in SWAYING]))


def sway_text(name: str, sway: float) -> str:
    """Sway of a body in a sentence.

    >>> sway_text("arm", 3.1e-4)
    'the feed arm sways by 0.31 mm from shot to shot (standard deviation, each direction): the uncertainties include it'
    """
    called = "whole telescope" if name == TELESCOPE else CLASSES[name]
    return (
        f"the {called} sways by {sway / MILLIMETRE:.2f} mm from shot to shot (standard deviation, each direction): "
        "the uncertainties include it"
    )


def worst_class(scatter: Sequence[ClassScatter]) -> ClassScatter | None:
    """Class whose shots scatter most beyond their claim; None where none does significantly and by much."""
    beyond = {
        each: float(chdtrc(each.degrees, each.factor * each.degrees)) for each in scatter if each.factor > LARGE_FACTOR
    }
    worst = min(beyond, key=lambda each: beyond[each], default=None)
    return worst if worst is not None and len(scatter) * beyond[worst] < RARE else None


def class_scatter(
    ends: Sequence[ShotEnds], fits: Sequence[GroupFit], sway: Mapping[str, float]
) -> tuple[ClassScatter, ...]:
    """Scatter of the used shots of each class of points; a shot counts in the classes of both its ends.

    ends   of each ranger's shots
    fits   of an adjustment, the rangers' first
    sway   of bodies, m, in the claim

    The variance factor is the sum of v' P v over that of the redundancy numbers, each over the class's shots.
    """
    near = np.concatenate([np.full(len(e.bodies), e.body) for e in ends])
    far = np.concatenate([e.bodies for e in ends])
    fits = fits[: len(ends)]
    used = np.concatenate([f.active for f in fits])
    weighed = np.concatenate([f.residual * f.standardised * NONCENTRALITY / f.detectable_error for f in fits])
    redundancy = np.concatenate([f.redundancy for f in fits])
    scatter = []
    for body, name in CLASSES.items():
        mine = used & ((near == body) | (far == body))
        degrees = float(redundancy[mine].sum())
        if mine.any() and degrees > LEAST_DEGREES:
            scatter.append(
                ClassScatter(
                    name=name,
                    factor=float(weighed[mine].sum()) / degrees,
                    shots=int(mine.sum()),
                    sway_m=float(np.hypot(sway.get(body, 0.0), sway.get(TELESCOPE, 0.0) if body else 0.0)),
                    degrees=degrees,
                )
            )
    return tuple(scatter)
