"""One epoch of a living site: its shots, what was carried to it, one adjustment, and what is carried on.

The recipe is that of a campaign (`coordinates.settle_network`), with two differences: each shot finds its ends where
the telescope had carried them, and what earlier epochs know takes the place of the records' priors.
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
from catseye.reduction.epoch.cycles import Resolved, resolve_cycles, without_shots
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.ranges import Phases, follow_electronics
from catseye.reduction.epoch.reason import Reason
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import SettledNetwork, allowed, refuted_priors, settle_network
from catseye.reduction.epoch.unknowns import CampaignNetwork, build_network
from catseye.reduction.live.shots import PhasedShot
from catseye.reduction.live.state import Carried, from_ground, to_ground, with_unseen
from catseye.reduction.live.thermometers import SuspectedBias, biases_of, considering, pull_of
from catseye.reduction.site.motion import CarriedMotion, ground_from

SHARED_BY_AN_EPOCH = (
    ParameterKind.ELECTRONICS,
    ParameterKind.REPEATS,
    ParameterKind.BODY,
    ParameterKind.AIR,
    ParameterKind.RADIATION,
)
SETTLED = 2e-6  # m: an epoch is one of many; a micrometre more is a thousandth of what a round claims


@dataclass(frozen=True, eq=False)
class Epoch:
    """What an epoch's adjustment gave.

    rows          its shots, repeats joined
    coordinates   in the ground frame, at the epoch
    carried       all that lasts
    reasons       row of the shots: why it was left out
    biases        station: how its thermometer may be biased
    opened        stations whose thermometers' priors were left out
    pulls         parameter of the air: what is doubted of its prior over the prior's variance
    """

    rows: tuple[PhasedShot, ...]
    coordinates: AdjustedCoordinates
    carried: Carried
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
    """The shots and the weather of an epoch, at a site whose telescope stands as it stood then.

    rows      shots, in any order; times are those of the buffers' middles
    weather   readings of the stations that speak; the others are left out of the site
    azimuth, elevation, mjd   rad, of the epoch

    Raises InputError: no weather at all.
    """
    stations = tuple(s for s in site.site.weather_station if any(w.station == s.name for w in weather))
    if not stations:
        raise InputError("no weather station has spoken (expected at least one reading before an epoch is solved)")
    posture = site.site.campaign.model_copy(
        update={"azimuth_deg": azimuth / DEGREE % 360.0, "elevation_deg": elevation / DEGREE, "start_mjd_utc": mjd}
    )
    said = [w for w in weather if any(w.station == s.name for s in stations)]
    fields = {field.name: getattr(site, field.name) for field in dataclasses.fields(SiteFolder)}
    fields["site"] = site.site.model_copy(update={"campaign": posture, "weather_station": stations})
    return ObservedSite(
        **fields,
        weather=Weather(
            np.array([w.ticks / TICKS_PER_DAY for w in said]),
            tuple(w.station for w in said),
            np.array([w.temperature_c for w in said]),
            np.array([w.pressure_hpa for w in said]),
            np.array([w.humidity_percent for w in said]),
        ),
        shots=ShotColumns(
            np.array([r.shot.number for r in rows], dtype=np.int64),
            np.array([r.mjd for r in rows]),
            tuple(r.shot.ranger for r in rows),
            tuple(r.shot.target for r in rows),
            np.array([r.shot.cycles for r in rows], dtype=np.int64),
            np.array([r.shot.samples_per_cycle for r in rows], dtype=np.int64),
            np.arange(len(rows)),
        ),
    )


def solve_epoch(
    observed: ObservedSite,
    rows: Sequence[PhasedShot],
    motion: CarriedMotion,
    *,
    settings: ReductionSettings,
    carried: Carried | None,
    lasting: Sequence[str],
    ticks: int,
    opened: Collection[str] = (),
) -> Epoch:
    """Everything that the shots of an epoch and what was carried to it say.

    observed   the shots and the weather, see `observed_site`
    rows       the same shots with their phases
    motion     of the telescope, its epoch that of `ticks`
    settings   of the reduction
    carried    prior at this very instant, None for the first epoch
    lasting    rangers and targets that stay in the state
    ticks      the epoch
    opened     stations whose thermometers' records pull the carried state no more

    Raises InputError where no shot can be used and EstimationError where the adjustment finds no answer.
    """
    phases = Phases.of([row.phase for row in rows])
    reasons = {k: reason for k, reason in enumerate(phases.reason) if reason}
    electronics, wrong = follow_electronics(observed, phases, settings.dense_shots)
    reasons |= wrong
    resolved = Resolved({}, {}, ())
    if carried is None:
        resolved = resolve_cycles(build_network(observed, phases, electronics, settings=settings, motion=motion))
        electronics = without_shots(electronics, set(resolved.rejected))
    known = () if carried is None else carried.points()

    def network_with(allowance: Allowance) -> CampaignNetwork:
        built = build_network(
            observed,
            phases,
            electronics,
            settings=settings,
            motion=motion,
            also=lasting,
            known=known,
            allowance=allowance,
        )
        return built if carried is None else _with_carried(built, carried, frames_at(built, motion))

    network = network_with(Allowance())
    if not network.rangers:
        raise InputError("no shot of this epoch can be used (expected a phase, a reference and a place for one)")
    settled = _judged(network, network_with, resolved.starts, predicted=carried is not None)
    refuted = frozenset(p.of for p in refuted_priors(settled) if p.kind is ParameterKind.THERMOMETER)
    biases = biases_of(settled.network.field, settled.solution, settled.network.layout.air)
    settled = _claiming(settled, biases, opened=opened, refuted=refuted)
    network, frames = settled.network, frames_at(settled.network, motion)
    solution, coordinates = settled.solution, coordinates_of(settled, resolved=resolved)
    reasons |= resolved.rejected
    layout = network.layout
    lasts = np.array(
        [i for i, free in enumerate(layout.free) if free and _lasts(layout.parameters[i], lasting, observed.triplets)]
    )
    seen = from_ground(
        tuple(layout.parameters[i] for i in lasts),
        solution.x[lasts],
        solution.q.within(lasts),
        frames=frames,
        ticks=ticks,
        elevation=float(motion.track.at(motion.epoch)[1]),
    )
    return Epoch(
        tuple(rows),
        coordinates,
        seen if carried is None else with_unseen(carried, seen),
        reasons,
        biases,
        refuted,
        pull_of(network.allowance, network.field),
    )


def _judged(
    network: CampaignNetwork,
    network_with: Callable[[Allowance], CampaignNetwork],
    starts: Mapping[str, np.ndarray],
    *,
    predicted: bool,
) -> SettledNetwork:
    """The adjustment, its explanations judged; once more where something has to be allowed for.

    Once: what a second adjustment would ask for, the next epoch asks for again. Doubts of the stations are told and
    claimed (`_claiming`), and not taken in: an epoch hardly knows a gradient, and what was carried on knows their
    offsets from hours.
    """
    settled = settle_network(network, starts, keep=SETTLED, predicted=predicted)
    told = allowed(settled)
    asked = replace(told, thermometers={}, profile=0.0)
    if not asked.same(settled.network.allowance):
        network = network_with(asked).with_strength(settled.network.strength)
        settled = settle_network(network, starts, keep=SETTLED, predicted=predicted)
    return settled._replace(network=replace(settled.network, allowance=replace(asked, profile=told.profile)))


def _claiming(
    settled: SettledNetwork, biases: Mapping[str, SuspectedBias], *, opened: Collection[str], refuted: Collection[str]
) -> SettledNetwork:
    """An adjustment whose claims take in what is suspected of the thermometers; the refuted are told already."""
    network = settled.network
    allowance = considering(network.allowance, biases, network.field, opened=opened, refuted=refuted)
    return settled._replace(network=replace(network, allowance=allowance))


def frames_at(network: CampaignNetwork, motion: CarriedMotion) -> dict[str, Transform]:
    """Ground from the frame of each moving point of a network, at the epoch."""
    return {n: t for n, t in frames_of_points(motion, list(network.places)).items() if n in network.layout.points}


def frames_of_points(motion: CarriedMotion, names: Sequence[str]) -> dict[str, Transform]:
    """Ground from the frame of each of some points that move, at the motion's epoch."""
    azimuth, elevation = motion.track.at(motion.epoch)
    kinds = {f: ground_from(motion.site, f, azimuth, elevation).single for f in ("alidade", "reflector")}
    return {name: kinds[motion.frames[name]] for name in names if motion.frames.get(name) in kinds}


