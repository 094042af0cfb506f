"""When does the bending of a ray matter? Prints the tables of docs/studies/bending.md, draws its figure.

python studies/bending.py DIRECTORY

Rays are integrated exactly through the index of Ciddor's formula, pressure by weight; the bound is the one proved in
`catseye.atmosphere.path.bending`.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catseye.atmosphere.index.air import group_refractivity, phase_refractivity
from catseye.atmosphere.path.bending import excess_bound, index_gradient, pointing_offset, sag, steepest_gradient
from catseye.atmosphere.path.mean import hydrostatic_pressure_hpa
from catseye.atmosphere.path.ray import FOUND, bent_ray, layered
from catseye.constants import ARCSECOND
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, STYLE, Figure, mpl, svg
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT

LENGTHS = (30.0, 60.0, 120.0, 300.0)  # m
GRADIENTS = (-0.0342, 0.01, -0.1, 0.3, -1.0, -3.0, 10.0)  # °C/m upwards
HEIGHTS = (0.2, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0)  # m, of a level path over hot ground
NOON = -1.0  # °C a factor e of height: asphalt or a dish in the sun, calm; a lawn has half of it
STEP = 0.01  # m, for the slope of the index by central differences


@dataclass(frozen=True)
class Column:
    """Air whose temperature is a function of height, 20 °C and 933 hPa at 1 m, dry."""

    even: float = 0.0  # °C/m
    layer: float = 0.0  # °C a factor e

    def temperature(self, z):
        return 20.0 + self.even * (z - 1.0) + self.layer * np.log(np.maximum(z, 1e-3))

    def _of(self, formula, z):
        warmth = np.clip(self.temperature(z), -40.0, 100.0)
        pressure = hydrostatic_pressure_hpa(933.0, 0.5 * (warmth + 20.0), 1.0, z_to=z)
        return formula(warmth, pressure, 0.0)

    def rays(self, a, b):
        """Rays through it, the optical path counted in the group index."""

        def phase(z):
            h = np.minimum(STEP, 0.02 * np.maximum(z, 0.05))
            slope = (self._of(phase_refractivity, z + h) - self._of(phase_refractivity, z - h)) / (2.0 * h)
            return self._of(phase_refractivity, z), slope

        return bent_ray(layered(phase, lambda z: self._of(group_refractivity, z)), a, b, tolerance=1e-10)


def level(length, z):
    """A level path at heights (m,)."""
    z = np.atleast_1d(z)
    a = np.stack([np.zeros(z.shape), np.zeros(z.shape), z], axis=1)
    return a, a + np.array([length, 0.0, 0.0])


def table() -> str:
    """Gradient and length: what bending does at most, and what the exact ray does."""
    lines = ["even gradient: range too short by (um), ray off its chord (mm), aim beside the target (arc seconds)"]
    lines.append(f"{'°C/m':>8s}" + "".join(f"{f'{d:.0f} m':>26s}" for d in LENGTHS))
    for lapse in GRADIENTS:
        g = index_gradient(lapse)
        cells = [
            f"{float(excess_bound(g, d)) * 1e6:10.4f}{abs(float(sag(g, d))) * 1e3:8.3f}"
            f"{abs(float(pointing_offset(g, d))) / ARCSECOND:8.2f}"
            for d in LENGTHS
        ]
        lines.append(f"{lapse:8.4g}" + "".join(cells))
    ray = Column(even=-1.0).rays(*level(120.0, 1.5))
    lines += [
        "",
        f"exact ray, -1 °C/m, 120 m, group index: {ray.optical_excess[0] * 1e6:.4f} um, "
        f"sag {ray.sag[0, 2] * 1e3:.3f} mm, aim {ray.leaving[0, 2] / ARCSECOND:.2f}",
    ]
    for limit in (0.2e-6, 1e-6, 10e-6):
        steep = [
            steepest_gradient(limit, d) / abs(float(index_gradient(-1.0)) - float(index_gradient(0.0))) for d in LENGTHS
        ]
        lines.append(f"{limit * 1e6:5.1f} um needs (°C/m): " + "".join(f"{s:10.2f}" for s in steep))
    counts = ", ".join(f"{c / ARCSECOND:.2f}" for c in BEAM_PER_COUNT)
    lines.append(f"a count of the mirrors' encoders is {counts} arc seconds of beam")
    return "\n".join(lines)


def hot_ground(length: float = 120.0):
    """Level paths over hot ground: heights, range too short (m), aim (rad), status."""
    ray = Column(layer=NOON).rays(*level(length, np.array(HEIGHTS)))
    return np.array(HEIGHTS), -ray.optical_excess, ray.leaving[:, 2], ray.status


def slanted():
    """From 1.5 m above hot ground up to targets at 120 m: heights of the target, excess, aim."""
    top = np.array([1.5, 3.0, 10.0, 30.0, 60.0, 100.0])
    a = np.tile([0.0, 0.0, 1.5], (len(top), 1))
    b = np.stack([np.sqrt(120.0**2 - (top - 1.5) ** 2), 0.0 * top, top], axis=1)
    ray = Column(layer=NOON).rays(a, b)
    across = np.hypot(ray.leaving[:, 0], ray.leaving[:, 2])
    return top, -ray.optical_excess, across, ray.status


def hot_table() -> str:
    lines = [
        f"hot ground, {-NOON:g} °C a factor e of height: height, gradient, range too short (um), bound, aim (arc s)"
    ]
    for length in (60.0, 120.0):
        for z, short, aim, status in zip(*hot_ground(length), strict=True):
            most = float(excess_bound(index_gradient(NOON / (0.5 * z)), length)) * 1e6
            told = f"{short * 1e6:9.3f}{most:9.3f}{aim / ARCSECOND:9.1f}" if status == FOUND else f"  {status}"
            lines.append(f"{length:6.0f} m {z:5.1f} m {NOON / z:7.2f} °C/m {told}")
    lines.append("slanted, 120 m from 1.5 m above it: target's height, range too short (um), aim (arc s)")
    for z, short, aim, status in zip(*slanted(), strict=True):
        lines.append(f"{z:8.1f} m {short * 1e6:9.4f} {aim / ARCSECOND:9.2f}  {status}")
    return "\n".join(lines)


def figure() -> str:
    """Three panels as SVG text."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = Figure(figsize=(10.8, 3.9), layout="constrained")
        left, middle, right = drawn.subplots(1, 3)
        _draw_excess(left)
        _draw_aim(middle)
        _draw_ground(right)
        return svg(drawn)


