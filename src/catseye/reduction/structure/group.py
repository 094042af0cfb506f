"""Points of many postures in the axes of their frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.estimation.harmonic.series import Spread
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.geometry.antenna.frames import (
    ELEVATION_AXIS_HEIGHT,
    REFLECTOR_TO_ELEVATION,
    ground_from_alidade_at,
    ground_from_reflector_at,
)
from catseye.geometry.frames.frame import Transforms
from catseye.reduction.structure.series import GroupSeries
from catseye.verdict import Verdict

FRAMES = ("ground", "alidade", "reflector")
MOST = 2e8  # numbers of all covariances: 1.6 GB
MOVED = 0.05 * DEGREE  # of elevation: less is no move, and the previous direction holds


@dataclass(frozen=True)
class Nominal:
    """Constants of a rigid telescope, m, as in `geometry.antenna.frames`."""

    elevation_axis_height: float = ELEVATION_AXIS_HEIGHT
    reflector_to_elevation: tuple[float, float, float] = REFLECTOR_TO_ELEVATION


@dataclass(frozen=True, eq=False)
class PlacesEpoch:
    """Points of one epoch.

    label          for messages: a folder, an epoch's number
    mjd            UTC; NaN where unknown
    azimuth, elevation   rad
    temperature_c  of the structure, degrees C; NaN where unknown
    names          n
    coordinates    (n, 3) m, ground frame
    covariance     (3n, 3n) m^2
    verdict        of the reduction; None without one
    """

    label: str
    mjd: float
    azimuth: float
    elevation: float
    temperature_c: float
    names: tuple[str, ...]
    coordinates: Array
    covariance: Array
    verdict: Verdict | None = None


def group_series(
    epochs: Sequence[PlacesEpoch],
    points: Sequence[str],
    *,
    group: str = "group",
    frame: str = "reflector",
    pivot: Array | None = None,
    nominal: Nominal | None = None,
    correlated: bool = True,
) -> GroupSeries:
    """Group of points through the epochs, in order of time.

    epochs    at least one; those without any of the points are left out
    points    names, or patterns such as "ZEG*"
    group     its name
    frame     of the group: "ground", "alidade" or "reflector"
    pivot     (3,) m in the frame, of turns; None: the middle of the points
    nominal   the rigid telescope
    correlated   False: points of an epoch independent, each with its own covariance: for thousands

    Raises InputError for too many points, an unknown frame, points that no epoch has, epochs of one name.
    """
    if frame not in FRAMES:
        raise InputError(f"frame {frame!r} (expected {', '.join(FRAMES)})")
    every_name = sorted({name for epoch in epochs for name in epoch.names})
    names = tuple(name for name in every_name if any(fnmatchcase(name, pattern) for pattern in points))
    for pattern in points:
        if not any(fnmatchcase(name, pattern) for name in every_name):
            some = ", ".join(every_name[:8]) + (", ..." if len(every_name) > 8 else "")
            raise InputError(f"no epoch has a point {pattern!r} (they have {some})")
    used = [epoch for epoch in epochs if set(epoch.names) & set(names)]
    labels = [epoch.label for epoch in used]
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise InputError(f"epoch {twice!r} appears twice (expected each once)")
    used.sort(key=lambda epoch: (np.isnan(epoch.mjd), epoch.mjd))
    if correlated and len(used) * (3 * len(names)) ** 2 > MOST:
        raise InputError(
            f"{len(names)} points in {len(used)} epochs with a covariance of all in each are too many (expected "
            f"{MOST:.0e} numbers at most): name fewer, or take them as independent"
        )
    places = np.full((len(used), len(names), 3), np.nan)
    # of absent points: ones, never used
    full = np.tile(np.eye(3 * len(names)), (len(used), 1, 1)) if correlated else np.zeros((0, 0, 0))
    alone = np.tile(np.eye(3), (len(used), len(names), 1, 1))
    for t, epoch in enumerate(used):
        present = [i for i, name in enumerate(epoch.names) if name in names]
        at = np.array([names.index(epoch.names[i]) for i in present])
        carrier = carrier_of(frame, epoch.azimuth, epoch.elevation, nominal=nominal or Nominal())
        places[t, at] = (epoch.coordinates[present] - carrier.translation) @ carrier.rotation
        rows = (3 * np.array(present)[:, None] + np.arange(3)).ravel()
        into = (3 * at[:, None] + np.arange(3)).ravel()
        if not correlated:
            coordinates = 3 * np.array(present)[:, None] + np.arange(3)
            blocks = epoch.covariance[coordinates[:, :, None], coordinates[:, None, :]]
            alone[t, at] = carrier.rotation.T @ blocks @ carrier.rotation
            continue
        turn = np.kron(np.eye(len(present)), carrier.rotation.T)
        full[t][np.ix_(into, into)] = turn @ epoch.covariance[np.ix_(rows, rows)] @ turn.T
    e = np.array([epoch.elevation for epoch in used])
    posture = TelescopePosture(
        np.array([epoch.azimuth for epoch in used]), e, np.array([epoch.temperature_c for epoch in used])
    )
    middle = np.nanmean(places, axis=(0, 1)) if pivot is None else np.asarray(pivot, dtype=float)
    mjd = np.array([epoch.mjd for epoch in used])
    sorted_labels = tuple(epoch.label for epoch in used)
    spread = Spread(full=full) if correlated else Spread(points=alone)
    return GroupSeries(
        group=group,
        frame=frame,
        names=names,
        mjd=mjd,
        posture=posture,
        way=ways(e),
        places=places,
        spread=spread,
        pivot=middle,
        labels=sorted_labels,
    )


def carrier_of(frame: str, azimuth: float, elevation: float, *, nominal: Nominal) -> Transforms:
    """Transform from a frame to the ground, at one posture.

    Of the rigid telescope.

    frame                "ground", "alidade" or "reflector"
    azimuth, elevation   rad

    Source: [PARKER04] eq. 2.40-2.44.
    """
    if frame == "ground":
        return Transforms("ground", "ground", np.eye(3), np.zeros(3))
    if frame == "alidade":
        return ground_from_alidade_at(azimuth)
    return ground_from_reflector_at(
        azimuth,
        elevation,
        elevation_axis_height=nominal.elevation_axis_height,
        reflector_to_elevation=nominal.reflector_to_elevation,
    )


def ways(elevation: Array) -> Array:
    """Direction of the last elevation move: 1 rose, -1 fell, 0 unknown.

    Before each epoch.

    elevation   (T,) rad, in order of time

    >>> ways(np.radians([10.0, 20.0, 20.01, 15.0])).tolist()
    [0.0, 1.0, 1.0, -1.0]
    """
    direction, last = np.zeros(len(elevation)), 0.0
    for t in range(1, len(elevation)):
        step = elevation[t] - elevation[t - 1]
        last = float(np.sign(step)) if abs(step) > MOVED else last
        direction[t] = last
    return direction