def _lasts(parameter: Parameter, lasting: Sequence[str], triplets: Mapping[str, TripletRecord]) -> bool:
    """Whether a parameter is one of something that stays: the air, a ranger's, a lasting point's.

    Errors that an epoch's shots share do not, nor by how much a body's table is off: its points that last say it.
    """
    kind, of, part = parameter
    if kind in SHARED_BY_AN_EPOCH:
        return False
    if kind in (ParameterKind.POINT, ParameterKind.GLASS):
        return of in lasting
    if kind is ParameterKind.PATH:
        return of in lasting and part in lasting
    if kind is ParameterKind.NORMAL:
        return any(n in lasting for n in (triplets[of].targets if of in triplets else [of]))
    return True


def _with_carried(network: CampaignNetwork, carried: Carried, frames: Mapping[str, Transform]) -> CampaignNetwork:
    """The network that begins at the carried state and has it instead of the priors that it took in already."""
    x, covariance = to_ground(carried, frames)
    at = {parameter: i for i, parameter in enumerate(network.layout.parameters)}
    shared = [i for i, parameter in enumerate(carried.parameters) if parameter in at]
    columns = np.array([at[carried.parameters[i]] for i in shared])
    prior = Linear("carried on", x[shared], covariance[np.ix_(shared, shared)], columns, np.eye(len(shared)))
    known = set(columns.tolist()) | {i for i, free in enumerate(network.layout.free) if not free}
    left = [g for g in (_without_known(group, known) for group in network.priors) if g is not None]
    start = np.array(network.layout.start)
    start[columns] = x[shared]
    return replace(network, layout=replace(network.layout, start=start.tolist()), priors=[prior, *left])


def _without_known(group: ObservationGroup, known: set[int]) -> ObservationGroup | None:
    """A prior without what the carried state has taken in already: rows all of whose parameters are known."""
    columns = np.asarray(group.columns)
    if columns.ndim == 2:  # a row its own: distances between carried points, priors of single parameters
        new = np.array([not set(row[row >= 0].tolist()) <= known for row in columns])
        if not isinstance(group, Linear) or group.covariance.ndim != 1 or new.all() or not new.any():
            return group if new.any() else None
        return Linear(group.name, group.observed[new], group.covariance[new], columns[new], group.matrix[new])
    if set(columns.tolist()) <= known:
        return None
    if not isinstance(group, Linear) or group.matrix.shape != (len(columns), len(columns)):
        return group
    new = np.array([int(c) not in known for c in columns])
    if new.all() or np.count_nonzero(group.matrix - np.diag(np.diag(group.matrix))):
        return group
    if group.covariance.ndim != 1:
        raise EstimationError(f"{group.name}: a prior of some carried parameters and some new is not independent")
    return Linear(group.name, group.observed[new], group.covariance[new], columns[new], group.matrix[np.ix_(new, new)])
