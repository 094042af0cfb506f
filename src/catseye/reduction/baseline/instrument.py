"""Calibration of an EDM baseline.

Shots and weather to pillars, and to the zero, scale and cyclic terms of the instrument.

Signs: observed = (1 + scale) D + zero + cyclic. An instrument that reads too much has zero above 0; the correction that
the standard adds to readings is -zero.

Source: [PARKER04] section 7.3.4 (total stations on a baseline).
"""

from dataclasses import replace
from typing import TypedDict

import numpy as np
from threadpoolctl import threadpool_limits

from catseye.aliases import Progress
from catseye.atmosphere.weather.humidity import humidity_doubts
from catseye.constants import MILLIMETRE, PPM
from catseye.errors import ArgumentError, EstimationError, InputError
from catseye.estimation.baseline.adjustment import CEILING, BaselineSolution
from catseye.estimation.baseline.iso17123 import FullTest
from catseye.estimation.baseline.model import KnownPlaces
from catseye.records.files.refusal import shown
from catseye.records.laboratory.baseline import Baseline, BaselineShots, Heights, numbers_of
from catseye.reduction.baseline.job import BaselineJob
from catseye.reduction.baseline.lengths import reduce_lengths
from catseye.reduction.baseline.result import BaselineCalibration
from catseye.reduction.baseline.settings import BaselineSettings
from catseye.reduction.baseline.statistical_tests import FOLLOWS, decisions_of


def calibrate_baseline(
    shots: BaselineShots,
    heights: Heights | None = None,
    against: Baseline | None = None,
    *,
    settings: BaselineSettings | None = None,
    progress: Progress | None = None,
) -> BaselineCalibration:
    """Pillars and instrument from one table of shots.

    shots      as read, with the weather of each
    heights    of the pillars; None: all level
    against    known pillars; None: estimated, with the scale of the instrument's frequency
    settings   assumptions
    progress   called at each step

    Raises InputError for tables that do not join, EstimationError where the shots do not determine the answer.
    """
    with threadpool_limits(limits=1, user_api="blas"):  # spinning pools make small matrices many times slower
        return _calibrated(shots, heights, against, settings or BaselineSettings(), progress)


def _calibrated(
    shots: BaselineShots,
    heights: Heights | None,
    against: Baseline | None,
    settings: BaselineSettings,
    progress: Progress | None,
) -> BaselineCalibration:
    notes = list(humidity_doubts(shots.humidity_percent))
    names = _ordered(shots, heights, against)
    shots = _renumbered(shots, names)
    height, u_height, reference = _heights(shots, heights, against, settings, notes)
    lengths = reduce_lengths(shots, height, u_height, reference_height=reference or 0.0, settings=settings)
    if against is None and settings.u_scale_ppm > 0.0:
        by_scale = lengths.stretch**2 * lengths.distance * settings.u_scale_ppm * PPM
        columns = np.concatenate([lengths.systematic, by_scale[:, None]], axis=1)
        lengths = replace(lengths, systematic=columns, effects=(*lengths.effects, "scale of the instrument"))
    calibrated_pillars = None if against is None else _calibrated_places(against)
    job = BaselineJob(shots, lengths, settings, calibrated_pillars, notes)
    keep, rejected, suspects, solution = job.cleaned(progress)
    solution, cyclic = job.with_cyclic(keep, solution)
    _refuse_gross(solution, job, keep)
    test, claimed, all_shots = job.full_tests(solution)
    weather = job.weather(keep, solution, cyclic)
    decisions = decisions_of(
        solution,
        test,
        settings,
        claimed=claimed,
        agreement=None if against is None else job.agreement(solution, cyclic, keep),
        weather=weather,
        against=against,
        suspects=suspects,
    )
    notes += _notes(shots, solution, settings, against)
    if any(d.name == FOLLOWS and d.passed is False for d in decisions) and not settings.corrected:
        share = np.mean((lengths.first / shots.slope)[keep]) / PPM
        notes.append(
            f"the lengths did not follow the weather: if they were corrected in the field, all are wrong by "
            f"{share:+.1f} ppm in the mean, which no u here includes; compare with lengths taken as corrected"
        )
    return BaselineCalibration(
        observations=shots,
        settings=settings,
        names=shots.names,
        heights=height if heights is not None else None,
        reference_height=reference,
        lengths=lengths,
        keep=keep,
        solution=solution,
        test=test,
        all_shots=all_shots,
        against=against,
        decisions=decisions,
        suspects=suspects,
        rejected=rejected,
        cyclic=cyclic,
        weather=weather,
        notes=tuple(notes),
    )


def _refuse_gross(solution: BaselineSolution, job: BaselineJob, keep: np.ndarray) -> None:
    """Raise InputError for gross contradictions.

    A scatter at the ceiling of the estimate is no noise; the row is the worst before any adjustment.
    """
    noise = solution.noise
    if np.isfinite(solution.u_noise).any() and np.any(np.array([noise.shot, noise.set, noise.air]) > 0.999 * CEILING):
        shots, x, y = job.shots, job.x, job.y
        straight = np.hypot(x[shots.end] - x[shots.start], y[shots.end] - y[shots.start])
        worst = int(np.argmax(np.where(keep, np.abs(job.lengths.distance - straight), -1.0)))
        raise EstimationError(
            f"{shots.file}: shots contradict each other by more than any noise of a distance meter (0.1 m, 1000 ppm); "
            f"look for a wrong pillar or digit, at {shots.where[worst]} first"
        )


