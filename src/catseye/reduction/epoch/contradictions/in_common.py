"""Errors that many records share: a copied sheet, one batch, a survey with another scale, datum or direction.

Each record alone stands out little, and a candidate for each would hide the common cause. Most of these errors no range
shows, since they move everything alike: their tests say so.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE, PPM
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.contradictions.contradiction import ALIKE, RecordGroup
from catseye.reduction.epoch.contradictions.hypotheses import (
    DIRECTIONS,
    Hypothesis,
    PriorRows,
    RecordKey,
    owners_of,
    prior_hypotheses,
)
from catseye.reduction.epoch.parameter import XYZ, Parameter
from catseye.reduction.epoch.prior_names import BENCHMARKS, GLASS, MONUMENTS, OFFSETS, ZEROS
from catseye.reduction.site.places import RangedPoint

FEWEST = 3  # records that share an error: two are rather two errors
AXES = ("about east", "about north", "about up")
PLACES, TURNS, HEIGHTS = "places of all monuments", "directions of all monuments", "heights of all mirrors"
DATUM = frozenset((PLACES, TURNS, HEIGHTS))  # only typed positions speak of them, and a posture moves these alike


def record_hypotheses(
    priors: Sequence[ObservationGroup],
    parameters: Sequence[Parameter],
    campaign: ObservedSite,
    places: Mapping[str, RangedPoint],
) -> list[Hypothesis]:
    """Hypotheses of the records that priors state, and of what many of them have in common."""
    return [
        *prior_hypotheses(priors, parameters, campaign, places),
        *_zeros(priors, parameters, campaign),
        *_surveys(priors, parameters),
        *_mirrors(priors),
        *_certificates(priors),
        *_glass(priors, parameters, places),
    ]


def _alike(
    of: str,
    where: str,
    unit: tuple[str, float],
    priors: Mapping[int, PriorRows],
    parts: tuple[str, ...] = ("",),
) -> list[Hypothesis]:
    """Hypothesis of an error in common; none where too few records share it."""
    if sum(len(rows) for rows, _ in priors.values()) < FEWEST:
        return []
    key = RecordKey(RecordGroup.COMMON, of)
    name, per_unit = unit
    return [
        Hypothesis(
            key=key, record=f"{of}{ALIKE}", where=where, parts=parts, unit=name, per_unit=per_unit, priors=dict(priors)
        )
    ]


def _zeros(
    priors: Sequence[ObservationGroup], parameters: Sequence[Parameter], campaign: ObservedSite
) -> list[Hypothesis]:
    result: list[Hypothesis] = []
    chosen: dict[str, Callable[[str], bool]] = {
        "zeros of all rangers": lambda _: True,
        "zeros of all rangers on monuments": lambda name: name in campaign.monuments,
        "zeros of all rangers on the feed arm": lambda name: name not in campaign.monuments,
    }
    for i, prior in enumerate(priors):
        if prior.name == ZEROS:
            names = [owner.of for owner in owners_of(prior, parameters)]
            rows = {of: np.flatnonzero([is_one(n) for n in names]) for of, is_one in chosen.items()}
            for of, at in rows.items():
                if of == next(iter(chosen)) or len(at) < len(names):
                    result += _alike(of, "mirrors: d0_mm", ("mm", MILLIMETRE), {i: (at, np.ones((len(at), 1)))})
    return result


def _surveys(priors: Sequence[ObservationGroup], parameters: Sequence[Parameter]) -> list[Hypothesis]:
    """Errors of a whole survey: scaled and turned about its middle, tilted about what defines a height."""
    result: list[Hypothesis] = []
    for i, prior in enumerate(priors):
        if prior.name != MONUMENTS:
            continue
        owners = owners_of(prior, parameters)
        axes = np.array([XYZ.index(owner.part) for owner in owners])
        names = list(dict.fromkeys(owner.of for owner in owners))
        typed = np.zeros((len(names), 3))
        free = np.zeros((len(names), 3), dtype=bool)
        row = np.array([names.index(owner.of) for owner in owners])
        typed[row, axes], free[row, axes] = prior.observed, True
        defining = ~free.all(axis=1)
        pivot, middle = (
            typed[some].mean(axis=0) for some in (defining if defining.any() else slice(None), slice(None))
        )
        middle[2] = pivot[2]
        tilted, points, at = (typed - pivot)[row], (typed - middle)[row], np.arange(len(owners))
        moved = np.flatnonzero(free.all(axis=0))
        if len(names) < FEWEST:
            continue
        shifted, parts = np.eye(3)[axes][:, moved], tuple(DIRECTIONS[axis] for axis in moved)
        about = zip(np.eye(3), (tilted, tilted, points), strict=True)
        turned = np.stack([np.cross(turn, from_there)[at, axes] for turn, from_there in about], axis=1)
        scaled = points[at, axes][:, None]
        result += _alike(PLACES, "monuments", ("mm", MILLIMETRE), {i: (at, shifted)}, parts)
        result += _alike(TURNS, "monuments", ("arcsec", ARCSECOND), {i: (at, turned)}, AXES)
        result += _alike("scale of all monuments", "monuments", ("ppm", PPM), {i: (at, scaled)})
    return result


def _mirrors(priors: Sequence[ObservationGroup]) -> list[Hypothesis]:
    """Heights of the mirrors above their fixed points, as one gauge or one drawing gives them."""
    up = {i: (np.arange(3), np.eye(3)[:, 2:]) for i, prior in enumerate(priors) if prior.name == OFFSETS}
    return _alike(HEIGHTS, "mirrors: dy_mm", ("mm", MILLIMETRE), up) if len(up) >= FEWEST else []


def _certificates(priors: Sequence[ObservationGroup]) -> list[Hypothesis]:
    marks = {i: prior for i, prior in enumerate(priors) if prior.name == BENCHMARKS}
    where = "benchmarks.csv: certified_distance_mm"
    constant = {i: (np.arange(1), np.ones((1, 1))) for i in marks}
    scale = {i: (np.arange(1), prior.observed[:, None]) for i, prior in marks.items()}
    return [
        *_alike("certificates of all benchmarks", where, ("mm", MILLIMETRE), constant),
        *_alike("scale of all certificates", where, ("ppm", PPM), scale),
    ]


def _glass(
    priors: Sequence[ObservationGroup], parameters: Sequence[Parameter], places: Mapping[str, RangedPoint]
) -> list[Hypothesis]:
    result: list[Hypothesis] = []
    for i, prior in enumerate(priors):
        if prior.name == GLASS:
            of = [owner.of for owner in owners_of(prior, parameters)]
            at = np.flatnonzero([places[name].normal is not None for name in of])
            rows = {i: (at, np.ones((len(at), 1)))}
            result += _alike("glass constants of all prisms", "targets.toml, triplets", ("mm", MILLIMETRE), rows)
    return result
