"""Main recipe: a campaign's samples to coordinates, pose and surface."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from catseye.aliases import Progress
from catseye.processors import one_thread
from catseye.records.night.campaign import REFERENCE, Campaign
from catseye.records.site.validity import expired_of_site
from catseye.reduction.detection.distortion import distortion_notes
from catseye.reduction.epoch.coordinates import AdjustedCoordinates, adjust_coordinates
from catseye.reduction.epoch.dew import dew_risk
from catseye.reduction.epoch.motion.posture_by_ranges import posture_by_ranges
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases, follow_electronics, measure_phases, walk_notes
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.surface import DishFit, fit_surface, surface_doubts, surface_notes
from catseye.reduction.epoch.telescope_track import at_middle_posture
from catseye.reduction.epoch.verdict import campaign_verdict
from catseye.reduction.site.places import sheet_notes
from catseye.reduction.site.plausible.campaign import plausible_campaign, refuse_fatal
from catseye.reduction.site.plausible.gain import implausible_gains
from catseye.reduction.site.plausible.record import ImplausibleRecord
from catseye.reduction.structure.site_bending import displaced_site
from catseye.reduction.structure.third_order import MeasuredPoints, ThirdOrder, third_order
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Reduction:
    """Result of reducing a campaign.

    no_surface   reason that there is no surface; "" with one
    status       of each shot, in the campaign's order
    rejected     shot id: reason; reference shots included
    notes        for the user, one line each
    implausible  records that no site has; what they state was left out, as their notes say
    third_order  measured places less the structural model's; None without a model, or with no point of the telescope
    """

    campaign: Campaign
    settings: ReductionSettings
    phases: Phases
    electronics: dict[str, ElectronicsPhase]
    coordinates: AdjustedCoordinates
    surface: DishFit | None
    no_surface: str
    status: tuple[ShotStatus, ...]
    rejected: dict[int, Reason]
    notes: tuple[str, ...]
    implausible: tuple[ImplausibleRecord, ...] = ()
    third_order: ThirdOrder | None = None

    @property
    def verdict(self) -> Verdict:
        """Verdict from records, scatter against the claim, and rejected shots.

        Also from the exported campaign's verdict.
        """
        verdict = campaign_verdict(self.campaign, self.coordinates, self.status, len(self.rejected))
        if self.implausible and verdict.word != "failed":
            return Verdict("doubtful", self.implausible[0].note)
        return verdict

    def held(self) -> "Reduction":
        """Reduction with its point covariance cached.

        Files and report use that covariance most.
        """
        return replace(self, coordinates=replace(self.coordinates, joint=self.coordinates.joint.held()))


def reduce_epoch(
    campaign: Campaign,
    settings: ReductionSettings | None = None,
    progress: Progress | None = None,
    *,
    adjusted: Callable[..., AdjustedCoordinates] = adjust_coordinates,
) -> Reduction:
    """Coordinates, pose and surface of one campaign.

    During a campaign nothing moves, or the telescope moves by its postures. With a structural model the typed places
    are displaced by it first, so that the adjustment begins where the bent telescope has them.

    campaign   from `read_campaign`
    settings   assumptions beyond the records (default: those of the layout)
    progress   called with (task, number done, total)
    adjusted   `adjust_coordinates`, or another function that does the same and more

    Raises InputError where a record is implausible and nothing else gives its quantity, or where nothing can be
    adjusted, and EstimationError where the adjustment finds no answer.
    """
    settings = settings or ReductionSettings()
    typed = at_middle_posture(campaign)
    campaign, implausible = plausible_campaign(displaced_site(typed))
    phases = measure_phases(campaign, settings, progress)
    clipped = np.array([reason is not None and reason.status is ShotStatus.CLIPPED for reason in phases.reason])
    implausible = (*implausible, *implausible_gains(campaign, clipped, phases.largest))
    refuse_fatal(implausible)
    with one_thread():
        electronics, wrong = follow_electronics(campaign, phases, settings.dense_shots)
        refuse_fatal(posture_by_ranges(campaign, phases, electronics))
        coordinates = adjusted(campaign, phases, electronics, settings=settings, progress=progress)
        surface, missing = fit_surface(campaign, coordinates, u_surface=settings.u_surface)
        coordinates = replace(coordinates, doubts=(*coordinates.doubts, *surface_doubts(surface)))
        remainder = _third_order(typed, coordinates, settings)
    reasons = {k: reason for k, reason in enumerate(phases.reason) if reason} | wrong | coordinates.unresolved
    ranges = coordinates.ranges
    for row, k in enumerate(ranges.shot):
        if not ranges.used[row]:
            reasons[int(k)] = _misfit(coordinates, row, settings)
    status = tuple(
        reasons[k].status if k in reasons else ShotStatus.REFERENCE if target == REFERENCE else ShotStatus.USED
        for k, target in enumerate(campaign.shots.target)
    )
    notes = [
        *(record.note for record in implausible),
        *campaign.doubt_notes,
        *coordinates.notes,
        *sheet_notes(campaign),
        *expired_of_site(campaign),
        *_weak_rangers(campaign, phases),
        *walk_notes(campaign, phases, wrong),
        *distortion_notes(
            campaign.shots.ranger,
            phases.relative_harmonics,
            phases.distorted,
            shot=campaign.shots.shot,
            samples_per_cycle=campaign.shots.samples_per_cycle,
        ),
        *dew_risk(campaign, surface_minus_air_c=settings.surface_minus_air_c).notes,
        *([missing] if missing else []),
        *surface_notes(surface),
        *surface_doubts(surface),
    ]
    return Reduction(
        campaign=campaign,
        settings=settings,
        phases=phases,
        electronics=electronics,
        coordinates=coordinates,
        surface=surface,
        no_surface=missing,
        status=status,
        rejected={int(campaign.shots.shot[k]): reasons[k] for k in sorted(reasons)},
        notes=tuple(notes),
        implausible=implausible,
        third_order=remainder,
    )


def _third_order(typed: Campaign, coordinates: AdjustedCoordinates, settings: ReductionSettings) -> ThirdOrder | None:
    """Measured places of the telescope's tracked points less the structural model's; None without a model."""
    if typed.structure is None:
        return None
    chosen = tuple(n for n in coordinates.points if not (n in typed.targets and typed.targets[n].shapes_dish))
    at = coordinates.rows(chosen)
    return third_order(typed, MeasuredPoints(chosen, coordinates.x[at], coordinates.block(chosen)), settings.u_position)


def _misfit(coordinates: AdjustedCoordinates, row: int, settings: ReductionSettings) -> Reason:
    ranges = coordinates.ranges
    error, w = ranges.residual[row], ranges.standardised[row]
    if abs(w) <= settings.critical:
        conflict = f"this shot and another on {ranges.target[row]} contradict each other"
        return Reason(ShotStatus.UNDECIDED, f"{conflict}, and nothing decides which is wrong; both are left out")
    text = (
        f"range {abs(error) * 1e3:.3f} mm too {'long' if error > 0 else 'short'} "
        f"for the adjusted points (w {w:.1f}, limit {settings.critical}): stray reflection"
    )
    return Reason(ShotStatus.REFLECTED, text)


def _weak_rangers(campaign: Campaign, phases: Phases) -> list[str]:
    """Rangers whose returns are much weaker than the others'."""
    usual: dict[str, float] = {}
    amplitude = phases.amplitude
    for name in campaign.rangers:
        lit = sorted(
            float(amplitude[k])
            for k, (ranger, target) in enumerate(zip(campaign.shots.ranger, campaign.shots.target, strict=True))
            if ranger == name and target != REFERENCE and not phases.reason[k]
        )
        if lit:
            usual[name] = lit[len(lit) // 2]
    if len(usual) < 3:
        return []
    typical = sorted(usual.values())[len(usual) // 2]
    return [
        f"{name} is weak: usual return {value:.2f} V, {100 * value / typical:.0f} % of the others'"
        for name, value in usual.items()
        if value < typical / 2.5
    ]
