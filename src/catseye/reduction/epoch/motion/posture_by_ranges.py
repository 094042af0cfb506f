"""Posture that the ranges from the ground contradict, with all typed positions of the telescope turned by it.

A tenth of a degree moves the feed arm by a decimetre, a whole half wavelength: every shot then takes the wrong number
of them, and each record looks wrong. Before any adjustment, a phase says where in a half wavelength a target is, and
with the right posture the typed positions say so too, to a tenth of it. The mean cosine of the differences is near
one at the right posture, and no larger than chance beside it.
"""

from collections.abc import Mapping

import numpy as np

from catseye.constants import MILLIMETRE, TWO_PI
from catseye.geometry.antenna.frames import ground_from_reflector_at
from catseye.records.night.campaign import REFERENCE, Campaign
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases
from catseye.reduction.site.places import RangedPoint, nominal_frame, places_of
from catseye.reduction.site.plausible.record import ImplausibleRecord

FARTHEST_DEG, STEP_DEG = 1.5, 0.01  # of the search, each way; a step moves a point 60 m away by a tenth of a wavelength
SAME_DEG = 0.03  # beyond, a posture is another one: pointing corrections are some hundredths of a degree
CERTAIN = 25.0  # n R^2 of the best posture: exp(-25) times the postures tried is one in a million
GOOD = 0.5  # mean cosine from which a posture is not doubted: of typed positions 16 mm off along the lines
BETTER = 0.25  # of its mean cosine than the stated posture's
FEWEST = 12  # lines from the ground to the telescope
INDEX = 1.00027  # group index of air, to 1e-4: 10 mm in 100 m


def posture_by_ranges(
    campaign: Campaign, phases: Phases, electronics: Mapping[str, ElectronicsPhase]
) -> list[ImplausibleRecord]:
    """Posture that the ranges contradict; fatal, as all typed positions turn with it."""
    lines = _lines(campaign, phases, electronics)
    if campaign.postures or len(lines[0]) < FEWEST:
        return []
    stands = campaign.site.campaign
    here = np.array([stands.azimuth_deg, stands.elevation_deg])
    stated = float(_agreement(campaign, lines, here[:1], here[1:])[0])
    if stated > GOOD:
        return []
    count = round(FARTHEST_DEG / STEP_DEG)
    turns = STEP_DEG * np.arange(-count, count + 1)
    best, at = stated, np.zeros(2)
    for azimuth in turns.tolist():
        agreement = _agreement(campaign, lines, np.full(len(turns), here[0] + azimuth), here[1] + turns)
        k = int(np.argmax(agreement))
        if agreement[k] > best:
            best, at = float(agreement[k]), np.array([azimuth, turns[k]])
    if best < stated + BETTER or len(lines[0]) * best**2 < CERTAIN or np.abs(at).max() < SAME_DEG:
        return []
    where = "site.toml: campaign.azimuth_deg, campaign.elevation_deg"
    text = (
        f"{stands.azimuth_deg:g}°, {stands.elevation_deg:g}° contradict the ranges from the ground: {len(lines[0])} "
        f"lines to the telescope fit {stands.azimuth_deg + at[0]:.2f}°, {stands.elevation_deg + at[1]:.2f}° (mean "
        f"cosine of their phases {best:.2f}, here {stated:.2f}); set azimuth_deg and elevation_deg right"
    )
    return [ImplausibleRecord(where, text, "posture", ("telescope",), fatal=True)]


# Targets in the reflector's frame and rangers in the ground's (n, 2, 3), constants, lengths by phase and half
# wavelengths (n,), all m
Lines = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _lines(campaign: Campaign, phases: Phases, electronics: Mapping[str, ElectronicsPhase]) -> Lines:
    """First usable shot on each line from the ground to a point that turns with the telescope."""
    places = places_of(campaign)
    turning = _turning(campaign, places)
    origins, targets, constants, lengths, halves = [], [], [], [], []
    used: set[tuple[str, str]] = set()
    for name in campaign.monuments:
        mine = electronics.get(name)
        if mine is None:
            continue
        d0 = campaign.mirror_of(name).d0_mm * MILLIMETRE
        for row, k in enumerate(mine.shots.tolist()):
            target = campaign.shots.target[k]
            if target == REFERENCE or target not in turning or (name, target) in used:
                continue
            used.add((name, target))
            origins.append(places[name].start)
            targets.append(places[target].start)
            constants.append(places[target].constant + d0)
            half = float(campaign.half_wavelengths(np.array([k]))[0])
            halves.append(half)
            lengths.append(-half * (phases.phase[k] - mine.phase[row]) / TWO_PI)
    on_reflector = nominal_frame(campaign).inverse().points(np.array(targets).reshape(-1, 3))
    ends = on_reflector, np.array(origins).reshape(-1, 3)
    return np.stack(ends, axis=1), np.array(constants), np.array(lengths), np.array(halves)


def _turning(campaign: Campaign, places: Mapping[str, RangedPoint]) -> set[str]:
    """Points typed in the reflector's frame."""
    typed = {t.name for t in campaign.targets.values() if t.frame == "reflector"}
    typed |= {n for t in campaign.triplets.values() if t.frame == "reflector" for n in t.targets}
    return (typed | {r.name for r in campaign.feedarm.ranger}) & set(places)


def _agreement(campaign: Campaign, lines: Lines, azimuth_deg: np.ndarray, elevation_deg: np.ndarray) -> np.ndarray:
    """Mean cosine (k,) of the phases against typed positions, at postures (k,)."""
    ends, constants, lengths, half = lines
    reflector = campaign.site.frames.reflector
    frames = ground_from_reflector_at(
        np.radians(azimuth_deg),
        np.radians(elevation_deg),
        elevation_axis_height=reflector.elevation_axis_height_mm * MILLIMETRE,
        reflector_to_elevation=np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE,
    )
    targets = np.einsum("kij,nj->kni", frames.rotation, ends[:, 0]) + frames.translation[:, None]
    distance = np.linalg.norm(targets - ends[:, 1], axis=2)
    return np.asarray(np.cos(TWO_PI * (INDEX * (distance - constants) - lengths) / half).mean(axis=1))
