"""Corners of each panel: a table of the layout, or derived from the prisms of a site."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.records.files.reading import Folder
from catseye.records.files.record import Name, Record, Within
from catseye.records.files.refusal import refusal, shown
from catseye.records.site.folder import SiteFolder

CORNER = re.compile(r"DP([0-9]{2,3})(C|[NP][0-9]{2,3})")
SAME_ANGLE = 1e-5  # rad: a millimetre at 100 m, between corners of one rib
COLUMNS = ("panel", "place", "corner", "x_mm", "y_mm", "design_offset_um")


class PanelCorner(Record):
    """Row of the layout: one corner of one panel.

    place              1 to 4, in order around the panel, from x to y
    x_mm, y_mm         coordinates of the corner in the reflector frame; the same in every row of a corner
    design_offset_um   design offset of this panel's surface at the corner, from the paraboloid
    panel              name of the panel
    corner             name of the actuator under the corner
    """

    panel: Name
    place: Annotated[int, Within(1, 4)]
    corner: Name
    x_mm: Annotated[float, Within(-1e6, 1e6)]
    y_mm: Annotated[float, Within(-1e6, 1e6)]
    design_offset_um: Annotated[float, Within(-2000, 2000)]


@dataclass(frozen=True, eq=False)
class PanelLayout:
    """Panels and corners as arrays.

    panels, corners   names
    xy                (c, 2) m, reflector frame
    quad              (p, 4) indices of each panel's corners, in order around it
    offset            (p, 4) m, design offset
    focal_length      m
    hashes            SHA-256 of the input files
    """

    panels: tuple[str, ...]
    corners: tuple[str, ...]
    xy: np.ndarray
    quad: np.ndarray
    offset: np.ndarray
    focal_length: float
    hashes: dict[str, str] = field(default_factory=dict)

    def only(self, panels: np.ndarray) -> "PanelLayout":
        """Layout of some panels (indices, sorted), without corners that none of them has."""
        corners, quad = np.unique(self.quad[panels], return_inverse=True)
        return PanelLayout(
            panels=tuple(self.panels[p] for p in panels),
            corners=tuple(self.corners[c] for c in corners),
            xy=self.xy[corners],
            quad=quad.reshape(-1, 4),
            offset=self.offset[panels],
            focal_length=self.focal_length,
            hashes=self.hashes,
        )

    def rows(self) -> Iterable[tuple[str, int, str, float, float, float]]:
        """Rows of the table of corners."""
        for p, name in enumerate(self.panels):
            for place in range(4):
                c = self.quad[p, place]
                x, y = self.xy[c] / MILLIMETRE
                yield name, place + 1, self.corners[c], round(x, 3), round(y, 3), round(self.offset[p, place] * 1e6, 2)

    def csv(self) -> str:
        """Table of corners as CSV text."""
        return "\n".join([",".join(COLUMNS), *(",".join(map(str, row)) for row in self.rows())]) + "\n"


def read_layout(path: Path, focal_length: float) -> PanelLayout:
    """Layout of a table; InputError unless panels have four corners in order, with places.

    path           of the table
    focal_length   m, of the design paraboloid
    """
    folder = Folder(path.parent)
    rows = folder.table(path.name, PanelCorner)
    if not rows:
        raise refusal(path.name, "holds a header and no rows (expected four per panel)")
    places: dict[str, tuple[float, float]] = {}
    panels: dict[str, dict[int, PanelCorner]] = {}
    for number, row in enumerate(rows, start=1):
        at = (row.x_mm, row.y_mm)
        if places.setdefault(row.corner, at) != at:
            raise refusal(path.name, f"row {number}, corner {row.corner!r} is at {at} (expected {places[row.corner]})")
        if panels.setdefault(row.panel, {}).setdefault(row.place, row) is not row:
            raise refusal(path.name, f"row {number}, place = {row.place} of panel {row.panel!r} is a duplicate")
    number_of = {name: k for k, name in enumerate(places)}
    for name, four in panels.items():
        if sorted(four) != [1, 2, 3, 4]:
            raise refusal(path.name, f"panel {name!r} has places {sorted(four)} (expected 1, 2, 3, 4)")
    quad = np.array([[number_of[four[k].corner] for k in (1, 2, 3, 4)] for four in panels.values()])
    offset = np.array([[four[k].design_offset_um * 1e-6 for k in (1, 2, 3, 4)] for four in panels.values()])
    xy = np.array(list(places.values())) * MILLIMETRE
    layout = PanelLayout(
        panels=tuple(panels),
        corners=tuple(places),
        xy=xy,
        quad=quad,
        offset=offset,
        focal_length=focal_length,
        hashes=dict(folder.hashes),
    )
    _refuse_flat(layout, path.name)
    return layout


def _refuse_flat(layout: PanelLayout, file: str) -> None:
    """Raise InputError unless panels are convex with corners from x to y, none at the vertex."""
    if np.any(np.sum(layout.xy**2, axis=1) == 0.0):
        raise refusal(file, "a corner is the vertex, where no direction is outwards (expected another place)")
    four = layout.xy[layout.quad]
    side = np.roll(four, -1, axis=1) - four
    after = np.roll(side, -1, axis=1)
    bad = np.flatnonzero(np.any(side[..., 0] * after[..., 1] - side[..., 1] * after[..., 0] <= 0.0, axis=1))
    if len(bad):
        raise refusal(
            file, f"panel {layout.panels[bad[0]]!r} lacks four corners in order around it (expected from x to y)"
        )


def layout_of_site(site: SiteFolder) -> PanelLayout:
    """Panels between the prisms DPhhC, DPhhNnn, DPhhPnn of a site's dish; or InputError.

    Between two hoops a panel lies between neighbouring ribs, angles that both hoops have; where the ribs change, a hoop
    has corners of both sides, and a corner of one side is on the edge of a panel of the other. Named Ttt by tier and
    Nnn, Pnn from the plane of symmetry, x below and above zero. Design offsets are zero: they are not published.
    """
    prisms = [(CORNER.fullmatch(name), t) for name, t in site.targets.items() if t.frame == "reflector"]
    corners = [(match, t) for match, t in prisms if match]
    if not corners:
        raise refusal("targets.toml", "has no prisms DPhhC, DPhhNnn, DPhhPnn (expected the corners of panels)")
    names = tuple(t.name for _, t in corners)
    xy = np.array([t.position_mm[:2] for _, t in corners]) * MILLIMETRE
    hoop = np.array([int(match[1]) for match, _ in corners])
    angle = np.arctan2(xy[:, 0], xy[:, 1])
    panels, quads = [], []
    for tier in range(int(hoop.min()), int(hoop.max())):
        inner, outer = (np.flatnonzero(hoop == h) for h in (tier, tier + 1))
        inner, outer = inner[np.argsort(angle[inner])], outer[np.argsort(angle[outer])]
        if not len(inner) or not len(outer):
            raise refusal("targets.toml", f"hoop {tier if not len(inner) else tier + 1} has no prisms")
        at = np.clip(np.searchsorted(angle[outer], angle[inner] - SAME_ANGLE), 0, len(outer) - 1)
        common = np.abs(angle[outer[at]] - angle[inner]) < SAME_ANGLE
        a, b = inner[common], outer[at[common]]
        for k in range(len(a) - 1):  # angles increase from +y to +x, opposite to x to y
            negative_x = float(angle[a[k]] + angle[a[k + 1]]) < 0.0
            on_side = angle[a] + np.roll(angle[a], -1)
            count = int(np.sum(on_side[k:-1] < 0.0)) if negative_x else int(np.sum(on_side[: k + 1] > 0.0))
            panels.append(f"T{tier:02d}{'N' if negative_x else 'P'}{count:02d}")
            quads.append([a[k + 1], b[k + 1], b[k], a[k]])
    layout = PanelLayout(
        panels=tuple(panels),
        corners=names,
        xy=xy,
        quad=np.array(quads, dtype=int),
        offset=np.zeros((len(quads), 4)),
        focal_length=site.site.paraboloid.focal_length_mm * MILLIMETRE,
        hashes={"targets.toml": site.hashes["targets.toml"], "site.toml": site.hashes["site.toml"]},
    )
    unused = sorted(set(range(len(names))) - set(layout.quad.ravel().tolist()))
    if unused:
        raise refusal("targets.toml", f"prism {shown(names[unused[0]])} is not a panel's corner ({len(unused)} such)")
    _refuse_flat(layout, "targets.toml")
    return layout
