"""Outcome of a hostile night: is the lie named, is its error within the claim, is it listed, or is nothing said?"""

import re
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from catseye.errors import EstimationError, InputError
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.simulator.night.lies.lie import lying_night
from catseye.simulator.night.sheets import write_night
from hostile.rows import Case
from nature_scene import kind_of, pose_distance

RARE = 1e-3  # probability, of a night, that one of its points or classes is beyond by chance
MOST = 2.0  # of the mean square normalised error of a row's classes
NAMED, COVERED, UNCHECKED, DOUBTFUL, SILENT = OUTCOMES = ("named", "covered", "unchecked", "doubtful", "silent")
ACCUSING = re.compile(
    r"thermometer is biased by|'s zero is not the sheet's|: its typed position is|: not the mirror sheet's"
    r"|'s is wrong, or its elevation|more likely its survey, mirror sheet or samples"
)
UNSURE = ("the ranges lean to", "the stations differ by")  # begin texts that are a finding only where they are doubts
TYPED_MM = 3.0  # between a stated and a true error of a typed position: rounding, and the telescope's expansion
TRUE_C = 0.9  # °C: a drawn offset beyond three of its u is no innocent thermometer


@dataclass(frozen=True)
class Errors:
    """Errors of a night's points against their claim.

    points   name: squared error, of three degrees of freedom if as claimed
    mean     class: mean square normalised error of its coordinates; "pose" besides
    freedom  class: degrees of freedom of that mean, as its coordinates are correlated
    far      points and classes that are beyond by chance less often than once in 1000 nights
    """

    points: dict[str, float]
    mean: dict[str, float]
    freedom: dict[str, float]
    far: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """Outcome of a night.

    word       one of `OUTCOMES`
    accused    texts that name an innocent record alone
    refused    the reduction's refusal; "" without
    verdict    its word
    candidates   explanations of contradictions, and implausible records
    alarms     these, doubts, and the reason of a verdict that is not good
    errors     None where it was refused
    checked    errors without the listed points
    listed     points listed as unchecked or unmeasured: their independent lines
    across     the same points: lines within 60° of the direction that has the fewest
    places     points that the night has
    seconds    of the processor
    texts      all that was said
    faulty     target that the night types 30 mm off besides, as every one does
    """

    case: Case
    word: str
    accused: tuple[str, ...]
    refused: str
    verdict: str
    candidates: tuple[str, ...]
    alarms: tuple[str, ...]
    errors: Errors | None
    checked: Errors | None
    listed: dict[str, int]
    across: dict[str, int]
    places: int
    seconds: float
    texts: tuple[str, ...] = field(default=(), repr=False)
    faulty: str | None = None

    @property
    def claimed(self) -> Errors | None:
        """Errors of the points whose uncertainties count: where the list has what is far, of the others."""
        return self.checked if self.word == UNCHECKED else self.errors


def rarity(square: float, weights: np.ndarray) -> float:
    """Probability that a weighted sum of squared unit normals exceeds a value.

    By three moments, exact for equal weights.

    Source: E. S. Pearson, Biometrika 46 (1959) 364; J. P. Imhof, Biometrika 48 (1961) 419, sec. 4.

    >>> weights = np.ones(5)
    >>> bool(np.isclose(rarity(20.5, weights), chi2.sf(20.5, 5)))
    True
    """
    first, second, third = (float(np.sum(weights**k)) for k in (1, 2, 3))
    freedom = second**3 / third**2
    return float(chi2.sf((square - first) / np.sqrt(second / freedom) + freedom, freedom))


def errors_of(reduction, truth, without=frozenset()) -> Errors:
    """Errors of all measured points but some."""
    campaign, coordinates = reduction.campaign, reduction.coordinates
    names = [n for n in coordinates.points if n in coordinates.places and n in truth.points and n not in without]
    points, members = {}, {}
    for name in names:
        error = coordinates.x[coordinates.index(name)] - truth.points[name]
        points[name] = float(error @ np.linalg.solve(coordinates.block([name]), error))
        members.setdefault(kind_of(name, campaign), []).append(name)
    mean, freedom, rare = {}, {}, {}
    for kind, some in members.items():
        error = np.concatenate([coordinates.x[coordinates.index(n)] - truth.points[n] for n in some])
        block = coordinates.block(some)
        u = np.sqrt(np.diag(block))
        mean[kind] = float(np.mean((error / u) ** 2))
        weights = np.linalg.eigvalsh(block / np.outer(u, u)).clip(0.0)
        freedom[kind] = float(weights.sum() ** 2 / np.sum(weights**2))
        rare[kind] = rarity(mean[kind] * len(u), weights)
    if reduction.surface is not None and truth.paraboloid is not None:
        square = pose_distance(reduction, truth)
        mean["pose"], freedom["pose"], rare["pose"] = square / 5.0, 5.0, float(chi2.sf(square, 5))
    far = [n for n, q in points.items() if chi2.sf(q, 3) * len(points) < RARE]
    return Errors(points, mean, freedom, (*far, *(kind for kind, p in rare.items() if p * len(rare) < RARE)))


def texts_of(reduction) -> tuple[list[str], list[str], list[str]]:
    """Notes and the verdict's reason; candidates of contradictions; texts that name one record alone."""
    coordinates = reduction.coordinates
    implausible = [record.note for record in reduction.implausible]
    notes = [*reduction.notes, *coordinates.doubts, reduction.verdict.why, *implausible]
    candidates = [f"{e.group}: {e.text}" for c in coordinates.contradictions for e in c.explanations] + implausible
    alone = [f"{c.named.group}: {c.named.text}" for c in coordinates.contradictions if c.named is not None]
    return notes, candidates, [*alone, *implausible, *(n for n in notes if ACCUSING.search(n))]


