"""Statistics of a crew's work.

Corners as found and as left, the result of turns, the quality of readings, day by day.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from catseye.reduction.panels.heights import PanelHeights, weighed_squares

SURE = 0.95  # probability from which a corner counts as within; below 1 - SURE as outside
FEWEST = 2  # least readings of a session for a control limit


@dataclass(frozen=True)
class CornerStatistics:
    """Distribution of corners about their neighbours' mean.

    corners            panel corners with a relative height
    rms                m, of the relative heights as measured
    rms_true           m, without the measurement's scatter: root of mean square less mean u², 0 if below
    within             share with |relative| within the goal, as measured
    expected_within    share of truly conforming corners to be expected: mean of the conformity probabilities
    surely, surely_not, undecided   counts: probability above 0.95, below 0.05, between
    median_u           m
    """

    corners: int
    rms: float
    rms_true: float
    within: float
    expected_within: float
    surely: int
    surely_not: int
    undecided: int
    median_u: float


def standing(heights: PanelHeights, chosen: np.ndarray | None = None) -> CornerStatistics:
    """Statistics of corners (p, 4) bool; of all measured ones if None."""
    selected = heights.known if chosen is None else heights.known & chosen
    h, u, p = heights.relative[selected], heights.u_relative[selected], heights.conforms[selected]
    if not len(h):
        return CornerStatistics(
            corners=0,
            rms=np.nan,
            rms_true=np.nan,
            within=np.nan,
            expected_within=np.nan,
            surely=0,
            surely_not=0,
            undecided=0,
            median_u=np.nan,
        )
    square = float(np.mean(h**2))
    surely, surely_not = int(np.sum(p >= SURE)), int(np.sum(p <= 1.0 - SURE))
    return CornerStatistics(
        corners=len(h),
        rms=square**0.5,
        rms_true=max(square - float(np.mean(u**2)), 0.0) ** 0.5,
        within=float(np.mean(np.abs(h) <= heights.sheet.goal_um * 1e-6)),
        expected_within=float(np.mean(p)),
        surely=surely,
        surely_not=surely_not,
        undecided=len(h) - surely - surely_not,
        median_u=float(np.median(u)),
    )


@dataclass(frozen=True)
class Reader:
    """Agreement of one member's or one session's readings with the others.

    name               of member or session
    readings           used
    variance_factor    1 if they scatter as the sheet claims
    low, high          its limits: 99.7 % of good ones lie between
    u_gauge            m, repeatability by their scatter: the sheet's, times the root of the factor
    doubts             readings in doubt
    corners            relative heights from their readings
    closure            (4,) m, mean change of each gauge's zero on the flat, last less first; nan without two
    """

    name: str
    readings: int
    degrees_of_freedom: float
    variance_factor: float
    low: float
    high: float
    u_gauge: float
    doubts: int
    closure: tuple[float, float, float, float]

    @property
    def in_control(self) -> bool:
        """True if the variance factor lies within its limits."""
        return bool(self.low <= self.variance_factor <= self.high)


def members(heights: PanelHeights) -> list[Reader]:
    """Agreement of each crew member's readings, by name."""
    who = np.array(heights.readings.member)
    return [_reader(heights, name, who == name) for name in sorted(set(heights.readings.member))]


def sessions(heights: PanelHeights) -> list[Reader]:
    """Agreement of each session's readings, in the table's order.

    The points of the control chart.
    """
    return [_reader(heights, name, heights.readings.session == k) for k, name in enumerate(heights.readings.sessions)]


