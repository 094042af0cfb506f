"""Places of points whose whole cycles the modulation frequencies give, however badly they were typed.

The shots with known cycles are adjusted with all typed positions uncertain by FAR. A typed position that this misses by
more than it can have is then taken as uncertain by as much, and a line that does not belong loses its known cycles.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import EstimationError, InputError
from catseye.estimation.least_squares.robust import OutlierSearch, adjust_robustly
from catseye.estimation.observations.kinds import ObservationGroup
from catseye.names import megahertz
from catseye.records.files.record import Record
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.lines.cycles import without_shots
from catseye.reduction.epoch.lines.frequency_cycles import FrequencyCycles, frequency_cycles
from catseye.reduction.epoch.prior_names import THERMOMETERS, ZEROS
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import build_network
from catseye.reduction.site.motion import TelescopeCarrier
from catseye.reduction.site.places import places_of

R = TypeVar("R", bound=Record)
FAR = 20.0  # m, standard uncertainty of each typed coordinate while it is not believed
DEPARTED = 36.0  # squared departure from a typed position in its u, six standard uncertainties, from which it is wrong
FOREIGN = 0.02  # m, residual of a line that has other cycles than its frequencies say: a quarter of the least error


@dataclass(frozen=True, eq=False)
class PlacedCampaign:
    """Campaign whose wrong typed positions are uncertain, with the phases whose cycles are known.

    rejected   shots at a frequency that disagrees with the others: index into the campaign's shots, and reason
    starts   point: (3,) m, where the adjustment begins
    moved    point: m, from its typed position
    """

    campaign: ObservedSite
    phases: Phases
    electronics: dict[str, ElectronicsPhase]
    frequencies: FrequencyCycles
    starts: Mapping[str, np.ndarray]
    moved: Mapping[str, float]
    rejected: Mapping[int, Reason] = field(default_factory=dict)

    @property
    def notes(self) -> list[str]:
        """Cycles by frequencies, and typed positions that they refute."""
        return [
            *self.frequencies.notes(),
            *(
                f"{name}: its typed position is {off / MILLIMETRE:.0f} mm off; the whole cycles of its lines come from "
                "the modulation frequencies"
                for name, off in sorted(self.moved.items())
            ),
        ]


def placed_by_frequencies(
    campaign: ObservedSite,
    phases: Phases,
    electronics: dict[str, ElectronicsPhase],
    *,
    settings: ReductionSettings,
    motion: TelescopeCarrier | None,
) -> PlacedCampaign:
    """Whole cycles by the modulation frequencies, and the places that these lines give.

    Unchanged where all shots have the site's frequency.
    """
    cycles = frequency_cycles(campaign, phases, electronics)
    rejected: dict[int, Reason] = {}
    if np.isfinite(cycles.blamed_hz):
        wrong = np.flatnonzero(campaign.modulation_of(np.arange(len(campaign.shots))) == cycles.blamed_hz)
        reason = Reason(ShotStatus.DOUBTED, f"{megahertz(cycles.blamed_hz)} disagrees with the other frequencies")
        rejected = {int(k): reason for part in electronics.values() for k in np.intersect1d(part.shots, wrong)}
        electronics = without_shots(electronics, set(rejected))
        cycles = replace(frequency_cycles(campaign, phases, electronics), disagreement=cycles.disagreement)
    placed = PlacedCampaign(campaign, phases, electronics, cycles, starts={}, moved={}, rejected=rejected)
    return _placed(placed, settings, motion) if cycles.sets else placed


def _placed(placed: PlacedCampaign, settings: ReductionSettings, motion: TelescopeCarrier | None) -> PlacedCampaign:
    campaign, phases, cycles = placed.campaign, placed.phases, placed.frequencies
    electronics, count = placed.electronics, len(campaign.shots)
    located_phases = replace(phases, cycles=cycles.cycles_of_shots(count))
    shots = {int(k) for part in electronics.values() for k in part.shots}
    resolved = without_shots(electronics, {k for k in shots if cycles.cycles_of_shots(count)[k] < 0})
    wide = uncertain(campaign, dict.fromkeys(campaign.target_names, FAR))
    network = build_network(wide, located_phases, resolved, settings=settings, motion=motion)
    placed = replace(placed, phases=located_phases)
    if not network.rangers:
        return placed
    x = np.array(network.layout.start)
    pairs = [shot_group(network, name, x) for name in network.rangers]
    groups: list[ObservationGroup] = [group for group, _ in pairs] + network.priors
    removable = [
        np.full(len(g.observed), i < len(pairs) or g.name in (THERMOMETERS, ZEROS)) for i, g in enumerate(groups)
    ]
    try:
        solution = adjust_robustly(
            x,
            groups,
            removable,
            outliers=OutlierSearch(
                points=[network.layout.columns(n) for n in network.places if n in network.layout.points],
                critical=settings.critical,
            ),
            free=np.array(network.layout.free),
            names=network.layout.names,
        ).require_converged()
    except (EstimationError, InputError):
        return placed
    foreign = {
        int(k)
        for fit, (_, part) in zip(solution.fits, pairs, strict=False)
        for k in part.electronics.shots[~fit.active & (np.abs(fit.estimated_error) > FOREIGN)].tolist()
    }
    cycles = cycles.without(foreign)
    starts, moved, typed = {}, {}, places_of(campaign)
    for name, place in network.places.items():
        if place.typed:
            columns = network.layout.columns(name)
            starts[name] = solution.x[columns]
            off = solution.x[columns] - place.start
            covariance = solution.q.within(columns) + typed[name].u_typed(settings.u_position) ** 2 * np.eye(3)
            if float(off @ np.linalg.solve(covariance, off)) > DEPARTED:
                moved[name] = float(np.linalg.norm(off))
    return replace(
        placed,
        campaign=uncertain(campaign, moved),
        phases=replace(phases, cycles=cycles.cycles_of_shots(count)),
        frequencies=cycles,
        starts=starts,
        moved=moved,
    )


def uncertain(campaign: ObservedSite, u: Mapping[str, float]) -> ObservedSite:
    """Campaign whose typed positions of some points have other standard uncertainties, m; triplets as wholes."""
    targets = {n: _with_u(t, u[n]) if n in u else t for n, t in campaign.targets.items()}
    triplets = {
        n: _with_u(t, max(u[part] for part in t.targets if part in u)) if set(t.targets) & u.keys() else t
        for n, t in campaign.triplets.items()
    }
    rangers = tuple(_with_u(r, u[r.name]) if r.name in u else r for r in campaign.feedarm.ranger)
    feedarm = campaign.feedarm.model_copy(update={"ranger": rangers})
    return replace(campaign, targets=targets, triplets=triplets, feedarm=feedarm)


def _with_u(record: R, u: float) -> R:
    return record.model_copy(update={"u_position_mm": u / MILLIMETRE})
