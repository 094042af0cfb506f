"""Displayed lengths to horizontal distances between pillars.

With the effect of each common cause.
"""

from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.index.air import air
from catseye.atmosphere.sound.velocity import (
    EARTH_RADIUS,
    arc_to_chord_correction,
    first_velocity_correction,
    second_velocity_correction,
)
from catseye.errors import ValidityError
from catseye.records.files.refusal import refusal
from catseye.records.laboratory.baseline import BaselineShots
from catseye.reduction.baseline.settings import BaselineSettings


@dataclass(frozen=True, eq=False)
class Lengths:
    """Corrections from displayed to horizontal distance of each shot; all (m,).

    index        group index of the air
    first, second, chord   corrections, m
    level        horizontal less slope, m
    distance     horizontal at the reference height, between the pillars' axes, m
    stretch      derivative of the distance by the slope length
    systematic   (m, q) effect of one standard uncertainty of each common cause, m
    effects      (q,) their names
    """

    index: np.ndarray
    first: np.ndarray
    second: np.ndarray
    chord: np.ndarray
    level: np.ndarray
    distance: np.ndarray
    stretch: np.ndarray
    systematic: np.ndarray
    effects: tuple[str, ...]


def horizontal_distance(chord, height_from, height_to, *, reference_height=0.0, radius=EARTH_RADIUS):
    """Distance at a common height from the slope distance, m.

    Between two points at different heights.

    chord              straight line, m
    height_from        of its beginning, m
    height_to          of its end, m
    reference_height   common height of the distance, m
    radius             of the earth at height zero, m

    Along the level surface at the reference height, so that parts of a line add up; its chord is shorter by D³/24R²,
    0.14 um at 510 m. Exact for a round earth: law of cosines with the legs R + h.
    Source: [RUEGER90], reduction of slope distances.

    Raises ValidityError where the heights differ by more than the chord.

    >>> round(float(horizontal_distance(20.4, 4.8, 4.754)), 6)
    20.399933
    """
    chord, height_1, height_2 = (np.asarray(v, float) for v in (chord, height_from, height_to))
    rise = height_2 - height_1
    bad = np.flatnonzero(~(np.abs(rise) < chord))
    if len(bad):
        k = bad[0]
        raise ValidityError(
            f"heights differ by {float(np.ravel(rise)[k]):g} m over a slope distance of "
            f"{float(np.ravel(np.broadcast_to(chord, rise.shape))[k]):g} m; expected less: check the heights"
        )
    common = radius + reference_height
    half = 0.5 * np.sqrt((chord - rise) * (chord + rise) / ((radius + height_1) * (radius + height_2)))
    return 2.0 * common * np.arcsin(half)


def reduce_lengths(
    shots: BaselineShots,
    height: np.ndarray,
    u_height: np.ndarray,
    *,
    reference_height: float,
    settings: BaselineSettings,
) -> Lengths:
    """Horizontal distances at one height, with the common effects.

    shots              as read
    height, u_height   (n,) of the pillars by their numbers in `shots`, m
    reference_height   m
    settings           assumptions
    """
    light = {"wavelength_um": settings.wavelength_um, "co2_ppm": settings.co2_ppm, "model": settings.air_model}
    state = air(shots.temperature_c, shots.pressure_hpa, shots.humidity_percent, **light)
    shown_length = shots.slope
    first = first_velocity_correction(shown_length, settings.reference_index, state.group_index)
    first = np.zeros_like(first) if settings.corrected else first
    along = shown_length + first
    second = second_velocity_correction(along, refraction=settings.refraction)
    chord = arc_to_chord_correction(along, refraction=settings.refraction)
    straight = along + second + chord
    height_1, height_2 = height[shots.start] + shots.instrument, height[shots.end] + shots.target
    try:
        distance = horizontal_distance(straight, height_1, height_2, reference_height=reference_height)
    except ValidityError as problem:
        k = int(np.flatnonzero(~(np.abs(height_2 - height_1) < straight))[0])
        raise refusal(shots.file, f"{shots.where[k]}, {problem}") from problem
    slopes = state.sensitivity
    rise = height_2 - height_1
    stretch = distance * straight / ((straight - rise) * (straight + rise))
    per_index = -(stretch**2) * distance / state.group_index  # a rate on the slope appears in D by 1/cos² of itself
    effects = {
        "temperature": per_index * slopes.temperature_c * settings.u_temperature_c,
        "pressure": per_index * slopes.pressure_hpa * settings.u_pressure_hpa,
        "humidity": per_index * slopes.humidity_percent * settings.u_humidity_percent,
        "formula of the index": per_index * state.standard_uncertainty,
    }
    for k in np.flatnonzero(u_height > 0.0).tolist():
        per_start = (rise / distance - 0.5 * distance / EARTH_RADIUS) * (shots.start == k)
        per_end = (-rise / distance - 0.5 * distance / EARTH_RADIUS) * (shots.end == k)
        effects[f"height of {shots.names[k]}"] = (per_start + per_end) * u_height[k]
    columns = np.stack(list(effects.values()), axis=1)
    level = distance - straight
    return Lengths(
        index=state.group_index,
        first=first,
        second=second,
        chord=chord,
        level=level,
        distance=distance,
        stretch=stretch,
        systematic=columns,
        effects=tuple(effects),
    )
