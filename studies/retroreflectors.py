"""Where does a range end inside a retroreflector? Closed forms, exact rays and the memo's one index, side by side.

python studies/retroreflectors.py DIRECTORY

Writes retroreflectors-return.svg and retroreflectors-aberration.svg into the directory and prints the tables of
docs/studies/retroreflectors.md.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from catseye.atmosphere.index.air import air
from catseye.constants import ARCSECOND, DEGREE
from catseye.gateways.optics.retroreflector_figures import Dimensions, aberration_plot, return_plot
from catseye.optics.glass import group_index, index_over_air
from catseye.optics.ray_trace import Plane, beam, corner, half_path, through_prism
from catseye.optics.retroreflector import prism
from catseye.optics.retroreflector.cats_eye import focal_radius
from catseye.optics.retroreflector.dihedral import on_axis_share, pupil_offset
from catseye.optics.retroreflector.kinds.ball import silvered

HEIGHT, APERTURE = 0.0381, 0.0254  # m
SEED, RAYS = 1, 200_000


def say(text: str) -> None:
    sys.stdout.write(text + "\n")


def direction(incidence: float, azimuth: float) -> np.ndarray:
    return np.array([np.sin(incidence) * np.cos(azimuth), np.sin(incidence) * np.sin(azimuth), np.cos(incidence)])


def angles(group: float, phase: float) -> None:
    """Traced range of a prism less the closed form with two indices, and less appendix B."""
    around = np.random.default_rng(SEED).uniform(-0.003, 0.003, (50, 3)) * [1.0, 1.0, 0.0]
    say("incidence   change µm   traced less two indices nm   appendix B less two indices µm")
    for degrees in (5, 10, 20, 30, 45):
        incidence = degrees * DEGREE
        change = float(prism.oblique_change(HEIGHT, incidence, group=group, phase=phase))
        worst = 0.0
        for azimuth in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
            u = direction(incidence, azimuth)
            aside = HEIGHT * np.tan(np.arcsin(np.sin(incidence) / phase)) * np.array([*u[:2], 0.0]) / np.sin(incidence)
            out = through_prism(beam(u, around + aside), height=HEIGHT, phase=phase, group=group)
            met = np.sum(out.direction * u, axis=-1) > 1.0 - 1e-9  # beyond 45 deg some miss a face
            path = half_path(out, u, (0.0, 0.0, -HEIGHT / group))[met]
            wrong = path + float(prism.range_constant(HEIGHT, group)) + change
            worst = max(worst, float(np.max(np.abs(wrong))))
        by_b = float(prism.obliquity_correction(HEIGHT, group, np.cos(incidence)))
        say(f"{degrees:>6}°   {change * 1e6:10.3f}   {worst * 1e9:.7f}   {(by_b - change) * 1e6:.3f}")


def cylinder(phase: float) -> None:
    """Do rays that enter and leave by the round face meet glass that grinding the prism round took away?"""
    rng = np.random.default_rng(SEED)
    points = np.pad(rng.uniform(-APERTURE, APERTURE, (RAYS, 2)), ((0, 0), (0, 1)))
    points = points[np.hypot(points[:, 0], points[:, 1]) < APERTURE]
    face, faces = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), corner((0.0, 0.0, -HEIGHT))
    lost = 0
    for degrees in (0.0, 10.0, 20.0, 30.0):
        for azimuth in (0.0, 30.0 * DEGREE, 60.0 * DEGREE):
            rays = beam(direction(degrees * DEGREE, azimuth), points).to(face, 1.0).refracted(face, 1.0 / phase)
            farthest = np.zeros(len(points))
            for _ in range(3):
                rays = rays.reflected_in(faces, phase)
                farthest = np.maximum(farthest, np.hypot(rays.position[:, 0], rays.position[:, 1]))
            rays = rays.to(face, phase)
            clear = np.hypot(rays.position[:, 0], rays.position[:, 1]) < APERTURE
            lost += int(np.sum(clear & (farthest >= APERTURE)))
    say(f"rays that the round edge of the prism takes besides: {lost} of {12 * len(points)}")


def balls() -> None:
    """The memo's ball for beams of several widths."""
    ball = replace(silvered(Dimensions().sizes()), aperture=0.03)
    focus = float(focal_radius(ball.r1, ball.phase))
    say(f"paraxial focus {focus / 0.0254:.3f} inch; the memo has {ball.r2 / 0.0254:.3f}")
    say("stop of 30 mm radius, which no such beam fills")
    say("beam mm   best R2 inch   mean path change µm   blur ″   share back at 18, 50, 120 m")
    for width in (0.005, 0.008, 0.010, 0.0125, 0.015):
        shares = [ball.collected_share(d, beam_radius=width, receiver=0.05) for d in (18.0, 50.0, 120.0)]
        say(
            f"{width * 1e3:5.1f}   {ball.best_radius(width) / 0.0254:.4f}   "
            f"{ball.mean_path_change(width) * 1e6:+.2f}   {ball.blur(width) / ARCSECOND:.0f}   "
            + "   ".join(f"{share:.2f}" for share in shares)
        )


def main(directory: Path) -> None:
    about = air(20.0, 933.0, 50.0, wavelength_um=0.780, model="rueger1990")
    n = index_over_air(0.780, air_phase=about.phase_index, air_group=about.group_index)
    group, phase = float(n.group), float(n.phase)
    memo = float(group_index(0.780)) / float(about.group_index)
    say(f"group index over air {group:.6f}, the memo's {memo:.6f}; phase {phase:.6f}")
    angles(group, phase)
    cylinder(phase)
    balls()
    three = 3.0 * ARCSECOND
    face = {"aperture": APERTURE, "beam_radius": 0.010}
    say(
        f"3 arcsec of deviation: far-field share on the axis "
        f"{on_axis_share(three, **face, wavelength=0.78e-6):.3f}, "
        f"{three * 100.0 * 1e3:.2f} mm aside at 100 m, "
        f"{pupil_offset(three, **face) * 1e6:.3f} µm without a lens, "
        f"{0.25 * 100.0 * three**2 * 1e9:.0f} nm with one, at 100 m"
    )
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "retroreflectors-return.svg").write_text(return_plot()[0], encoding="utf-8")
    (directory / "retroreflectors-aberration.svg").write_text(aberration_plot()[0], encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
