"""Explanation of one shot: budget, Monte Carlo, and the adjustment's result.

The budget is of its range before any adjustment.
"""

from dataclasses import dataclass, replace

import numpy as np

from catseye.aliases import Progress
from catseye.constants import MILLIMETRE, TWO_PI
from catseye.errors import EstimationError, InputError
from catseye.estimation.quality.propagation import STUDENT, Budget, Scattered, agreement, monte_carlo, propagate
from catseye.records.night.campaign import REFERENCE, Campaign
from catseye.records.site.mirror import Mirror
from catseye.reduction.budget.chain import drawing, measurement
from catseye.reduction.budget.inputs import Item, correlation_of, items_of
from catseye.reduction.budget.scene import Assumptions, ShotScene, scene_of
from catseye.reduction.epoch.coordinates import AdjustedCoordinates
from catseye.reduction.epoch.epoch import Reduction, reduce_epoch
from catseye.reduction.epoch.head import IMAGE, LASER
from catseye.reduction.epoch.ranges import Phases, follow_electronics, measure_phases
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.telescope_track import at_middle_posture, moved_ends
from catseye.reduction.site.places import RangedPoint, places_of
from catseye.signal.cycles.whole import CycleDecision, decision, unwrapped_length
from catseye.verdict import Verdict

LIKELY_SLIP = 1e-6  # probability of a wrong cycle count above which the range is doubtful
CHECKED = 0.05  # redundancy below which the other shots do not determine a target


@dataclass(frozen=True)
class AdjustedShot:
    """Result of the campaign's adjustment for one shot; lengths in metres.

    range_, u_range         by this shot with the estimated corrections; u without systematic parameters
    residual                that minus the adjusted distance
    standardised            test statistic of the residual
    redundancy              share of an error of this shot that shows in its residual
    distance, u_distance    between the adjusted points
    used                    True where the shot took part
    """

    range_: float
    u_range: float
    residual: float
    standardised: float
    redundancy: float
    distance: float
    u_distance: float
    used: bool


