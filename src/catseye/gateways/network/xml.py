"""Adjusted network in the XML of GNU Gama's gama-local (gama-local-adjustment).

Units are Gama's: m and gon for values, mm and cc (1e-4 gon) for uncertainties, mm2 for covariances; `f` in percent.
Its residual is adjusted minus observed, opposite to catseye's. The a-priori reference standard deviation is 1, because
sigmas are absolute here. Differences from gama-local's own files are listed in the file itself (`DIFFERENCES`).
"""

from collections import Counter
from collections.abc import Iterator
from xml.sax.saxutils import escape

import numpy as np
from scipy.special import ndtri, stdtrit

from catseye.constants import MILLIMETRE, TWO_PI
from catseye.estimation.network.diagnosis import pieces_of
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.version import __version__

NAMESPACE = "http://www.gnu.org/software/gama/gama-local-adjustment"
GON = TWO_PI / 400.0  # rad
CC = 1e-4 * GON  # rad
FULL = 300  # most unknowns with a full covariance matrix; else its diagonal, as with gama-local --cov-band 0
PIECE = 5_000
TAGS = {
    "horizontal_distance": "distance",
    "direction": "direction",
    "angle": "angle",
    "height_difference": "height-diff",
    "slope_distance": "slope-distance",
    "fixed_distance": "slope-distance",
    "zenith_angle": "zenith-angle",
    "azimuth": "azimuth",
    "vector": "d",
    "coordinates": "coordinate-",
}
SUMMARY = (
    ("distances", "distance"),
    ("directions", "direction"),
    ("angles", "angle"),
    ("xyz-coords", "coordinate-"),
    ("h-diffs", "height-diff"),
    ("z-angles", "zenith-angle"),
    ("s-dists", "slope-distance"),
    ("vectors", "d"),
    ("azimuths", "azimuth"),
)
ROLES = {
    "": "<from>%s</from><to>%s</to>",
    "angle": "<from>%s</from><left>%s</left><right>%s</right>",
    "id": "<id>%s</id>",
}
SHORT = "<obs>%.10f</obs><adj>%.10f</adj><stdev>%.6f</stdev><qrr>%.9g</qrr><f>%.3f</f>"
TESTED = f"{SHORT}<std-residual>%.3f</std-residual>"
BODIES = {5: SHORT, 6: TESTED, 8: f"{TESTED}<err-obs>%.6f</err-obs><err-adj>%.6f</err-adj>"}  # by the number of values
TURNING = ("direction", "angle", "azimuth")
DIFFERENCES = """written by catseye, not by gama-local; it differs in this:
  approximate coordinates are the file's, or where it has none the adjusted ones;
  angles are left-handed (clockwise) whatever the input's sense; an orientation runs from the x axis towards y;
  covariances belong to the coordinates as they are written, also where axes and angles are inconsistent;
  a coordinate held alone (x without y) is adjusted with variance 0; x without y, where there is no y, is missing;
  observations left out of the adjustment, and kinds that gama-local does not have, are missing:"""


def network_xml(adjusted: AdjustedNetwork) -> Iterator[str]:
    """Text of the XML file in pieces; without an answer, only the reason.

    adjusted   network; `scaled` becomes Gama's "aposteriori"

    Source: [GAMA18] schema gama-local-adjustment.xsd, version 1.00.
    """
    yield f'<?xml version="1.0"?>\n<gama-local-adjustment xmlns="{NAMESPACE}">\n'
    if not adjusted.answered:
        text = _text(adjusted.solution.status)
        yield f'<error category="gamaLocalAdjustment"><description>{text}</description></error>\n'
    else:
        unknowns = _Unknowns(adjusted)
        yield _comment(adjusted)
        yield f"<description>{_text(adjusted.network.description)}</description>\n"
        yield (
            f'<network-general-parameters gama-local-version="catseye {__version__}" '
            f'gama-local-algorithm="gauss-newton" gama-local-compiler="python" '
            f'axes-xy="{unknowns.axes_name}" angles="left-handed"/>\n'
        )
        yield _summary(adjusted, unknowns)
        yield from _coordinates(adjusted, unknowns)
        yield "<observations>\n"
        yield from _observations(adjusted, unknowns.turn)
        yield "</observations>\n"
    yield "</gama-local-adjustment>\n"


def _text(text: str) -> str:
    """Text of an element; control characters, invalid in XML, become the replacement character."""
    return escape("".join(c if c >= " " or c in "\t\n\r" else "\ufffd" for c in text))


