"""Third order of one posture: measured places less the structural model's, and what moves its frames there.

[PARKER04] section 2.6: the model is the second order, ranges correct what it does not repeat. Two answers: each target
and ranger of the site against its displaced place, whose uncertainty is mostly its record's; and the shift and turn of
each frame by the targets of the model's own groups, whose places at rest are known better (`corrections`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import EstimationError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.records.site.folder import SiteFolder
from catseye.reduction.structure.antenna import Antenna
from catseye.reduction.structure.corrections import (
    Corrections,
    FrameMotion,
    MeasuredPosture,
    correct_posture,
    frame_motion,
    group_of,
)
from catseye.reduction.structure.displacement import displacements
from catseye.reduction.structure.site_bending import bending_of

FEWEST = 3  # targets of a frame whose motion they give alone


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Adjusted points of a campaign.

    names        n
    x            (n, 3) m, ground frame
    covariance   (3n, 3n) m²
    """

    names: tuple[str, ...]
    x: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class ThirdOrder:
    """Measured places less the structural model's, in one posture.

    antenna      the model
    posture      of the telescope and its temperature
    names        n targets and rangers of the telescope
    displacement (n, 3) m, by the model, ground axes
    residual     (n, 3) m, measured less place by the model
    covariance   (n, 3, 3) m², of each residual: measurement, record and model
    corrections  of the model's frames by targets of its groups; None without such a target
    alone        frame: its motion by its own targets, three or more, its parents as corrected
    """

    antenna: Antenna
    posture: TelescopePosture
    names: tuple[str, ...]
    displacement: np.ndarray
    residual: np.ndarray
    covariance: np.ndarray
    corrections: Corrections | None
    alone: Mapping[str, FrameMotion]

    @property
    def title(self) -> str:
        """Title of the structural model."""
        return self.antenna.record.title

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainty of each residual (n, 3), m."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def largest(self) -> tuple[str, float, float]:
        """Point with the largest residual against its u, the residual's length and u, m."""
        length, u = np.linalg.norm(self.residual, axis=1), np.linalg.norm(self.u, axis=1)
        k = int(np.argmax(length / u))
        return self.names[k], float(length[k]), float(u[k])


def third_order(site: SiteFolder, measured: MeasuredPoints, u_typed: float) -> ThirdOrder | None:
    """Third order of a site's posture; None without a model, or with no point of the telescope measured.

    site       its records as typed, at the posture
    measured   adjusted points, any
    u_typed    m, of each coordinate of a record without its own

    Source: [PARKER04] section 2.6.
    """
    bending = bending_of(site)
    if bending is None:
        return None
    row = {name: k for k, name in enumerate(measured.names)}
    prisms = {name for name, target in site.targets.items() if target.shapes_dish}
    points = [p for name, p in bending.points.items() if name in row and name not in prisms]
    if not points:
        return None
    record = site.site.campaign
    at = TelescopePosture(record.azimuth_deg * DEGREE, record.elevation_deg * DEGREE, bending.temperature_c)
    moved = displacements(bending.antenna, points, at)
    rows = np.array([row[p.name] for p in points])
    axes = 3 * rows[:, None] + np.arange(3)
    measured_blocks = measured.covariance[axes[:, :, None], axes[:, None, :]]
    typed = np.array([_u_record(site, p.name, u_typed) for p in points])[:, None, None]
    corrections, alone = _frames(bending.antenna, at, measured)
    return ThirdOrder(
        antenna=bending.antenna,
        posture=at,
        names=tuple(p.name for p in points),
        displacement=moved.ground[0],
        residual=measured.x[rows] - moved.places[0],
        covariance=measured_blocks + moved.covariance[0] + typed**2 * np.eye(3),
        corrections=corrections,
        alone=alone,
    )


def _u_record(site: SiteFolder, name: str, usual: float) -> float:
    """Standard uncertainty of each coordinate of a typed place, m."""
    records = {ranger.name: ranger.u_position_mm for ranger in site.feedarm.ranger}
    records |= {target.name: target.u_position_mm for target in site.targets.values()}
    records |= {part: t.u_position_mm for t in site.triplets.values() for part in t.targets}
    u_mm = records.get(name)
    return usual if u_mm is None else u_mm * MILLIMETRE


def _frames(
    antenna: Antenna, at: TelescopePosture, measured: MeasuredPoints
) -> tuple[Corrections | None, dict[str, FrameMotion]]:
    """Corrections of the frames by targets of the model's groups."""
    row = {name: k for k, name in enumerate(measured.names)}
    names = tuple(name for group in antenna.groups.values() for name in group.names if name in row)
    carriers = {frame for name in names for frame in antenna.chain(antenna.groups[group_of(antenna, name)].frame)}
    if not carriers & set(antenna.motions):
        return None, {}
    rows = np.array([row[name] for name in names])
    axes = (3 * rows[:, None] + np.arange(3)).ravel()
    targets = MeasuredPosture(names, measured.x[rows], measured.covariance[np.ix_(axes, axes)], at)
    corrections = correct_posture(antenna, targets)
    alone = {}
    for frame in corrections.frames:
        count = sum(antenna.groups[group_of(antenna, name)].frame == frame for name in names)
        if count >= FEWEST:
            try:
                alone[frame] = frame_motion(antenna, targets, frame, added=corrections.six)
            except EstimationError:  # its targets lie on one line
                continue
    return corrections, alone
