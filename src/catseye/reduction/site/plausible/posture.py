"""Posture that contradicts the targets: faces ranged from behind, and a dish that its prisms are not on.

A retroreflector returns light through its face only. Targets of the telescope turn with it, so that a posture in
radians, or with azimuth and elevation exchanged, turns faces away from the rangers that hit them. Prisms of the dish
that are typed in the ground frame do not turn with it, and so measure the posture by themselves.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.records.night.campaign import REFERENCE, Campaign
from catseye.records.site.target import TargetRow
from catseye.reduction.site.bodies import ABOVE_THE_GROUND
from catseye.reduction.site.places import nominal_frame, places_of
from catseye.reduction.site.plausible.record import ImplausibleRecord
from catseye.reduction.site.posture import PostureOffset, axis_lean

BEHIND = 92.0 * DEGREE  # incidence from which a face cannot be seen, with 2° for a typed normal
MOST, MOST_FACES = 0.05, 1  # share of the shots, and faces; a single wrong normal has no more faces
FEWEST = 20  # shots on faces that turn with the telescope
FEWEST_PRISMS, U_TYPED_M = 6, 0.005  # twice the unknowns; m, of a typed position at least: chosen
FEWEST_ON_FACE = 3  # shots on one face, all from behind, by which its normal is wrong
LEAST_ELEVATION, MOST_ELEVATION, MOST_AZIMUTH = 0.0, 90.0, 540.0  # degrees, of a cause that is possible
CAUSES: dict[str, Callable[[float, float], tuple[float, float]]] = {
    "both in radians": lambda a, e: (a / DEGREE, e / DEGREE),
    "elevation_deg in radians": lambda a, e: (a, e / DEGREE),
    "azimuth_deg in radians": lambda a, e: (a / DEGREE, e),
    "azimuth and elevation exchanged": lambda a, e: (e, a),
    "a zenith distance for the elevation": lambda a, e: (a, 90.0 - e),
    "an azimuth counted from south": lambda a, e: (a + 180.0, e),
    "an azimuth counted anticlockwise": lambda a, e: (-a, e),
}


def implausible_posture(campaign: Campaign) -> list[ImplausibleRecord]:
    """Posture or normals that turn the faces of ranged targets away.

    Away from the rangers that hit them.
    """
    if campaign.postures:  # a journal's, from the telescope itself
        return []
    faces = _shots_on_faces(campaign)
    count, from_behind = (sum(shots[k] for shots in faces.values()) for k in (0, 1))
    wrong = {name: shots for name, shots in faces.items() if shots[1]}
    if len(wrong) <= MOST_FACES or count < FEWEST or from_behind <= MOST * count:
        return [_turned(name, shots) for name, (shots, b) in wrong.items() if b == shots >= FEWEST_ON_FACE]
    stands = campaign.site.campaign
    azimuth, elevation = stands.azimuth_deg, stands.elevation_deg
    causes = []
    for cause, posture_of in CAUSES.items():
        a, e = posture_of(azimuth, elevation)
        if LEAST_ELEVATION <= e <= MOST_ELEVATION and abs(a) <= MOST_AZIMUTH:
            faces_there = _shots_on_faces(_at(campaign, a, e))
            if not any(b for _, b in faces_there.values()):
                causes.append(f"{cause} ({a:.4g}°, {e:.4g}°)")
    guess = f": looks like {' or '.join(causes)}" if causes else ""
    text = (
        f"at {azimuth:g}°, {elevation:g}° {from_behind} of {count} shots on faces of the telescope would come from "
        f"behind{guess}; set azimuth_deg and elevation_deg right"
    )
    where = "site.toml: campaign.azimuth_deg, campaign.elevation_deg"
    return [ImplausibleRecord(where, text, "posture", ("telescope",), fatal=True)]


def posture_by_ground_prisms(campaign: Campaign) -> list[ImplausibleRecord]:
    """Posture that prisms of the dish contradict, typed in the ground frame.

    Their distances along the normal from the design surface are fitted by a turn of the dish and a shift along its
    axis. The encoders may differ from the dish by as much as the largest pointing correction.
    """
    prisms = _ground_prisms(campaign)
    if campaign.postures or len(prisms) < FEWEST_PRISMS:
        return []
    frame = nominal_frame(campaign)
    points = (np.array([t.position_mm for t in prisms]) * MILLIMETRE - frame.translation) @ frame.rotation
    focal = campaign.site.paraboloid.focal_length_mm * MILLIMETRE
    normals = np.column_stack([-points[:, :2] / (2.0 * focal), np.ones(len(points))])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    distance = (points[:, 2] - (points[:, 0] ** 2 + points[:, 1] ** 2) / (4.0 * focal)) * normals[:, 2]
    pivot = -np.array(campaign.site.frames.reflector.reflector_to_elevation_mm) * MILLIMETRE
    lean = axis_lean(*np.radians([campaign.site.campaign.azimuth_deg, campaign.site.campaign.elevation_deg]))
    turns = lean @ frame.rotation  # (2, 3): axes of larger azimuth and elevation, reflector frame
    design = np.column_stack(
        [*(np.einsum("ij,ij->i", normals, np.cross(axis, points - pivot)) for axis in turns), normals[:, 2]]
    )
    inverse = np.linalg.pinv(design.T @ design)
    solution = inverse @ design.T @ distance
    u_typed = max(float(np.sqrt(np.mean((distance - design @ solution) ** 2))), U_TYPED_M)
    u = u_typed * np.sqrt(np.diag(inverse)[:2])
    offset = PostureOffset("prisms typed in the ground frame", solution[:2], u)
    if not offset.doubt:
        return []
    where = "site.toml: campaign.azimuth_deg, campaign.elevation_deg"
    text = f"{offset.doubt}; kept, set the posture or the positions right"
    return [ImplausibleRecord(where, text, "posture", ("telescope",))]


def _ground_prisms(campaign: Campaign) -> list[TargetRow]:
    """Prisms typed in the ground frame that are too high to stand there."""
    stands = [m.z_mm * MILLIMETRE for m in campaign.monuments.values()]
    least = max(stands, default=0.0) + ABOVE_THE_GROUND
    return [
        t
        for t in campaign.targets.values()
        if t.frame == "ground" and t.kind.shapes_dish and t.position_mm[2] * MILLIMETRE > least
    ]


def _turned(name: str, shots: int) -> ImplausibleRecord:
    text = f"{name} turns its back to the rangers of all {shots} shots on it; kept, see the signs of its normal"
    return ImplausibleRecord("normal", text, "normal", (name,))


def _at(campaign: Campaign, azimuth_deg: float, elevation_deg: float) -> Campaign:
    posture = {"azimuth_deg": azimuth_deg, "elevation_deg": elevation_deg}
    stands = campaign.site.campaign.model_copy(update=posture)
    return replace(campaign, site=campaign.site.model_copy(update={"campaign": stands}))


def _shots_on_faces(campaign: Campaign) -> dict[str, tuple[int, int]]:
    """Shots on each face that turns with the telescope, and those of them from behind.

    From rangers that do not turn with it.
    """
    places = places_of(campaign)
    pairs = zip(campaign.shots.ranger, campaign.shots.target, strict=True)
    lines = Counter((r, t) for r, t in pairs if t != REFERENCE)
    faces: dict[str, tuple[int, int]] = {}
    for (ranger, target), number in lines.items():
        start, face = places[ranger], places[target]
        if face.axis is None or bool(start.body) == bool(face.body):
            continue
        toward = start.start - face.start
        away = bool(toward @ face.axis < np.cos(BEHIND) * np.linalg.norm(toward))
        shots, from_behind = faces.get(target, (0, 0))
        faces[target] = shots + number, from_behind + number * away
    return faces
