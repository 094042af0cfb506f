"""How far does each way in which a phase lies move a range, before and after its correction? In micrometres.

python studies/phase_systematics.py [FIGURE.svg]

Numbers of the notes and of the example night where they have one; what is assumed says so. Then the example night's own
reference shots: which random walk do they show?
"""

import sys
from pathlib import Path

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.gateways.writers.drawing import FAINT, INK, SERIES, STYLE, Figure, mpl, svg
from catseye.records.night.campaign import REFERENCE, read_campaign
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.signal.drift.walk import estimate_walk, longest_gap, midpoint_uncertainty, walk_test
from catseye.signal.systematics.amplitude import amplitude_phase
from catseye.signal.systematics.cyclic import imbalance_range, leakage_range
from catseye.signal.systematics.feedback import fringe_contrast, fringe_uncertainty
from catseye.signal.systematics.leakage import rms_range_error, worst_range_error
from catseye.signal.systematics.multipath import (
    cats_eye_error,
    largest_share,
    returned_share_of_pass,
    two_retroreflectors,
)

WAVELENGTH = 0.199811  # m, [PARKER04] eq. 1.30
LIGHT = 780e-9  # m
MICRO = 1e6
PER_RADIAN = WAVELENGTH / (4 * np.pi)
LEAKAGE, U_LEAKAGE = 0.031, 0.0008  # V, ZP101 of the example night
CUBE, USUAL, WEAK = 6.50, 4.35, 0.91  # V, its reference, its median return, and that of one shot in twenty
COUPLING, U_COUPLING = 2e-3, 1e-4  # rad a factor e of amplitude; assumed
WALK = 0.01 / 60  # rad per root second: 10 mrad per root hour
NOISE = 5e-4  # rad, of a reference shot: 3.4 mV in 6.5 V
BARE, TILTED = (
    float(returned_share_of_pass(0.01, part, 0.3)) for part in (0.5, 0.02)
)  # a coated diode, square on and tilted


def effects() -> list[tuple[str, float, float, str]]:
    """Name, largest deviation, what is left as u after the correction (both micrometres), and how it is corrected."""
    fringe = float(fringe_contrast(1e-6)) * 0.1  # a millionth of the power, 0.1 rad a unit of power: assumed
    cross = 0.5 * float(fringe_contrast(1e-4, 0.1))  # a tenth of the contrast of a 1e-4 share: assumed
    still = {"shots": 16, "correlation": 0.0}
    rows = [
        ("leakage, usual return", worst_range_error(LEAKAGE / USUAL, WAVELENGTH),
         U_LEAKAGE / USUAL * PER_RADIAN, "subtracted, u 0.8 mV"),
        ("leakage, weak return", worst_range_error(LEAKAGE / WEAK, WAVELENGTH),
         U_LEAKAGE / WEAK * PER_RADIAN, "subtracted, u 0.8 mV"),
        ("crosstalk 1:1000 ([PARKER04] 5.8)", worst_range_error(1e-3, WAVELENGTH),
         rms_range_error(1e-3, WAVELENGTH), "none; rms of any phase"),
        ("unlike channels, 0.2 % and 2 mrad", PER_RADIAN * np.hypot(1e-3, 1e-3),
         2e-6, "fitted on a rail; not in this instrument"),
        ("cat's-eye, diode square on", worst_range_error(BARE, WAVELENGTH),
         worst_range_error(TILTED, WAVELENGTH), "diode tilted; largest"),
        ("second retroreflector, 1 %", worst_range_error(0.01, WAVELENGTH),
         rms_range_error(0.01, WAVELENGTH), "none; rms of any distance"),
        ("amplitude to phase, weak return", -PER_RADIAN * amplitude_phase(WEAK, CUBE, COUPLING),
         PER_RADIAN * U_COUPLING * np.log(CUBE / WEAK), "coefficient known to 5 %"),
        ("light into the laser, 1e-6", PER_RADIAN * fringe,
         PER_RADIAN * fringe_uncertainty(fringe, **still), "mean of 16 shots, path astir"),
        ("interference on the detector", PER_RADIAN * cross,
         PER_RADIAN * fringe_uncertainty(cross, **still), "mean of 16 shots, path astir"),
        ("drift of an hour", PER_RADIAN * WALK * 60,
         PER_RADIAN * midpoint_uncertainty(120.0, WALK, NOISE), "reference every 2 minutes"),
    ]  # fmt: skip
    return [(name, float(most) * MICRO, float(rest) * MICRO, how) for name, most, rest, how in rows]