def _ordered(shots: BaselineShots, heights: Heights | None, against: Baseline | None) -> tuple[str, ...]:
    if against is not None:
        numbers_of(against, shots.names, shots.file)
        return against.pillars
    if heights is None:
        return shots.names
    for name in shots.names:
        if name not in heights.height:
            raise InputError(f"{heights.file}: pillar {shown(name)} of {shots.file} is missing (expected its height)")
    return tuple(name for name in heights.height if name in shots.names)


def _renumbered(shots: BaselineShots, names: tuple[str, ...]) -> BaselineShots:
    from copy import copy

    number = np.array([names.index(n) for n in shots.names])
    renumbered = copy(shots)
    renumbered.names, renumbered.start, renumbered.end = names, number[shots.start], number[shots.end]
    return renumbered


def _heights(
    shots: BaselineShots,
    heights: Heights | None,
    against: Baseline | None,
    settings: BaselineSettings,
    notes: list[str],
) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Heights and their u by the pillars' numbers, and reference height.

    None: unknown.
    """
    n = len(shots.names)
    if heights is None:
        if settings.reference_height is not None:
            text = "reference_height_m needs heights: no reference without heights"
            raise ArgumentError(text, "reference_height_m", "heights")
        notes.append("no heights of pillars: taken as level, which makes lengths on a slope too long")
        return np.zeros(n), np.zeros(n), None
    touched = {shots.names[i] for i in (*shots.start, *shots.end)}
    for name in touched:
        if name not in heights.height:
            raise InputError(f"{heights.file}: pillar {shown(name)} of {shots.file} is missing (expected its height)")
    reference = settings.reference_height
    if against is not None:
        if reference is not None and reference != against.reference_height_m:
            text = (
                f"reference_height_m {reference:g} is not the known baseline's ({against.reference_height_m}); "
                "leave it out"
            )
            raise ArgumentError(text, "reference_height_m")
        reference = against.reference_height_m
        if reference is None:
            notes.append("the known baseline has no heights: distances are compared at the first pillar's height")
    first = next(h for name, h in heights.height.items() if name in touched)
    height = np.array([heights.height.get(name, first) for name in shots.names])
    u = np.array([heights.u.get(name, 0.0) for name in shots.names])
    return height, u, first if reference is None else reference


def _calibrated_places(against: Baseline) -> KnownPlaces:
    n = len(against.pillars)
    number = {name: i for i, name in enumerate(against.pillars)}
    rows = [number[entry[2:]] + (n if entry[0] == "y" else 0) for entry in against.known]
    return KnownPlaces(np.array(against.x_m), np.array(against.y_m), np.array(rows), against.covariance)


def _notes(
    shots: BaselineShots, solution: BaselineSolution, settings: BaselineSettings, against: Baseline | None
) -> list[str]:
    notes = []
    if against is None:
        notes.append(
            "the scale is not determined without a known baseline: the pillars carry the instrument's, "
            f"{settings.u_scale_ppm:g} ppm (1σ)"
        )
        if not np.isfinite(shots.direction).any():
            notes.append("no horizontal directions: the pillars are assumed to be in a straight line")
    if settings.unit_length is None:
        notes.append("no cyclic terms: the instrument's unit length is missing")
    if not np.isfinite(solution.u_noise[1:]).any():
        notes.append("too few redundant sets to estimate the noise: the maker's claim is used")
    elif solution.noise.air * float(np.max(solution.used.distance)) ** 2 > 4.0 * (solution.noise.set + 1e-12):
        notes.append(
            f"sets scatter in proportion to distance, {solution.noise.air**0.5 / PPM:.1f} ppm: the air, or the "
            "measurement of its temperature, more than pointing and centring"
        )
    return notes


class BaselineRecordValues(TypedDict):
    """Keys of BASELINE.toml from a calibration.

    `records.laboratory.baseline.Baseline` explains them.
    """

    reference_height_m: float | None
    pillars: tuple[str, ...]
    x_m: tuple[float, ...]
    y_m: tuple[float, ...]
    known: tuple[str, ...]
    covariance_mm2: tuple[tuple[float, ...], ...]
    s_mm: float | None
    degrees_of_freedom: int | None
    zero_mm: float
    u_zero_mm: float


def record_values(calibration: BaselineCalibration) -> BaselineRecordValues:
    """Values of a calibration for BASELINE.toml.

    Pillars in their order along the line.
    """
    s, order = calibration.solution, calibration.order
    rows, covariance = s.places
    n = len(s.x)
    selected = [int(np.flatnonzero(rows == r)[0]) for axis in (0, n) for r in order + axis if r in rows]
    labels = [f"{'x' if rows[k] < n else 'y'} {calibration.names[rows[k] % n]}" for k in selected]
    zero, u_zero = s.of("zero")
    test = calibration.test if isinstance(calibration.test, FullTest) else None
    return {
        "reference_height_m": calibration.reference_height,
        "pillars": tuple(calibration.names[i] for i in order),
        "x_m": tuple(s.x[order].tolist()),
        "y_m": tuple(s.y[order].tolist()),
        "known": tuple(labels),
        "covariance_mm2": tuple(map(tuple, (covariance[np.ix_(selected, selected)] / MILLIMETRE**2).tolist())),
        "s_mm": test.s / MILLIMETRE if test is not None else None,
        "degrees_of_freedom": test.degrees_of_freedom if test is not None else None,
        "zero_mm": zero / MILLIMETRE,
        "u_zero_mm": u_zero / MILLIMETRE,
    }