def _draw_excess(ax) -> None:
    lapse = np.geomspace(0.05, 20.0, 60)
    for length, colour in zip(LENGTHS, SERIES, strict=False):
        ax.loglog(lapse, excess_bound(index_gradient(-lapse), length) * 1e6, color=colour)
        some = np.array([0.2, 1.0, 4.0])
        found = [-Column(even=-s).rays(*level(length, 1.5)).optical_excess[0] * 1e6 for s in some]
        ax.loglog(some, found, "o", ms=4, color=colour)
        _name(ax, f"{length:.0f} m", 20.0, 1e6 * float(excess_bound(index_gradient(-20.0), length)), colour)
    ax.axhline(1.0, color=BAD, lw=0.9, ls="--")
    ax.text(0.055, 1.4, "1 µm", color=BAD, fontsize=8.5)
    ax.set_ylim(1e-6, 1e3)
    _gradients(ax)
    ax.set_ylabel("range too short (µm)")
    ax.set_title("Bending and the range\nlines: bound, dots: rays")


def _draw_aim(ax) -> None:
    lapse = np.geomspace(0.05, 20.0, 60)
    for length, colour in zip(LENGTHS, SERIES, strict=False):
        aim = np.abs(pointing_offset(index_gradient(-lapse), length)) / ARCSECOND
        ax.loglog(lapse, aim, color=colour)
        _name(ax, f"{length:.0f} m", lapse[-1], aim[-1], colour)
    for count, name in zip(BEAM_PER_COUNT / ARCSECOND, ("azimuth", "elevation"), strict=True):
        ax.axhline(count, color=FAINT, lw=0.9, ls="--")
        ax.text(70.0, count * 0.9, name, color=FAINT, fontsize=8.0, ha="right", va="top")
    _gradients(ax)
    ax.set_ylabel("aim beside the target (arc seconds)")
    ax.set_title("Bending and the mirrors\ndashed: a count of their encoders")


def _name(ax, text, x, y, colour) -> None:
    """A curve's name beyond its right end."""
    ax.annotate(text, (x, y), color=colour, xytext=(4, 0), textcoords="offset points", va="center", fontsize=8.5)


def _gradients(ax) -> None:
    ax.set_xlim(0.05, 75.0)
    ax.set_xticks([0.1, 1, 10], ["0.1", "1", "10"])
    ax.set_xlabel("temperature falling upwards (°C/m)")


def _draw_ground(ax) -> None:
    for length, colour in ((60.0, SERIES[1]), (120.0, SERIES[2])):
        z, short, _, status = hot_ground(length)
        good = status == FOUND
        ax.loglog(z[good], short[good] * 1e6, ".-", color=colour, label=f"{length:.0f} m")
    ax.axhline(1.0, color=BAD, lw=0.9, ls="--")
    ax.set_xticks([0.2, 0.5, 1, 2, 5, 10], ["0.2", "0.5", "1", "2", "5", "10"])
    ax.minorticks_off()
    ax.set_xlabel("height of a level path (m)")
    ax.set_ylabel("range too short (µm)")
    ax.set_title("Over ground in the noon sun\n1 °C a factor e of height")
    ax.legend(loc="lower left")


def main(directory: str) -> None:
    sys.stdout.write(f"{table()}\n\n{hot_table()}\n")
    Path(directory).mkdir(parents=True, exist_ok=True)
    Path(directory, "bending.svg").write_text(figure(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