@dataclass(frozen=True, eq=False)
class Explanation:
    """Explanation of one shot.

    shot, ranger, target, mjd_utc   of the record
    status      its final status; NOT_ADJUSTED without an adjustment
    reason      reason that it was not used, None where it was
    phasor      V, the light, complex
    u_across    V, standard uncertainty of the quadrature across it, which turns its phase
    scene       its measurement; None without a range, and then so are the next five
    items       inputs of its range with units, slopes and sources
    budget      first order, metres
    cycles      whole cycles decided: margin (m, optical), probability of a slip
    coarse      source of the coarse length
    scattered   of the Monte Carlo; None without one
    adjusted    None without an adjustment
    references  of the ranger, (shot id, seconds after this shot, weight)
    notes       one line each
    """

    shot: int
    ranger: str
    target: str
    mjd_utc: float
    status: ShotStatus
    reason: Reason | None
    phasor: complex
    u_across: float
    scene: ShotScene | None = None
    items: tuple[Item, ...] = ()
    budget: Budget | None = None
    cycles: CycleDecision | None = None
    coarse: str = ""
    scattered: Scattered | None = None
    adjusted: AdjustedShot | None = None
    references: tuple[tuple[int, float, float], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Verdict on the shot's range from its own chain and the network."""
        if self.budget is None:
            if self.status == "reference":
                return Verdict("good", "a reference shot, which tracks the electronics and has no range")
            return Verdict("failed", f"no range: {self.reason or self.status}")
        if self.reason:
            return Verdict("doubtful", f"excluded from the adjustment: {self.reason}")
        if self.cycles is not None and float(self.cycles.slip_probability) > LIKELY_SLIP:
            chance = float(self.cycles.slip_probability)
            return Verdict("doubtful", f"the number of whole cycles is wrong with a probability of {chance:.1e}")
        if self.scattered is not None and agreement(self.budget, self.scattered, digits=1) is False:
            return Verdict("doubtful", "the budget differs from its Monte Carlo: use the Monte Carlo")
        if self.adjusted is None:
            return Verdict("doubtful", "there is no adjustment to check it")
        return Verdict("good", "used in the adjustment, which confirms it")


def explain_shot(
    campaign: Campaign,
    shot: int,
    *,
    settings: ReductionSettings | None = None,
    assumptions: Assumptions | None = None,
    draws: int = 0,
    seed: int = 1,
    reduction: Reduction | None = None,
    progress: Progress | None = None,
) -> Explanation:
    """Origin and uncertainty of a shot's range, before any adjustment.

    campaign     from `read_campaign`
    shot         id in shots.csv
    settings     assumptions of the reduction
    assumptions  uncertainties that no record states
    draws, seed  of the Monte Carlo; none for 0
    reduction    of this campaign with these settings, if available
    progress     called with (task, number done, total)

    The distance is scan point to reference point by this shot alone, zero and leakage by the sheet, air by the weather
    stations. The places of both ends only determine the air and the whole cycles: adjusted ones where the
    campaign can be reduced, those of the records otherwise.

    Raises InputError where there is no such shot.

    Source: [PARKER04] eqs. 5.12-5.19; [JCGM100] clause 5 and annex G; [JCGM101] clause 7.
    """
    settings, campaign = settings or ReductionSettings(), at_middle_posture(campaign)
    rows = np.flatnonzero(campaign.shots.shot == shot)
    if not len(rows):
        low, high = int(campaign.shots.shot.min()), int(campaign.shots.shot.max())
        raise InputError(f"shot {shot} is not in shots.csv (expected {low} to {high}, {len(campaign.shots)} shots)")
    row, notes = int(rows[0]), []
    try:
        reduction = reduction or reduce_epoch(campaign, settings, progress)
    except (InputError, EstimationError) as problem:
        notes.append(f"the campaign cannot be adjusted: {problem}")
    phases = reduction.phases if reduction else measure_phases(campaign, settings, progress)
    _, wrong = follow_electronics(campaign, phases)
    status, reason = _status(campaign, phases, wrong, row, reduction)
    partial = Explanation(
        shot=shot,
        ranger=campaign.shots.ranger[row],
        target=campaign.shots.target[row],
        mjd_utc=float(campaign.shots.mjd_utc[row]),
        status=status,
        reason=reason,
        phasor=complex(phases.phasor[row]),
        u_across=float(phases.u_across[row]),
        adjusted=_adjusted(reduction.coordinates, row) if reduction else None,
        notes=tuple(notes),
    )
    if campaign.shots.target[row] == REFERENCE or phases.reason[row] or status is ShotStatus.NO_REFERENCE:
        return partial
    ends, place = moved_ends(campaign, row, *_places(campaign, row, reduction))
    try:
        scene = scene_of(
            campaign, phases, wrong, row=row, ends=ends, place=place, settings=settings, assumptions=assumptions
        )
    except InputError as problem:
        return replace(partial, notes=(*partial.notes, str(problem)))
    return _budgeted(partial, scene, draws, seed, progress)


def budget_of(scene: ShotScene, items: tuple[Item, ...]) -> Budget:
    """First-order budget of a scene's range."""
    return propagate(
        [item.given for item in items],
        np.array([item.slope for item in items]),
        value=scene.range_,
        correlation=correlation_of(scene, items),
    )


def scatter_of(scene: ShotScene, items: tuple[Item, ...], draws: int, *, seed: int) -> Scattered:
    """Monte Carlo of a scene's range."""
    generator = np.random.default_rng(seed)
    scattered = monte_carlo(measurement(scene, items), drawing(scene, items), draws=draws, generator=generator)
    spreadless = any(i.given.distribution == STUDENT and i.given.degrees_of_freedom <= 2.0 for i in items)
    return replace(scattered, u=float("nan")) if spreadless else scattered  # such a t has no variance, only an interval


def _budgeted(partial: Explanation, scene: ShotScene, draws: int, seed: int, progress: Progress | None) -> Explanation:
    items = items_of(scene)
    budget = budget_of(scene, items)
    if progress is not None and draws:
        progress("Monte Carlo", 0, draws)
    cycles, coarse = _cycles(scene, partial.adjusted, items)
    shots, references = scene.campaign.shots, scene.references
    neighbours = zip(references.shots, references.seconds - scene.seconds, references.weight, strict=True)
    return replace(
        partial,
        scene=scene,
        items=items,
        budget=budget,
        cycles=cycles,
        coarse=coarse,
        scattered=scatter_of(scene, items, draws, seed=seed) if draws else None,
        notes=(*partial.notes, *_missing_effects(scene.mirror, partial.ranger in scene.campaign.monuments)),
        references=tuple((int(shots.shot[k]), float(after), float(weight)) for k, after, weight in neighbours),
    )


def _missing_effects(mirror: Mirror, has_mount: bool) -> list[str]:
    """Effects of the head without a value in its mirror sheet.

    The budget cannot include them.
    """
    effects = {
        "u_amplitude_to_phase_rad": "coupling of amplitude to phase",
        "u_cyclic_mm": "cyclic terms",
        "u_second_pass_per_volt": "light that the detector sends out again",
        "u_feedback_rad": LASER,
        "u_image_um": IMAGE,
        **({"u_axis_mm": "offsets of axes and beam"} if has_mount else {}),
    }
    missing = [effect for key, effect in effects.items() if getattr(mirror, key) is None]
    if not missing:
        return []
    return [f"not in this budget, missing in mirrors/{mirror.zp}.toml: {', '.join(missing)}"]


def _status(
    campaign: Campaign, phases: Phases, wrong: dict[int, Reason], row: int, reduction: Reduction | None
) -> tuple[ShotStatus, Reason | None]:
    if reduction:
        return reduction.status[row], reduction.rejected.get(int(campaign.shots.shot[row]))
    reason = phases.reason[row] or wrong.get(row)
    usual = ShotStatus.REFERENCE if campaign.shots.target[row] == REFERENCE else ShotStatus.NOT_ADJUSTED
    return reason.status if reason else usual, reason


def _places(
    campaign: Campaign, row: int, reduction: Reduction | None
) -> tuple[tuple[np.ndarray, np.ndarray], RangedPoint]:
    names = campaign.shots.ranger[row], campaign.shots.target[row]
    if reduction and set(names) <= set(reduction.coordinates.points):
        coordinates = reduction.coordinates
        a, b = (coordinates.x[coordinates.index(name)] for name in names)
        return (a, b), coordinates.places[names[1]]
    places = places_of(campaign)
    return (places[names[0]].start, places[names[1]].start), places[names[1]]


def _adjusted(coordinates: AdjustedCoordinates, row: int) -> AdjustedShot | None:
    ranges = coordinates.ranges
    at = np.flatnonzero(ranges.shot == row)
    if not len(at):
        return None
    k = int(at[0])
    names = [ranges.ranger[k], ranges.target[k]]
    if not set(names) <= set(coordinates.points):
        return None
    a, b = (coordinates.x[coordinates.index(name)] for name in names)
    distance = float(np.linalg.norm(b - a))
    direction = (b - a) / distance
    derivative = np.concatenate([-direction, direction])
    return AdjustedShot(
        range_=float(ranges.range_[k]),
        u_range=float(ranges.u_range[k]),
        residual=float(ranges.residual[k]),
        standardised=float(ranges.standardised[k]),
        redundancy=float(ranges.redundancy[k]),
        distance=distance,
        u_distance=float(np.sqrt(max(derivative @ coordinates.block(names) @ derivative, 0.0))),
        used=bool(ranges.used[k]),
    )


def _cycles(scene: ShotScene, adjusted: AdjustedShot | None, items: tuple[Item, ...]) -> tuple[CycleDecision, str]:
    """Decision on N, and the source of its coarse length.

    The distance by all other shots where they determine it, else the records' places.

    Leaving a shot out turns its residual r into r / redundancy and its u into u / root redundancy.
    """
    phases = [item.slope * item.given.u for item in items if item.unit == "rad" and item.key != "coupling"]
    u_length = float(np.sqrt(np.sum(np.square(phases))))
    u_phase = u_length * scene.index * TWO_PI / scene.half
    observed = float(unwrapped_length(scene.cycles, scene.phase, scene.half))
    if adjusted is not None and (not adjusted.used or adjusted.redundancy >= CHECKED):
        share = adjusted.redundancy if adjusted.used else 1.0
        misfit = adjusted.residual / share
        total = adjusted.u_range / np.sqrt(share)
        if not adjusted.used and adjusted.standardised:
            total = abs(adjusted.residual / adjusted.standardised)
        u_coarse = float(np.sqrt(max(total**2 - u_length**2, 0.0)))  # `decision` adds the phase's own again
        coarse, source = observed - scene.index * misfit, "the adjusted points, this shot left out"
    else:
        coarse = observed - scene.index * (scene.range_ - float(np.linalg.norm(scene.a - scene.b)))
        u_coarse, source = _u_typed(scene), "the records' places"
    cycles = decision(coarse, scene.phase, scene.half, u_coarse=scene.index * u_coarse, u_phase=u_phase)
    return cycles, source


def _u_typed(scene: ShotScene) -> float:
    """Standard uncertainty of the distance between the records' places, m."""
    total = 0.0
    places = places_of(scene.campaign)
    for name in (scene.ranger, scene.target):
        if places[name].typed:
            total += (places[name].u_start or scene.settings.u_position) ** 2
        elif name in scene.campaign.monuments:
            monument, mirror = scene.campaign.monuments[name], scene.campaign.mirror_of(name)
            u = np.array([monument.u_x_mm, monument.u_y_mm, monument.u_z_mm]) * MILLIMETRE
            total += float(np.sum((scene.towards * u) ** 2)) + (mirror.u_offset_mm * MILLIMETRE) ** 2
    return float(np.sqrt(total))
