"""What do fabrication, calibration and aim do to a triplet? Prints the tables of its page, draws its figure.

python studies/triplet_tolerances.py DIRECTORY

Units are placed in three dimensions and reduced as the laboratory and the telescope do; places are those of the example
night.
"""

import sys
from pathlib import Path

import numpy as np

from catseye.atmosphere.index.air import group_refractivity
from catseye.constants import DEGREE, SPEED_OF_LIGHT, TWO_PI
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, STYLE, Figure, mpl, svg
from catseye.geometry.antenna.triplet_mount import aim_angles, misaim
from catseye.geometry.clearance import visibility
from catseye.optics.retroreflector.prism import obliquity_correction
from catseye.records.night.campaign import read_campaign
from catseye.reduction.site.places import nominal_frame, places_of
from catseye.reduction.triplet.memo import median_series
from catseye.reduction.triplet.sensitivity import Departures, calibration_error, telescope_error, triplet_sensitivities
from catseye.reduction.triplet.tolerances import SLOPES, TOLERANCE, glass_effect, refractivity_change
from catseye.reduction.triplet.use import MountedTriplet, ball_distance_memo, ball_ranges, incidence_on_prisms

EXAMPLE = Path(__file__).parents[1] / "examples" / "night-01"
UNITS = 200_000  # of the Monte Carlo
UM = 1e-6
LEANS = (0.1, 0.3, 1.0)  # deg


def site() -> tuple[list[MountedTriplet], np.ndarray, np.ndarray]:
    """The ten units, the six scan points, the aim point A, ground frame."""
    campaign = read_campaign(EXAMPLE)
    places, frame = places_of(campaign), nominal_frame(campaign)
    ratio = campaign.site.ranging.bk7_to_air_group_index_ratio
    units = [MountedTriplet.of(t, frame, ratio=ratio, u_normal=0.3 * DEGREE) for t in campaign.triplets.values()]
    scan = np.stack([places[r.name].start for r in campaign.feedarm.ranger])
    return units, scan, frame.points(np.array([10.2, -5985.2, 55949.2]) * 1e-3)  # feedarm.toml, aim_point


def made(rng, m: int) -> Departures:
    """Units within the drawing's tolerances, rectangular."""
    spacing, along, across = rng.uniform(-TOLERANCE, TOLERANCE, (3, m))
    return Departures(spacing=spacing, along=along, across=across)


def in_laboratory(rng) -> np.ndarray:
    """Errors of H_corr, m: the scan point anywhere before the plate between the prisms, the beam within 50 mm."""
    aside, above = rng.uniform(-0.3175, 0.3175, UNITS), rng.uniform(-0.05, 0.05, UNITS)
    return calibration_error(made(rng, UNITS), depth=rng.uniform(18.0, 18.4, UNITS), aside=aside, above=above)


def seen(units, scan) -> np.ndarray:
    """Scan points (60, 3) from each unit's mid-point in its own axes."""
    return np.concatenate([(scan - u.prisms.mean(axis=0)) @ np.stack([u.axis, u.across, u.normal]).T for u in units])


def on_telescope(rng, places: np.ndarray) -> np.ndarray:
    """Errors of the distance to the ball, m: every ranger and unit of the site alike."""
    return telescope_error(made(rng, UNITS), scan_point=places[rng.integers(0, len(places), UNITS)])


def sensitivity_table() -> str:
    lines = ["largest effect, um: in H_corr; in the distance to the ball (46 m, 12 deg); feed arm against ground"]
    for r in triplet_sensitivities():
        memo = "" if np.isnan(r.memo) else f"< {r.memo / UM:.1f}"
        lines.append(
            f"{r.cause:40s}{r.size:>10s}{memo:>8s}{r.calibration / UM:10.2f}{r.use / UM:10.2f}{r.tie / UM:10.2f}"
        )
    return "\n".join(lines)


def scatter_table() -> str:
    units, scan, _ = site()
    rng = np.random.default_rng(2026)
    places = seen(units, scan)
    lines = [f"{UNITS} units, spacing and ball within 0.15 mm: standard deviation, 99 %, largest, um"]
    for name, error in (("calibration", in_laboratory(rng)), ("telescope", on_telescope(rng, places))):
        size = np.abs(error) / UM
        lines.append(f"{name:12s}{np.std(error) / UM:8.2f}{np.quantile(size, 0.99):8.2f}{size.max():8.2f}")
    far = np.linalg.norm(places, axis=1)
    angle = np.degrees(np.arccos(places[:, 2] / far))
    lines.append(f"site: {far.min():.1f} to {far.max():.1f} m, {angle.min():.1f} to {angle.max():.1f} deg")
    return "\n".join(lines)


