"""How well a line of counts follows the antenna at slew rates, and what a whole count and a moving target do.

    python studies/tracking.py DIRECTORY

writes tracking.svg into the directory and prints the tables. The rangers are the twelve ground rangers of the example
night; the telescope is rigid and turns on both axes at once at the rates of the GBT, 35.2 and 17.6 deg/min, through
all elevations and many azimuths. Targets stand all over the dish and on the alidade. The beams are exact rays.

What it shows. Between two exact pointings 128 ms apart the line is off by a few hundredths of a millimetre, even near
the azimuth axis of a mirror, which for a ground ranger looks at the pintle. Rounding to whole counts adds far more,
half a count of each axis; the GBT's beam and 2 inch retroreflectors bear it. What slewing does break is the range: it
runs by up to 0.65 m/s, most of a half wavelength of the modulation within one buffer.
"""

import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from catseye.constants import DEGREE
from catseye.gateways.writers.drawing import BAD, FAINT, SERIES, STYLE, Figure, mpl, svg
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT
from catseye.geometry.mirror.pointing import MirrorStation, in_mirror_axes
from catseye.geometry.mirror.track import apparent_motion, line_bound, longest_interval
from catseye.geometry.sky.time_tag import TimeTag, tag_step
from catseye.optics.spot import offset_range, offset_share, steering_range
from catseye.records.files.examples import example_campaign
from catseye.records.night.campaign import read_campaign
from catseye.reduction.site.stations import station_of
from catseye.reduction.steering.tracking import (
    AZIMUTH_SLEW,
    BUFFER,
    ELEVATION_SLEW,
    AntennaPath,
    Drive,
    fixed,
    follow,
    misses,
    mounted,
    smear,
)

START = TimeTag(52889, 0)
LIGHT = {"receiver": 0.050, "waist": 0.010, "wavelength": 0.78e-6}  # of reduction.link.Link
APERTURES = {"25.4 mm, straight on": 0.0254, "14.8 mm: the same at 29 deg": 0.0148, "10 mm": 0.010}  # clear radii
WAVELENGTH = 0.199811  # m, modulation in air
AT = 120.0  # m
INTERVALS = (0.032, 0.064, 0.128, 0.256, 0.512, 1.024)
RAMP = 60.0  # s: drives are started so long before the study begins, to be at full rate


@dataclass(frozen=True)
class Sample:
    """Pairs of rangers and targets at many postures of a slew, flat arrays of one length; metres and radians.

    off       past the target at worst within the interval, of the real line
    whole     the same, on whole counts
    range     distance
    phi       from the azimuth axis
    rate      of the range, m/s
    speed     across the beam, m/s
    bound     what `line_bound` allows
    longest   s, interval that surely holds a quarter of a count
    """

    off: np.ndarray
    whole: np.ndarray
    range: np.ndarray
    phi: np.ndarray
    rate: np.ndarray
    speed: np.ndarray
    bound: np.ndarray
    longest: np.ndarray


def rangers() -> MirrorStation:
    """The ground rangers of the example night, (12,)."""
    night = read_campaign(example_campaign())
    each = [station_of(night.monuments[n], night.mirror_of(n)) for n in sorted(night.monuments)]
    return MirrorStation.of_parameters(np.stack([s.parameters for s in each]))


def dish(step: float = 20.0) -> np.ndarray:
    """Targets on the reflector (n, 3), m, its frame."""
    x, y = np.meshgrid(np.arange(-50.0, 50.1, step), np.arange(4.0, 104.1, step))
    inside = np.hypot(x, y - 54.0) <= 50.0
    x, y = x[inside], y[inside]
    return np.stack([x, y, (x**2 + y**2) / 240.0], axis=-1)


ALIDADE = np.array([[20.0, 10.0, 3.0], [-18.0, -12.0, 25.0], [0.0, 25.0, 48.0]])  # m, alidade frame: chosen


