"""Records that may be wrong, and the change of an epoch's observations by the error of each.

A record errs in rows of a prior (a monument's three coordinates, a certificate, a thermometer's offset), or in many
ranges at once (the modulation frequency, the pressure, a body that moves). `explain` tests each as additional
parameters; what it finds is allowed for by a wider prior, or by parameters with these slopes.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.least_squares.patterns import Patterns
from catseye.estimation.observations.kinds import Distances, Linear, ObservationGroup
from catseye.names import megahertz
from catseye.records.night.campaign import ObservedSite
from catseye.reduction.epoch.contradictions.contradiction import ALIKE, FIXED_SURVEY, RecordGroup
from catseye.reduction.epoch.parameter import XYZ, Parameter, ParameterKind
from catseye.reduction.epoch.prior_names import (
    BENCHMARKS,
    GLASS,
    HEADS,
    LEAKAGE,
    MONUMENTS,
    OFFSETS,
    SOUND,
    THERMOMETERS,
    TRIPLET_BALLS,
    ZEROS,
)
from catseye.reduction.site.places import RangedPoint

DIRECTIONS = ("east", "north", "up")
MM_PER_HOUR = MILLIMETRE / 3600.0
SHORTEST = 600.0  # s of a campaign in which a drift is tested
BODIES = {"arm": "the feed arm", "dish": "the dish", "alidade": "the alidade"}
TELESCOPE = "telescope"
UNITS = {  # unit of an error, and the same in SI as the change of an observed value
    RecordGroup.MODULATION: ("ppm", PPM),
    RecordGroup.PRESSURE: ("hPa", 1.0),
    RecordGroup.HUMIDITY: ("%", 1.0),
    RecordGroup.THERMOMETERS: ("°C", -1.0),  # its parameter is what it reads too much, by the record 0
    RecordGroup.SOUND: ("°C", -1.0),
    RecordGroup.MOVEMENTS: ("mm/h", MM_PER_HOUR),
    RecordGroup.LEAKAGE: ("mV", 1e-3),
    RecordGroup.ELECTRONICS: ("mm/h", MM_PER_HOUR),
    RecordGroup.MONUMENTS: ("mm", MILLIMETRE),
    RecordGroup.OFFSETS: ("mm", MILLIMETRE),
    RecordGroup.BENCHMARKS: ("mm", MILLIMETRE),
    RecordGroup.TRIPLETS: ("mm", MILLIMETRE),
    RecordGroup.ZEROS: ("mm", MILLIMETRE),
    RecordGroup.GLASS: ("mm", MILLIMETRE),
    RecordGroup.LINES: ("mm", MILLIMETRE),
    RecordGroup.HEADS: ("mm", MILLIMETRE),
}
SINGLES = {  # priors each of whose rows is a record
    ZEROS: (RecordGroup.ZEROS, "zero of {of}", "mirrors/{sheet}.toml: d0_mm"),
    THERMOMETERS: (RecordGroup.THERMOMETERS, "{of}'s thermometer", "weather.csv: temperature_c, {of}"),
    SOUND: (RecordGroup.SOUND, "sounded line {of}-{part}", "path_temperatures.csv"),
    GLASS: (RecordGroup.GLASS, "glass constant of {of}", "targets.toml, triplets: {of}"),
    LEAKAGE: (RecordGroup.LEAKAGE, "{parameter}", "mirrors/{sheet}.toml: leakage_amplitude_volt"),
    HEADS: (RecordGroup.HEADS, "{parameter}", "mirrors/{sheet}.toml"),
}
HEAD_UNITS = {ParameterKind.AMPLITUDE: ("mrad", 1e-3), ParameterKind.SECOND_PASS: ("1/kV", 1e-3)}
WITHOUT_PRIOR = frozenset(
    (
        RecordGroup.MODULATION,
        RecordGroup.PRESSURE,
        RecordGroup.HUMIDITY,
        RecordGroup.MOVEMENTS,
        RecordGroup.ELECTRONICS,
        RecordGroup.LINES,
    )
)
EVERYTHING = ""  # owner of what all rangers or stations have in common


PriorRows = tuple[np.ndarray, np.ndarray]  # of a prior, and their change by errors


class RecordKey(NamedTuple):
    """Identity of a record: its group and its owner."""

    group: RecordGroup
    of: str


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A record that may be wrong.

    record    for people
    where     file and keys
    parts     of its numbers; ("",) of a single one
    unit      of an error, and
    per_unit  the same in SI, with the sign of the change of the observations by a record that states too much
    priors    index into the priors: rows (r,) of it, and the change (r, parts) of their observed values by SI errors;
              without any, the ranges change by `slopes_of`
    """

    key: RecordKey
    record: str
    where: str
    parts: tuple[str, ...]
    unit: str
    per_unit: float
    priors: Mapping[int, PriorRows]


