"""Observation kinds, one file each: predicted values, derivatives, covariance.

The solver knows only the protocol `ObservationGroup`. A new kind is a new file and one line here.

Points are identified by the column of their x in the parameter vector; y and z follow it. Other parameters are
identified by their own column, and -1 stands for none. Axes are x east, y north, z up; azimuths run clockwise from +y
to +x, zenith angles from +z. Angles are predicted on the turn nearest to the observed value.
"""

from catseye.estimation.observations.angle import HorizontalAngles
from catseye.estimation.observations.azimuth import Azimuths
from catseye.estimation.observations.bodies.frame_point import FramePoints
from catseye.estimation.observations.bodies.level_plane import LevelPlanes
from catseye.estimation.observations.bodies.point_on_line import PointsOnLine
from catseye.estimation.observations.bodies.point_on_plane import PointsOnPlane
from catseye.estimation.observations.bodies.point_on_sphere import PointsOnSphere
from catseye.estimation.observations.bodies.rigid_body import RigidBodies
from catseye.estimation.observations.bodies.rigid_triplet import RigidTriplets
from catseye.estimation.observations.coordinates import ObservedCoordinates
from catseye.estimation.observations.direction import Directions
from catseye.estimation.observations.distance import Distances
from catseye.estimation.observations.distance_difference import DistanceDifferences
from catseye.estimation.observations.fixed_distance import FixedDistances
from catseye.estimation.observations.height_difference import HeightDifferences
from catseye.estimation.observations.horizontal_distance import HorizontalDistances
from catseye.estimation.observations.inclination import Inclinations
from catseye.estimation.observations.joint import Joint
from catseye.estimation.observations.kind import ObservationGroup, ObservationKind, Reported
from catseye.estimation.observations.linear import Linear
from catseye.estimation.observations.moving_distance import MovingDistances
from catseye.estimation.observations.tilt import ObservedTilts
from catseye.estimation.observations.vector import Vectors
from catseye.estimation.observations.zenith_angle import ZenithAngles

__all__ = [
    "Azimuths",
    "Directions",
    "DistanceDifferences",
    "Distances",
    "FixedDistances",
    "FramePoints",
    "HeightDifferences",
    "HorizontalAngles",
    "HorizontalDistances",
    "Inclinations",
    "Joint",
    "LevelPlanes",
    "Linear",
    "MovingDistances",
    "ObservationGroup",
    "ObservationKind",
    "ObservedCoordinates",
    "ObservedTilts",
    "PointsOnLine",
    "PointsOnPlane",
    "PointsOnSphere",
    "Reported",
    "RigidBodies",
    "RigidTriplets",
    "Vectors",
    "ZenithAngles",
]
