"""Solve one epoch of a live site from shots and state.

The recipe is a campaign's (`coordinates.iterate_adjustment`), with two differences: each shot's ends are where the
telescope was at that shot, and the state of earlier epochs replaces the records' priors.
"""

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import EstimationError, InputError
from catseye.estimation.observations.kinds import Linear, ObservationGroup
from catseye.geometry.frames.frame import Transform
from catseye.records.night.campaign import ObservedSite
from catseye.records.night.live import TICKS_PER_DAY, LiveWeather
from catseye.records.night.shot import ShotColumns
from catseye.records.night.weather import Weather
from catseye.records.site.folder import SiteFolder
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.epoch.allowance import Allowance
from catseye.reduction.epoch.coordinates import AdjustedCoordinates, coordinates_of
from catseye.reduction.epoch.lines.cycles import Resolved, resolve_cycles, without_shots
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.ranges import Phases, follow_electronics
from catseye.reduction.epoch.reason import Reason
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import SettledNetwork, allowed, iterate_adjustment
from catseye.reduction.epoch.unknowns import CampaignNetwork, build_network
from catseye.reduction.live.shots import PhasedShot
from catseye.reduction.live.state import Carried, from_ground, to_ground, update_correlated
from catseye.reduction.live.thermometers import SuspectedBias, biases_of, prior_pulls, with_suspected_biases
from catseye.reduction.site.motion import GROUND, TelescopeCarrier

SHARED_BY_AN_EPOCH = (
    ParameterKind.RECORD,
    ParameterKind.ELECTRONICS,
    ParameterKind.REPEATS,
    ParameterKind.BODY,
    ParameterKind.AIR,
    ParameterKind.RADIATION,
)
SETTLED = 2e-6  # m: an epoch is one of many; a micrometre more is a thousandth of a round's u


@dataclass(frozen=True, eq=False)
class Epoch:
    """Result of an epoch's adjustment.

    rows          its shots, repeats joined
    coordinates   in the ground frame, at the epoch
    state         parameters that persist
    reasons       row of the shots: why it was rejected
    biases        station: suspected bias of its thermometer
    opened        stations whose thermometers' priors were dropped
    pulls         parameter of the air: possible error of its prior over the prior's variance
    """

    rows: tuple[PhasedShot, ...]
    coordinates: AdjustedCoordinates
    state: Carried
    reasons: dict[int, Reason]
    biases: dict[str, SuspectedBias] = field(default_factory=dict)
    opened: frozenset[str] = frozenset()
    pulls: dict[Parameter, float] = field(default_factory=dict)


def observed_site(
    site: SiteFolder,
    rows: Sequence[PhasedShot],
    weather: Sequence[LiveWeather],
    *,
    azimuth: float,
    elevation: float,
    mjd: float,
) -> ObservedSite:
    """Shots and weather of an epoch, with the telescope's position.

    rows      shots, in any order; times are those of the buffers' middles
    weather   readings of the stations in use; the others are removed from the site
    azimuth, elevation, mjd   rad, of the epoch

    Raises InputError if there is no weather at all.
    """
    stations = tuple(s for s in site.site.weather_station if any(w.station == s.name for w in weather))
    if not stations:
        raise InputError("no weather reading received (expected at least one before an epoch is solved)")
    posture = site.site.campaign.model_copy(
        update={"azimuth_deg": azimuth / DEGREE % 360.0, "elevation_deg": elevation / DEGREE, "start_mjd_utc": mjd}
    )
    readings = [w for w in weather if any(w.station == s.name for s in stations)]
    fields = {field.name: getattr(site, field.name) for field in dataclasses.fields(SiteFolder)}
    fields["site"] = site.site.model_copy(update={"campaign": posture, "weather_station": stations})
    return ObservedSite(
        **fields,
        weather=Weather(
            np.array([w.ticks / TICKS_PER_DAY for w in readings]),
            tuple(w.station for w in readings),
            np.array([w.temperature_c for w in readings]),
            np.array([w.pressure_hpa for w in readings]),
            np.array([w.humidity_percent for w in readings]),
        ),
        shots=ShotColumns(
            shot=np.array([r.shot.number for r in rows], dtype=np.int64),
            mjd_utc=np.array([r.mjd for r in rows]),
            ranger=tuple(r.shot.ranger for r in rows),
            target=tuple(r.shot.target for r in rows),
            cycles=np.array([r.shot.cycles for r in rows], dtype=np.int64),
            samples_per_cycle=np.array([r.shot.samples_per_cycle for r in rows], dtype=np.int64),
            frame=np.arange(len(rows)),
        ),
    )