@dataclass(frozen=True, eq=False)
class ShotLines:
    """Lines of one ranger's m shots, as errors of records change them.

    towards      (m, 3) unit vectors from target to ranger
    index        (m,) group index of the paths
    distance     (m,) m
    optical      (m,) m, as measured
    seconds      (m,) since the campaign's middle
    per_hpa, per_percent   (m,) change of the index by pressure and humidity
    bodies       of the ranger, and (m) of the targets: "" on the ground
    modulation_hz   (m,) Hz
    """

    name: str
    targets: tuple[str, ...]
    towards: np.ndarray
    index: np.ndarray
    distance: np.ndarray
    optical: np.ndarray
    seconds: np.ndarray
    per_hpa: np.ndarray
    per_percent: np.ndarray
    bodies: tuple[str, tuple[str, ...]]
    modulation_hz: np.ndarray


def is_parameter(key: RecordKey) -> bool:
    """True for an error that is a parameter: of a record without a prior, or one that many priors share."""
    shared = RecordKey(RecordGroup.TRIPLETS, EVERYTHING), RecordKey(RecordGroup.COMMON, key.of)
    return key.group in WITHOUT_PRIOR or key in shared


def parameter_of(key: RecordKey) -> Parameter:
    """Parameter of the error of a record without a prior."""
    return Parameter(ParameterKind.RECORD, f"{key.group.value} {key.of}".strip())


def parts_of(group: RecordGroup) -> tuple[str, ...]:
    """Parts of an error that changes ranges: three of a movement."""
    return DIRECTIONS if group is RecordGroup.MOVEMENTS else ("",)


def slopes_of(key: RecordKey, sight: ShotLines) -> np.ndarray:
    """Change (m, parts) of the optical lengths by an SI error of a record without a prior."""
    group, of = key
    if group is RecordGroup.MODULATION:
        mine = of in (EVERYTHING, sight.name)
        at = np.array([mine or of == megahertz(hz) for hz in sight.modulation_hz.tolist()], dtype=bool)
        return np.where(at, -sight.optical, 0.0)[:, None]
    if group is RecordGroup.ELECTRONICS:
        return (sight.index * sight.seconds * float(of == sight.name))[:, None]
    if group is RecordGroup.PRESSURE:
        return -(sight.distance * sight.per_hpa)[:, None]
    if group is RecordGroup.HUMIDITY:
        return -(sight.distance * sight.per_percent)[:, None]
    if group is RecordGroup.LINES:
        ranger, target = of.split()
        on_line = np.array([ranger == sight.name and t == target for t in sight.targets], dtype=float)
        return (sight.index * on_line)[:, None]
    stated_rows, target_bodies = sight.bodies
    moves = float(_belongs(of, sight.name, stated_rows)) - np.array(
        [_belongs(of, t, b) for t, b in zip(sight.targets, target_bodies, strict=True)], dtype=float
    )
    return sight.towards * (sight.index * sight.seconds * moves)[:, None]


def _belongs(of: str, name: str, body: str) -> bool:
    """True for a point of the body, of the telescope, or for the point itself."""
    return name == of or (of in BODIES and body == of) or (of == TELESCOPE and body != "")