def _reader(heights: PanelHeights, name: str, rows: np.ndarray) -> Reader:
    part, redundancy = weighed_squares(heights)
    used = rows[heights.model.tips.row] & np.isfinite(part)
    degrees = float(np.sum(redundancy[used]))
    factor = float(np.sum(part[used])) / degrees if degrees > 0.5 else np.nan
    low, high = chi2.ppf([0.00135, 0.99865], degrees) / degrees if degrees > FEWEST else (np.nan, np.nan)
    places = {heights.readings.where[k] for k in np.flatnonzero(rows)}
    return Reader(
        name=name,
        readings=int(np.sum(used)),
        degrees_of_freedom=degrees,
        variance_factor=factor,
        low=float(low),
        high=float(high),
        u_gauge=heights.sheet.u_gauge_um * 1e-6 * max(factor, 0.0) ** 0.5,
        doubts=sum(d.where in places for d in heights.doubts),
        closure=_closure(heights, rows),
    )


def _closure(heights: PanelHeights, rows: np.ndarray) -> tuple[float, float, float, float]:
    """Last reading on the flat minus the first.

    By gauge, mean over sessions.
    """
    readings = heights.readings
    changes = []
    for s in range(len(readings.sessions)):
        on_flat = np.flatnonzero(rows & (readings.corner < 0) & (readings.session == s))
        if len(on_flat) > 1:
            changes.append(readings.reading[on_flat[-1]] - readings.reading[on_flat[0]])
    a, b, c, d = np.mean(changes, axis=0) if changes else np.full(4, np.nan)
    return float(a), float(b), float(c), float(d)


@dataclass(frozen=True, eq=False)
class Setting:
    """Result of turning the screws, by corners that both tables hold.

    names          (k,) panel and corner
    wanted         (k,) m, intended change: relative height as found, opposite sign
    got            (k,) m, actual change
    gain, u_gain   got over wanted, a straight line through zero by weighted least squares; 1 is perfect
    scatter        m, rms of got less gain times wanted: turning and reading together, without errors of maps

    Both changes hold the readings as found, which pulls the gain towards 1: by u²/rms² of them, 0.2 % at 10 µm of 200.
    """

    names: tuple[tuple[str, str], ...]
    wanted: np.ndarray
    got: np.ndarray
    gain: float
    u_gain: float
    scatter: float


def setting(as_found: PanelHeights, as_left: PanelHeights) -> Setting | None:
    """Result of the crew's turns.

    None where the two tables have fewer than three corners in common.
    """
    where = {(p, c): (i, k) for i, k, p, c in _named(as_found)}
    names, a, b = [], [], []
    for i, k, p, c in _named(as_left):
        if (p, c) in where:
            names.append((p, c))
            a.append(where[p, c])
            b.append((i, k))
    if len(names) < 3:
        return None
    one, two = tuple(np.array(a).T), tuple(np.array(b).T)
    intended = -as_found.relative[one]
    got = as_left.relative[two] - as_found.relative[one]
    u = np.hypot(as_found.u_relative[one], as_left.u_relative[two])
    weight = 1.0 / (u**2 + (as_found.sheet.screw.u_turn * as_found.sheet.screw.pitch_mm * 1e-3) ** 2)
    gain = float(np.sum(weight * intended * got) / np.sum(weight * intended**2))
    remainder = got - gain * intended
    return Setting(
        names=tuple(names),
        wanted=intended,
        got=got,
        gain=gain,
        u_gain=float(np.sqrt(np.mean(weight * remainder**2) / np.sum(weight * intended**2))),
        scatter=float(np.sqrt(np.mean(remainder**2))),
    )


def _named(heights: PanelHeights) -> list[tuple[int, int, str, str]]:
    layout = heights.layout
    return [
        (int(i), int(k), layout.panels[i], layout.corners[layout.quad[i, k]]) for i, k in np.argwhere(heights.known)
    ]


def zeros(heights: PanelHeights) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Zeros (4,) of each session's gauges and their u, m, with its name."""
    at = heights.model.columns
    gauge = np.arange(4)
    zeros_by_session = []
    for s, name in enumerate(heights.readings.sessions):
        value, u = heights.value(at.zero(np.full(4, s), gauge))
        zeros_by_session.append((name, value, u))
    return zeros_by_session
