"""`follow`: the feed arm's vibration, followed by a phase-locked filter and predicted."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.result import Result, digest_of, quantities
from catseye.api.telescope.inputs import InputFiles, posture_of, refuse_alone
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.night.vibration_series import VibrationSeries
    from catseye.records.site.folder import SiteFolder
    from catseye.records.site.mirror import MirrorGeometry
    from catseye.records.site.structural_model import StructuralModel
    from catseye.records.site.target import FeedArmRanger
    from catseye.reduction.structure.antenna import Antenna
    from catseye.reduction.structure.arm_motion import ArmMotion
    from catseye.reduction.structure.following import FollowedVibration, VibrationSamples

LEADS = (0.128, 0.5, 1.0, 2.0)  # s after the last sample
SLOWEST_MM = 1e4


@dataclass(frozen=True, eq=False, repr=False)
class FollowResult(Result):
    """Vibration of m modes, followed on A axes to the end of its samples.

    frequency_hz, u_frequency_hz   (m,) Hz
    damping_ratio      (m,) of critical
    amplitude, u_amplitude   (m, A) m, after the last sample
    phase, u_phase     (m, A) rad: the displacement is amplitude cos(phase)
    leads              (l,) s after the end of the last sample
    predicted, covariance   (l, A) m and (l, A, A) m^2: vibration at these times
    before, after      (A,) m, rms of the second half's samples, and of what following them leaves
    axes               names of the axes
    followed           everything else of the filter
    motion             of the arm and of a ranger on it; None without a structural model
    read               files that were read
    """

    frequency_hz: np.ndarray
    u_frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    amplitude: np.ndarray
    u_amplitude: np.ndarray
    phase: np.ndarray
    u_phase: np.ndarray
    leads: np.ndarray
    predicted: np.ndarray
    covariance: np.ndarray
    before: np.ndarray
    after: np.ndarray
    axes: tuple[str, ...]
    followed: "FollowedVibration"
    motion: "ArmMotion | None" = None
    read: tuple[Path, ...] = field(default=())

    def passages(self) -> "Sequence[Passage]":
        """Modes with amplitude and phase, residual, and the arm's motion with frame and pivot."""
        from catseye.gateways.structure.following_objects import following_passages

        return following_passages(self.followed, self.motion)

    def rows(self) -> list[str]:
        """Lines of the prediction that the command prints."""
        from catseye.gateways.structure.following_objects import following_lines

        return following_lines(self.followed, self.motion)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye follow --json`."""
        from catseye.gateways.structure.following_objects import following_object

        return following_object(self.followed, self.motion, self.verdict)

    def tables(self) -> "dict[str, QTable]":
        """`modes`: a row a mode and axis; `predicted`: a row a lead; `residuals`: a row a checked sample."""
        vibration, axes = self.followed, self.axes
        m, a = self.amplitude.shape
        modes: dict[str, tuple[Any, str]] = {
            "mode": (np.repeat(np.array(vibration.names), a), ""),
            "axis": (np.tile(np.array(axes), m), ""),
            "frequency": (np.repeat(self.frequency_hz, a), "Hz"),
            "u_frequency": (np.repeat(self.u_frequency_hz, a), "Hz"),
            "damping_ratio": (np.repeat(self.damping_ratio, a), ""),
            "amplitude": (self.amplitude.ravel(), "m"),
            "u_amplitude": (self.u_amplitude.ravel(), "m"),
            "phase": (self.phase.ravel(), "rad"),
            "u_phase": (self.u_phase.ravel(), "rad"),
        }
        predicted: dict[str, tuple[Any, str]] = {"lead": (self.leads, "s")}
        residuals: dict[str, tuple[Any, str]] = {"time": (vibration.samples.seconds[vibration.checked], "s")}
        for k, axis in enumerate(axes):
            predicted[axis] = (self.predicted[:, k], "m")
            predicted[f"u_{axis}"] = (np.sqrt(self.covariance[:, k, k]), "m")
            residuals[f"sample_{axis}"] = (vibration.samples.values[vibration.checked, k], "m")
            residuals[f"residual_{axis}"] = (vibration.residual[:, k], "m")
            residuals[f"claim_{axis}"] = (np.sqrt(vibration.claim[:, k, k]), "m")
        return {"modes": quantities(modes), "predicted": quantities(predicted), "residuals": quantities(residuals)}

    def figures(self) -> "dict[str, Figure]":
        """Last samples beside their predictions and what comes next; residuals before and after following."""
        from catseye.gateways.structure.following_figures import following_figure

        return {"following": following_figure(self.followed)}

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file read."""
        return {path.name: digest_of(path) for path in self.read if path.is_file()}

    def sources(self) -> tuple[Path, ...]:
        """Files and directories that `save` leaves alone: those read."""
        return self.read


@with_units
def follow(
    series: "str | os.PathLike[str]",
    *,
    slope_mm: Annotated[Any, In("mm", one=True)] = None,
    u_signal: Annotated[Any, In("", one=True)] = None,
    u_mm: Annotated[Any, In("mm", one=True)] = None,
    window_s: Annotated[Any, In("s", one=True)] = 0.0,
    modes: Annotated[Any, In("", whole=True)] = 1,
    near_hz: Annotated[Any, In("Hz", many=True)] = None,
    ahead_s: Annotated[Any, In("s", one=True)] = 0.128,
    leads_s: Annotated[Any, In("s", many=True)] = LEADS,
    model: "str | os.PathLike[str] | StructuralModel | None" = None,
    target: str | None = None,
    posture_deg: Annotated[Any, In("deg", many=True)] = None,
    temperature_c: Annotated[Any, In("deg_C", one=True)] = None,
    site: "str | os.PathLike[str] | SiteFolder | None" = None,
    ranger: str | None = None,
) -> FollowResult:
    """Vibration of the feed arm, followed by a phase-locked filter: amplitude, frequency, phase, and what comes next.

    Modes are found in the first half of the samples, or are the model's; the second half checks each prediction.

    series      VIBRATION.csv: signals of a quadrant detector, displacements, ranges, or coordinates at full rate
    slope_mm    of a quadrant detector: displacement over the difference of halves over the sum
    u_signal    noise of each quadrant, unit of the signals
    u_mm        white noise of each displacement, range or coordinate
    window_s    over which each sample is a mean: 0.128 of a ranger's buffer
    modes       number of modes to find, 1 to 6
    near_hz     first guesses of their frequencies, one each
    ahead_s     time over which the check predicts: the nearest whole number of samples
    leads_s     times after the end of the last sample for which the vibration is predicted
    model       structural model whose vibrations are the modes, and which gives the arm's motion
    target      of the model, whose ground coordinates the series has
    posture_deg, temperature_c   of the telescope, at rest, for coordinates and for a ranger
    site, ranger   ranger of the feed arm, whose scan point is predicted; with model and posture_deg

    Raises ArgumentError for arguments that do not fit together, InputError for a series that cannot be used,
    EstimationError where modes cannot be found.
    Source: [PARKER04] section 2.6.1, quadrant detector and loop; the filter: `signal.vibration.filter`.

    >>> found = follow("vibration/quadrant.csv", slope_mm=10, u_signal=0.002, modes=2, near_hz=(0.8, 1.0))
    >>> found.frequency_hz.round(1).tolist(), found.verdict.word
    ([0.8, 1.0], 'good')
    """
    from catseye.records.night.vibration_series import read_vibration_series
    from catseye.records.site.structural_model import StructuralModel
    from catseye.reduction.structure.antenna import antenna_of
    from catseye.reduction.structure.arm_motion import arm_motion
    from catseye.reduction.structure.following import follow_vibration, modes_of_model

    for needed, value, dependent in (
        ("model", model, {"target": target, "site": site, "ranger": ranger}),
        ("ranger", ranger, {"site": site}),
        ("site", site, {"ranger": ranger}),
    ):
        refuse_alone(dependent, needed, value)
    leads = _limited(leads_s, "leads_s", 0.0, 3600.0)
    near = None if near_hz is None else _limited(near_hz, "near_hz", 1e-3, 1e4)
    if near is not None and len(near) != modes:
        raise ArgumentError(f"near_hz has {len(near)} guesses for {modes} modes", "near_hz", "modes")
    for name, number, low, high in (("modes", modes, 1, 6), ("ahead_s", ahead_s, 0.0, 60.0),
                                    ("window_s", window_s, 0.0, 10.0)):  # fmt: skip
        _limited([number], name, low, high)
    for name, number in (("slope_mm", slope_mm), ("u_signal", u_signal), ("u_mm", u_mm)):
        if number is not None and not 0.0 < number <= SLOWEST_MM:
            raise ArgumentError(f"{name} = {number:g} (expected above 0, to {SLOWEST_MM:g})", name)
    files = InputFiles()
    files.paths.append(place_of(series))
    recorded = read_vibration_series(files.paths[-1])
    _refuse_kind(recorded.kind, slope_mm=slope_mm, u_signal=u_signal, u_mm=u_mm, target=target)
    antenna = None if model is None else antenna_of(files.read(model, StructuralModel))
    posture = posture_of(posture_deg)
    if posture is None and (target is not None or ranger is not None):
        raise ArgumentError("posture_deg is missing: the place of target and ranger depends on it", "posture_deg")
    celsius = temperature_c
    if celsius is None:
        celsius = 15.0 if antenna is None else antenna.record.reference_temperature_c
    stated = {"slope_mm": slope_mm, "u_signal": u_signal, "u_mm": u_mm}
    samples = _samples(recorded, antenna, target, posture, celsius, window=float(window_s), **stated)
    if window_s > samples.interval * (1.0 + 1e-9):
        raise ArgumentError(f"window_s = {window_s:g} is longer than the {samples.interval:g} s between samples",
                            "window_s")  # fmt: skip
    if antenna is None:
        vibration = follow_vibration(samples, count=modes, near_hz=near, ahead=ahead_s, leads=leads)
        motion = None
    else:
        record = antenna.record
        vibration = follow_vibration(
            samples,
            modes=modes_of_model(record, samples),
            names=tuple(mode.name for mode in record.vibration),
            ahead=ahead_s,
            leads=leads,
        )
        axes_of_arm = ("x", "y") if target is None else ("x", "y", "z")
        if samples.axes != axes_of_arm and ranger is not None:
            text = f"ranger does not go with the axes {', '.join(samples.axes)}: they do not show how the arm turns"
            raise ArgumentError(text, "ranger")
        arm = None if ranger is None else _on_arm(files, site, ranger)
        motion = None
        if samples.axes == axes_of_arm:
            motion = arm_motion(vibration, antenna, target=target, ranger=arm, posture=posture, temperature_c=celsius)
    frequency, u_frequency = vibration.state.frequencies_hz()
    amplitude, u_amplitude = vibration.state.amplitudes()
    phase, u_phase = vibration.state.phases()
    return FollowResult(
        verdict=vibration.verdict,
        frequency_hz=frequency,
        u_frequency_hz=u_frequency,
        damping_ratio=np.array([mode.damping_ratio for mode in vibration.state.modes]),
        amplitude=amplitude,
        u_amplitude=u_amplitude,
        phase=phase,
        u_phase=u_phase,
        leads=vibration.leads,
        predicted=vibration.predicted,
        covariance=vibration.covariance,
        before=vibration.before,
        after=vibration.after,
        axes=samples.axes,
        followed=vibration,
        motion=motion,
        read=tuple(files.paths),
    )


def _on_arm(files: InputFiles, site: Any, name: str) -> "tuple[FeedArmRanger, MirrorGeometry]":
    """Records of a feed-arm ranger and its mirror. Raises ArgumentError for one on the ground."""
    mounted = files.ranger(None, None, files.site(site), name)
    if mounted.arm is None:
        raise ArgumentError(f"ranger {name} stands on the ground (expected one of the feed arm)", "ranger")
    return mounted.arm, mounted.mirror


def _limited(values: Any, name: str, low: float, high: float) -> tuple[float, ...]:
    """Numbers within limits, one at least. Raises ArgumentError otherwise."""
    row = tuple(float(v) for v in values)
    if not row or not all(low <= v <= high for v in row):
        text = ", ".join(f"{v:g}" for v in row)
        raise ArgumentError(f"{name} = {text} (expected {low:g} to {high:g})", name)
    return row


def _refuse_kind(kind: str, **stated: Any) -> None:
    """Raise ArgumentError for what a kind of series needs and lacks, or has and cannot use."""
    needed = {"quadrant": ("slope_mm", "u_signal"), "ground": ("u_mm", "target")}.get(kind, ("u_mm",))
    for name, value in stated.items():
        if name in needed and value is None:
            raise ArgumentError(f"{name} is missing: a series of the kind {kind} needs {' and '.join(needed)}", *needed)
        if name not in needed and value is not None:
            raise ArgumentError(f"{name} says nothing of a series of the kind {kind}", name)


def _samples(
    recorded: "VibrationSeries",
    antenna: "Antenna | None",
    target: str | None,
    posture: tuple[float, float] | None,
    celsius: float,
    *,
    window: float,
    slope_mm: float | None,
    u_signal: float | None,
    u_mm: float | None,
) -> "VibrationSamples":
    """Samples of a series; of a target's coordinates in its frame's axes."""
    from catseye.reduction.structure.arm_motion import samples_of_target
    from catseye.reduction.structure.following import samples_of

    slope, u = (None if v is None else v * MILLIMETRE for v in (slope_mm, u_mm))
    if recorded.kind != "ground":
        return samples_of(recorded, slope=slope, u_signal=u_signal, u=u, window=window)
    assert antenna is not None
    assert target is not None
    assert posture is not None
    assert u is not None
    return samples_of_target(recorded, antenna, target, posture=posture, temperature_c=celsius, u=u, window=window)