def owners_of(prior: ObservationGroup, parameters: Sequence[Parameter]) -> list[Parameter]:
    """Parameter of each row of a prior of independent parameters, which errors in common may follow."""
    assert isinstance(prior, Linear)
    columns = prior.columns[: len(prior.observed)] if prior.columns.ndim == 1 else prior.columns[:, 0]
    return [parameters[c] for c in columns.tolist()]


def prior_hypotheses(
    priors: Sequence[ObservationGroup],
    parameters: Sequence[Parameter],
    campaign: ObservedSite,
    places: Mapping[str, RangedPoint],
) -> list[Hypothesis]:
    """Hypotheses of the records that priors state.

    parameters   of the adjustment
    """
    surveyed = Counter(owner.of for p in priors if p.name == MONUMENTS for owner in owners_of(p, parameters))
    fixed = frozenset(name for name in campaign.monuments if surveyed[name] < len(XYZ))
    listing = _Listing(parameters, campaign, places, fixed)
    result = [h for i, prior in enumerate(priors) for h in listing.of_prior(i, prior)]
    thermometers = [(i, p) for i, p in enumerate(priors) if p.name == THERMOMETERS]
    if sum(len(p.observed) for _, p in thermometers) > 1:
        all_rows = {i: (np.arange(len(p.observed)), np.ones((len(p.observed), 1))) for i, p in thermometers}
        where = "weather.csv: temperature_c"
        result.append(_one(RecordGroup.THERMOMETERS, EVERYTHING, f"all thermometers{ALIKE}", where, all_rows))
    heights = [h for h in result if h.key.group is RecordGroup.TRIPLETS]
    if len(heights) > 1:
        balls = {i: rows for h in heights for i, rows in h.priors.items()}
        title = f"heights of all triplets{ALIKE}"
        result.append(_one(RecordGroup.TRIPLETS, EVERYTHING, title, "triplets: h_corr_mm", balls))
    return result


@dataclass(frozen=True, eq=False)
class _Listing:
    """Records behind the rows of priors.

    fixed   monuments that hold the survey's datum in one direction or all: no prior says so
    """

    parameters: Sequence[Parameter]
    campaign: ObservedSite
    places: Mapping[str, RangedPoint]
    fixed: Collection[str]

    def of_prior(self, i: int, prior: ObservationGroup) -> list[Hypothesis]:
        """Hypotheses of one prior."""
        if prior.name in SINGLES:
            return self._singles(i, prior)
        if prior.name == MONUMENTS:
            return self._monuments(i, prior)
        if prior.name == OFFSETS:
            name = self.parameters[int(prior.columns[0])].of
            where = f"mirrors/{self.campaign.mirror_of(name).zp}.toml: dx_mm, dy_mm, dz_mm"
            title = f"mirror offset of {name}"
            if name in self.fixed:  # an error of the mirror's place is one of the datum
                title, where = f"mirror offset{FIXED_SURVEY}{name}", f"{where}; monuments/{name}.toml"
            return [_place(RecordGroup.OFFSETS, name, title, where, {i: (np.arange(3), np.eye(3))})]
        if prior.name == TRIPLET_BALLS:
            return self._triplet(i, prior)
        if isinstance(prior, Distances) and prior.name == BENCHMARKS:
            ranger, target = (self.parameters[int(c[0])].of for c in (prior.origin, prior.target))
            where = f"benchmarks.csv: {target}, certified_distance_mm"
            title = f"certificate of {ranger}-{target}"
            return [_one(RecordGroup.BENCHMARKS, f"{ranger} {target}", title, where, {i: (np.arange(1), np.eye(1))})]
        return []

    def _singles(self, i: int, prior: ObservationGroup) -> list[Hypothesis]:
        group, record, where = SINGLES[prior.name]
        result = []
        for k, parameter in enumerate(owners_of(prior, self.parameters)):
            of = str(parameter) if group is RecordGroup.HEADS else parameter.of
            sheet = self.campaign.mirror_of(parameter.of).zp if "{sheet}" in where else ""
            text = record.format(of=parameter.of, part=parameter.part, parameter=parameter)
            row = {i: (np.array([k]), np.eye(1))}
            unit = HEAD_UNITS.get(parameter.kind)
            result.append(_one(group, of, text, where.format(of=parameter.of, sheet=sheet), row, unit))
        return result

    def _monuments(self, i: int, prior: ObservationGroup) -> list[Hypothesis]:
        rows: dict[str, list[int]] = {}
        owners = owners_of(prior, self.parameters)
        for k, owner in enumerate(owners):
            rows.setdefault(owner.of, []).append(k)
        result = []
        for name, at in rows.items():
            axes = [XYZ.index(owners[k].part) for k in at]
            where = f"monuments/{name}.toml: {', '.join(XYZ[a] + '_mm' for a in axes)}"
            parts = tuple(DIRECTIONS[a] for a in axes)
            result.append(
                _place(
                    RecordGroup.MONUMENTS, name, f"monument {name}", where, {i: (np.array(at), np.eye(len(at)))}, parts
                )
            )
        return result

    def _triplet(self, i: int, prior: ObservationGroup) -> list[Hypothesis]:
        ball = self.parameters[int(prior.columns[0])].of
        (triplet,) = [t for t in self.campaign.triplets.values() if t.ball.target == ball]
        normal = self.places[triplet.left_prism.target].normal
        assert normal is not None
        where = f"triplets/{triplet.triplet}.toml: h_corr_mm"
        title = f"height of triplet {triplet.triplet}"
        return [_one(RecordGroup.TRIPLETS, triplet.triplet, title, where, {i: (np.arange(3), normal[:, None])})]


