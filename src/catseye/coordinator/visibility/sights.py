"""Visible ranger-target pairs by posture, cached per half degree."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from catseye.constants import DEGREE
from catseye.coordinator.visibility.vantage import SeenRetroreflector, Vantage, nominal_posture, reflector_at
from catseye.records.night.live import LivePosture
from catseye.records.site.folder import SiteFolder
from catseye.records.site.solids import Solids
from catseye.reduction.steering.visibility import RangeLimits, Retroreflectors, Sight, Visibility, frames_at, visibility

STEP = 0.5 * DEGREE  # of azimuth and elevation, size of a cached cell
CACHE_SIZE = 8  # cells; one takes some ms, and a tracking telescope does not return


@dataclass(frozen=True, eq=False)
class Seen:
    """Visible targets by ranger in one posture.

    unseen   reason for each other pair that was tested
    """

    targets: dict[str, tuple[str, ...]]
    unseen: dict[tuple[str, str], str]


class VisibleSights:
    """Visible pairs of a site.

    vantages   of the rangers
    retros     that matter: those of the ground rangers, and those of the feed arm's
    solids     obstacles
    limits     of ranges

    Pairs that both move with the reflector are the same in every posture: they are computed once, in the posture of the
    record.
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
        """Visible pairs in a posture, by the middle of its half-degree cell."""
        cell = round(posture.azimuth / STEP), round(posture.elevation / STEP)
        if cell not in self._kept:
            if len(self._kept) >= CACHE_SIZE:
                self._kept.pop(next(iter(self._kept)))
            middle = LivePosture(0, cell[0] * STEP, cell[1] * STEP)
            ground_vantages = {name: v for name, v in self.vantages.items() if v.frame == "ground"}
            pairs = self._pairs(ground_vantages, self.ground, middle)
            self._kept[cell] = Seen({**pairs.targets, **self._arm.targets}, {**pairs.unseen, **self._arm.unseen})
        return self._kept[cell]

    def _pairs(
        self, vantages: Mapping[str, Vantage], retros: Mapping[str, SeenRetroreflector], posture: LivePosture | None
    ) -> Seen:
        """Visible pairs of rangers and retroreflectors.

        Without a posture in the record's, for pairs on the telescope.
        """
        if not vantages or not retros:
            return Seen(dict.fromkeys(vantages, ()), {})
        stands = posture or nominal_posture(self.site)
        frame = reflector_at(self.site, stands)
        to_ground = frames_at(stands.azimuth, stands.elevation, frame)
        table = Retroreflectors.with_axes(
            tuple(retros),
            tuple(r.kind for r in retros.values()),
            np.array([to_ground[r.frame].points(r.point) for r in retros.values()]),
            tuple(None if r.axis is None else to_ground[r.frame].directions(r.axis) for r in retros.values()),
        )
        scan_points = {name: to_ground[v.frame].points(v.station.scan_point) for name, v in vantages.items()}
        visible = visibility(scan_points, table, self.solids, frames=to_ground, limits=self.limits)
        return Seen(
            {name: _names(visible, i) for i, name in enumerate(vantages)}, _reasons(visible, posture is not None)
        )


def _names(table: Visibility, ranger: int) -> tuple[str, ...]:
    return tuple(table.targets[t] for t in np.flatnonzero(table.code[ranger] == Sight.SEEN))


def _reasons(table: Visibility, enabled: bool) -> dict[tuple[str, str], str]:
    """Reasons for invisible pairs; none for pairs on the telescope (thousands)."""
    if not enabled:
        return {}
    pairs = np.argwhere(table.code != Sight.SEEN).tolist()
    return {(table.rangers[r], table.targets[t]): table.reason(r, t) for r, t in pairs}
