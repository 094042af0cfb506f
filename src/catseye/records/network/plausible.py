"""Checks for wrong units: angles beyond the circle, lengths a thousand times off the coordinates.

Impossible values are refused with both interpretations; unlikely ones are accepted with a doubt in the network.
"""

import re
from dataclasses import replace

import numpy as np

from catseye.constants import DEGREE, TWO_PI
from catseye.estimation.network.model import ObservationNetwork, label
from catseye.estimation.observations.kinds import Distances, FixedDistances, HorizontalDistances
from catseye.records.files.refusal import refusal

GON = 0.9 * DEGREE
CIRCLES = 2.0  # turns above which an angle is impossible; accumulated angles may exceed one turn
FAR = 100.0  # times the distance by coordinates: beyond it a wrong unit, not a blunder
CLOSED = 0.05  # relative misclosure of a triangle allowed in the other unit
THOUSAND = (1e-3, 1e3)  # millimetres typed as metres, and kilometres
ALIKE = 3.0  # factor around a thousand within which lengths and coordinates most likely differ by the unit
PACKED = re.compile(r"([0-9]{1,3})([0-5][0-9])([0-5][0-9](?:\.[0-9]+)?)")
LENGTHS = Distances | HorizontalDistances | FixedDistances


def beyond_circle(value: float, unit: str) -> tuple[str, bool]:
    """Both interpretations of an angle beyond the circle, or ""; and True if it is impossible.

    value   rad
    unit    "deg" or "gon" in the file; "rad" for others

    >>> beyond_circle(453015 * DEGREE, "deg")
    ('453015 deg is 1258 turns and 135 deg; read as packed 45-30-15 it is 45.5042 deg', True)
    >>> beyond_circle(450.0 * GON, "gon")[0]
    '450 gon is 1 turn and 50 gon; read with its point lost, 4.50, it is 4.5 gon'
    """
    turns = int(abs(value) // TWO_PI)
    if turns == 0 or abs(value) < TWO_PI * (1.0 + 1e-12):
        return "", False
    size = {"deg": DEGREE, "gon": GON}.get(unit, 1.0)
    number, remainder = value / size, (abs(value) - turns * TWO_PI) / size
    text = f"{number:.10g} {unit} is {turns} turn{'s' * (turns > 1)} and {remainder:.6g} {unit}"
    packed = PACKED.fullmatch(f"{abs(number):.10g}") if unit == "deg" else None
    if packed is not None and int(packed[1]) <= 360:
        degrees = int(packed[1]) + int(packed[2]) / 60.0 + float(packed[3]) / 3600.0
        text += f"; read as packed {packed[1]}-{packed[2]}-{packed[3]} it is {degrees:.6g} deg"
    elif unit == "gon" and float(number).is_integer():
        text += f"; read with its point lost, {number / 100.0:.2f}, it is {number / 100.0:.6g} gon"
    return text, abs(value) > CIRCLES * TWO_PI


def with_lengths_checked(network: ObservationNetwork) -> ObservationNetwork:
    """Network with a doubt for lengths a thousand times off its coordinates; InputError if certain.

    Certain: most lengths that can be checked by reference points are a hundred times too long or too short for them (a
    triangle does not close), and fit after a factor of a thousand. Reference points are held or in the datum.
    """
    rows = _lengths(network)
    if not len(rows[0]):
        return network
    group, row, ends, length, level = rows
    points = network.points
    for reference, must in ((points.fixed, True), (np.isfinite(points.xyz), False)):
        sure = reference & np.isfinite(points.xyz)
        places = np.where(level[:, None], sure[ends][:, :, :2].all(axis=2), sure[ends].all(axis=2))
        checked, wrong = _triangles(points.xyz, ends, length, level=level, reference=places)
        if checked < 1 or 2 * len(wrong) < checked:
            continue
        for factor in THOUSAND:
            _, still = _triangles(points.xyz, ends, length * factor, level=level, reference=places, far=1.0 + CLOSED)
            if 2 * len(still) >= max(len(wrong), 1):
                continue
            k = wrong[0]
            unit = "mm" if factor < 1.0 else "km"
            name = label(network, int(group[k]), int(row[k]))
            text = f"{name}, {length[k]:.10g} m, does not fit the coordinates of its points; in {unit} it is "
            text += f"{length[k] * factor:.10g} m, which does ({len(wrong)} of {checked} lengths likewise)"
            if must:
                raise refusal(network.source, f"{text} (expected lengths in m)")
            return replace(network, doubts=(*network.doubts, f"lengths in another unit than the coordinates? {text}"))
    return network


def _lengths(network: ObservationNetwork) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Group, row, points (m, 2), length (m,) and horizontal mask (m,) of every measured length."""
    tables = []
    for g, group in enumerate(network.groups):
        if isinstance(group, LENGTHS):
            m = len(group.observed)
            ends = np.stack([group.origin, group.target], axis=1) // 3
            level = np.full(m, isinstance(group, HorizontalDistances))
            tables.append((np.full(m, g), np.arange(m), ends, group.observed, level))
    if not tables:
        return (np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2), int), np.zeros(0), np.zeros(0, bool))
    joined = tuple(np.concatenate(part) for part in zip(*tables, strict=True))
    finite = np.isfinite(joined[3])
    return tuple(part[finite] for part in joined)


def _triangles(
    xyz: np.ndarray, ends: np.ndarray, length: np.ndarray, *, level: np.ndarray, reference: np.ndarray, far: float = FAR
) -> tuple[int, list[int]]:
    """Number of lengths checked by reference points, and rows `far` times too long or short.

    reference   (m, 2) bool: that end is a reference point
    """
    flat = np.where(np.isfinite(xyz), xyz, 0.0)
    complete = np.flatnonzero(reference.all(axis=1))
    along = flat[ends[complete, 1]] - flat[ends[complete, 0]]
    along[level[complete], 2] = 0.0
    apart = np.linalg.norm(along, axis=1)
    off = (length[complete] > far * apart) | (apart > far * length[complete])
    wrong, checked = complete[off & (apart > 0.0)].tolist(), int(np.sum(apart > 0.0))
    one = np.flatnonzero(reference[:, 0] != reference[:, 1])
    free = np.where(reference[one, 0], ends[one, 1], ends[one, 0])
    anchor = np.where(reference[one, 0], ends[one, 0], ends[one, 1])
    order = np.argsort(free, kind="stable")
    points, first = np.unique(free[order], return_index=True)
    for part in np.split(order, first[1:]) if len(points) else []:
        near, distant = part[np.argmin(length[one[part]])], part[np.argmax(length[one[part]])]
        base = flat[anchor[near]] - flat[anchor[distant]]
        base[2] *= not level[one[near]]
        side = float(np.linalg.norm(base))
        if side == 0.0:
            continue
        checked += 1
        short, long = length[one[near]], length[one[distant]]
        if long - short > far * side or side > far * (long + short):
            wrong.append(int(one[distant]))
    return checked, wrong