def _one(
    group: RecordGroup,
    of: str,
    record: str,
    where: str,
    priors: Mapping[int, PriorRows],
    unit_and_size: tuple[str, float] | None = None,
) -> Hypothesis:
    """Hypothesis of a record of one number."""
    unit, per_unit = unit_and_size or UNITS[group]
    return Hypothesis(
        key=RecordKey(group, of), record=record, where=where, parts=("",), unit=unit, per_unit=per_unit, priors=priors
    )


def _place(
    group: RecordGroup,
    of: str,
    record: str,
    where: str,
    priors: Mapping[int, PriorRows],
    parts: tuple[str, ...] = DIRECTIONS,
) -> Hypothesis:
    """Hypothesis of a record of a place."""
    unit, per_unit = UNITS[group]
    return Hypothesis(
        key=RecordKey(group, of), record=record, where=where, parts=parts, unit=unit, per_unit=per_unit, priors=priors
    )


def frequency_texts(campaign: ObservedSite) -> tuple[str, ...]:
    """Modulation frequencies of a campaign in words; none where its shots all have the site's."""
    if campaign.shots.modulation_hz is None:
        return ()
    return tuple(megahertz(hz) for hz in np.unique(campaign.shots.modulation_hz).tolist())


def range_hypotheses(
    rangers: Sequence[str],
    bodies: Collection[str],
    *,
    monuments: Collection[str],
    seconds: float,
    frequencies: Collection[str] = (),
) -> list[Hypothesis]:
    """Hypotheses of records that change ranges and have no prior.

    bodies      of the points of the network
    monuments   with a ranger that fired
    seconds     duration of the campaign; a shorter one than `SHORTEST` tests no movement
    frequencies  of the modulation, in words, where a campaign has several
    """
    keys = [
        (RecordGroup.MODULATION, EVERYTHING, "modulation frequency", "site.toml: modulation_hz"),
        *((RecordGroup.MODULATION, r, f"modulation frequency of {r}", "site.toml: modulation_hz") for r in rangers),
        *((RecordGroup.MODULATION, f, f"modulation frequency {f}", "shots.csv: modulation_hz") for f in frequencies),
        (RecordGroup.PRESSURE, EVERYTHING, "pressure at all stations", "weather.csv: pressure_hpa"),
        (RecordGroup.HUMIDITY, EVERYTHING, "humidity at all stations", "weather.csv: humidity_percent"),
    ]
    if seconds >= SHORTEST:
        moving = {b: BODIES[b] for b in sorted(set(bodies) & set(BODIES))}
        moving |= {TELESCOPE: "the telescope"} if len(moving) > 1 else {}
        moving |= {m: f"monument {m}" for m in monuments}
        keys += [(RecordGroup.MOVEMENTS, of, f"movement of {text}", "") for of, text in moving.items()]
        keys += [(RecordGroup.ELECTRONICS, r, f"electronic drift of {r}", "") for r in rangers]
    return [_place(group, of, record, where, {}, parts_of(group)) for group, of, record, where in keys]