def solve_epoch(
    observed: ObservedSite,
    rows: Sequence[PhasedShot],
    motion: TelescopeCarrier,
    *,
    settings: ReductionSettings,
    state: Carried | None,
    tracked: Sequence[str],
    ticks: int,
    opened: Collection[str] = (),
) -> Epoch:
    """Solve an epoch from its shots and the predicted state.

    observed   the shots and the weather, see `observed_site`
    rows       the same shots with their phases
    motion     of the telescope, its epoch that of `ticks`
    settings   of the reduction
    state      prior at this instant, None for the first epoch
    tracked    rangers and targets that stay in the state
    ticks      the epoch
    opened     stations whose thermometer priors no longer affect the state

    Raises InputError if no shot can be used and EstimationError if the adjustment does not converge.
    """
    phases = Phases.of([row.phase for row in rows])
    reasons = {k: reason for k, reason in enumerate(phases.reason) if reason}
    electronics, wrong = follow_electronics(observed, phases, settings.dense_shots)
    reasons |= wrong
    resolved = Resolved({}, {}, ())
    if state is None:
        resolved = resolve_cycles(build_network(observed, phases, electronics, settings=settings, motion=motion))
        electronics = without_shots(electronics, set(resolved.rejected))
    state_points = () if state is None else state.points()

    def network_with(allowance: Allowance) -> CampaignNetwork:
        built = build_network(
            observed,
            phases,
            electronics,
            settings=settings,
            motion=motion,
            also=tracked,
            known=state_points,
            allowance=allowance,
        )
        return built if state is None else _with_state(built, state, frames_at(built, motion))

    network = network_with(Allowance())
    if not network.rangers:
        raise InputError("no usable shot in this epoch (expected a phase, a reference and a position for at least one)")
    settled = _judged(network, network_with, resolved.starts, predicted=state is not None)
    refuted = frozenset(p.of for p in settled.network.allowance.refuted if p.kind is ParameterKind.THERMOMETER)
    biases = biases_of(settled.network.field, settled.solution, settled.network.layout.air)
    settled = _with_suspicions(settled, biases, opened=opened, refuted=refuted)
    network, frames = settled.network, frames_at(settled.network, motion)
    solution, coordinates = settled.solution, coordinates_of(settled, resolved=resolved, with_records=False)
    reasons |= resolved.rejected
    layout = network.layout
    lasts = np.array(
        [
            i
            for i, free in enumerate(layout.free)
            if free and _persists(layout.parameters[i], tracked, observed.triplets)
        ]
    )
    estimate = from_ground(
        tuple(layout.parameters[i] for i in lasts),
        solution.x[lasts],
        solution.q.within(lasts),
        frames=frames,
        ticks=ticks,
        elevation=float(motion.track.at(motion.epoch)[1]),
    )
    return Epoch(
        rows=tuple(rows),
        coordinates=coordinates,
        state=estimate if state is None else update_correlated(state, estimate),
        reasons=reasons,
        biases=biases,
        opened=refuted,
        pulls=prior_pulls(network.allowance, network.field),
    )


def _judged(
    network: CampaignNetwork,
    network_with: Callable[[Allowance], CampaignNetwork],
    starts: Mapping[str, np.ndarray],
    *,
    predicted: bool,
) -> SettledNetwork:
    """Adjust, check the explanations, repeat once if allowances are needed.

    Once only: the next epoch asks again for what a second adjustment would need. Suspected stations are reported and
    covered by the claims (`_with_suspicions`), but not estimated: an epoch hardly determines a gradient, and the state
    knows the stations' offsets from hours.
    """
    settled = iterate_adjustment(network, starts, keep=SETTLED, predicted=predicted)
    allowance = allowed(settled)
    requested = replace(allowance, thermometers={}, profile=0.0)
    if not requested.same(settled.network.allowance):
        network = network_with(requested).with_strength(settled.network.strength)
        settled = iterate_adjustment(network, starts, keep=SETTLED, predicted=predicted)
    return settled._replace(network=replace(settled.network, allowance=replace(requested, profile=allowance.profile)))


