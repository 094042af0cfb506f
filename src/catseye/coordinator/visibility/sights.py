"""Which ranger can see which retroreflector, posture by posture; kept for half a degree of the telescope's motion."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from catseye.constants import DEGREE
from catseye.coordinator.visibility.vantage import SeenRetroreflector, Vantage, nominal_posture, reflector_at
from catseye.records.night.live import LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.records.site.solids import Solids
from catseye.reduction.steering.visibility import RangeLimits, Retroreflectors, Sight, Visibility, frames_at, visibility

STEP = 0.5 * DEGREE  # of azimuth and elevation, within which the answer is kept
KEPT = 8  # answers; one takes some ms, and a telescope that tracks does not come back


@dataclass(frozen=True, eq=False)
class Seen:
    """For one posture: by ranger the names it sees; for each other pair that was asked why not."""

    targets: dict[str, tuple[str, ...]]
    unseen: dict[tuple[str, str], str]


class VisibleSights:
    """Visible pairs of a site.

    vantages   of the rangers
    retros     that matter: those of the ground rangers, and those of the feed arm's
    solids     what stands in the way
    limits     of ranges

    What moves with the feed arm sees what moves with the reflector the same way in every posture: it is found once, in
    the posture of the record.
    """

    def __init__(
        self,
        site: SiteFolder,
        vantages: Mapping[str, Vantage],
        *,
        ground: Mapping[str, SeenRetroreflector],
        arm: Mapping[str, SeenRetroreflector],
        solids: Solids | None = None,
        limits: RangeLimits | None = None,
    ):
        self.site, self.solids, self.limits = site, solids or Solids(), limits
        self.vantages, self.ground = vantages, ground
        self._kept: dict[tuple[int, int], Seen] = {}
        riders = {name: v for name, v in vantages.items() if v.frame == "reflector"}
        self._arm = self._pairs(riders, {n: r for n, r in arm.items() if r.frame == "reflector"}, None)

    def at(self, posture: LivePosture) -> Seen:
        """What is seen in a posture: that of the middle of its cell of half a degree."""
        cell = round(posture.azimuth / STEP), round(posture.elevation / STEP)
        if cell not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            middle = LivePosture(0, cell[0] * STEP, cell[1] * STEP)
            standing = {name: v for name, v in self.vantages.items() if v.frame == "ground"}
            seen = self._pairs(standing, self.ground, middle)
            self._kept[cell] = Seen({**seen.targets, **self._arm.targets}, {**seen.unseen, **self._arm.unseen})
        return self._kept[cell]

    def _pairs(
        self, vantages: Mapping[str, Vantage], retros: Mapping[str, SeenRetroreflector], posture: LivePosture | None
    ) -> Seen:
        """Which rangers see which retroreflectors; without a posture in the record's, where riders are asked."""
        if not vantages or not retros:
            return Seen(dict.fromkeys(vantages, ()), {})
        stands = posture or nominal_posture(self.site)
        frame = reflector_at(self.site, stands)
        to_ground = frames_at(stands.azimuth, stands.elevation, frame)
        table = Retroreflectors(
            tuple(retros),
            tuple(r.kind for r in retros.values()),
            np.array([to_ground[r.frame].points(r.point) for r in retros.values()]),
            np.array([to_ground[r.frame].directions(r.axis) for r in retros.values()]),
        )
        scan_points = {name: to_ground[v.frame].points(v.station.scan_point) for name, v in vantages.items()}
        visible = visibility(scan_points, table, self.solids, frames=to_ground, limits=self.limits)
        return Seen(
            {name: _names(visible, i) for i, name in enumerate(vantages)}, _reasons(visible, posture is not None)
        )


def _names(table: Visibility, ranger: int) -> tuple[str, ...]:
    return tuple(table.targets[t] for t in np.flatnonzero(table.code[ranger] == Sight.SEEN))


def _reasons(table: Visibility, wanted: bool) -> dict[tuple[str, str], str]:
    """Why pairs are not seen; of riders, who have thousands, nothing."""
    if not wanted:
        return {}
    pairs = np.argwhere(table.code != Sight.SEEN).tolist()
    return {(table.rangers[r], table.targets[t]): table.reason(r, t) for r, t in pairs}
