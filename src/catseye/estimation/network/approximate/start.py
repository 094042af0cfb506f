"""Approximate coordinates and orientations for all unknowns of a network.

Each point is placed by least squares of all observations to points already placed: ranges, directions of oriented
sets, zenith angles, height differences, vectors, and the directions of its own set, whose orientation is eliminated.
One routine thus covers polar points, trilateration, intersection, resection and free stationing; starts all around
determine if a second position fits as well. Then a local network is built about a station with enough sights, level but
of arbitrary orientation, and attached to the placed points by a Helmert transformation; from ranges alone it is
unfolded. Given coordinates are taken as known, good or poor: points placed from points that are metres off are metres
off too, but serve as a start. A point is placed again, and named, only if most lengths at it contradict its given
coordinates by a twentieth, e.g. for exchanged points.

If nothing (or too little) is given, the first local network keeps its own axes: z up if it has angles, those of
`Unfolding`, mirror image and side included, if it has ranges alone. `Approximation.assumed` names its points.

`sightings` reads the network into one table, `ties` places one point, `search` places them one by one, `figures` builds
local networks, `bodies` poses rigid bodies and `given` checks given coordinates.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from catseye.estimation.network.approximate.bodies import bodies_of, poses
from catseye.estimation.network.approximate.figures import place_all
from catseye.estimation.network.approximate.given import disagreeing, replace_disagreeing
from catseye.estimation.network.approximate.search import PlacingSearch
from catseye.estimation.network.approximate.sightings import GROUND, parts_of, sightings
from catseye.estimation.network.model import ObservationNetwork
from catseye.estimation.observations.kinds import (
    Directions,
    Distances,
    FixedDistances,
    HorizontalDistances,
    Joint,
    LevelPlanes,
)


class Approximation(NamedTuple):
    """Start values of the adjustment.

    xyz          (n, 3) m; nan if not found
    parameters   (p,) values of the other parameters
    found        names of the points with newly computed coordinates
    missing      name -> reason
    assumed      those of `found` not determined by observations: on an assumed side of a mirror plane, or in a figure
                 placed by convention because too little is given
    replaced     names of the points whose given coordinates grossly disagreed with the lengths, and were replaced
    """

    xyz: np.ndarray
    parameters: np.ndarray
    found: tuple[str, ...]
    missing: dict[str, str]
    assumed: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()


def approximate(network: ObservationNetwork) -> Approximation:
    """Start values of all points and of the orientations, level heights and poses.

    network   points may have nan coordinates; all others are taken as known; absent ones stay nan

    Directions, angles, azimuths, zenith angles, inclinations, ranges, horizontal distances, height differences, level
    planes, vectors, observed coordinates and rigid bodies are used; other kinds determine too little by themselves.
    Other parameters, and those held or with a prior, keep their start values. Refraction and ranger zeros that are not
    in the start values are neglected.

    Source: [FOERSTNER16] chapter 4, the least squares of each point; the order of placing is ours.

    >>> from catseye.estimation.network.model import NetworkPoints
    >>> from catseye.estimation.observations.kinds import Vectors
    >>> points = NetworkPoints(("A", "P"), np.array([[1.0, 2.0, 3.0], [np.nan] * 3]), *np.zeros((2, 2, 3), dtype=bool))
    >>> leg = Vectors("leg", np.array([10.0, 0.0, 1.0]), np.full(3, 1e-6), np.array([0]), np.array([3]))
    >>> approximate(ObservationNetwork(points, (), (leg,))).xyz[1]
    array([11.,  2.,  4.])
    """
    points, original = network.points, network.points
    n = len(points.names)
    if points.absent.any():  # any value, as no observation depends on it
        points = replace(points, xyz=np.where(points.absent, 0.0, points.xyz), absent=np.zeros_like(points.absent))
        network = replace(network, points=points)
    values = np.array([p.start for p in network.parameters], dtype=float)
    unknown = ~np.isfinite(points.xyz).all(axis=1)
    movable = np.array(original.free.all(axis=1))
    search = _search(network if unknown.any() else _lengths_and_directions_of(network), values)
    replaced = np.zeros(n, dtype=bool)
    if disagreeing(search.rows, search.xyz, movable).any():
        search, replaced = replace_disagreeing(_search(network, values), movable, np.array(points.datum.any(axis=1)))
    if unknown.any():
        place_all(search)
    search.orient_sets()
    free = {3 * n + k for k, p in enumerate(network.parameters) if np.isinf(p.sigma)}
    other_starts = [_levels(network, search.xyz), poses(network, search.xyz, values)]
    for column, start in chain(search.orientations.items(), *other_starts):
        if column in free:
            values[column - 3 * n] = start
    placed = np.isfinite(search.xyz).all(axis=1)
    missing = {points.names[p]: search.reason(p) for p in np.flatnonzero(~placed).tolist()}
    new, assumed = unknown & placed, np.zeros(n, dtype=bool)
    assumed[list(search.sides | search.conventional)] = True
    named = [tuple(points.names[p] for p in np.flatnonzero(k)) for k in (new, assumed & new, replaced)]
    xyz = np.where(original.absent, np.nan, search.xyz)
    return Approximation(
        xyz=xyz, parameters=values, found=named[0], missing=missing, assumed=named[1], replaced=named[2]
    )


def _search(network: ObservationNetwork, values: np.ndarray) -> PlacingSearch:
    """Search from the given coordinates, not yet advanced."""
    bodies = [(point, local) for point, local, _, _ in bodies_of(network, values)]
    return PlacingSearch(sightings(network), network.points.xyz.astype(float), _given_orientations(network), bodies)


def _lengths_and_directions_of(network: ObservationNetwork) -> ObservationNetwork:
    """Network with lengths and directions only, enough if all points are given."""
    kinds = Directions | Distances | FixedDistances | HorizontalDistances | Joint
    return replace(network, groups=tuple(g for g in network.groups if isinstance(g, kinds)))


def _given_orientations(network: ObservationNetwork) -> dict[int, float]:
    """Orientations by column, of those held or with a prior."""
    n = 3 * len(network.points.names)
    return {n + k: p.start for k, p in enumerate(network.parameters) if np.isfinite(p.sigma)} | {GROUND: 0.0}


def _levels(network: ObservationNetwork, xyz: np.ndarray) -> Iterator[tuple[int, float]]:
    """Column and height of each level plane, from its placed points."""
    for group, _ in parts_of(network):
        if isinstance(group, LevelPlanes):
            height = xyz[group.point // 3, 2] + group.height - group.observed
            for column in np.unique(group.columns[:, 1]):
                placed_heights = height[(group.columns[:, 1] == column) & np.isfinite(height)]
                if column >= 0 and len(placed_heights):
                    yield int(column), float(np.median(placed_heights))