def is_typed_so(text: str, coordinates, truth) -> bool:
    """True for a text that states an error of a typed position which is off by as much: far drawn ones are."""
    told = re.match(r"(\S+): its typed position is (\d+) mm off", text)
    if told is None:
        return False
    names = [n for n in coordinates.points if n in truth.points and n.startswith(told[1])]
    off = [1e3 * np.linalg.norm(coordinates.start[coordinates.index(n)] - truth.points[n]) for n in names]
    return any(abs(float(told[2]) - each) < TYPED_MM for each in off)


def lines_across(name: str, coordinates) -> int:
    """Number of a point's lines within 60° of the direction that has the fewest of them."""
    ranges = coordinates.ranges
    pairs = {(r, t) for r, t, used in zip(ranges.ranger, ranges.target, ranges.used, strict=True) if used}
    others = sorted({t if r == name else r for r, t in pairs if name in (r, t)} & set(coordinates.points))
    if name not in coordinates.points or len(others) < 3:
        return 0
    towards = coordinates.x[coordinates.rows(others)] - coordinates.x[coordinates.index(name)]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    weakest = np.linalg.eigh(towards.T @ towards)[1][:, 0]
    return int(np.count_nonzero(np.abs(towards @ weakest) > 0.5))


def outcome(case: Case, adjust=reduce_epoch) -> Outcome:
    """Simulate, reduce and judge one night."""
    night = lying_night(case.seed, case.lies, **case.setting)
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        try:
            reduction = adjust(read_campaign(write_night(night, Path(folder) / "night")))
        except (InputError, EstimationError) as refusal:
            text = str(refusal)
            word = NAMED if case.lies and all(re.search(pattern, text) for pattern in case.named) else DOUBTFUL
            taken = time.process_time() - begun
            return Outcome(
                case=case,
                word=word,
                accused=(),
                refused=text,
                verdict="refused",
                candidates=(),
                alarms=(text,),
                errors=None,
                checked=None,
                listed={},
                across={},
                places=0,
                seconds=taken,
                texts=(text,),
            )
        taken = time.process_time() - begun
        return _judged(case, night.truth, reduction, taken)


def _judged(case: Case, truth, reduction, seconds: float) -> Outcome:
    coordinates = reduction.coordinates
    notes, candidates, alone = texts_of(reduction)
    shots = dict(zip(reduction.campaign.shots.shot.tolist(), reduction.campaign.shots.ranger, strict=True))
    doubts = {*coordinates.doubts, reduction.verdict.why}
    said = [text for text in (*notes, *candidates) if text in doubts or not text.startswith(UNSURE)]
    if case.shots:
        said += [f"{shots[shot]}: {reason}" for shot, reason in reduction.rejected.items()]
    listed = {*coordinates.unchecked, *coordinates.unmeasured}
    errors, checked = errors_of(reduction, truth), errors_of(reduction, truth, listed)
    word = _word(case, said, errors, checked, alarmed=reduction.verdict.word != "good" or bool(candidates))
    common = [f"{r.record} {r.where}" for r in coordinates.records if r.unchecked and r.in_common]
    if word in (DOUBTFUL, SILENT) and case.lies and all(any(re.search(p, t) for t in common) for p in case.named):
        word = UNCHECKED  # a record of all that the report lists as checked by nothing
    biased = [s for s, value in truth.thermometer_offsets_c.items() if abs(value) > TRUE_C]
    typed = rf"^{truth.wrongly_typed}\b.*position|position.*\b{truth.wrongly_typed}\b"  # a fault of every drawn night
    right = [*case.named, *(rf"{s}.*thermometer" for s in biased), typed]
    innocent = [text for text in dict.fromkeys(alone) if not any(re.search(p, text) for p in right)]
    accused = tuple(text for text in innocent if not is_typed_so(text, coordinates, truth))
    alarms = (*candidates, *coordinates.doubts, *([reduction.verdict.why] if reduction.verdict.word != "good" else []))
    lines = dict(zip(coordinates.points, coordinates.lines.tolist(), strict=False))  # empty without a test of lines
    return Outcome(
        case=case,
        word=word,
        accused=accused,
        refused="",
        verdict=reduction.verdict.word,
        candidates=tuple(candidates),
        alarms=tuple(dict.fromkeys(alarms)),
        errors=errors,
        checked=checked,
        listed={n: int(lines.get(n, 0)) for n in sorted(listed)},
        across={n: lines_across(n, coordinates) for n in sorted(listed)},
        places=len([n for n in coordinates.points if n in coordinates.places]) + len(coordinates.unmeasured),
        seconds=seconds,
        texts=tuple(dict.fromkeys((*said, *notes))),
        faulty=truth.wrongly_typed,
    )


def _word(case: Case, said: list[str], errors: Errors, checked: Errors, *, alarmed: bool) -> str:
    """Word of a night that was reduced.

    checked   errors without the points that are listed
    alarmed   whether the verdict is doubtful or candidates are listed
    """
    hits = [any(re.search(pattern, text) for text in said) for pattern in case.named]
    within, besides = not errors.far, not checked.far
    if case.lies and all(hits) and (besides or not case.covers):
        return NAMED
    if within:
        return COVERED
    if besides:
        return UNCHECKED
    return DOUBTFUL if alarmed else SILENT
