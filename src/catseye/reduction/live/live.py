"""Live reduction: weather, postures and shots to a solution per epoch.

With a structural model the site's telescope bends: places in the state are those at rest, poses what remains beyond
the model. It uses no clock, network or file, and its answers depend on its input alone: a journal replayed in order
gives the same answers bit for bit.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from statistics import median
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from catseye.aliases import Array
from catseye.constants import DEGREE, MILLIMETRE, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import CatseyeError
from catseye.geometry.frames.frame import Transforms
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.records.site.target import FeedArmRanger, TargetRow
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.epoch.contradictions.contradiction import Contradiction, RecordGroup
from catseye.reduction.epoch.notes import contradiction_text
from catseye.reduction.epoch.parameter import GRADIENT, POINT_KINDS, Parameter, ParameterKind
from catseye.reduction.epoch.ranges import MRAD_PER_ROOT_HOUR
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.live.changes import LiveChange, placed, without_points, without_velocities
from catseye.reduction.live.epoch import Epoch, frames_of_points, observed_site, solve_epoch
from catseye.reduction.live.jitter import Jitter
from catseye.reduction.live.pose import LivePose, live_pose
from catseye.reduction.live.ranges import RangeColumns, range_columns
from catseye.reduction.live.repeats import joined_repeats
from catseye.reduction.live.shots import PhasedShot, RangerHistory, ShotAnswer, SolvedLine, answer, phased
from catseye.reduction.live.state import (
    DEFAULT_NOISE,
    Carried,
    ProcessNoise,
    inflated,
    marginal,
    predict,
    with_reference,
    with_velocities,
)
from catseye.reduction.live.thermometers import SuspectedBias
from catseye.reduction.live.weather import BiasedPeriod, StationWatch
from catseye.reduction.site.bodies import bodies_of, tracked_names
from catseye.reduction.site.motion import (
    LONGEST_GAP,
    REFLECTOR,
    PostureTrack,
    TelescopeCarrier,
    bent_ground_from,
    carried_point,
    frames_of,
    ground_from,
)
from catseye.reduction.site.places import places_of
from catseye.reduction.structure.site_bending import RememberedBending, bending_of, displaced_site, refuse_narrow_model

Typed = TypeVar("Typed", TargetRow, TripletRecord, FeedArmRanger)  # records with a typed position
FIRST_INDEX = 1.00028  # group index before the first epoch, good to 5e-5: 6 mm at 120 m, enough for whole cycles


@dataclass(frozen=True)
class LiveSettings:
    """Settings of a live reduction.

    reduction        as for a campaign
    filter           motion model between epochs: "random_walk", or "constant_velocity" for each tracked telescope point
    loosening        process noise between epochs (a key of stored settings, hence the name)
    u_flexure_mm     u of each coordinate of a typed telescope point for flexure, added to the record's
    jitter_mm        body: distance of its points at a shot from their epoch mean: wind, vibration
    lasting_path     share of the standard deviation of a path's index that persists between epochs
    references_s     s before an epoch within which reference shots count
    reference_after  number of the epoch that becomes the reference epoch of poses
    bending_mm_per_degree   of a body's points for each degree that the telescope moves during an epoch
    """

    reduction: ReductionSettings = field(default_factory=ReductionSettings)
    filter: Literal["random_walk", "constant_velocity"] = "random_walk"
    loosening: ProcessNoise = DEFAULT_NOISE
    u_flexure_mm: float = 10.0
    jitter_mm: Mapping[str, float] = field(default_factory=lambda: {"arm": 0.2, "dish": 0.03, "alidade": 0.03})
    lasting_path: float = 0.7
    references_s: float = 1200.0
    reference_after: int = 2
    bending_mm_per_degree: Mapping[str, float] = field(
        default_factory=lambda: {"arm": 0.2, "dish": 0.05, "alidade": 0.05}
    )


@dataclass(frozen=True, eq=False)
class EpochAnswer:
    """Solution of an epoch.

    number        counted from 1
    ticks         its instant; positions are means over the epoch, predicted for that instant
    azimuth, elevation   rad, of the telescope at that instant
    names         of the points, sorted; monuments' fixed points are "ZY101-F"
    x             (n, 3) m, ground frame
    covariance    (3n, 3n) m^2
    shots         number of shots used at each point; joined repeats count once
    used          numbers of the shots used
    rejected      shot number: reason, for the epoch's other shots; references included
    variance_factor, degrees_of_freedom   of the shots and the predicted state
    refractivity_ppm   mean group refractivity of the paths
    air           name: estimate and u
    zeros         ranger: m, and u
    pose          of dish and feed since the reference epoch
    notes         for people
    jitter_mm     body: jitter assumed in this epoch
    doubts        reasons why the answer is doubtful, a sentence each; none of a good one
    biases        station: suspected bias of its thermometer; stations that are not used at all are absent
    returned      biased periods of stations, recognised since the last epoch as having ended
    ranges        columns of the epoch's ranges, see `range_columns`; journalled beside the answer
    reference     number of the epoch to which the pose refers; 0 before there is one
    """

    number: int
    ticks: int
    azimuth: float
    elevation: float
    names: tuple[str, ...]
    x: Array
    covariance: Array
    shots: tuple[int, ...]
    used: tuple[int, ...]
    rejected: dict[int, Reason]
    variance_factor: float
    degrees_of_freedom: float
    refractivity_ppm: float
    air: dict[str, tuple[float, float]]
    zeros: dict[str, tuple[float, float]]
    pose: LivePose | None
    notes: tuple[str, ...]
    jitter_mm: Mapping[str, float] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    biases: Mapping[str, SuspectedBias] = field(default_factory=dict)
    returned: tuple[BiasedPeriod, ...] = ()
    ranges: RangeColumns = field(default_factory=dict)
    reference: int = 0

    def point(self, name: str) -> tuple[Array, Array]:
        """Position (3,) m of a point, and covariance (3, 3).

        Raises KeyError for a point that is not in the epoch.
        """
        if name not in self.names:
            raise KeyError(name)
        k = 3 * self.names.index(name)
        return self.x[k // 3], self.covariance[k : k + 3, k : k + 3]


@dataclass(frozen=True, eq=False)
class EpochJob:
    """An epoch to be solved, possibly in another process."""

    rows: list[PhasedShot]
    weather: list[LiveWeather]
    motion: TelescopeCarrier
    places: dict[str, Array]
    index: float
    azimuth: float
    elevation: float
    state: Carried | None
    tracked: tuple[str, ...]
    ticks: int
    rules: ReductionSettings
    opened: frozenset[str] = frozenset()

    def solve(self) -> Epoch | str:
        """The epoch, or the reason why there is none."""
        with threadpool_limits(limits=1, user_api="blas"):
            try:
                site = self.motion.site
                rows = joined_repeats(self.rows, self._lengths, site.site.ranging.modulation_hz, index=self.index)
                observed = observed_site(
                    site, rows, self.weather, azimuth=self.azimuth, elevation=self.elevation, mjd=self.motion.epoch
                )
                return solve_epoch(
                    displaced_site(observed),
                    rows,
                    self.motion,
                    settings=self.rules,
                    state=self.state,
                    tracked=self.tracked,
                    ticks=self.ticks,
                    opened=self.opened,
                )
            except CatseyeError as problem:
                return str(problem)

    def _lengths(self, ranger: str, target: str, mjd: Array) -> Array:
        """Predicted distances, m; NaN where unknown."""
        if ranger not in self.places or target not in self.places:
            return np.full(len(mjd), np.nan)
        return self.motion.distances(ranger, target, self.places, mjd)


READINGS = {RecordGroup.THERMOMETERS, RecordGroup.SOUND, RecordGroup.PRESSURE, RecordGroup.HUMIDITY}


class Live:
    """A live site's reduction; see the module."""

    def __init__(self, site: SiteFolder, settings: LiveSettings | None = None):
        self.settings = settings or LiveSettings()
        self.site = self._recorded = _with_flexure(site, self.settings)
        self.frames = frames_of(site)
        bending = bending_of(site)
        self.bending = None if bending is None else RememberedBending(bending)
        if self.bending is not None:
            refuse_narrow_model(self.bending)
        self.bodies = bodies_of(site, self.frames)
        self.lasting = tracked_names(site)
        self.track = PostureTrack()
        self.stations = StationWatch.of(site)
        self._opened: frozenset[str] = frozenset()  # stations whose thermometer priors no longer affect the state
        self._pulls: dict[Parameter, float] = {}  # prior errors' effect in the last epoch
        self._contradicted: tuple[str, ...] = ()  # records of the site that an epoch contradicted: they stay wrong
        self._reported: set[BiasedPeriod] = set()
        self.jitter = Jitter(self.settings.jitter_mm)
        self.rangers = {name: RangerHistory() for name in site.rangers}
        self.state: Carried | None = None
        self.number = 0
        self.last_ticks = 0
        self.failed = ""  # reason why the last solve gave nothing
        self._pending: list[PhasedShot] = []
        self._lines: dict[tuple[str, str], SolvedLine] = {}
        self._local: dict[str, Array] = _local_places(self.site, self.frames)
        self._constants = {name: place.constant for name, place in places_of(self.site).items()}
        self._index = FIRST_INDEX
        self._moved: dict[str, tuple[float, float, float]] = {}  # mm, positions that replace the records'
        self.reference_number = 0  # epoch to which poses refer; 0 before there is one
        self._solving = False  # an epoch was begun and not accepted
        self._waiting: list[LiveChange] = []  # changes for its end

    # Input ---------------------------------------------------------------------------------------------

    def weather(self, read: LiveWeather) -> str:
        """Add one reading; return the reason for rejection, else ""."""
        return self.stations.add(read)

    def posture(self, read: LivePosture) -> None:
        """Add one posture of the telescope."""
        self.track.add(read)

    def shot(self, shot: LiveShot) -> ShotAnswer:
        """Add one shot; return its status and range."""
        history = self.rangers.get(shot.ranger)
        if history is None:
            return ShotAnswer.refused(Reason(ShotStatus.NO_RANGER, f"unknown ranger {shot.ranger}"), math.nan, math.nan)
        mirror, adc, rules = self.site.mirror_of(shot.ranger), self.site.site.adc, self.settings.reduction
        reference = shot.target == REFERENCE
        usual = history.usual[reference]
        modulation = self.site.site.ranging.modulation_hz
        distance, rate = (math.nan, 0.0) if reference else self._distance(shot)
        run = -2.0 * TWO_PI * modulation * self._index * rate / SPEED_OF_LIGHT / shot.if_hz
        row = phased(
            shot,
            mirror,
            adc,
            settings=rules,
            usual=median(usual) if usual else math.nan,
            run=run if abs(run) < 0.5 * math.pi else 0.0,
        )
        stamped = abs(run) * shot.if_hz * TICK_SECONDS / math.sqrt(12.0)  # rad: a stamp has steps of 0.864 ms
        u_across = math.hypot(row.phase.u_across, stamped * abs(row.phase.phasor))
        phase = replace(row.phase, u_across=u_across)
        row = replace(row, phase=phase, shot=replace(shot, samples=None))  # the epoch needs its phase alone
        result = answer(
            row,
            history,
            predicted=None if math.isnan(distance) else (lambda: distance),
            line=lambda: self._line(shot.ranger, shot.target),
            d0=mirror.d0_mm * MILLIMETRE,
            modulation_hz=modulation,
            walk=self.site.site.ranging.electronic_drift_mrad_per_sqrt_hour * MRAD_PER_ROOT_HOUR,
        )
        if result.status is ShotStatus.NO_PLACE:
            reason = Reason(ShotStatus.NO_PLACE, "no telescope position received")
            if shot.target not in self._local:
                reason = Reason(ShotStatus.NO_PLACE, f"the site has no target {shot.target}")
            result = ShotAnswer.refused(reason, result.amplitude, result.phase)
            row = row.left_out(reason)
        if result.status in (ShotStatus.USED, ShotStatus.REFERENCE):
            usual.append(result.amplitude)
        if result.status is ShotStatus.REFERENCE:
            history.references.append(row)
        if not reference or result.status is not ShotStatus.REFERENCE:
            self._pending.append(row)
        return result

    def clock_corrected(self, ticks: int) -> None:
        """Discard everything stamped after a clock was set back to `ticks`."""
        self.track.forget_after(ticks)
        self.stations.forget_after(ticks)
        self._pending = [row for row in self._pending if row.shot.ticks <= ticks]
        for history in self.rangers.values():
            references = [row for row in history.references if row.shot.ticks <= ticks]
            history.references.clear()
            history.references.extend(references)
        if self.state is not None and self.state.ticks > ticks:
            self.state = replace(self.state, ticks=ticks)

    def change(self, change: LiveChange) -> None:
        """Change the reduction: at once, or when the epoch that is being solved has been accepted.

        Raises InputError: a position for something that is not a target.
        """
        if change.positions_mm is not None:
            placed(self.site, self._recorded, change.positions_mm)
        self._waiting.append(change)
        if not self._solving:
            self._apply_changes()

    def place(self, name: str, mjd: ArrayLike) -> Array:
        """Predicted position (..., 3) m, ground frame, at times (...).

        Raises InputError if the point is on the telescope and no posture was received, KeyError for an unknown point.
        """
        local, frame = self._local[name], self.frames[name]
        times = np.asarray(mjd, dtype=float)
        if frame == "ground":
            return np.broadcast_to(local, (*times.shape, 3)).copy()
        return np.asarray(self._ground_from(name, *self.track.at(times)).points(local))

    def bent_frame(self, part: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
        """Transform to ground from the reflector frame as a part of it is bent, at postures (...), rad.

        part   "arm", whose rangers ride and turn with it, or "dish"; without a model the rigid telescope's
        """
        body = "" if self.bending is None else self.bending.frame_of(part)
        return bent_ground_from(self.site, REFLECTOR, body, azimuth, elevation, self.bending)

    def _ground_from(self, name: str, azimuth: ArrayLike, elevation: ArrayLike) -> Transforms:
        """Transform to ground from a point's frame, where it is at rest."""
        return bent_ground_from(self.site, self.frames[name], self._body(name), azimuth, elevation, self.bending)

    def _body(self, name: str) -> str:
        """Name shared by points that move as one."""
        return self.frames[name] if self.bending is None else self.bending.body(name)

    def uncertainty(self) -> dict[str, Array]:
        """Covariance (3, 3) m^2 of each point of the state.

        Ground axes, for points of the telescope at the latest posture.
        """
        if self.state is None:
            return {}
        latest = self.track.latest
        turns: dict[str, Array] = {}
        if latest is not None:
            for frame in ("alidade", "reflector"):
                turns[frame] = ground_from(self.site, frame, latest.azimuth, latest.elevation).single.rotation
        blocks = {}
        for i, parameter in enumerate(self.state.parameters):
            point = str(parameter._replace(part=""))
            if parameter.kind in POINT_KINDS and parameter.part == "x" and point in self._local:
                turn = turns.get(self.frames[point], np.eye(3))
                blocks[point] = turn @ self.state.covariance[i : i + 3, i : i + 3] @ turn.T
        return blocks

    # Solutions -------------------------------------------------------------------------------------------------

    def begin(self, ticks: int) -> "EpochJob | None":
        """Take all shots since the last epoch; None if unusable.

        ticks   the middle of the round, or its end: points are predicted for it

        `failed` says why there is no job. Shots stay for the next epoch if weather or posture is missing. Between
        `begin` and `accept` more shots may be added; they belong to the next epoch.
        """
        self._apply_changes()
        weather = self.stations.trusted_readings(ticks)
        self.failed = self._unready(weather)
        if self.failed:
            return None
        self._solving = True
        rows, self._pending = self._rows(ticks), []
        mjd = ticks / TICKS_PER_DAY
        azimuth, elevation = (float(v) for v in self.track.at(mjd))
        times = [r.mjd for r in rows if r.shot.target != REFERENCE]
        track = self.track.between(min([mjd, *times]), max([mjd, *times]))
        motion = TelescopeCarrier(
            site=self.site,
            track=track,
            frames=self.frames,
            epoch=mjd,
            bodies=self.bodies,
            jitter_mm=self._shaking(rows),
            lasting=self.settings.lasting_path,
            bending=None if self.bending is None else self.bending.bending,
        )
        names = {name for r in rows for name in (r.shot.ranger, r.shot.target)} & self._local.keys()
        places = {name: self._local[name] for name in sorted(names)}
        self._apply_suspicions(self.stations.moved(), trusted=frozenset(read.station for read in weather))
        state = self._predicted_state(ticks, elevation)
        return EpochJob(
            rows=rows,
            weather=weather,
            motion=motion,
            places=places,
            index=self._index,
            azimuth=azimuth,
            elevation=elevation,
            state=state,
            tracked=self.lasting,
            ticks=ticks,
            rules=self.settings.reduction,
            opened=self._opened,
        )

    def accept(self, job: "EpochJob", epoch: "Epoch | str") -> EpochAnswer | None:
        """Adopt the result of `job.solve()`; None if it failed, see `failed`."""
        try:
            if isinstance(epoch, str):
                self.failed = epoch
                return None
            return self._accept(epoch, job.motion, job.azimuth, job.elevation)
        finally:
            self._solving = False
            self._apply_changes()

    def solve(self, ticks: int) -> EpochAnswer | None:
        """Run `begin`, `EpochJob.solve` and `accept` in one call."""
        job = self.begin(ticks)
        return None if job is None else self.accept(job, job.solve())

    def set_reference(self) -> None:
        """Make the last epoch the reference epoch of poses."""
        if self.state is not None:
            self.state = with_reference(self.state, self._moving())
            self.reference_number = self.number

    # Inside ----------------------------------------------------------------------------------------------------------

    def _apply_changes(self) -> None:
        """Apply the changes that wait, in order."""
        waiting, self._waiting = self._waiting, []
        for change in waiting:
            rules = change.rules(self.settings.reduction)
            self.settings = replace(self.settings, reduction=rules, filter=change.filter or self.settings.filter)
            if self.settings.filter == "random_walk" and self.state is not None:
                self.state = without_velocities(self.state)
            if change.positions_mm is not None:
                self._move(dict(change.positions_mm))
            if change.reference:
                self.set_reference()

    def _move(self, positions_mm: dict[str, tuple[float, float, float]]) -> None:
        """Begin targets anew whose approximate position is another one now."""
        before, self._moved = self._moved, positions_mm
        names = [n for n in sorted({*before, *positions_mm}) if before.get(n) != positions_mm.get(n)]
        if not names:
            return
        self.site = placed(self.site, self._recorded, positions_mm)
        local = _local_places(self.site, self.frames)
        self._local |= {name: local[name] for name in names}
        self._lines = {line: solved for line, solved in self._lines.items() if line[1] not in names}
        if self.state is not None:
            self.state = without_points(self.state, names)

    def _accept(self, epoch: Epoch, motion: TelescopeCarrier, azimuth: float, elevation: float) -> EpochAnswer:
        coordinates = epoch.coordinates
        self.number += 1
        self.jitter.learn(coordinates.ranges, self.bodies)
        self.state, self.last_ticks = epoch.state, epoch.state.ticks
        self._suspect(epoch)
        self._remember(coordinates.contradictions)
        frames = frames_of_points(motion, coordinates.points)
        for name, x in zip(coordinates.points, coordinates.x, strict=True):
            self._local[name] = frames[name].inverse().points(x) if name in frames else np.array(x)
        ranges = coordinates.ranges
        self._index = 1.0 + coordinates.refractivity_ppm * 1e-6
        for k, (ranger, target) in enumerate(zip(ranges.ranger, ranges.target, strict=True)):
            added = -(ranges.glass[k] + ranges.obliquity[k] + ranges.zero[k] + ranges.head[k])
            d0 = self.site.mirror_of(ranger).d0_mm * MILLIMETRE
            self._lines[ranger, target] = SolvedLine(1.0 + float(ranges.refractivity[k]), float(added) - d0)
        if self.number == self.settings.reference_after:
            self.set_reference()
        pose = None
        if self.number >= self.settings.reference_after:
            pose = live_pose(inflated(self.state, epoch.pulls), self.bodies, self.site)
        rows = epoch.rows
        used = [n for k, on in zip(ranges.shot, ranges.used, strict=True) if on for n in rows[int(k)].numbers]
        why = dict(epoch.reasons)
        for row, on in enumerate(ranges.used):
            if not on:
                text = f"range {ranges.residual[row] * 1e3:+.3f} mm off, w {ranges.standardised[row]:.1f}"
                why[int(ranges.shot[row])] = Reason(ShotStatus.REFLECTED, text)
        rejected = {n: reason for k, reason in why.items() for n in rows[k].numbers}
        return EpochAnswer(
            number=self.number,
            ticks=self.last_ticks,
            azimuth=azimuth,
            elevation=elevation,
            names=coordinates.points,
            x=coordinates.x,
            covariance=coordinates.covariance,
            shots=tuple(int(n) for n in coordinates.shots),
            used=tuple(sorted(set(used))),
            rejected=dict(sorted(rejected.items())),
            variance_factor=coordinates.variance_factor,
            degrees_of_freedom=coordinates.degrees_of_freedom,
            refractivity_ppm=coordinates.refractivity_ppm,
            air=coordinates.air,
            zeros=coordinates.zeros,
            pose=pose,
            notes=(*coordinates.notes, *self.stations.notes()),
            jitter_mm=motion.jitter_mm,
            doubts=tuple(dict.fromkeys((*coordinates.doubts, *self._contradicted))),
            biases=epoch.biases,
            returned=self._returned(),
            ranges=range_columns(ranges, rows),
            reference=self.reference_number,
        )

    def _remember(self, contradictions: Sequence[Contradiction]) -> None:
        """Store contradictions with records of the site.

        The state knows better since, so that later epochs contradict nothing; readings may be right again.
        """
        lasting = [
            contradiction_text(c, self.site) for c in contradictions if not {e.group for e in c.explanations} & READINGS
        ]
        self._contradicted = tuple(dict.fromkeys((*self._contradicted, *lasting)))

    def _suspect(self, epoch: Epoch) -> None:
        """Store an epoch's suspicions about the thermometers.

        The state's covariance grows by the effect of a suspected prior where a suspicion ends unexplained, and once
        when the ranges determine an offset by which the record has biased the state so far.
        """
        named = {n for n, bias in epoch.biases.items() if bias.judgement == "biased"}
        pulled = {p: pull for p, pull in epoch.pulls.items() if p.of in named - self._opened - epoch.opened}
        over = {p: pull for p, pull in self._pulls.items() if p not in epoch.pulls and p.of not in self._opened}
        self.state = inflated(epoch.state, pulled | over)
        self._opened |= named | epoch.opened
        self._pulls = {p: pull for p, pull in epoch.pulls.items() if p not in pulled}
        self.stations.judged({n: (bias.offset_c, n in named) for n, bias in epoch.biases.items()})

    def _apply_suspicions(self, moved: frozenset[str], *, trusted: frozenset[str]) -> None:
        """Apply changes in the stations' suspicions to the state.

        moved   stations that read at another level: their offsets are removed
        trusted  stations in use now: for the others a suspicion is no longer updated
        """
        if self.state is None:
            return
        of = {Parameter(ParameterKind.THERMOMETER, name) for name in moved}
        unobserved = {p for p in self._pulls if p.kind is ParameterKind.THERMOMETER and p.of not in trusted}
        if not of and not unobserved:
            return
        applied = {
            p: v for p, v in self._pulls.items() if p in of | unobserved or p.kind is not ParameterKind.THERMOMETER
        }
        offsets = {p for p in self.state.parameters if p in of}
        self.state = marginal(inflated(self.state, applied), offsets)
        self._pulls = {p: pull for p, pull in self._pulls.items() if p not in applied}
        self._opened -= moved

    def _returned(self) -> tuple[BiasedPeriod, ...]:
        """Biased periods that have ended since the last call."""
        closed = {s for s in self.stations.stretches() if s.last is not None and math.isfinite(s.offset_c)}
        new, self._reported = closed - self._reported, closed
        return tuple(sorted(new, key=lambda stretch: (stretch.station, stretch.first)))

    def _unready(self, weather: Sequence[LiveWeather]) -> str:
        if not any(not r.reason for r in self._pending):
            self._pending = []
            return "no usable shot since the last epoch"
        if not len(self.track):
            return "no telescope position received"
        return "" if weather else "no weather reading received"

    def _rows(self, ticks: int) -> list[PhasedShot]:
        """Shots and earlier references by time; those without posture marked."""
        since = (ticks / TICKS_PER_DAY) - self.settings.references_s / SECONDS_PER_DAY
        references = [r for history in self.rangers.values() for r in history.references if r.mjd >= since]
        latest = [
            history.references[-1]
            for history in self.rangers.values()
            if history.references and history.references[-1].mjd < since
        ]
        rows = sorted([*self._pending, *references, *latest], key=lambda r: (r.mjd, r.shot.ranger, r.shot.number))
        moving = {name for name, frame in self.frames.items() if frame != "ground"}
        age = self.track.age(np.array([r.mjd for r in rows]))
        nearest, expected = "the nearest telescope position is", f"(expected within {LONGEST_GAP:g} s)"
        return [
            row.left_out(Reason(ShotStatus.NO_POSTURE, f"{nearest} {old:.1f} s away {expected}"))
            if not row.reason and old > LONGEST_GAP and {row.shot.ranger, row.shot.target} & moving
            else row
            for row, old in zip(rows, age, strict=True)
        ]

    def _shaking(self, rows: Sequence[PhasedShot]) -> dict[str, float]:
        """Jitter of each body, mm, with bending by the telescope's motion."""
        times = [r.mjd for r in rows if r.shot.target != REFERENCE]
        angles = self.track.at(np.array(times or [rows[-1].mjd]))
        moved = float(np.ptp(angles[1])) / DEGREE
        bent = {b: self.settings.bending_mm_per_degree.get(b, 0.0) * moved / math.sqrt(12.0) for b in self.jitter.mm}
        return {b: math.hypot(u, bent[b]) for b, u in self.jitter.mm.items()}

    def _predicted_state(self, ticks: int, elevation: float) -> Carried | None:
        if self.state is None:
            return None
        state = self.state
        if self.settings.filter == "constant_velocity":
            state = with_velocities(state, self._moving(), self.settings.loosening)
        seconds = (ticks - state.ticks) / TICKS_PER_DAY * SECONDS_PER_DAY
        rules = self.settings.reduction
        profile = rules.u_gradient_c_per_m if GRADIENT in state.parameters else rules.u_profile_c
        path = self.settings.lasting_path * self.site.site.ranging.path_index_fluctuation_ppm
        return predict(
            state,
            ticks,
            seconds,
            elevation=elevation,
            bodies=self.bodies,
            noise=self.settings.loosening,
            profile_sigma=profile,
            path_sigma_ppm=path,
        )

    def _moving(self) -> list[str]:
        points = self.state.points() if self.state is not None else {}
        return [n for n in self.lasting if n in self.bodies and n in points]

    def _distance(self, shot: LiveShot) -> tuple[float, float]:
        """Predicted distance, m, and rate, m/s, mid-buffer; NaN, 0 if unknown."""
        if shot.target not in self._local or (
            {self.frames[shot.ranger], self.frames[shot.target]} != {"ground"} and not len(self.track)
        ):
            return math.nan, 0.0
        if self._body(shot.ranger) == self._body(shot.target):
            return float(np.linalg.norm(self._local[shot.target] - self._local[shot.ranger])), 0.0
        half = 0.5 * shot.duration / SECONDS_PER_DAY
        ends = [self._bent_place(n, shot.middle_mjd) for n in (shot.ranger, shot.target)]
        first, middle, last = (self._length(shot, ends, shot.middle_mjd + dt) for dt in (-half, 0.0, half))
        return middle, (last - first) / shot.duration

    def _bent_place(self, name: str, mjd: float) -> Array:
        """Place (3,) m in its frame as the telescope is bent in the middle of a buffer.

        During it the bending changes by 0.03 mm at most: 0.3 m/rad at 0.01 rad/s.
        """
        if self.bending is None or not self._body(name):
            return self._local[name]
        azimuth, elevation = self.track.angles(mjd)
        rigid = ground_from(self.site, self.frames[name], azimuth, elevation)
        return rigid.inverse().points(self._ground_from(name, azimuth, elevation).points(self._local[name]))

    def _length(self, shot: LiveShot, ends: Sequence[Array], mjd: float) -> float:
        azimuth, elevation = self.track.angles(mjd)
        a, b = (
            carried_point(self.site, self.frames[n], end, azimuth, elevation)
            for n, end in zip((shot.ranger, shot.target), ends, strict=True)
        )
        return math.dist(a, b)

    def _line(self, ranger: str, target: str) -> SolvedLine:
        line = self._lines.get((ranger, target))
        if line is not None:
            return line
        d0 = self.site.mirror_of(ranger).d0_mm * MILLIMETRE
        return SolvedLine(self._index, -self._constants.get(target, 0.0) - d0)


def _local_places(site: SiteFolder, frames: Mapping[str, str]) -> dict[str, Array]:
    """Recorded position (3,) m of each point in its body's frame."""
    posture = site.site.campaign
    azimuth, elevation = posture.azimuth_deg * DEGREE, posture.elevation_deg * DEGREE
    back = {f: ground_from(site, f, azimuth, elevation).single.inverse() for f in ("alidade", "reflector")}
    places = {name: place.start for name, place in places_of(site).items()}
    for name, m in site.monuments.items():
        places[str(Parameter(ParameterKind.FIXED_POINT, name))] = np.array([m.x_mm, m.y_mm, m.z_mm]) * MILLIMETRE
    return {n: back[frames[n]].points(x) if frames[n] in back else np.array(x) for n, x in places.items()}


def _with_flexure(site: SiteFolder, settings: LiveSettings) -> SiteFolder:
    """The site with flexure in the u of typed positions."""
    usual = settings.reduction.u_position / MILLIMETRE

    def wider(record: Typed) -> Typed:
        u = math.hypot(record.u_position_mm or usual, settings.u_flexure_mm)
        return record.model_copy(update={"u_position_mm": u})

    values = {attribute.name: getattr(site, attribute.name) for attribute in fields(SiteFolder)}
    values["targets"] = {n: wider(t) if t.frame != "ground" else t for n, t in site.targets.items()}
    values["triplets"] = {n: wider(t) if t.frame != "ground" else t for n, t in site.triplets.items()}
    arm = tuple(wider(r) for r in site.feedarm.ranger)
    values["feedarm"] = site.feedarm.model_copy(update={"ranger": arm})
    return SiteFolder(**values)