class _Unknowns:
    """Unknown, fixed and constrained coordinates, as Gama counts them: x with y, z alone; orientations."""

    def __init__(self, adjusted: AdjustedNetwork):
        network = adjusted.network
        self.turn, self.axes_name = _level_axes(network.axes)
        flags = [(f @ np.abs(self.turn)) > 0.0 for f in (network.points.fixed, network.points.datum)]
        self.fixed, self.datum = (np.stack([f[:, :2].all(axis=1), f[:, 2]], axis=1) for f in flags)
        self.datum &= ~self.fixed
        absent = (network.points.absent @ np.abs(self.turn)) > 0.0
        self.existing = np.stack([~absent[:, :2].any(axis=1), ~absent[:, 2]], axis=1)
        self.x, self.given = (
            np.where(absent, np.nan, np.where(network.points.absent, 0.0, xyz) @ self.turn)
            for xyz in (adjusted.solution.x, network.points.xyz)
        )
        columns: dict[int, int] = {}
        for group in network.groups:
            column = getattr(group, "orientation", None)
            if column is not None:
                columns |= {int(c): int(o) // 3 for c, o in zip(column, group.origin, strict=True) if c >= 0}  # type: ignore[attr-defined]
        self.orientations = dict(sorted(columns.items()))
        free = np.repeat(~self.fixed & self.existing, (2, 1), axis=1)
        self.coordinates = np.flatnonzero(free.ravel())  # in the file's axes
        self.clockwise = -np.sign(np.linalg.det(self.turn[:2, :2]))  # from x to y
        self.zero = np.arctan2(self.turn[0, 0], self.turn[1, 0])  # azimuth of the x axis

    def covariance(self, adjusted: AdjustedNetwork) -> tuple[np.ndarray, int]:
        """Upper band of the unknowns' covariance by rows, and its width without the diagonal, unscaled."""
        size = len(self.coordinates) + len(self.orientations)
        turns = np.array(list(self.orientations), dtype=int)
        angular = np.full(len(turns), self.clockwise / CC)
        if size > FULL:
            blocks = np.nan_to_num(adjusted.solution.covariance)  # absent coordinates are not among these
            variances = np.einsum("ki,nkl,li->ni", self.turn, blocks, self.turn).ravel()
            return np.concatenate(
                [variances[self.coordinates] / MILLIMETRE**2, adjusted.solution.q.diagonal()[turns] / CC**2]
            ), 0
        points, place = np.divmod(self.coordinates, 3)
        named = np.unique(points)
        q = adjusted.solution.q.within(np.concatenate([(3 * named[:, None] + np.arange(3)).ravel(), turns]))
        to = np.zeros((size, len(q)))
        row = np.arange(len(points))
        for axis in range(3):
            to[row, 3 * np.searchsorted(named, points) + axis] = self.turn[axis, place] / MILLIMETRE
        to[len(points) + np.arange(len(turns)), 3 * len(named) + np.arange(len(turns))] = angular
        return (to @ q @ to.T)[np.triu_indices(size)], size - 1


def _level_axes(axes: np.ndarray) -> tuple[np.ndarray, str]:
    """Axes of the file and Gama's name of them; x east, y north if the third is not up."""
    if axes[2, 2] != 1.0:
        return np.eye(3), "en"
    letters = {(1, 0): "e", (-1, 0): "w", (0, 1): "n", (0, -1): "s"}
    return axes, "".join(letters[int(axes[0, k]), int(axes[1, k])] for k in (0, 1))


def _comment(adjusted: AdjustedNetwork) -> str:
    table = adjusted.table
    counts = [f"{n} of kind {kind.replace('_', ' ')}" for kind, n in _by_kind(adjusted) if n and kind not in TAGS]
    counts += [f"{int(np.sum(~table.active))} left out"] if not table.active.all() else []
    text = f"{DIFFERENCES} {', '.join(counts) or 'none here'}"
    return f"<!-- {_text(text).replace('--', '- -')} -->\n"


def _by_kind(adjusted: AdjustedNetwork) -> list[tuple[str, int]]:
    """Number of active rows of each kind; vectors and coordinates count once, as in gama-local."""
    table = adjusted.table
    split = np.array([TAGS.get(kind, "") in ("d", "coordinate-") for kind in table.kinds], dtype=bool)[table.kind]
    counted = table.active & (~split | (table.component == adjusted.network.axis_names[0]))
    return list(zip(table.kinds, np.bincount(table.kind[counted], minlength=len(table.kinds)).tolist(), strict=True))


def _summary(adjusted: AdjustedNetwork, unknowns: _Unknowns) -> str:
    network, table, overall = adjusted.network, adjusted.table, adjusted.global_test
    kinds: Counter[str] = Counter()
    for kind, count in _by_kind(adjusted):
        kinds[TAGS.get(kind, "")] += count
    priors = sum(0.0 < p.sigma < np.inf for p in network.parameters)
    equations = int(table.active.sum()) + priors
    free = int(np.sum(network.points.free)) + sum(p.sigma > 0.0 for p in network.parameters)
    degrees = round(adjusted.solution.degrees_of_freedom)
    tested = np.isfinite(overall.p)
    ratio, lower, upper = (np.sqrt(v) if tested else 0.0 for v in (overall.factor, overall.lower, overall.upper))
    changed = ~unknowns.fixed & unknowns.existing
    states = (("adjusted", changed), ("constrained", unknowns.datum), ("fixed", unknowns.fixed))
    return "".join(
        [
            "<network-processing-summary>\n<coordinates-summary>\n",
            *(
                f"  <coordinates-summary-{name}><count-xyz>{np.sum(xy & z)}</count-xyz><count-xy>{np.sum(xy & ~z)}"
                f"</count-xy><count-z>{np.sum(z & ~xy)}</count-z></coordinates-summary-{name}>\n"
                for name, (xy, z) in ((name, state.T) for name, state in states)
            ),
            "</coordinates-summary>\n<observations-summary>",
            *(f"<{name}>{kinds[tag]}</{name}>" for name, tag in SUMMARY),
            f"</observations-summary>\n<project-equations><equations>{equations}</equations><unknowns>{free}</unknowns>"
            f"<degrees-of-freedom>{degrees}</degrees-of-freedom><defect>{degrees - equations + free}</defect>"
            f"<sum-of-squares>{ratio**2 * degrees:.7e}</sum-of-squares>",
            "<connected-network/>" if not pieces_of(network).any() else "<disconnected-network/>",
            f"</project-equations>\n<standard-deviation><apriori>1</apriori><aposteriori>{ratio:.7e}</aposteriori>"
            f"<used>{'aposteriori' if adjusted.scaled else 'apriori'}</used><probability>{1.0 - adjusted.level:.3f}"
            f"</probability><ratio>{ratio:.6f}</ratio><lower>{lower:.6f}</lower><upper>{upper:.6f}</upper>",
            "<passed/>" if tested and lower < ratio < upper else "<failed/>",
            f"<confidence-scale>{_confidence_scale(adjusted):.7e}</confidence-scale></standard-deviation>\n</network-processing-summary>\n",
        ]
    )


def _confidence_scale(adjusted: AdjustedNetwork) -> float:
    """Half a confidence interval in standard deviations: normal, or Student's if scaled."""
    tail = 0.5 * adjusted.level
    return -float(stdtrit(adjusted.solution.degrees_of_freedom, tail) if adjusted.scaled else ndtri(tail))


def _coordinates(adjusted: AdjustedNetwork, unknowns: _Unknowns) -> Iterator[str]:
    approximate = np.where(np.isfinite(unknowns.given), unknowns.given, unknowns.x)
    yield "<coordinates>\n"
    for tag, xyz, mask in (
        ("fixed", unknowns.x, unknowns.fixed),
        ("approximate", approximate, ~unknowns.fixed & unknowns.existing),
        ("adjusted", unknowns.x, ~unknowns.fixed & unknowns.existing),
    ):
        yield f"<{tag}>\n"
        capital = unknowns.datum if tag != "fixed" else np.zeros_like(unknowns.datum)
        rows = zip(adjusted.names, xyz.tolist(), mask.tolist(), capital.tolist(), strict=True)
        yield "".join([_point(*row) for row in rows if any(row[2])])
        yield f"</{tag}>\n"
    yield "<orientation-shifts>\n"
    start = 3 * len(adjusted.names)
    for column, point in unknowns.orientations.items():
        values = (adjusted.network.parameters[column - start].start, adjusted.solution.parameters[column - start])
        approx, corrected = ((unknowns.clockwise * (v - unknowns.zero)) % TWO_PI / GON for v in values)
        name = _text(adjusted.names[point])
        yield f"  <orientation><id>{name}</id><approx>{approx:.6f}</approx><adj>{corrected:.8f}</adj></orientation>\n"
    entries, band = unknowns.covariance(adjusted)
    entries = (entries * adjusted.factor).tolist()
    size = len(unknowns.coordinates) + len(unknowns.orientations)
    yield f"</orientation-shifts>\n<cov-mat><dim>{size}</dim><band>{band}</band>\n"
    for low in range(0, len(entries), PIECE):
        yield "".join([f"<flt>{value:.9e}</flt>\n" for value in entries[low : low + PIECE]])
    yield "</cov-mat>\n<original-index>\n"
    indices = [*(unknowns.coordinates + 1).tolist(), *(column + 1 for column in unknowns.orientations)]
    yield "".join([f"<ind>{i}</ind>\n" for i in indices])
    yield "</original-index>\n</coordinates>\n"


def _point(name: str, xyz: list[float], mask: list[bool], capital: list[bool]) -> str:
    x, y = ("X", "Y") if capital[0] else ("x", "y")
    z = "Z" if capital[1] else "z"
    level = f"<{x}>{xyz[0]:.10f}</{x}><{y}>{xyz[1]:.10f}</{y}>" if mask[0] else ""
    return f"  <point><id>{_text(name)}</id>{level}{f'<{z}>{xyz[2]:.10f}</{z}>' if mask[1] else ''}</point>\n"


def _observations(adjusted: AdjustedNetwork, turn: np.ndarray) -> Iterator[str]:
    table = adjusted.table
    written = np.abs(turn.T @ adjusted.network.axes).argmax(axis=0)  # index of the file's axes
    letter = {name: "xyz"[int(k)] for name, k in zip(adjusted.network.axis_names, written, strict=True)}
    supported = np.array([kind in TAGS for kind in table.kinds], dtype=bool)
    rows = np.flatnonzero(table.active & supported[table.kind])
    names = [_text(name) for name in adjusted.names]
    numbers, length = _numbers(adjusted, table.sign if turn is not adjusted.network.axes else np.ones(len(table)))
    for low in range(0, len(rows), PIECE):
        part = rows[low : low + PIECE]
        lines = []
        columns = (c[part].tolist() for c in (table.kind, table.component, length, table.ends, numbers))
        for kind, component, count, at, row in zip(*columns, strict=True):
            tag = TAGS[table.kinds[kind]] + letter.get(component, "")
            roles = ROLES.get("id" if tag.startswith("coordinate") else tag, ROLES[""])
            ends = [names[i] for i in at[: roles.count("%s")]]
            lines.append(f"<{tag}>{roles}{BODIES[count]}</{tag}>\n" % (*ends, *row[:count]))
        yield "".join(lines)


def _numbers(adjusted: AdjustedNetwork, sign: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values that gama-local writes of the observations, (m, 8), and their number (m,).

    sign   (m,) sign of components in the written axes

    The error is given for uncorrelated observations that are well checked or have a large residual.
    """
    table, share, scale = adjusted.table, _adjusted_share(adjusted), np.sqrt(adjusted.factor)
    angular = table.unit == "rad"
    value, fine = np.where(angular, GON, 1.0), np.where(angular, CC, MILLIMETRE)
    observed, corrected = sign * table.observed / value, sign * (table.observed - table.residual) / value
    turning = np.array([TAGS.get(kind) in TURNING for kind in table.kinds], dtype=bool)[table.kind]
    sigma, v = table.u / fine, -sign * table.residual / fine
    qrr, control = (1.0 - share) * sigma**2, 100.0 * np.abs(1.0 - np.sqrt(share))
    with np.errstate(invalid="ignore", divide="ignore"):  # unchecked: not written
        studentised, error = np.abs(v) / (scale * np.sqrt(qrr)), v / (1.0 - share)
    alone = np.array([g.covariance.ndim == 1 for g in adjusted.network.groups], dtype=bool)[table.group]
    full = alone & ((control >= 5.0) | (studentised > _confidence_scale(adjusted)))
    numbers = np.stack(
        [
            observed,
            np.where(turning, corrected % 400.0, corrected),
            scale * sigma * np.sqrt(share),
            qrr,
            control,
            studentised,
            error,
            error - v,
        ],
        axis=1,
    )
    return numbers, np.where(control < 0.1, 5, np.where(full, 8, 6))


def _adjusted_share(adjusted: AdjustedNetwork) -> np.ndarray:
    """Variance of each adjusted observation over that of the observed one, (m,), variance factor 1."""
    solution, table = adjusted.solution, adjusted.table
    share = 1.0 - table.redundancy
    x = solution.state
    for g, group in enumerate(adjusted.network.groups):
        if group.covariance.ndim > 1:  # not valid for correlated observations
            _, jacobian = group.predict(x)
            columns = np.broadcast_to(group.columns, jacobian.shape)
            of_group = table.group == g
            forms = np.sum(solution.q.products(columns, jacobian) * jacobian, axis=1)[table.row[of_group]]
            share[of_group] = forms / solution.fits[g].sigma[table.row[of_group]] ** 2
    return np.clip(share, 0.0, 1.0)  # rounding