def use_table() -> str:
    """What the memo's shortcuts do on the telescope, largest over the site."""
    units, scan, aim = site()
    half = SPEED_OF_LIGHT / (2 * 1500e6 * 1.00025)
    series, angles, kept, square = [], [], [], []
    for u in units:
        d = np.linalg.norm(scan[:, None] - u.prisms, axis=2)
        whole = np.linalg.norm(scan - u.prisms.mean(axis=0), axis=1)
        for more in (0.0, 1.0):  # 3.13: INT of the length with the glass, or one more
            delta = (np.floor((d[:, 0] + 0.0335) / half) + more) * half
            series.append(np.abs(median_series(d[:, 0], d[:, 1], u.d_12, delta=delta) - whole).max())
        cosine = incidence_on_prisms(u, scan)[0]
        memo = np.cos(visibility.incidence(scan, u.prisms, aim - u.prisms))
        wrong = obliquity_correction(u.heights, u.ratio, memo) - obliquity_correction(u.heights, u.ratio, cosine)
        angles.append(np.abs(wrong).max())
        kept.append(np.abs(wrong.mean(axis=1)).max())
        found = ball_ranges(
            [u], scan, (d - obliquity_correction(u.heights, u.ratio, cosine))[None], covariance=np.zeros((12, 12))
        )
        sight = (scan - u.ball) / np.linalg.norm(scan - u.ball, axis=1, keepdims=True)
        square.append(np.abs(ball_distance_memo(found.d_mp[0], sight, u.h_corr * u.normal) - found.d_bc[0]).max())
    return "\n".join(
        [
            "the memo's shortcuts on the telescope, largest over the site:",
            f"  series of figure 10              {max(series) / UM:10.3f} um",
            f"  angles A-T-S for the incidence   {max(angles) / UM:10.3f} um in a range, {max(kept) / UM:.4f} in D_MP",
            f"  (e . n) H_corr to first order    {max(square) / 1e-9:10.3f} nm",
        ]
    )


def aim_table() -> str:
    """Each unit's mount turned to A, and again when A has moved by 50 mm; base axes: the outer one the unit's y."""
    units, _, aim = site()
    lines = [
        "unit, distance to A (m), swing and tip (mrad) that follow A 50 mm lower, lean left by a scope 80 mm above"
    ]
    for u in units:
        base = np.stack([u.axis, u.across, u.normal])
        towards = base @ (aim - u.ball)
        lower = base @ (aim - [0.0, 0.0, 0.05] - u.ball)
        swing, tip = aim_angles(lower)
        lean = misaim(*aim_angles(towards, (0.0, 0.08)), towards=towards)
        distance = float(np.linalg.norm(towards))
        angles = f"{float(swing) * 1e3:9.3f}{float(tip) * 1e3:9.3f}{lean[1] * 1e3:9.3f}"
        lines.append(f"{u.name}{distance:8.1f}{angles}")
    return "\n".join(lines)


def air_table() -> str:
    start = float(group_refractivity(20.0, 933.0, 50.0, model="rueger1990"))
    lines = ["air's temperature: change of n_A exact, by D.5 (1e-6); range by tabulated P_c too long: prism, ball (um)"]
    for t in (-15.0, 0.0, 10.0, 30.0, 40.0):
        exact = float(group_refractivity(t, 933.0, 50.0, model="rueger1990")) - start
        linear = float(refractivity_change(t - 20.0, 0.0, 0.0, slopes=SLOPES))
        prism, ball = glass_effect(np.array([0.0381, 0.14651]), exact) / UM
        lines.append(f"{t:6.0f}{exact * 1e6:10.3f}{linear * 1e6:10.3f}{prism:10.2f}{ball:10.2f}")
    return "\n".join(lines)


