"""Simulated panel setting: a crew measures solid panels, by geometry alone.

Each panel is a piece of the paraboloid, moved and turned as a rigid body, with a twist and bumps on it. The tool stands
on its shaft; each gauge's intersection with the solid panel is searched along its line, and the panel is found by
crossing the outlines. Nothing here is linear, and only the records of the reduction are used.
"""

from dataclasses import dataclass

import numpy as np

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import PanelLayout


@dataclass(frozen=True, eq=False)
class SolidPanels:
    """Panels as rigid bodies: v -> middle + R (v - middle) + shift, reflector frame.

    middle    (p, 3) m
    shift     (p, 3) m
    rotation  (p, 3, 3)
    twist     (p,) m at a corner of the panel's half sides
    half      (p, 2) m, half sides along and across
    bumps     (p, n) m amplitudes of waves on the surface, bump_k (n, 2) rad/m, bump_phase (n,)
    """

    layout: PanelLayout
    middle: np.ndarray
    shift: np.ndarray
    rotation: np.ndarray
    twist: np.ndarray
    half: np.ndarray
    bumps: np.ndarray
    bump_k: np.ndarray
    bump_phase: np.ndarray

    def shape(self, panel: np.ndarray, xy: np.ndarray) -> np.ndarray:
        """Height of the panel's surface over its design, (n,) m.

        At places of the design (n, 2).
        """
        arm = xy - self.middle[panel, :2]
        out = self.middle[panel, :2] / np.linalg.norm(self.middle[panel, :2], axis=1)[:, None]
        along = np.sum(arm * out, axis=1)
        across = out[:, 0] * arm[:, 1] - out[:, 1] * arm[:, 0]
        half = self.half[panel]
        wave = np.sin(xy @ self.bump_k.T + self.bump_phase)
        return self.twist[panel] * along * across / (half[:, 0] * half[:, 1]) + np.sum(self.bumps[panel] * wave, axis=1)

    def meets(self, panel: np.ndarray, start: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Distance (n,) m along a line to the panel's surface, by secants."""

        def outside(s: np.ndarray) -> np.ndarray:
            point = start + s[:, None] * direction
            offset = point - self.middle[panel] - self.shift[panel]
            design = self.middle[panel] + np.einsum("nji,nj->ni", self.rotation[panel], offset)
            rise = design[:, 2] - np.sum(design[:, :2] ** 2, axis=1) / (4.0 * self.layout.focal_length)
            length = np.sqrt(1.0 + np.sum(design[:, :2] ** 2, axis=1) / (2.0 * self.layout.focal_length) ** 2)
            return rise / length - self.shape(panel, design[:, :2])

        a, b = np.zeros(len(start)), np.full(len(start), 1e-4)
        fa, fb = outside(a), outside(b)
        for _ in range(20):
            step = np.where(fb == fa, 0.0, fb * (b - a) / np.where(fb == fa, 1.0, fb - fa))
            a, fa, b = b, fb, b - step
            fb = outside(b)
            if np.max(np.abs(step), initial=0.0) < 1e-13:
                break
        return b

    def heights(self) -> np.ndarray:
        """Height (p, 4) m of panel corners over the paraboloid, along normals."""
        p = np.repeat(np.arange(len(self.layout.panels)), 4)
        xy = self.layout.xy[self.layout.quad].reshape(-1, 2)
        point, _, _, normal = frame_at(xy, self.layout.focal_length)
        return self.meets(p, point, normal).reshape(-1, 4)


def frame_at(xy: np.ndarray, focal_length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3) of the paraboloid with outward, round and normal axes.

    Gradients of z - (x² + y²)/4f, crossed.
    """
    point = np.column_stack([xy, np.sum(xy**2, axis=1) / (4.0 * focal_length)])
    normal = np.column_stack([-xy / (2.0 * focal_length), np.ones(len(xy))])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    round_ = np.cross([0.0, 0.0, 1.0], np.column_stack([xy, np.zeros(len(xy))]))
    round_ /= np.linalg.norm(round_, axis=1)[:, None]
    return point, np.cross(round_, normal), round_, normal


def solid_panels(
    layout: PanelLayout,
    rng: np.random.Generator,
    *,
    piston: float = 3e-4,
    slope: float = 1e-4,
    twist: float = 3e-5,
    bump: float = 0.0,
) -> SolidPanels:
    """Randomly displaced panels, before setting.

    piston   m along the normal; slope rad about two axes; twist m at its corners; bump m rms of the surface
    """
    p = len(layout.panels)
    four = layout.xy[layout.quad]
    xy = four.mean(axis=1)
    middle, out, round_, normal = frame_at(xy, layout.focal_length)
    turn = rng.normal(0.0, slope, (p, 1)) * out + rng.normal(0.0, slope, (p, 1)) * round_
    turn += rng.normal(0.0, slope, (p, 1)) * normal
    half = 0.25 * np.stack(
        [np.linalg.norm(four[:, 1] + four[:, 2] - four[:, 0] - four[:, 3], axis=1),
         np.linalg.norm(four[:, 2] + four[:, 3] - four[:, 0] - four[:, 1], axis=1)], axis=1,
    )  # fmt: skip
    waves = 6
    length = rng.uniform(2.0, 5.0, waves)
    angle = rng.uniform(0.0, 2.0 * np.pi, waves)
    return SolidPanels(
        layout=layout,
        middle=middle,
        shift=rng.normal(0.0, piston, (p, 1)) * normal,
        rotation=_rotations(turn),
        twist=rng.normal(0.0, twist, p),
        half=half,
        bumps=rng.normal(0.0, 1.0, (p, waves)) * bump * np.sqrt(2.0 / waves),
        bump_k=(2.0 * np.pi / length)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]),
        bump_phase=rng.uniform(0.0, 2.0 * np.pi, waves),
    )


def _rotations(vector: np.ndarray) -> np.ndarray:
    """Rotations (p, 3, 3) of rotation vectors, Rodrigues."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None]
    x, y, z = vector.T
    o = np.zeros_like(x)
    k = np.moveaxis(np.array([[o, -z, y], [z, o, -x], [-y, x, o]]), 2, 0) / np.where(angle == 0.0, 1.0, angle)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def panel_at(layout: PanelLayout, xy: np.ndarray) -> int:
    """Index of the panel whose outline encloses a place; -1 if none."""
    a = layout.xy[layout.quad] - xy
    b = np.roll(a, -1, axis=1)
    up = (a[..., 1] <= 0.0) != (b[..., 1] <= 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        where = a[..., 0] - a[..., 1] * (b[..., 0] - a[..., 0]) / (b[..., 1] - a[..., 1])
    inside = np.sum(up & (where > 0.0), axis=1) % 2 == 1
    return int(np.argmax(inside)) if inside.any() else -1


@dataclass(frozen=True, eq=False)
class Crew:
    """Crew and its errors; systematic effects are drawn once a session.

    rng            random generator of all variations
    gauge          m, repeatability of a reading
    zero           m, of a gauge's zero in a session
    lean           rad, lean of the shaft at each corner, in both directions
    inclinometer   rad, noise of a reading of the lean; nan: no inclinometer
    level          rad, zero of the inclinometers in a session
    shaft          m, how far shafts stand off the design
    flat           m, unevenness of the flat
    """

    rng: np.random.Generator
    gauge: float = 3e-6
    zero: float = 3e-6
    lean: float = 20.0 * ARCSECOND
    inclinometer: float = 5.0 * ARCSECOND
    level: float = 10.0 * ARCSECOND
    shaft: float = 5e-4
    flat: float = 1e-6


HEADER = (
    "corner,turn,session,member,a_mm,b_mm,c_mm,d_mm,lean_x_arcsec,lean_y_arcsec,temperature_c,elevation_deg"  # of CSV
)


@dataclass(frozen=True, eq=False)
class CornerTour:
    """Places where a crew uses its tool.

    turns          of the tool at each corner, quarter turns
    corners        numbers; all if None, in sessions of `a_day`, each by the next of `members`
    elevation_deg  of the telescope
    """

    turns: tuple[int, ...] = (0, 2)
    corners: np.ndarray | None = None
    members: tuple[str, ...] = ("first", "second")
    a_day: int = 60
    elevation_deg: float = 77.6


def panel_readings(
    solid: SolidPanels,
    sheet: PanelInstrument,
    crew: Crew,
    *,
    tour: CornerTour | None = None,
    shafts: np.ndarray | None = None,
) -> tuple[list[str], np.ndarray]:
    """Rows of READINGS.csv with header, and heights (c,) of all shafts, m.

    solid      panels as they stand
    sheet      of the instrument: places, linearity, scale, temperature, sag of its gauges
    tour       of all corners if None
    shafts     heights, drawn if None
    """
    tour = tour or CornerTour()
    layout, rng = solid.layout, crew.rng
    chosen = np.arange(len(layout.corners)) if tour.corners is None else tour.corners
    stands = rng.normal(0.0, crew.shaft, len(layout.corners)) if shafts is None else shafts
    lines, flat = [HEADER], rng.normal(0.0, crew.flat, 4)
    for day in range(-(-len(chosen) // tour.a_day)):
        zero, level = rng.normal(0.0, crew.zero, 4), rng.normal(0.0, crew.level, 2)
        warm = sheet.flat_temperature_c + rng.normal(0.0, 3.0)
        place = (f"day{day + 1:02d}", tour.members[day % len(tour.members)])
        lines += [_on_flat(sheet, crew, place, zero + flat, warm)]
        for corner in chosen[day * tour.a_day : (day + 1) * tour.a_day]:
            lean = rng.normal(0.0, crew.lean, 2)
            for turn in tour.turns:
                lines.append(
                    _placement(solid, sheet, crew, (int(corner), turn), place, (zero, level, lean, warm),
                               tour.elevation_deg, stands[corner])
                )  # fmt: skip
        lines += [_on_flat(sheet, crew, place, zero + flat, warm)]
    return lines, stands


def _gauge_readings(true: np.ndarray, sheet: PanelInstrument, warm: float) -> np.ndarray:
    """Gauge readings (4,) m for displacements (4,).

    With scale, linearity undone by bisection, temperature, digits.
    """
    readings = np.empty(4)
    for k, g in enumerate(sheet.gauge):
        target = (true[k] + g.zero_um_per_c * 1e-6 * (warm - sheet.flat_temperature_c)) * (1.0 + g.scale_ppm * 1e-6)
        low, high = target - 1e-3, target + 1e-3
        at, correction = (np.array(v) for v in zip(*g.linearity, strict=True)) if g.linearity else ([0.0], [0.0])
        for _ in range(60):
            middle = 0.5 * (low + high)
            if middle + np.interp(middle, np.array(at) * 1e-3, np.array(correction) * 1e-6) < target:
                low = middle
            else:
                high = middle
        readings[k] = np.round(0.5 * (low + high) / (sheet.resolution_um * 1e-6)) * sheet.resolution_um * 1e-6
    return readings


def _on_flat(sheet: PanelInstrument, crew: Crew, place: tuple[str, str], zero: np.ndarray, warm: float) -> str:
    readings = _gauge_readings(zero + crew.rng.normal(0.0, crew.gauge, 4), sheet, warm)
    cells = ",".join(f"{v / MILLIMETRE:.3f}" for v in readings)
    return f"FLAT,0,{place[0]},{place[1]},{cells},,,{warm:.1f},"


def _placement(
    solid: SolidPanels,
    sheet: PanelInstrument,
    crew: Crew,
    where: tuple[int, int],
    place: tuple[str, str],
    effects: tuple[np.ndarray, np.ndarray, np.ndarray, float],
    elevation_deg: float,
    stand: float,
) -> str:
    """One row: the tool on its shaft, turned and leaning.

    Gauges run along its axis to the surface.
    """
    (corner, turn), (zero, level, lean, warm) = where, effects
    layout = solid.layout
    point, out, round_, normal = (v[0] for v in frame_at(layout.xy[[corner]], layout.focal_length))
    angle = turn * np.pi / 2.0
    x, y = np.cos(angle) * out + np.sin(angle) * round_, np.cos(angle) * round_ - np.sin(angle) * out
    axis = normal + np.tan(lean[0]) * out + np.tan(lean[1]) * round_
    axis /= np.linalg.norm(axis)
    own_x = x - axis * (x @ axis)
    own_x /= np.linalg.norm(own_x)
    own_y = np.cross(axis, own_x)
    foot = point + stand * normal
    base = np.array([foot + g.x_mm * 1e-3 * own_x + g.y_mm * 1e-3 * own_y for g in sheet.gauge])
    panel = np.array([panel_at(layout, b[:2]) for b in base])
    on = panel >= 0
    length = np.full(4, np.nan)
    length[on] = solid.meets(panel[on], base[on], np.tile(axis, (int(on.sum()), 1)))
    elevation = np.radians(elevation_deg)
    up = np.array([0.0, -np.cos(elevation), np.sin(elevation)])
    droop = np.array([g.sag_um for g in sheet.gauge]) * 1e-6 * (1.0 - float(normal @ up))
    readings = _gauge_readings(
        np.where(on, length, 0.0) - droop + zero + crew.rng.normal(0.0, crew.gauge, 4), sheet, warm
    )
    cells = ",".join(f"{v / MILLIMETRE:.3f}" if ok else "" for v, ok in zip(readings, on, strict=True))
    leans = ","
    if np.isfinite(crew.inclinometer):
        read = np.array([axis @ x, axis @ y]) + level + crew.rng.normal(0.0, crew.inclinometer, 2)
        leans = ",".join(f"{v / ARCSECOND:.1f}" for v in read)
    return f"{layout.corners[corner]},{turn},{place[0]},{place[1]},{cells},{leans},{warm:.1f},{elevation_deg}"


def screwed(solid: SolidPanels, corner_moves: np.ndarray) -> SolidPanels:
    """Panels after corner moves (p, 4) m along the normals.

    Each is turned to fit, and twisted by the remainder.

    corner_moves   in the layout's order
    """
    layout = solid.layout
    four = frame_at(layout.xy[layout.quad].reshape(-1, 2), layout.focal_length)[0].reshape(-1, 4, 3)
    _, out, round_, normal = frame_at(solid.middle[:, :2], layout.focal_length)
    arm = four - solid.middle[:, None]
    u, v = np.einsum("pkc,pc->pk", arm, out), np.einsum("pkc,pc->pk", arm, round_)
    flat_arm = layout.xy[layout.quad] - solid.middle[:, None, :2]
    radial = solid.middle[:, :2] / np.linalg.norm(solid.middle[:, :2], axis=1)[:, None]
    along = np.einsum("pkc,pc->pk", flat_arm, radial)
    across = radial[:, None, 0] * flat_arm[..., 1] - radial[:, None, 1] * flat_arm[..., 0]
    saddle = along * across / (solid.half[:, :1] * solid.half[:, 1:])
    design = np.stack([np.ones_like(u), u, v, saddle], axis=2)
    a = np.linalg.solve(design, corner_moves[..., None])[..., 0]
    turn = a[:, 2:3] * out - a[:, 1:2] * round_  # w × (u out + v round) along the normal: w_out v - w_round u
    return SolidPanels(
        **{
            **solid.__dict__,
            "shift": solid.shift + a[:, :1] * normal,
            "rotation": _rotations(turn) @ solid.rotation,
            "twist": solid.twist + a[:, 3],
        }
    )
