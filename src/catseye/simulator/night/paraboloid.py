"""Best-fit paraboloid of the true dish, at design focal length.

The truth of the pose.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from catseye.simulator.night.posture import TruePosture
from catseye.simulator.night.structure import FOCAL_LENGTH

MINIMUM_PRISMS = 6


@dataclass(frozen=True)
class GroundParaboloid:
    """Paraboloid in the ground frame, with normal `deviations`, m.

    Positive towards the focus.
    """

    axis: np.ndarray  # unit vector, from the vertex to the focus
    vertex: np.ndarray
    focus: np.ndarray
    deviations: dict[str, float]


def normal_deviation(point):
    """Normal deviation of points (..., 3) from z = (x^2 + y^2)/(4 f).

    Positive towards the focus; good to its square / 100 m.
    """
    slope2 = np.sum(point[..., :2] ** 2, axis=-1) / (4.0 * FOCAL_LENGTH**2)
    return (point[..., 2] - FOCAL_LENGTH * slope2) / np.sqrt(1.0 + slope2)


def best_paraboloid(points: dict[str, np.ndarray], pose: TruePosture) -> GroundParaboloid | None:
    """Least squares fit over two tilts and three shifts; None below six prisms."""
    if len(points) < MINIMUM_PRISMS:
        return None
    prisms = pose.reflector_from_nominal(np.array(list(points.values())))

    def deviations(parameters):
        turned = Rotation.from_rotvec([parameters[0] / 100.0, parameters[1] / 100.0, 0.0])
        return normal_deviation(turned.inv().apply(prisms - parameters[2:]))

    fit = least_squares(deviations, np.zeros(5), xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac", method="lm")
    turned = Rotation.from_rotvec([fit.x[0] / 100.0, fit.x[1] / 100.0, 0.0])
    axis = turned.apply([0.0, 0.0, 1.0])
    vertex = pose.nominal(fit.x[2:])
    return GroundParaboloid(
        axis=pose.nominal_direction(axis),
        vertex=vertex,
        focus=vertex + FOCAL_LENGTH * pose.nominal_direction(axis),
        deviations=dict(zip(points, (float(d) for d in deviations(fit.x)), strict=True)),
    )
