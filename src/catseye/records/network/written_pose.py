"""Written poses: pose.json of `catseye pose`, and of `catseye reduce`."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from catseye.constants import DEGREE
from catseye.records.files.reading import Folder
from catseye.records.files.refusal import refusal, shown
from catseye.records.files.verdicts import stored_verdict
from catseye.verdict import Verdict

FILE = "pose.json"
GROUP_POSE = "catseye-pose-1"  # format of `catseye pose --out`
NIGHT_POSE = "catseye-reduction-1"  # format of `catseye reduce --out`
MADE_BY = {GROUP_POSE: "catseye pose --out", NIGHT_POSE: "catseye reduce --out"}
POSTURES = ("posture", "nominal_posture")  # of a group's pose, and of a night's


@dataclass(frozen=True, eq=False)
class WrittenPose:
    """Pose read from a file; None for each part that the file lacks.

    file         as named by the user, for messages
    posture_deg  azimuth and elevation of the telescope, degrees
    frame        axes of rotation and translation: "ground", "alidade", "reflector"; "" if unknown
    rotation     (3,) rad, rotation vector
    covariance   (6, 6) m², m rad, rad²: translation then rotation
    correction   (3,) rad, rad, m: azimuth times cos E, elevation and focus, with beam
    correction_covariance   (3, 3) of it
    verdict      of the pose
    digest       SHA-256 of the file
    pivot, translation   (3,) m, of the rotation, and its shift
    """

    file: str
    posture_deg: tuple[float, float] | None
    frame: str
    rotation: np.ndarray | None
    covariance: np.ndarray | None
    correction: np.ndarray | None
    correction_covariance: np.ndarray | None
    verdict: Verdict | None
    digest: str
    pivot: np.ndarray | None = None
    translation: np.ndarray | None = None

    @property
    def posture(self) -> tuple[float, float] | None:
        """Azimuth and elevation of the telescope, rad."""
        return None if self.posture_deg is None else (self.posture_deg[0] * DEGREE, self.posture_deg[1] * DEGREE)


def read_written_pose(
    path: Path | str, *, expected: tuple[str, ...] = (GROUP_POSE,), folder: Folder | None = None
) -> WrittenPose:
    """Pose of a pose.json.

    path       of the file
    expected   formats that are welcome, of GROUP_POSE and NIGHT_POSE
    folder     of the file, if it collects hashes

    Raises InputError with file, place, value and expectation.
    """
    path = Path(path)
    folder, file = folder or Folder(path.parent), str(path)
    document = _document(folder.text(path.name), file, expected)
    pointing = document.get("pointing")
    beam: Mapping[str, Any] = pointing if isinstance(pointing, dict) else {}
    return WrittenPose(
        file=file,
        posture_deg=_posture_deg(file, document),
        frame=str(document.get("frame") or ""),
        rotation=_numbers(file, document, "rotation", (3,)),
        covariance=_numbers(file, document, "covariance", (6, 6)),
        correction=_numbers(file, beam, "correction", (3,), of="pointing."),
        correction_covariance=_numbers(file, beam, "covariance", (3, 3), of="pointing."),
        verdict=stored_verdict(file, document),
        digest=folder.hashes[path.name],
        pivot=_numbers(file, document, "pivot", (3,)),
        translation=_numbers(file, document, "translation", (3,)),
    )


def _document(text: str, file: str, expected: tuple[str, ...]) -> dict[str, Any]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise refusal(file, f"is not JSON: {problem}") from problem
    mark = document.get("format") if isinstance(document, dict) else None
    if not isinstance(document, dict) or mark not in expected:
        wanted = " or ".join(f"{each!r}, as {MADE_BY[each]} writes it" for each in expected)
        raise refusal(file, f"is not such a pose: format = {shown(mark)} (expected {wanted})")
    return document


def _posture_deg(file: str, document: Mapping[str, Any]) -> tuple[float, float] | None:
    """Posture (2,), degrees, of a document."""
    key = next((each for each in POSTURES if isinstance(document.get(each), dict)), None)
    if key is None:
        return None
    angles = [document[key].get(angle) for angle in ("azimuth_deg", "elevation_deg")]
    if any(isinstance(v, bool) or not isinstance(v, int | float) or not math.isfinite(v) for v in angles):
        raise refusal(file, f"{key} = {shown(document[key])} (expected azimuth_deg and elevation_deg)")
    azimuth, elevation = (float(v) for v in angles)
    return azimuth, elevation


def _numbers(
    file: str, document: Mapping[str, Any], key: str, shape: tuple[int, ...], of: str = ""
) -> np.ndarray | None:
    """Finite numbers of a shape; None where the key is missing."""
    if document.get(key) is None:
        return None
    try:
        values = np.array(document[key], dtype=float)
    except (TypeError, ValueError) as problem:
        raise refusal(file, f"{of}{key} cannot be read: {problem} (expected numbers)") from problem
    if values.shape != shape or not np.isfinite(values).all():
        size = " x ".join(map(str, shape))
        raise refusal(file, f"{of}{key} has the shape {values.shape} (expected {size} finite numbers)")
    return values
