"""Pose of a body over the nights, beside posture, temperature and date."""

from dataclasses import dataclass

import numpy as np

from catseye.names import counted
from catseye.records.archive.layout import AXES, POSE_PRODUCTS
from catseye.reduction.query.span import ArchiveSpan
from catseye.verdict import Verdict

UPPER = np.triu_indices(6)


@dataclass(frozen=True, eq=False)
class PoseSeries:
    """Poses of a body over n nights against its nominal posture.

    frame            (n,) of all vectors
    night, mjd       (n,)
    pivot            (n, 3) m, point about which the rotation turns
    translation      (n, 3) m
    rotation         (n, 3) rad, rotation vector
    covariance       (n, 6, 6) of translation and rotation, m and rad; zero in unobserved directions
    azimuth, elevation   (n,) rad, of the telescope
    temperature_c    (n,) of the air
    unobserved       (n,) directions that the night does not show
    """

    body: str
    verdict: Verdict
    frame: np.ndarray
    night: np.ndarray
    mjd: np.ndarray
    pivot: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    covariance: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    temperature_c: np.ndarray
    unobserved: np.ndarray

    @property
    def motion(self) -> np.ndarray:
        """Translation and rotation (n, 6), m and rad."""
        return np.hstack([self.translation, self.rotation])

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 6) of the motion, m and rad."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))


def pose_series(span: ArchiveSpan, body: str) -> PoseSeries:
    """Poses of a body over the nights.

    Raises InputError: an unknown body, a span without a night.
    """
    plain = ("frame", "night", "mjd", "azimuth", "elevation", "temperature_c", "unobserved")
    vectors = ("pivot", "translation", "rotation")
    parts = [f"{vector}_{axis}" for vector in vectors for axis in AXES]
    rows = span.table("poses", *plain, *parts, *POSE_PRODUCTS, body=body)
    if not len(rows["night"]):
        span.refuse_empty("poses", "body", body)
    covariance = np.zeros((len(rows["night"]), 6, 6))
    upper = np.column_stack([rows[name] for name in POSE_PRODUCTS])
    covariance[:, UPPER[0], UPPER[1]] = upper
    covariance[:, UPPER[1], UPPER[0]] = upper
    good = f"{counted(len(rows['night']), 'night')}, all of them good"
    return PoseSeries(
        body=body,
        verdict=span.verdict(rows["night"].tolist(), good),
        covariance=covariance,
        **{name: rows[name] for name in plain},
        **{vector: np.column_stack([rows[f"{vector}_{axis}"] for axis in AXES]) for vector in vectors},
    )
