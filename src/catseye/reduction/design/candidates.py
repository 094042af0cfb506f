"""Criterion with a ranger at candidate places, each by a low-rank update."""

from collections.abc import Callable

import numpy as np

from catseye.aliases import Array
from catseye.estimation.design.addition import with_ranger
from catseye.estimation.design.network import predict
from catseye.reduction.design.aim import DesignAim
from catseye.reduction.design.scene import DesignPoint, DesignScene
from catseye.reduction.steering.visibility import Retroreflectors, visibility


def with_ranger_at(
    scene: DesignScene,
    aim: DesignAim,
    ranger: DesignPoint,
    places: Array,
    *,
    progress: Callable[[int], None] | None = None,
) -> Array:
    """Standard uncertainties (k,) m, root of the criterion, with one ranger more at each of some places.

    scene      without it
    aim        what is evaluated; over several postures the worst
    ranger     its priors; on the ground
    places     (k, 3) m, ground
    progress   called with the places done
    """
    result = np.zeros(len(places))
    for posture, frames in enumerate(scene.postures):
        prediction = predict(scene.network(posture))
        criterion = aim.criterion(scene, posture)
        rows = np.array([i for i, point in enumerate(scene.points) if point.kind is not None], dtype=int)
        points = prediction.network.points
        table = Retroreflectors.with_axes(
            tuple(scene.points[i].name for i in rows),
            tuple(point.kind for point in scene.points if point.kind is not None),
            points[rows],
            [
                None if (axis := scene.points[i].axis) is None else scene.turns[posture][i] @ np.array(axis)
                for i in rows
            ],
        )
        stands = {str(k): place for k, place in enumerate(places)}
        seen = visibility(stands, table, scene.solids, frames=frames, limits=scene.limits).seen
        for k, place in enumerate(places):
            added = with_ranger(prediction, place, rows[seen[k]], u=np.array(ranger.u), u_zero=ranger.u_zero)
            result[k] = max(result[k], criterion.true_value(added))
            if progress is not None:
                progress(k + 1)
    return np.sqrt(result)
