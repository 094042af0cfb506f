"""`subreflector`: six degrees of freedom of a subreflector and the lengths of its actuators."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.pose import PoseResult
from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.telescope.inputs import InputFiles
from catseye.api.units import In, with_units
from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import ArgumentError, InputError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.network.written_pose import WrittenPose
    from catseye.records.site.subreflector import SubreflectorMount
    from catseye.reduction.pose.subreflector import SubreflectorState

MOST_SHIFT_MM, MOST_TURN_DEG = 5000.0, 80.0


@dataclass(frozen=True, eq=False, repr=False)
class SubreflectorResult(Result):
    """Position of a subreflector and the lengths of its six actuators, with covariance.

    shift        (3,) m, of the pivot from rest, prime-focus axes
    turn         (3,) rad, about x, then y, then z, right-handed
    covariance   (6, 6) m², m rad, rad²: shift then turn
    names        of the actuators
    lengths      (6,) m, between the joints
    lengths_covariance   (6, 6) m²
    changes      (6,) m, lengths less those at rest
    state        everything else
    read         files that were read
    """

    shift: np.ndarray
    turn: np.ndarray
    covariance: np.ndarray
    names: tuple[str, ...]
    lengths: np.ndarray
    lengths_covariance: np.ndarray
    changes: np.ndarray
    state: "SubreflectorState"
    read: tuple[Path, ...] = field(default=())

    def passages(self) -> "Sequence[Passage]":
        """Source of the position, and what brings the subreflector back to rest."""
        from catseye.gateways.pose.subreflector_objects import subreflector_passages

        return subreflector_passages(self.state)

    def rows(self) -> list[str]:
        """Lines of the tables that the command prints: six degrees of freedom, six actuators."""
        from catseye.gateways.pose.subreflector_objects import subreflector_lines

        return subreflector_lines(self.state)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye subreflector --json`."""
        from catseye.gateways.pose.subreflector_objects import subreflector_object

        return {"verdict": self.verdict.to_object(), **subreflector_object(self.state)}

    def tables(self) -> "dict[str, QTable]":
        """`position`: a row a degree of freedom; `lengths`: a row an actuator."""
        u = np.sqrt(np.diag(self.covariance))
        position = {
            "component": ([f"{kind} {axis}" for kind in ("shift", "turn") for axis in "xyz"], ""),
            "value": (np.concatenate([self.shift / MILLIMETRE, self.turn / DEGREE]), ""),
            "u": (u / np.repeat([MILLIMETRE, DEGREE], 3), ""),
            "unit": (["mm"] * 3 + ["deg"] * 3, ""),
        }
        actuators = {
            "actuator": (list(self.names), ""),
            "length": (self.lengths / MILLIMETRE, "mm"),
            "change": (self.changes / MILLIMETRE, "mm"),
            "u": (np.sqrt(np.diag(self.lengths_covariance)) / MILLIMETRE, "mm"),
            "least": (self.state.limits[:, 0] / MILLIMETRE, "mm"),
            "most": (self.state.limits[:, 1] / MILLIMETRE, "mm"),
        }
        return {"position": quantities(position, frame="prime_focus"), "lengths": quantities(actuators)}

    def figures(self) -> "dict[str, Figure]":
        """Actuators at rest and moved, from the side and from above, and their lengths within the limits."""
        from catseye.gateways.pose.subreflector_figures import actuators_figure

        return {"actuators": actuators_figure(self.state)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """Files that `save` leaves alone: those read."""
        return self.read


@with_units
def subreflector(
    mount: "str | os.PathLike[str] | SubreflectorMount",
    *,
    shift_mm: Annotated[Any, In("mm", many=True)] = None,
    turn_deg: Annotated[Any, In("deg", many=True)] = None,
    lengths_mm: Annotated[Any, In("mm", many=True)] = None,
    pose: "str | os.PathLike[str] | WrittenPose | PoseResult | None" = None,
) -> SubreflectorResult:
    """Six degrees of freedom of a subreflector, and the lengths of its six actuators.

    Each from the other: lengths for a wanted position, the position at given lengths, or both from a measured pose.

    mount        subreflector.toml, or its record
    shift_mm     (3,) wanted shift of the pivot from rest, prime-focus axes; 0 without
    turn_deg     (3,) wanted turn about x, then y, then z; 0 without
    lengths_mm   (6,) of the actuators, in the order of the record; instead
    pose         of the subreflector in the reflector frame, of `pose` or its pose.json; instead

    The covariance is that of the actuators' lengths in the record, or the pose's.
    Raises ArgumentError for arguments that do not fit together, InputError for a file or a pose that cannot be used,
    EstimationError where the lengths do not determine a position. Source: [PARKER04] section 2.6;
    `geometry.antenna.subreflector` has the order of the turns.

    >>> moved = subreflector("subreflector/hexapod.toml", shift_mm=(0.0, 0.0, 10.0))
    >>> back = subreflector("subreflector/hexapod.toml", lengths_mm=moved.lengths * 1e3)
    >>> moved.changes.round(5).tolist()[:2], abs(back.shift).round(9).tolist()
    ([-0.0081, -0.0081], [0.0, 0.0, 0.01])
    """
    from catseye.records.site.subreflector import SubreflectorMount
    from catseye.reduction.pose.subreflector import state_of_lengths, state_of_pose, state_of_position

    files = InputFiles()
    record = files.read(mount, SubreflectorMount)
    commanded = shift_mm is not None or turn_deg is not None
    sources = {
        "shift_mm" if shift_mm is not None else "turn_deg": commanded,
        "lengths_mm": lengths_mm is not None,
        "pose": pose is not None,
    }
    ways = [name for name, present in sources.items() if present]
    if len(ways) != 1:
        text = f"{' and '.join(ways)} both state the position" if ways else "the position is missing"
        names = ["shift_mm", "turn_deg", "lengths_mm", "pose"]
        raise ArgumentError(f"{text} (expected shift_mm with turn_deg, lengths_mm, or pose)", *names)
    if commanded:
        shift = _row(shift_mm, "shift_mm", count=3, most=MOST_SHIFT_MM) * MILLIMETRE
        state = state_of_position(record, shift, _row(turn_deg, "turn_deg", count=3, most=MOST_TURN_DEG) * DEGREE)
    elif pose is None:
        state = state_of_lengths(record, _row(lengths_mm, "lengths_mm", count=6, most=1e5) * MILLIMETRE)
    else:
        frame, pivot, translation, rotation, covariance = _pose(pose, files)
        state = state_of_pose(
            record, frame=frame, pivot=pivot, translation=translation, rotation=rotation, covariance=covariance
        )
    return SubreflectorResult(
        verdict=state.verdict,
        shift=state.six[:3],
        turn=state.six[3:],
        covariance=state.covariance,
        names=state.names,
        lengths=state.lengths,
        lengths_covariance=state.lengths_covariance,
        changes=state.lengths - state.rest,
        state=state,
        read=tuple(files.paths),
    )


def _row(values: Any, name: str, *, count: int, most: float) -> np.ndarray:
    """Numbers (count,) of an argument within a limit; zeros without. Raises ArgumentError otherwise."""
    row = np.zeros(count) if values is None else np.asarray(values, dtype=float)
    if row.shape != (count,) or not np.all(np.abs(row) <= most):
        text = ", ".join(f"{v:g}" for v in np.ravel(row))
        raise ArgumentError(f"{name} = {text} (expected {count} numbers, each within {most:g} of 0)", name)
    return row


def _pose(pose: Any, files: InputFiles) -> tuple[str, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Frame, pivot, translation, rotation and covariance of a pose; InputError where its file lacks one."""
    from catseye.records.network.written_pose import WrittenPose, read_written_pose

    if isinstance(pose, PoseResult):
        return pose.frame, pose.pivot, pose.translation, pose.rotation, pose.covariance
    if not isinstance(pose, WrittenPose):
        path = place_of(pose, output=True)
        path = path / "pose.json" if path.is_dir() else path
        files.paths.append(path)
        pose = read_written_pose(path)
    parts = {name: getattr(pose, name) for name in ("pivot", "translation", "rotation", "covariance")}
    lacking = [name for name, value in parts.items() if value is None]
    if lacking:
        raise InputError(f"{pose.file}: {lacking[0]} is missing (expected a pose of catseye pose --out)")
    return pose.frame, *parts.values()