def slew(azimuth: float, up: bool = True) -> AntennaPath:
    """Both axes at full rate from t = 0 on, elevation from 5 to 88 deg or back."""
    low, high = (5.0 * DEGREE, 88.0 * DEGREE) if up else (88.0 * DEGREE, 5.0 * DEGREE)
    rate = ELEVATION_SLEW if up else -ELEVATION_SLEW
    lead = RAMP * AZIMUTH_SLEW
    return AntennaPath(
        Drive(azimuth - lead, azimuth + 9.0, rate=AZIMUTH_SLEW, begin=-RAMP),
        Drive(low - RAMP * rate, high + 0.5 * rate * RAMP, rate=ELEVATION_SLEW, begin=-RAMP),
    )


def sampled(interval: float = BUFFER, *, azimuths: int = 12, every: float = 4.0, shares: int = 7) -> Sample:
    """Single intervals, every few seconds of slews from many azimuths."""
    stations = rangers()
    found = []
    seconds = 83.0 * DEGREE / ELEVATION_SLEW
    for azimuth in 2.0 * np.pi * np.arange(azimuths) / azimuths:
        for frame, own in (("reflector", dish()), ("alidade", ALIDADE)):
            path = slew(float(azimuth), up=azimuth < np.pi)
            for begin in np.arange(0.0, seconds, every):
                found.append(_one(stations, path, fixed(own, frame, path), own, frame, float(begin), interval, shares))
    return Sample(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _one(stations, path, targets, own, frame, begin, interval, shares) -> tuple[np.ndarray, ...]:
    """One interval: all rangers and targets."""

    def later(t):
        return targets(np.asarray(t) + begin)

    track = follow(mounted(stations), later, START, intervals=1, interval=interval)
    between = np.arange(1, shares + 1) / (shares + 1)
    off = misses(track, mounted(stations), later, shares=between)[0]
    whole = misses(track, mounted(stations), later, shares=between, whole_counts=True)[0]
    place, speed, bend = path.motion(own, frame, begin)
    relative = place[None] - stations.scan_point[:, None]
    seen = apparent_motion(stations.mirror_from_ground[:, None], relative, speed[None], acceleration=bend[None])
    distance = np.linalg.norm(relative, axis=-1)
    rate = np.sum(relative * speed[None], axis=-1) / distance
    across = np.sqrt(np.maximum(np.sum(speed[None] ** 2, axis=-1) - rate**2, 0.0))
    most = 1.05 * np.linalg.norm(bend, axis=-1)[None] + 1e-4
    bound = line_bound(
        seen[0], np.linalg.norm(seen[1], axis=-1), np.broadcast_to(most, distance.shape), interval=interval
    )[2]
    apparent = np.linalg.norm(seen[1], axis=-1), np.broadcast_to(most, distance.shape)
    longest = longest_interval(seen[0], *apparent)
    mirror = in_mirror_axes(stations[:, None], place[None])
    phi = np.arctan2(np.hypot(mirror[..., 0], mirror[..., 1]), mirror[..., 2])
    return tuple(a.ravel() for a in (off.max(0), whole.max(0), distance, phi, rate, across, bound, longest))


def rounding(distance: float = AT, draws: int = 400_000, seed: int = 3) -> dict[str, float]:
    """What whole counts do at Phi = 90 deg: rms and largest miss, m, by counts anywhere, and by the formula."""
    rng = np.random.default_rng(seed)
    off = distance * np.hypot(*(rng.uniform(-0.5, 0.5, (2, draws)) * BEAM_PER_COUNT[:, None]))
    half = distance * BEAM_PER_COUNT
    return {
        "azimuth rms": float(half[0] / np.sqrt(12.0)),
        "elevation rms": float(half[1] / np.sqrt(12.0)),
        "rms": float(np.hypot(*half) / np.sqrt(12.0)),
        "drawn rms": float(np.sqrt(np.mean(off**2))),
        "largest": float(0.5 * np.hypot(*half)),
    }


def table(sample: Sample) -> str:
    """The numbers of the page."""
    near = sample.phi < 2.0 * DEGREE
    there = (sample.range <= AT) & ~near
    lines = ["line of counts over 128 ms, both axes at full rate; mm past the target"]
    lines.append(f"{'':34s}{'pairs':>9s}{'median':>9s}{'largest':>9s}{'bound':>9s}")
    for name, use in (
        ("Phi above 2 deg", ~near),
        ("of these within 120 m", there),
        ("Phi 10 to 170 deg", (sample.phi > 10 * DEGREE) & (sample.phi < 170 * DEGREE)),
        ("Phi below 2 deg", near),
    ):
        if use.any():
            off = 1e3 * sample.off[use]
            worst = 1e3 * sample.bound[use]
            most = f"{worst.max():9.3f}" if np.isfinite(worst.max()) else f"{'no':>9s}"
            lines.append(f"{name:34s}{use.sum():9d}{np.median(off):9.4f}{off.max():9.4f}{most}")
    round_ = {k: f"{1e3 * v:.2f}" for k, v in rounding().items()}
    lines += ["", f"whole counts at 120 m, Phi = 90 deg, mm: {round_}"]
    lines.append(f"whole counts, all pairs above 2 deg: largest {1e3 * sample.whole[~near].max():.1f} mm")
    size = "clear radius"
    lines += ["", f"{size:30s}" + "".join(f"{1e3 * d:>10.1f} mm" for d in (0.0, *_offsets()))]
    for name, aperture in APERTURES.items():
        share = offset_share([0.0, *_offsets()], AT, aperture=aperture, **LIGHT)
        lines.append(f"{name:30s}" + "".join(f"{s / share[0]:13.4f}" for s in share))
    change = offset_range(_offsets(), AT, aperture=0.0254, **LIGHT)
    lines.append(
        f"range, um, by diffraction: {[f'{1e6 * c:.4f}' for c in change]}, by steering: "
        f"{[f'{1e6 * c:.2f}' for c in steering_range(_offsets(), AT)]}"
    )
    lines += [
        "",
        f"speed across the beam up to {sample.speed.max():.2f} m/s; an MJD of 8 decimals costs up to "
        f"{1e3 * sample.speed.max() * tag_step(8) / 2:.2f} mm (cut: {1e3 * sample.speed.max() * tag_step(8):.2f}), "
        f"of 11 decimals {1e6 * sample.speed.max() * tag_step(11) / 2:.2f} um",
    ]
    lines.append(
        f"longest interval for a quarter of a count: {sample.longest.min():.2f} s at least, median "
        f"{np.median(sample.longest):.2f} s"
    )
    left = smear(sample.rate, wavelength=WAVELENGTH)[1]
    lines.append(
        f"range runs by up to {np.abs(sample.rate).max():.2f} m/s, median {np.median(np.abs(sample.rate)):.2f}; "
        f"a buffer keeps more than 90 % of its amplitude for {100 * np.mean(left > 0.9):.0f} % of the pairs, "
        f"less than half for {100 * np.mean(left < 0.5):.0f} %; one cycle of 1 ms at least "
        f"{100 * smear(np.abs(sample.rate).max(), wavelength=WAVELENGTH, duration=1e-3)[1]:.3f} %"
    )
    return "\n".join(lines)


def _offsets() -> np.ndarray:
    """m at 120 m: rms of rounding, its largest, and a whole count of each."""
    r = rounding()
    return np.array([r["rms"], r["largest"], 2.0 * r["largest"]])


def figure(sample: Sample) -> str:
    """Four panels as SVG text."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = Figure(figsize=(9.6, 7.0), layout="constrained")
        axes = drawn.subplots(2, 2)
        _draw_phi(axes[0, 0], sample)
        _draw_intervals(axes[0, 1])
        _draw_return(axes[1, 0])
        _draw_smear(axes[1, 1], sample)
        return svg(drawn)


def _draw_phi(ax, sample: Sample) -> None:
    edges = np.geomspace(0.5, 180.0, 22)
    phi = sample.phi / DEGREE
    middle, most, typical, bound = [], [], [], []
    for low, high in pairwise(edges):
        use = (phi >= low) & (phi < high)
        if use.sum() >= 5:
            middle.append(np.sqrt(low * high))
            most.append(1e3 * sample.off[use].max())
            typical.append(1e3 * np.median(sample.off[use]))
            bound.append(1e3 * sample.bound[use].max())
    ax.loglog(middle, bound, ":", color=FAINT, label="bound, worst pair")
    ax.loglog(middle, most, ".-", color=SERIES[1], label="worst pair")
    ax.loglog(middle, typical, ".-", color=SERIES[0], label="median")
    ax.axhline(1.0, color=BAD, lw=0.9, ls="--")
    ax.set_ylim(1e-3, 30.0)
    ax.set_xlabel("target from the azimuth axis, Φ (deg)")
    ax.set_ylabel("beam past the target (mm)")
    ax.set_title("Over 128 ms a line of counts holds a millimetre")
    ax.legend(loc="upper right")


def _draw_intervals(ax) -> None:
    most, typical = [], []
    for interval in INTERVALS:
        part = sampled(interval, azimuths=4, every=12.0, shares=3)
        use = part.phi > 2.0 * DEGREE
        most.append(1e3 * part.off[use].max())
        typical.append(1e3 * np.median(part.off[use]))
    ms = 1e3 * np.array(INTERVALS)
    ax.loglog(ms, most, ".-", color=SERIES[1], label="worst pair, Φ > 2°")
    ax.loglog(ms, typical, ".-", color=SERIES[0], label="median")
    ax.axhline(1.0, color=BAD, lw=0.9, ls="--", label="1 mm")
    ax.axhline(1e3 * rounding()["rms"], color=SERIES[2], lw=0.9, ls="-.", label="whole counts at 120 m, rms")
    ax.axvline(128.0, color=FAINT, lw=0.8)
    ax.set_xlabel("interval (ms)")
    ax.set_ylabel("beam past the target (mm)")
    ax.set_title("It grows with the square of the interval")
    ax.legend(loc="lower right")


def _draw_return(ax) -> None:
    offsets = np.linspace(0.0, 0.032, 25)
    r = rounding()
    ax.axvspan(0.0, 1e3 * r["largest"], color=SERIES[2], alpha=0.15, lw=0)
    ax.axvline(1e3 * r["rms"], color=SERIES[2], lw=0.9, ls="-.")
    for (name, aperture), colour in zip(APERTURES.items(), SERIES, strict=False):
        share = offset_share(offsets, AT, aperture=aperture, **LIGHT)
        ax.plot(1e3 * offsets, share / share[0], color=colour, label=name)
    ax.annotate("whole counts", (0.4, 0.04), color=SERIES[2], fontsize=8.5)
    ax.set_ylim(0.0, 1.05)
    ax.set_xlabel("beam off the retroreflector at 120 m (mm)")
    ax.set_ylabel("return over that of a hit")
    ax.set_title("A whole count costs a 2 inch retroreflector nothing")
    ax.set_xlim(0.0, 50.0)
    ax.legend(loc="upper right", title="clear radius", title_fontsize=8.5)


def _draw_smear(ax, sample: Sample) -> None:
    speed = np.linspace(0.0, 1.1, 400)
    ax.plot(speed, smear(speed, wavelength=WAVELENGTH)[1], color=SERIES[1], label="left of a 128 ms buffer")
    edges = np.linspace(0.0, 1.1, 45)
    ax.hist(
        np.abs(sample.rate),
        bins=edges,
        weights=np.full(sample.rate.size, 10.0 / sample.rate.size),
        color=SERIES[0],
        alpha=0.35,
        label="pairs of a slew (arbitrary height)",
    )
    ax.set_ylim(0.0, 1.05)
    ax.set_xlabel("change of the range (m/s)")
    ax.set_ylabel("amplitude")
    ax.set_title("But the range runs away under the buffer")
    ax.legend(loc="upper right")


def main(directory: str) -> None:
    """Print the tables, write the figure."""
    target = Path(directory)
    target.mkdir(parents=True, exist_ok=True)
    sample = sampled()
    (target / "tracking.svg").write_text(figure(sample), encoding="utf-8")
    sys.stdout.write(f"{table(sample)}\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python studies/tracking.py DIRECTORY")
    main(sys.argv[1])