def line_hypothesis(ranger: str, target: str) -> Hypothesis:
    """Hypothesis that all shots on one line err by the same, as by a reflection."""
    return _one(RecordGroup.LINES, f"{ranger} {target}", f"all shots of {ranger} on {target}", "", {})


def patterns_of(
    hypotheses: Sequence[Hypothesis],
    sights: Sequence[ShotLines],
    counts: Sequence[int],
    active: np.ndarray,
) -> Patterns:
    """Patterns of hypotheses in stacked observations, rangers' groups first.

    The rows of an error in common are kept: without a whole survey nothing holds the points.

    counts   rows of each group, sights' and priors'
    active   (rows,) bool
    """
    first = np.cumsum([0, *counts])
    vectors, stated_rows = [], []
    for h in hypotheses:
        vector = np.zeros((int(first[-1]), len(h.parts)))
        stated = [first[len(sights) + i] + rows for i, (rows, _) in h.priors.items()]
        for at, (_, change) in zip(stated, h.priors.values(), strict=True):
            vector[at] = change
        if not h.priors:
            for low, sight in zip(first, sights, strict=False):
                vector[low : low + len(sight.targets)] = slopes_of(h.key, sight)
        vectors.append(np.where(active[:, None], vector, 0.0))
        leavable = [] if h.key.group is RecordGroup.COMMON else stated
        stated_rows.append(np.concatenate([np.zeros(0, dtype=int), *leavable]))
    return Patterns.of(vectors, int(first[-1]), stated_rows)


def with_error(prior: ObservationGroup, rows: PriorRows, column: np.ndarray) -> ObservationGroup:
    """Prior whose record may err by parameters that others share.

    rows     of it, and their change by the k errors
    column   (k,) of the parameters
    """
    at, change = rows
    slope = np.zeros((len(prior.observed), len(column)))
    slope[at] = change
    spread = np.broadcast_to(column, slope.shape)
    if isinstance(prior, Distances):
        assert prior.nuisance is not None
        coefficient = np.hstack([np.broadcast_to(prior.coefficient, prior.nuisance.shape), slope])
        return replace(prior, nuisance=np.hstack([prior.nuisance, spread]), coefficient=coefficient)
    assert isinstance(prior, Linear)
    further = column if prior.columns.ndim == 1 else spread
    columns = np.concatenate([prior.columns, further], axis=-1)
    return replace(prior, columns=columns, matrix=np.hstack([prior.matrix, slope]))


def widened(prior: ObservationGroup, rows: PriorRows, sigma: np.ndarray) -> ObservationGroup:
    """Prior whose record may err by more than it states.

    rows     of it, and their change by the errors, as of a hypothesis
    sigma    (parts,) SI, of these errors
    """
    assert isinstance(prior, Linear | Distances)
    at, change = rows
    m = len(prior.observed)
    added = np.zeros((m, m))
    added[np.ix_(at, at)] = (change * sigma) @ (change * sigma).T
    covariance = np.asarray(prior.covariance)
    if covariance.ndim == 1:
        diagonal = np.diag(added)
        alone = np.count_nonzero(added - np.diag(diagonal)) == 0
        return replace(prior, covariance=covariance + diagonal if alone else np.diag(covariance) + added)
    return replace(prior, covariance=covariance + added)
