"""Figure of polarization in cube corners as SVG text: sectors, analyser, far-field axis.

Source: [PARKER04] section 6.2.5; chapter 8 (rotation about the beam).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.gateways.writers.drawing import FAINT, INK, SERIES, STYLE, Figure, Svg, mpl, svg
from catseye.optics.coating import index
from catseye.optics.glass import phase_index
from catseye.optics.polarization import ellipse, linear, retarder
from catseye.optics.retroreflector.corner_polarization import (
    EDGES,
    ORDERS,
    Corner,
    far_field_jones,
    hollow_corner,
    returned_power,
    sector_jones,
    solid_corner,
    through_plate,
)

AZIMUTHS = np.linspace(0.0, np.pi, 73)
TILTS = np.radians(np.linspace(0.0, 20.0, 21))  # total reflection ends at 20.3 deg towards an edge
OBLIQUE = np.radians(15.0)
METALS = ("gold", "silver", "aluminium")
LABELS = 1.42  # radii: labels of sectors, clear of the circle


def corners(wavelength_um: float, glass: str) -> dict[str, Corner]:
    """Compared kinds of corners, by display name."""
    glass_index = float(phase_index(wavelength_um, glass))
    metals = {metal: np.conj(complex(index(metal, wavelength_um))) for metal in METALS}  # opposite time convention
    corners = {
        f"{glass}, bare": solid_corner(glass_index),
        f"{glass}, aluminium behind": solid_corner(glass_index, metals["aluminium"]),
    }
    corners |= {f"hollow, {metal}": hollow_corner(metal_index) for metal, metal_index in metals.items()}
    return corners


def polarization_plot(wavelength_um: float = 0.780, glass: str = "BK7-old") -> tuple[Svg, dict[str, Any]]:
    """Three panels as SVG text, and their numbers.

    wavelength_um   um, in air, 0.62 to 1.01: range of the metals' and the glass's data
    glass           a name in `glass.GLASSES`

    Raises ValidityError outside. At normal incidence the corner is evenly lit and its face has no reflection loss.
    """
    kinds = corners(wavelength_um, glass)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = Figure(figsize=(11.4, 4.3), layout="constrained")
        sectors, analyser, axis = drawn.subplots(1, 3)
        bare = next(iter(kinds.values()))
        _draw_sectors(sectors, bare, glass)
        _draw_analyser(analyser, kinds)
        _draw_axis(axis, kinds)
        return svg(drawn), {
            "wavelength_um": wavelength_um,
            "glass": glass,
            "index": bare.index,
            "corners": {name: _numbers(corner) for name, corner in kinds.items()},
        }


def _numbers(corner: Corner) -> dict[str, float]:
    """Shares of the incident light at normal incidence."""
    jones = sector_jones(corner, 0.0)
    all_back, crossed, axis = _shares(jones)
    split = through_plate(jones, retarder(0.5 * np.pi, 0.25 * np.pi))
    return {
        "returned": float(all_back.mean()),
        "crossed_least": float(crossed.min()),
        "crossed_most": float(crossed.max()),
        "far_field_axis": float(axis.mean()),
        "through_splitter_and_quarter_wave": float(returned_power(split, linear(0.0), analyser=linear(0.5 * np.pi))),
    }


def _shares(jones: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Returned light, crossed analyser and far-field axis, by azimuth of linear polarization."""
    light = linear(AZIMUTHS)
    axis = np.sum(np.abs(np.einsum("ij,aj->ai", far_field_jones(jones), light)) ** 2, axis=1)
    return returned_power(jones, light), returned_power(jones, light, analyser=linear(AZIMUTHS + 0.5 * np.pi)), axis


def _draw_sectors(ax: Any, corner: Corner, glass: str) -> None:
    """Draw the aperture as seen by the ranger, with the field that leaves each sector."""
    ax.set_aspect("equal")
    ax.set_axis_off()
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.plot(np.cos(turn), np.sin(turn), color=FAINT, lw=1.0)
    jones = sector_jones(corner, 0.0)
    for edge in EDGES:
        flat = edge[:2] / np.hypot(*edge[:2])
        ax.plot([0.0, flat[0]], [0.0, flat[1]], color=INK, lw=1.2)
        ax.plot([0.0, -flat[0]], [0.0, -flat[1]], color=FAINT, lw=0.8, ls="--")
    for order, j in zip(ORDERS, jones, strict=True):
        entry = _sector_middle(order)
        field = j @ linear(0.0)
        phase = np.exp(-1j * turn)
        path = -0.62 * entry[:, None] + 0.2 * np.real(field[:, None] * phase)  # light leaves opposite to its entry
        ax.plot(*path, color=SERIES[0], lw=1.4)
        ax.annotate("", path[:, 8], path[:, 0], arrowprops={"arrowstyle": "->", "color": SERIES[0], "lw": 1.4})
        tilt, turning = ellipse(field)
        angles = f"{np.degrees(tilt):+.0f}°, {np.degrees(turning):+.0f}°"
        ax.text(*(-LABELS * entry), angles, ha="center", va="center", fontsize=7.5, color=INK)
    ax.annotate("", (0.16, 0.0), (-0.16, 0.0), arrowprops={"arrowstyle": "<->", "color": SERIES[1], "lw": 1.6})
    ax.set_xlim(-1.8, 1.8)
    ax.set_ylim(-1.5, 1.5)
    ax.set_title(f"{glass}, bare, normal incidence\norange in, blue back: azimuth, ellipticity", fontsize=9.0)


def _sector_middle(order: tuple[int, ...]) -> NDArray[np.float64]:
    """Unit vector to the middle of the sector where light of this face order enters."""
    flat = EDGES[:, :2] / np.hypot(*EDGES[0, :2])
    middle = flat[order[2]] - flat[order[0]]
    return middle / np.hypot(*middle)


def _draw_analyser(ax: Any, kinds: dict[str, Corner]) -> None:
    for (name, corner), colour in zip(kinds.items(), SERIES, strict=False):
        for tilt, style in ((OBLIQUE, "-"), (0.0, "--")):
            back, crossed, _ = _shares(sector_jones(corner, tilt))
            ax.plot(np.degrees(AZIMUTHS), crossed / back, color=colour, ls=style, label=name if tilt else None)
    ax.set_xlim(0.0, 180.0)
    ax.set_xticks([0, 45, 90, 135, 180])
    ax.set_ylim(-0.01, 1.1)
    ax.set_xlabel("azimuth of linear light from an edge (°)")
    ax.set_ylabel("share of the returned light")
    ax.set_title(
        f"Through a crossed analyser\n{np.degrees(OBLIQUE):.0f}° towards an edge; dashed: normal", fontsize=9.0
    )
    ax.legend(loc="upper right")


def _draw_axis(ax: Any, kinds: dict[str, Corner]) -> None:
    for (name, corner), colour in zip(kinds.items(), SERIES, strict=False):
        ends = []
        for tilt in TILTS:
            m = far_field_jones(sector_jones(corner, float(tilt)))
            ends.append(np.linalg.svd(m, compute_uv=False) ** 2)
        most, least = np.array(ends).T
        ax.fill_between(np.degrees(TILTS), least, most, color=colour, alpha=0.35, lw=0.0)
        ax.plot(np.degrees(TILTS), 0.5 * (most + least), color=colour, lw=1.2, label=name)
    ax.set_xlim(0.0, 20.0)
    ax.set_ylim(0.0, 1.18)
    ax.set_xlabel("incidence, towards an edge (°)")
    ax.set_ylabel("relative to a perfect corner of that area")
    ax.set_title("Far-field axis\nband: best to worst polarization", fontsize=9.0)