def curves() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Deviations, in micrometres, over a half wavelength of distance beyond 100 m."""
    distance = 100.0 + np.linspace(0.0, WAVELENGTH / 2, 601)
    x = -4 * np.pi * distance / WAVELENGTH
    return (distance - 100.0) * 1e3, {
        "leakage, 31 mV in 4.35 V": leakage_range(x, LEAKAGE / USUAL * np.exp(1j), WAVELENGTH) * MICRO,
        "cat's-eye, share 1.5e-3": cats_eye_error(distance, BARE, WAVELENGTH) * MICRO,
        "1 % of a second return, 3 cm behind": np.full(601, two_retroreflectors(0.01, 0.03, WAVELENGTH) * MICRO),
        "unlike channels": imbalance_range(x, gain=2e-3, skew=2e-3, wavelength=WAVELENGTH) * MICRO,
    }


def shown(size: float) -> str:
    """Two digits, or whole micrometres."""
    return f"{size:.0f}" if size >= 10.0 else f"{size:.2g}"


def draw(rows: list[tuple[str, float, float, str]]) -> str:
    """Two panels: deviations against distance; sizes before and after."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 4.9), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.35))
        along, waves = curves()
        for (name, wave), color in zip(waves.items(), SERIES, strict=False):
            left.plot(along, wave, color=color, lw=1.6, label=name)
        left.set(title="Range read too long, uncorrected", xlabel="distance beyond 100 m, mm", ylabel="µm")
        left.set_ylim(-130, 250)
        left.legend(loc="upper left")
        for y, (_, most, rest, how) in enumerate(reversed(rows)):
            right.plot([rest, most], [y, y], color=FAINT, lw=1.0, zorder=1)
            right.plot(most, y, "o", color=SERIES[1], ms=6.5)
            right.plot(rest, y, "o", color=SERIES[0], ms=6.5)
            right.text(most * 1.25, y, shown(most), va="center", fontsize=8, color=INK)
            right.text(rest / 1.25, y, shown(rest), va="center", ha="right", fontsize=8, color=INK)
            right.text(2500, y, how, va="center", fontsize=7.5, color=FAINT)
        right.set_yticks(range(len(rows)), [name for name, *_ in reversed(rows)])
        right.set(xscale="log", xlim=(0.1, 2000), ylim=(-0.6, len(rows) - 0.4), xlabel="µm")
        right.set_xticks([0.1, 1, 10, 100, 1000], ["0.1", "1", "10", "100", "1000"])
        right.set_title("Largest before (orange), left after (blue)")
        return svg(figure)


def night() -> str:
    """What the example night's reference shots say of the random walk that its site gives."""
    campaign = read_campaign(Path(__file__).parents[1] / "examples" / "night-01")
    phases = measure_phases(campaign, ReductionSettings())
    rejected = follow_electronics(campaign, phases)[1]
    shots = campaign.shots
    good = np.array([t == REFERENCE and not r for t, r in zip(shots.target, phases.reason, strict=True)])
    good[list(rejected)] = False
    seconds = (shots.mjd_utc - shots.mjd_utc[0]) * SECONDS_PER_DAY
    ranger, phase = np.array(shots.ranger), np.angle(phases.phasor)
    for name in campaign.rangers:
        mine = np.flatnonzero(good & (ranger == name))
        mine = mine[np.argsort(seconds[mine])]
        phase[mine] = np.unwrap(phase[mine])
    given = (seconds[good], phase[good], phases.u_phase[good] ** 2)
    lines = []
    for what, late in (("all", 0), ("without each ranger's first", 1)):
        rank = np.array([np.sum(good & (ranger == ranger[k]) & (seconds < seconds[k])) for k in np.flatnonzero(good)])
        t, y, v = (a[rank >= late] for a in given)
        series = ranger[good][rank >= late]
        walk = estimate_walk(t, y, v, series=series)
        test = walk_test(t, y, v, random_walk=WALK, series=series)
        low, high = (60e3 * edge for edge in walk.interval())
        lines.append(
            f"  {what} ({len(t)} references): {60e3 * walk.random_walk:.1f} mrad per root hour, 95 % {low:.1f} to "
            f"{high:.1f}; the site's 10 gives {test.statistic:.0f}, expected {test.low:.0f} to {test.high:.0f}\n"
        )
    return "random walk that the example night's reference shots show\n" + "".join(lines)


def main(figure: str | None) -> None:
    """Print the table; write the figure where one is asked for."""
    rows = effects()
    for name, most, rest, how in rows:
        sys.stdout.write(f"{name:36s}{most:9.2f} um   left {rest:7.2f} um   {how}\n")
    wanted = 5e-6 / PER_RADIAN
    sys.stdout.write(
        f"share of a further path that stays below 10 um: {float(largest_share(10e-6, WAVELENGTH)):.2e}\n"
        f"reference shots for 5 um midway: every {float(longest_gap(wanted, WALK, 0.0)):.1f} s without noise, "
        f"{float(longest_gap(wanted, WALK, 3e-4, endless=True)):.1f} s in a row of 0.3 mrad each\n"
    )
    sys.stdout.write(night())
    if figure is not None:
        Path(figure).parent.mkdir(parents=True, exist_ok=True)
        Path(figure).write_text(draw(rows), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
