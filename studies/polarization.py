"""What does a cube corner do to the ranger's polarized light? Prints docs/studies/polarization.md's numbers, draws it.

python studies/polarization.py DIRECTORY
"""

import sys
from pathlib import Path

import numpy as np

from catseye.gateways.optics.polarization_figures import corners, polarization_plot
from catseye.optics.glass import slopes
from catseye.optics.polarization import linear, retardance, retarder, total_reflection_retardance
from catseye.optics.retroreflector.corner_polarization import (
    far_field_jones,
    returned_power,
    sector_jones,
    solid_corner,
    through_plate,
)

WAVELENGTH_UM, GLASS = 0.780, "BK7-old"
LIGHT = np.linspace(0.0, np.pi, 181)


def straight_on(told) -> str:
    lines = [f"straight on, {told['glass']} of index {told['index']:.6f} over air at {told['wavelength_um']} um"]
    lines.append(f"{'':26s}{'returned':>10s}{'crossed':>16s}{'far axis':>10s}{'splitter + l/4':>16s}")
    for name, n in told["corners"].items():
        crossed = f"{n['crossed_least']:.4f}-{n['crossed_most']:.4f}"
        split = n["through_splitter_and_quarter_wave"]
        lines.append(f"{name:26s}{n['returned']:10.4f}{crossed:>16s}{n['far_field_axis']:10.4f}{split:16.4f}")
    return "\n".join(lines)


def phases(index: float) -> str:
    d = float(total_reflection_retardance(1.0 / np.sqrt(3.0), index))
    j = sector_jones(solid_corner(index), 0.0)
    step = np.linalg.det(sector_jones(solid_corner(index + 1e-6), 0.0)[0]) / np.linalg.det(j[0])
    slope = 0.5 * np.angle(step) / 1e-6  # rad per unit of index, mean of both polarizations
    bend = -float(slopes(WAVELENGTH_UM, GLASS).phase)  # dn/d(wavelength), 1/um
    delay = 0.5 * slope * bend * WAVELENGTH_UM**2 / (2.0 * np.pi) * 1e3  # nm one way: c dphi/dw / 2
    return (
        f"one face: s behind p by {np.degrees(d):.3f} deg; a sector: retarder of "
        f"{np.degrees(float(retardance(j[0]))):.2f} deg; delay by the phases' dispersion {delay:.1f} nm"
    )


def tilted() -> str:
    lines = ["incidence (deg) towards an edge / away: crossed least-most; far axis worst-best; returned least"]
    for name, corner in corners(WAVELENGTH_UM, GLASS).items():
        for degrees in (0.0, 5.0, 10.0, 15.0, 20.0):
            cells = []
            for azimuth in (0.0, np.pi):
                j = sector_jones(corner, np.radians(degrees), azimuth)
                crossed = returned_power(j, linear(LIGHT), analyser=linear(LIGHT + np.pi / 2))
                axis = np.linalg.svd(far_field_jones(j), compute_uv=False) ** 2
                least = returned_power(j, linear(LIGHT)).min()
                cells.append(f"{crossed.min():.3f}-{crossed.max():.3f} {axis[1]:.3f}-{axis[0]:.3f} {least:.3f}")
            lines.append(f"{name:26s}{degrees:5.0f}  " + "   ".join(cells))
    return "\n".join(lines)


def splitter() -> str:
    """What a polarizing splitter and a plate send to the detector, all of it and on the far field's axis."""
    lines = ["splitter: all the light / far axis, without a plate and with a quarter wave, at three azimuths"]
    plates = {"none": np.eye(2), "quarter": retarder(np.pi / 2, np.pi / 4)}
    for name, corner in corners(WAVELENGTH_UM, GLASS).items():
        cells = []
        for plate in plates.values():
            for turn in (0.0, np.pi / 12, np.pi / 6):  # the reflector turned about its axis
                c, s = np.cos(turn), np.sin(turn)
                r = np.array([[c, -s], [s, c]])
                back = through_plate(r @ sector_jones(corner, 0.0) @ r.T, plate)
                cross = {"analyser": linear(np.pi / 2)}
                axis = abs(far_field_jones(back)[1, 0]) ** 2
                cells.append(f"{float(returned_power(back, linear(0.0), **cross)):.3f}/{axis:.3f}")
        lines.append(f"{name:26s}" + "  ".join(cells))
    return "\n".join(lines)


def main(directory: str) -> None:
    Path(directory).mkdir(parents=True, exist_ok=True)
    drawn, told = polarization_plot(WAVELENGTH_UM, GLASS)
    sys.stdout.write("\n\n".join((straight_on(told), phases(told["index"]), tilted(), splitter())) + "\n")
    Path(directory, "polarization.svg").write_text(drawn, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