def _with_suspicions(
    settled: SettledNetwork, biases: Mapping[str, SuspectedBias], *, opened: Collection[str], refuted: Collection[str]
) -> SettledNetwork:
    """The adjustment with claims covering suspected but not refuted thermometers."""
    network = settled.network
    allowance = with_suspected_biases(network.allowance, biases, network.field, opened=opened, refuted=refuted)
    return settled._replace(network=replace(network, allowance=allowance))


def frames_at(network: CampaignNetwork, motion: TelescopeCarrier) -> dict[str, Transform]:
    """Ground from the frame of each moving network point."""
    return {n: t for n, t in frames_of_points(motion, list(network.places)).items() if n in network.layout.points}


def frames_of_points(motion: TelescopeCarrier, names: Sequence[str]) -> dict[str, Transform]:
    """Ground from the frame of each moving point."""
    azimuth, elevation = motion.track.at(motion.epoch)
    moving = [name for name in names if motion.frames.get(name, GROUND) != GROUND]
    one_of = {motion.body(name): name for name in moving}
    bodies = {body: motion.ground_from(name, azimuth, elevation).single for body, name in one_of.items()}
    return {name: bodies[motion.body(name)] for name in moving}


def _persists(parameter: Parameter, tracked: Sequence[str], triplets: Mapping[str, TripletRecord]) -> bool:
    """True for parameters of the air, a ranger, a tracked point.

    Errors shared by an epoch's shots do not persist, nor does a body's table offset: its tracked points hold it.
    """
    kind, of, part = parameter
    if kind in SHARED_BY_AN_EPOCH:
        return False
    if kind in (ParameterKind.POINT, ParameterKind.GLASS):
        return of in tracked
    if kind is ParameterKind.PATH:
        return of in tracked and part in tracked
    if kind is ParameterKind.NORMAL:
        return any(n in tracked for n in (triplets[of].targets if of in triplets else [of]))
    return True


def _with_state(network: CampaignNetwork, state: Carried, frames: Mapping[str, Transform]) -> CampaignNetwork:
    """The network with the state in place of its priors."""
    x, covariance = to_ground(state, frames)
    at = {parameter: i for i, parameter in enumerate(network.layout.parameters)}
    shared = [i for i, parameter in enumerate(state.parameters) if parameter in at]
    columns = np.array([at[state.parameters[i]] for i in shared])
    prior = Linear("predicted state", x[shared], covariance[np.ix_(shared, shared)], columns, np.eye(len(shared)))
    present = set(columns.tolist()) | {i for i, free in enumerate(network.layout.free) if not free}
    priors = [g for g in (_without_present(group, present) for group in network.priors) if g is not None]
    start = np.array(network.layout.start)
    start[columns] = x[shared]
    return replace(network, layout=replace(network.layout, start=start.tolist()), priors=[prior, *priors])


def _without_present(group: ObservationGroup, present: set[int]) -> ObservationGroup | None:
    """A prior without rows that the state already contains."""
    columns = np.asarray(group.columns)
    if columns.ndim == 2:  # parameters per row: distances between points, priors of single parameters
        new = np.array([not set(row[row >= 0].tolist()) <= present for row in columns])
        if not isinstance(group, Linear) or group.covariance.ndim != 1 or new.all() or not new.any():
            return group if new.any() else None
        return Linear(group.name, group.observed[new], group.covariance[new], columns[new], group.matrix[new])
    if set(columns.tolist()) <= present:
        return None
    if not isinstance(group, Linear) or group.matrix.shape != (len(columns), len(columns)):
        return group
    new = np.array([int(c) not in present for c in columns])
    if new.all() or np.count_nonzero(group.matrix - np.diag(np.diag(group.matrix))):
        return group
    if group.covariance.ndim != 1:
        raise EstimationError(f"{group.name}: a correlated prior mixes parameters of the state with new ones")
    return Linear(group.name, group.observed[new], group.covariance[new], columns[new], group.matrix[np.ix_(new, new)])
