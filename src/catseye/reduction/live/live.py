"""The live reduction: fed with weather, postures and shots in one order, asked for a solution after each round.

Nothing here knows a clock, a network or a file, and what it answers depends on what it was fed and on nothing else: a
journal replayed in its order gives the same answers bit for bit.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from statistics import median
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from catseye.constants import DEGREE, MILLIMETRE, SECONDS_PER_DAY, SPEED_OF_LIGHT, TWO_PI
from catseye.errors import CatseyeError
from catseye.records.night.live import TICK_SECONDS, TICKS_PER_DAY, LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.records.site.target import FeedArmRanger, TargetRow
from catseye.records.site.triplet import TripletRecord
from catseye.reduction.epoch.parameter import GRADIENT, POINT_KINDS, Parameter, ParameterKind
from catseye.reduction.epoch.ranges import MRAD_PER_ROOT_HOUR
from catseye.reduction.epoch.reason import Reason, ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.live.epoch import Epoch, frames_of_points, observed_site, solve_epoch
from catseye.reduction.live.jitter import Jitter
from catseye.reduction.live.pose import LivePose, live_pose
from catseye.reduction.live.repeats import joined_repeats
from catseye.reduction.live.shots import PhasedShot, RangerNow, ShotAnswer, SolvedLine, answer, phased
from catseye.reduction.live.state import (
    USUAL,
    Carried,
    Loosening,
    carried_on,
    widened,
    with_reference,
    with_velocities,
    without,
)
from catseye.reduction.live.thermometers import SuspectedBias
from catseye.reduction.live.weather import StationWatch, Stretch
from catseye.reduction.site.bodies import bodies_of, lasting_names
from catseye.reduction.site.motion import (
    LONGEST_GAP,
    CarriedMotion,
    PostureTrack,
    carried_point,
    frames_of,
    ground_from,
)
from catseye.reduction.site.places import places_of

Array = NDArray[np.float64]
Typed = TypeVar("Typed", TargetRow, TripletRecord, FeedArmRanger)  # records with a position that somebody typed
FIRST_INDEX = 1.00028  # group index before the first epoch, good to 5e-5: 6 mm at 120 m, enough for whole cycles


@dataclass(frozen=True)
class LiveSettings:
    """How a living site is reduced.

    reduction        as for a campaign
    filter           between epochs: "random_walk", or "constant_velocity" of each lasting point of the telescope
    loosening        how much less sure the state gets between epochs
    u_flexure_mm     of each coordinate of a typed point of the telescope against a rigid one, beside the record's
    jitter_mm        how far points of a body are at a shot from their mean of the epoch: wind, vibration
    lasting_path     share of the standard deviation of a path's index that lasts; the rest is an epoch's own
    references_s     s before an epoch whose reference shots count
    reference_after  epochs, after which the reference epoch is set that poses count from
    bending_mm_per_degree   of a body's points for each degree that the telescope moves during an epoch
    """

    reduction: ReductionSettings = field(default_factory=ReductionSettings)
    filter: Literal["random_walk", "constant_velocity"] = "random_walk"
    loosening: Loosening = USUAL
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
    """The solution of an epoch.

    number        counted from 1
    ticks         the instant for which it holds; places are means over the epoch, carried there
    azimuth, elevation   rad, of the telescope then
    names         of the points, sorted; monuments' fixed points are "ZY101-F"
    x             (n, 3) m, ground frame
    covariance    (3n, 3n) m^2
    shots         how many took part at each point; repeats that were joined count once
    used          numbers of the shots that took part
    rejected      number: why not, for the others of the epoch; references included
    variance_factor, degrees_of_freedom   of the shots and what was carried to them
    refractivity_ppm   mean group refractivity of the paths
    air           name: estimate and u
    zeros         ranger: m, and u
    pose          of dish and feed since the reference epoch
    notes         for people
    jitter_mm     body: how far its points were at a shot from their mean, as the epoch believed
    doubts        why the answer is not good though it was found, a sentence each; none of a good one
    biases        station: how its thermometer may be biased; one that is not believed at all is not in it
    returned      stretches that turned out since the last epoch to have been biased
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
    returned: tuple[Stretch, ...] = ()

    def point(self, name: str) -> tuple[Array, Array]:
        """(3,) m and its covariance (3, 3).

        Raises KeyError for a point that is not in the epoch.
        """
        if name not in self.names:
            raise KeyError(name)
        k = 3 * self.names.index(name)
        return self.x[k // 3], self.covariance[k : k + 3, k : k + 3]


@dataclass(frozen=True, eq=False)
class EpochJob:
    """An epoch to be solved, by itself: another process may do it."""

    rows: list[PhasedShot]
    weather: list[LiveWeather]
    motion: CarriedMotion
    places: dict[str, Array]
    index: float
    azimuth: float
    elevation: float
    carried: Carried | None
    lasting: tuple[str, ...]
    ticks: int
    rules: ReductionSettings
    opened: frozenset[str] = frozenset()

    def solve(self) -> Epoch | str:
        """The epoch, or why there is none."""
        with threadpool_limits(limits=1, user_api="blas"):
            try:
                site = self.motion.site
                rows = joined_repeats(self.rows, self._lengths, site.site.ranging.modulation_hz, index=self.index)
                observed = observed_site(
                    site, rows, self.weather, azimuth=self.azimuth, elevation=self.elevation, mjd=self.motion.epoch
                )
                return solve_epoch(
                    observed,
                    rows,
                    self.motion,
                    settings=self.rules,
                    carried=self.carried,
                    lasting=self.lasting,
                    ticks=self.ticks,
                    opened=self.opened,
                )
            except CatseyeError as problem:
                return str(problem)

    def _lengths(self, ranger: str, target: str, mjd: Array) -> Array:
        """Predicted distances, m; NaN where nobody knows."""
        if ranger not in self.places or target not in self.places:
            return np.full(len(mjd), np.nan)
        return self.motion.distances(ranger, target, self.places, mjd)


class Live:
    """A living site's reduction; see the module."""

    def __init__(self, site: SiteFolder, settings: LiveSettings | None = None):
        self.settings = settings or LiveSettings()
        self.site = _with_flexure(site, self.settings)
        self.frames = frames_of(site)
        self.bodies = bodies_of(site, self.frames)
        self.lasting = lasting_names(site)
        self.track = PostureTrack()
        self.stations = StationWatch.of(site)
        self._opened: frozenset[str] = frozenset()  # stations whose thermometers' records pull the state no more
        self._pulls: dict[Parameter, float] = {}  # of the last epoch
        self._told: set[Stretch] = set()
        self.jitter = Jitter(self.settings.jitter_mm)
        self.rangers = {name: RangerNow() for name in site.rangers}
        self.carried: Carried | None = None
        self.number = 0
        self.last_ticks = 0
        self.failed = ""  # why the last solve gave nothing
        self._pending: list[PhasedShot] = []
        self._lines: dict[tuple[str, str], SolvedLine] = {}
        self._own: dict[str, Array] = _own_places(self.site, self.frames)
        self._constants = {name: place.constant for name, place in places_of(self.site).items()}
        self._index = FIRST_INDEX

    # What it is fed with ---------------------------------------------------------------------------------------------

    def weather(self, read: LiveWeather) -> str:
        """One reading; why it is doubted, "" where it is not."""
        return self.stations.add(read)

    def posture(self, read: LivePosture) -> None:
        """One posture of the telescope."""
        self.track.add(read)

    def shot(self, shot: LiveShot) -> ShotAnswer:
        """One shot; it takes part in the next epoch."""
        now = self.rangers.get(shot.ranger)
        if now is None:
            return ShotAnswer.refused(
                Reason(ShotStatus.NO_RANGER, f"{shot.ranger} is not at this site"), math.nan, math.nan
            )
        mirror, adc, rules = self.site.mirror_of(shot.ranger), self.site.site.adc, self.settings.reduction
        own = shot.target == REFERENCE
        usual = now.usual[own]
        modulation = self.site.site.ranging.modulation_hz
        distance, rate = (math.nan, 0.0) if own else self._distance(shot)
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
        said = answer(
            row,
            now,
            predicted=None if math.isnan(distance) else (lambda: distance),
            line=lambda: self._line(shot.ranger, shot.target),
            d0=mirror.d0_mm * MILLIMETRE,
            modulation_hz=modulation,
            walk=self.site.site.ranging.electronic_drift_mrad_per_sqrt_hour * MRAD_PER_ROOT_HOUR,
        )
        if said.status is ShotStatus.NO_PLACE:
            reason = Reason(ShotStatus.NO_PLACE, "the telescope has told no posture")
            if shot.target not in self._own:
                reason = Reason(ShotStatus.NO_PLACE, f"the site has no target {shot.target}")
            said = ShotAnswer.refused(reason, said.amplitude, said.phase)
            row = row.left_out(reason)
        if said.status in (ShotStatus.USED, ShotStatus.REFERENCE):
            usual.append(said.amplitude)
        if said.status is ShotStatus.REFERENCE:
            now.references.append(row)
        if not own or said.status is not ShotStatus.REFERENCE:
            self._pending.append(row)
        return said

    def clock_corrected(self, ticks: int) -> None:
        """Forget what was stamped later than now: the clock was set back; what is known counts from now on."""
        self.track.forget_after(ticks)
        self.stations.forget_after(ticks)
        self._pending = [row for row in self._pending if row.shot.ticks <= ticks]
        for now in self.rangers.values():
            kept = [row for row in now.references if row.shot.ticks <= ticks]
            now.references.clear()
            now.references.extend(kept)
        if self.carried is not None and self.carried.ticks > ticks:
            self.carried = replace(self.carried, ticks=ticks)

    def place(self, name: str, mjd: ArrayLike) -> Array:
        """(..., 3) m, ground frame: where a point is predicted at times (...).

        Raises InputError where the telescope has told no posture and the point is on it, KeyError for a stranger.
        """
        own, frame = self._own[name], self.frames[name]
        times = np.asarray(mjd, dtype=float)
        if frame == "ground":
            return np.broadcast_to(own, (*times.shape, 3)).copy()
        return np.asarray(ground_from(self.site, frame, *self.track.at(times)).points(own))

    def uncertainty(self) -> dict[str, Array]:
        """Covariance (3, 3) m^2 of each carried point, ground axes as the telescope last stood."""
        if self.carried is None:
            return {}
        latest = self.track.latest
        turns: dict[str, Array] = {}
        if latest is not None:
            for frame in ("alidade", "reflector"):
                turns[frame] = ground_from(self.site, frame, latest.azimuth, latest.elevation).single.rotation
        blocks = {}
        for i, parameter in enumerate(self.carried.parameters):
            point = str(parameter._replace(part=""))
            if parameter.kind in POINT_KINDS and parameter.part == "x" and point in self._own:
                turn = turns.get(self.frames[point], np.eye(3))
                blocks[point] = turn @ self.carried.covariance[i : i + 3, i : i + 3] @ turn.T
        return blocks

    # What it answers -------------------------------------------------------------------------------------------------

    def begin(self, ticks: int) -> "EpochJob | None":
        """The epoch of all shots since the last one, for an instant, ready to be solved; None where there is nothing.

        ticks   the middle of the round, or its end: points are carried there

        `failed` says why there is nothing. Shots stay for the next epoch where weather or posture is missing. Between
        `begin` and `take_in` more shots may be fed; they belong to the next epoch.
        """
        weather = self.stations.believed(ticks)
        self.failed = self._unready(weather)
        if self.failed:
            return None
        rows, self._pending = self._rows(ticks), []
        mjd = ticks / TICKS_PER_DAY
        azimuth, elevation = (float(v) for v in self.track.at(mjd))
        times = [r.mjd for r in rows if r.shot.target != REFERENCE]
        told = self.track.between(min([mjd, *times]), max([mjd, *times]))
        motion = CarriedMotion(
            self.site, told, self.frames, mjd, self.bodies, self._shaking(rows), self.settings.lasting_path
        )
        known = {name for r in rows for name in (r.shot.ranger, r.shot.target)} & self._own.keys()
        places = {name: self._own[name] for name in sorted(known)}
        self._start_anew(self.stations.moved(), heard=frozenset(read.station for read in weather))
        carried = self._carried_to(ticks, elevation)
        return EpochJob(
            rows,
            weather,
            motion,
            places,
            self._index,
            azimuth,
            elevation,
            carried,
            self.lasting,
            ticks,
            self.settings.reduction,
            self._opened,
        )

    def take_in(self, job: "EpochJob", epoch: "Epoch | str") -> EpochAnswer | None:
        """What `job.solve()` found becomes what is known; None where it found nothing, `failed` says why."""
        if isinstance(epoch, str):
            self.failed = epoch
            return None
        return self._take_in(epoch, job.motion, job.azimuth, job.elevation)

    def solve(self, ticks: int) -> EpochAnswer | None:
        """`begin`, `EpochJob.solve` and `take_in` in one."""
        job = self.begin(ticks)
        return None if job is None else self.take_in(job, job.solve())

    def set_reference(self) -> None:
        """Poses count from the last epoch on."""
        if self.carried is not None:
            self.carried = with_reference(self.carried, self._moving())

    # Inside ----------------------------------------------------------------------------------------------------------

    def _take_in(self, epoch: Epoch, motion: CarriedMotion, azimuth: float, elevation: float) -> EpochAnswer:
        coordinates = epoch.coordinates
        self.number += 1
        self.jitter.learn(coordinates.ranges, self.bodies)
        self.carried, self.last_ticks = epoch.carried, epoch.carried.ticks
        self._suspect(epoch)
        frames = frames_of_points(motion, coordinates.points)
        for name, x in zip(coordinates.points, coordinates.x, strict=True):
            self._own[name] = frames[name].inverse().points(x) if name in frames else np.array(x)
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
            pose = live_pose(widened(self.carried, epoch.pulls), self.bodies, self.site)
        rows = epoch.rows
        used = [n for k, on in zip(ranges.shot, ranges.used, strict=True) if on for n in rows[int(k)].numbers]
        why = dict(epoch.reasons)
        for row, on in enumerate(ranges.used):
            if not on:
                text = f"range {ranges.residual[row] * 1e3:+.3f} mm off, w {ranges.standardised[row]:.1f}"
                why[int(ranges.shot[row])] = Reason(ShotStatus.REFLECTED, text)
        rejected = {n: reason for k, reason in why.items() for n in rows[k].numbers}
        return EpochAnswer(
            self.number,
            self.last_ticks,
            azimuth,
            elevation,
            coordinates.points,
            coordinates.x,
            coordinates.covariance,
            tuple(int(n) for n in coordinates.shots),
            tuple(sorted(set(used))),
            dict(sorted(rejected.items())),
            coordinates.variance_factor,
            coordinates.degrees_of_freedom,
            coordinates.refractivity_ppm,
            coordinates.air,
            coordinates.zeros,
            pose,
            (*coordinates.notes, *self.stations.notes()),
            motion.jitter_mm,
            coordinates.doubts,
            epoch.biases,
            self._returned(),
        )

    def _suspect(self, epoch: Epoch) -> None:
        """Take in what an epoch suspects of the thermometers.

        The state itself is less sure by that where the suspicion ends unexplained, and once where the ranges say an
        offset at which its record has pulled so far.
        """
        named = {n for n, each in epoch.biases.items() if each.judgement == "biased"}
        pulled = {p: pull for p, pull in epoch.pulls.items() if p.of in named - self._opened - epoch.opened}
        over = {p: pull for p, pull in self._pulls.items() if p not in epoch.pulls and p.of not in self._opened}
        self.carried = widened(epoch.carried, pulled | over)
        self._opened |= named | epoch.opened
        self._pulls = {p: pull for p, pull in epoch.pulls.items() if p not in pulled}
        self.stations.judged({n: (each.offset_c, n in named) for n, each in epoch.biases.items()})

    def _start_anew(self, moved: frozenset[str], *, heard: frozenset[str]) -> None:
        """Take stations' doubts into the state where they change.

        moved   stations that read at another level: their offsets are forgotten
        heard   stations that are believed now: without a suspected one nothing tells of the doubt any more
        """
        if self.carried is None:
            return
        of = {Parameter(ParameterKind.THERMOMETER, name) for name in moved}
        left = {p for p in self._pulls if p.kind is ParameterKind.THERMOMETER and p.of not in heard}
        if not of and not left:
            return
        taken = {p: v for p, v in self._pulls.items() if p in of | left or p.kind is not ParameterKind.THERMOMETER}
        known = {p for p in self.carried.parameters if p in of}
        self.carried = without(widened(self.carried, taken), known)
        self._pulls = {p: pull for p, pull in self._pulls.items() if p not in taken}
        self._opened -= moved

    def _returned(self) -> tuple[Stretch, ...]:
        """Stretches of a bias that have ended since this was asked last."""
        ended = {s for s in self.stations.stretches() if s.last is not None and math.isfinite(s.offset_c)}
        new, self._told = ended - self._told, ended
        return tuple(sorted(new, key=lambda stretch: (stretch.station, stretch.first)))

    def _unready(self, weather: Sequence[LiveWeather]) -> str:
        if not any(not r.reason for r in self._pending):
            self._pending = []
            return "no shot since the last epoch can be used"
        if not len(self.track):
            return "the telescope has told no posture"
        return "" if weather else "no weather station has spoken"

    def _rows(self, ticks: int) -> list[PhasedShot]:
        """The epoch's shots and the reference shots before, in order of time; those without a posture say so."""
        since = (ticks / TICKS_PER_DAY) - self.settings.references_s / SECONDS_PER_DAY
        references = [r for now in self.rangers.values() for r in now.references if r.mjd >= since]
        latest = [
            now.references[-1] for now in self.rangers.values() if now.references and now.references[-1].mjd < since
        ]
        rows = sorted([*self._pending, *references, *latest], key=lambda r: (r.mjd, r.shot.ranger, r.shot.number))
        moving = {name for name, frame in self.frames.items() if frame != "ground"}
        age = self.track.age(np.array([r.mjd for r in rows]))
        nearest, expected = "the telescope's nearest is", f"(expected {LONGEST_GAP:g} s)"
        return [
            row.left_out(Reason(ShotStatus.NO_POSTURE, f"{nearest} {old:.1f} s away {expected}"))
            if not row.reason and old > LONGEST_GAP and {row.shot.ranger, row.shot.target} & moving
            else row
            for row, old in zip(rows, age, strict=True)
        ]

    def _shaking(self, rows: Sequence[PhasedShot]) -> dict[str, float]:
        """Jitter of each body, mm: as learnt, and bent by the telescope's own motion during the epoch's shots."""
        times = [r.mjd for r in rows if r.shot.target != REFERENCE]
        angles = self.track.at(np.array(times or [rows[-1].mjd]))
        moved = float(np.ptp(angles[1])) / DEGREE
        bent = {b: self.settings.bending_mm_per_degree.get(b, 0.0) * moved / math.sqrt(12.0) for b in self.jitter.mm}
        return {b: math.hypot(u, bent[b]) for b, u in self.jitter.mm.items()}

    def _carried_to(self, ticks: int, elevation: float) -> Carried | None:
        if self.carried is None:
            return None
        carried = self.carried
        if self.settings.filter == "constant_velocity":
            carried = with_velocities(carried, self._moving(), self.settings.loosening)
        seconds = (ticks - carried.ticks) / TICKS_PER_DAY * SECONDS_PER_DAY
        rules = self.settings.reduction
        profile = rules.u_gradient_c_per_m if GRADIENT in carried.parameters else rules.u_profile_c
        path = self.settings.lasting_path * self.site.site.ranging.path_index_fluctuation_ppm
        return carried_on(
            carried,
            ticks,
            seconds,
            elevation=elevation,
            bodies=self.bodies,
            rule=self.settings.loosening,
            profile_sigma=profile,
            path_sigma_ppm=path,
        )

    def _moving(self) -> list[str]:
        known = self.carried.points() if self.carried is not None else {}
        return [n for n in self.lasting if n in self.bodies and n in known]

    def _distance(self, shot: LiveShot) -> tuple[float, float]:
        """Predicted distance, m, at the buffer's middle and its rate, m/s; NaN and zero where nobody knows."""
        if shot.target not in self._own or (
            {self.frames[shot.ranger], self.frames[shot.target]} != {"ground"} and not len(self.track)
        ):
            return math.nan, 0.0
        if self.frames[shot.ranger] == self.frames[shot.target]:
            return float(np.linalg.norm(self._own[shot.target] - self._own[shot.ranger])), 0.0
        half = 0.5 * shot.duration / SECONDS_PER_DAY
        first, middle, last = (self._length(shot, shot.middle_mjd + dt) for dt in (-half, 0.0, half))
        return middle, (last - first) / shot.duration

    def _length(self, shot: LiveShot, mjd: float) -> float:
        azimuth, elevation = self.track.angles(mjd)
        a, b = (
            carried_point(self.site, self.frames[n], self._own[n], azimuth, elevation)
            for n in (shot.ranger, shot.target)
        )
        return math.dist(a, b)

    def _line(self, ranger: str, target: str) -> SolvedLine:
        known = self._lines.get((ranger, target))
        if known is not None:
            return known
        d0 = self.site.mirror_of(ranger).d0_mm * MILLIMETRE
        return SolvedLine(self._index, -self._constants.get(target, 0.0) - d0)


def _own_places(site: SiteFolder, frames: Mapping[str, str]) -> dict[str, Array]:
    """(3,) m of each point in the frame that carries it, as the records have it."""
    posture = site.site.campaign
    azimuth, elevation = posture.azimuth_deg * DEGREE, posture.elevation_deg * DEGREE
    back = {f: ground_from(site, f, azimuth, elevation).single.inverse() for f in ("alidade", "reflector")}
    places = {name: place.start for name, place in places_of(site).items()}
    for name, m in site.monuments.items():
        places[str(Parameter(ParameterKind.FIXED_POINT, name))] = np.array([m.x_mm, m.y_mm, m.z_mm]) * MILLIMETRE
    return {n: back[frames[n]].points(x) if frames[n] in back else np.array(x) for n, x in places.items()}


def _with_flexure(site: SiteFolder, settings: LiveSettings) -> SiteFolder:
    """The site with typed positions on the telescope as uncertain as a telescope that bends makes them."""
    usual = settings.reduction.u_position / MILLIMETRE

    def wider(record: Typed) -> Typed:
        u = math.hypot(record.u_position_mm or usual, settings.u_flexure_mm)
        return record.model_copy(update={"u_position_mm": u})

    own = {each.name: getattr(site, each.name) for each in fields(SiteFolder)}
    own["targets"] = {n: wider(t) if t.frame != "ground" else t for n, t in site.targets.items()}
    own["triplets"] = {n: wider(t) if t.frame != "ground" else t for n, t in site.triplets.items()}
    arm = tuple(wider(r) for r in site.feedarm.ranger)
    own["feedarm"] = site.feedarm.model_copy(update={"ranger": arm})
    return SiteFolder(**own)