def figure() -> str:
    """Four panels as SVG text."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = Figure(figsize=(10.8, 8.6), layout="constrained")
        axes = drawn.subplots(2, 2, width_ratios=(1.15, 1.0))
        _draw_causes(axes[0, 0])
        _draw_scatter(axes[0, 1])
        _draw_aside(axes[1, 0])
        _draw_lean(axes[1, 1])
        return svg(drawn)


def _draw_causes(ax) -> None:
    rows = triplet_sensitivities()[::-1]
    least = 0.05
    for k, r in enumerate(rows):
        for step, value, mark in ((0.22, r.calibration, "o"), (0.0, r.use, "s"), (-0.22, r.tie, "D")):
            if value / UM > least:
                ax.plot(value / UM, k + step, mark, color=SERIES["osD".index(mark)], ms=4)
    ax.axvline(150.0, color=BAD, lw=0.9, ls="--")
    ax.text(170.0, len(rows) - 0.9, "150 µm", color=BAD, fontsize=8.0, va="bottom")
    ax.set_xscale("log")
    ax.set_xlim(least, 2000.0)
    ax.set_yticks(range(len(rows)), [f"{r.cause}, {r.size}" for r in rows], fontsize=7.5)
    for mark, colour, name in (("o", 0, "H_corr"), ("s", 1, "distance to ball"), ("D", 2, "feed arm to ground")):
        ax.plot([], [], mark, color=SERIES[colour], ms=5, label=name)
    ax.legend(loc="lower right", handletextpad=0.2, frameon=True, framealpha=1.0, edgecolor="none")
    ax.set_xlabel("largest effect (µm); below 0.05 not drawn")
    ax.set_title("One cause at a time\ncalibration at 18 m; use at 46 m, 12°")


def _draw_scatter(ax) -> None:
    units, scan, _ = site()
    rng = np.random.default_rng(2026)
    draws = (
        ("calibration", in_laboratory(rng), SERIES[0], (2.0, 0.30)),
        ("telescope", on_telescope(rng, seen(units, scan)), SERIES[1], (10.5, 0.09)),
    )
    for name, error, colour, at in draws:
        ax.hist(np.abs(error) / UM, bins=np.linspace(0, 32, 129), density=True, histtype="step", color=colour, lw=1.4)
        ax.text(*at, name, color=colour, fontsize=8.5)
    ax.axvline(4.39, color=FAINT, lw=0.9, ls="--")
    ax.text(4.7, 0.62, "1.32 + 2.65 + 0.42", color=FAINT, fontsize=8.0)
    ax.set_xlim(0, 32)
    ax.set_xlabel("size of the error (µm)")
    ax.set_ylabel("density (1/µm)")
    ax.set_title("200 000 units within 0.15 mm\nevery ranger and unit of the site")


def _draw_aside(ax) -> None:
    h = np.linspace(0.0, 0.6, 61)
    across = [float(calibration_error(Departures(across=TOLERANCE), above=v)) / UM for v in h]
    ax.plot(h * 1e3, np.abs(across), color=SERIES[0])
    ax.axhline(2.65, color=BAD, lw=0.9, ls="--")
    ax.axvline(317.5, color=FAINT, lw=0.9, ls=":")
    ax.axvspan(0.0, 50.0, color=SERIES[2], alpha=0.15, lw=0)
    ax.text(56.0, 4.4, "where the beam\nlands", color=SERIES[2], fontsize=8.5, va="top")
    ax.text(8.0, 2.73, "A.8: x D₁₂ / 2 D₀", color=BAD, fontsize=8.5)
    ax.text(324.0, 0.25, "D₁₂ / 2", color=FAINT, fontsize=8.5)
    ax.set_xlim(0, 600)
    ax.set_ylim(0, None)
    ax.set_xlabel("height of the scan point above the prisms' line (mm)")
    ax.set_ylabel("error of H_corr (µm)")
    ax.set_title('Ball 0.15 mm across the line: "the same bound"\nholds below half the spacing')


def _draw_lean(ax) -> None:
    angle = np.radians(np.linspace(0.0, 35.0, 71))
    around = np.linspace(0.0, TWO_PI, 24, endpoint=False)
    out, ahead = np.sin(angle)[:, None], np.cos(angle)[:, None]
    s = 46.0 * np.stack([out * np.cos(around), out * np.sin(around), ahead + 0.0 * around], axis=-1)
    for lean, colour in zip(LEANS, SERIES, strict=False):
        worst = np.abs(telescope_error(Departures(lean_x=lean * DEGREE), scan_point=s)).max(axis=1) / UM
        ax.plot(np.degrees(angle), worst, color=colour)
        ax.text(35.4, worst[-1], f"{lean:g}°", color=colour, fontsize=8.5, va="center")
    aside = np.abs(telescope_error(Departures(along=TOLERANCE), scan_point=s)).max(axis=1) / UM
    ax.plot(np.degrees(angle)[1:], aside[1:], color=FAINT, ls="--")
    ax.text(35.4, aside[-1], "ball 0.15\nmm aside", color=FAINT, fontsize=8.0, va="center")
    ax.axvspan(0.0, 12.0, color=SERIES[2], alpha=0.12, lw=0)
    ax.text(0.7, 60.0, "this site", color=SERIES[2], fontsize=8.5, va="top")
    ax.set_yscale("log")
    ax.set_xlim(0, 42)
    ax.set_ylim(0.01, 200)
    ax.set_xlabel("incidence on the plate (°)")
    ax.set_ylabel("error of the distance to the ball (µm)")
    ax.set_title("A plate that does not point at A\nby the angle at the line, 46 m")


def main(directory: str) -> None:
    tables = (sensitivity_table(), scatter_table(), use_table(), aim_table(), air_table())
    sys.stdout.write("\n\n".join(tables) + "\n")
    Path(directory).mkdir(parents=True, exist_ok=True)
    Path(directory, "triplet-tolerances.svg").write_text(figure(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
