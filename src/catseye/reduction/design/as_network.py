"""A design as a network of observations, for `catseye plan`."""

import numpy as np

from catseye.estimation.design.network import LEAST_U_SCALE, LEAST_U_ZERO, DesignNetwork
from catseye.estimation.network.model import NetworkParameter, NetworkPoints, ObservationNetwork
from catseye.estimation.observations.kinds import Distances, Linear, ObservationGroup, ObservedCoordinates
from catseye.reduction.design.scene import DesignScene


def network_of_scene(scene: DesignScene, posture: int = 0) -> ObservationNetwork:
    """Network of a scene's ranges, priors and ties, observed as predicted, ground frame."""
    design = scene.network(posture)
    count = len(design.points)
    parameters = [
        NetworkParameter(f"zero {scene.points[i].name}", sigma=max(float(u), LEAST_U_ZERO), unit="m")
        for i, u in zip(design.rangers, design.u_zero, strict=True)
    ]
    parameters.append(NetworkParameter("scale", sigma=max(design.u_scale, LEAST_U_SCALE)))
    nowhere = np.zeros((count, 3), dtype=bool)
    return ObservationNetwork(
        points=NetworkPoints(
            names=tuple(point.name for point in scene.points), xyz=design.points, fixed=nowhere, datum=nowhere
        ),
        parameters=tuple(parameters),
        groups=(_ranges(design), *_priors(design)),
        source=scene.name,
    )


def _ranges(design: DesignNetwork) -> Distances:
    ranger, target = design.pairs.T
    origin, count = design.rangers[ranger], len(design.pairs)
    distance = np.linalg.norm(design.points[target] - design.points[origin], axis=1)
    first = 3 * len(design.points)
    return Distances(
        name="ranges",
        observed=distance,
        covariance=design.claim.variance(distance),
        origin=3 * origin,
        target=3 * target,
        nuisance=first + ranger[:, None],
        coefficient=np.ones((count, 1)),
        scaling=np.full((count, 1), first + len(design.rangers)),
        scaling_coefficient=np.ones((count, 1)),
    )


def _priors(design: DesignNetwork) -> list[ObservationGroup]:
    rows = np.arange(len(design.points))
    groups: list[ObservationGroup] = [
        ObservedCoordinates.of_points("places", design.points, np.linalg.inv(design.information), 3 * rows)
    ]
    for unit in design.units:
        columns = np.concatenate([3 * i + np.arange(3) for i in unit.points])
        values, vectors = np.linalg.eigh(unit.information)
        kept = values > 1e-9 * values[-1]
        matrix = vectors[:, kept].T
        at = design.points[list(unit.points)].ravel()
        groups.append(Linear("ties", matrix @ at, 1.0 / values[kept], columns, matrix))
    return groups
