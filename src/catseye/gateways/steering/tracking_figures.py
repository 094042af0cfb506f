"""Figures of tracking, searching and visibility."""

import numpy as np

from catseye.gateways.writers.drawing import BAD, FAINT, GRID, SERIES, Figure, mpl, styled
from catseye.geometry.mirror.search_pattern import count_size
from catseye.reduction.steering.spot_fit import Spot
from catseye.reduction.steering.tracking import CountTrack, Following
from catseye.reduction.steering.visibility import Sight, Visibility

SIGHTS = {
    Sight.SEEN: (SERIES[2], "seen"),
    Sight.INCIDENCE: (SERIES[4], "incidence"),
    Sight.OBSTRUCTED: (SERIES[1], "obstructed"),
    Sight.TOO_FAR: (SERIES[3], "too far"),
    Sight.TOO_NEAR: (SERIES[5], "too near"),
    Sight.BEYOND_STOPS: (BAD, "beyond the stops"),
}
MOST_PAIRS = 6  # lines of a figure
MOST_LABELS = 60  # on one axis
ELLIPSE = 3.0  # standard deviations drawn


def miss_figure(
    track: CountTrack,
    misses: np.ndarray,
    shares: np.ndarray,
    *,
    limit: float = 1e-3,
    ideal_misses: np.ndarray | None = None,
) -> Figure:
    """Distance by which beams miss their targets over the track: worst pair, median, limit.

    track          followed track
    misses         (s, k, r, p) m, of `reduction.steering.tracking.misses`
    shares         (k,) position within each interval
    limit          m, drawn as a line
    ideal_misses   (s, k, r, p) m, at the counts of mirrors without imperfections; drawn if present
    """
    good = track.status == Following.FOLLOWED
    when = (track.since[:-1, None] + np.asarray(shares) * np.diff(track.since)[:, None]).ravel()
    with styled():
        figure = Figure(figsize=(8.6, 3.2), layout="constrained")
        ax = figure.subplots()
        if good.any():
            distances_mm = 1e3 * misses[:, :, good].reshape(len(when), -1)
            ax.plot(when, distances_mm.max(axis=1), color=SERIES[1], lw=1.1, label=f"worst of {int(good.sum())} pairs")
            ax.plot(when, np.median(distances_mm, axis=1), color=SERIES[0], lw=1.1, label="median")
            if ideal_misses is not None:
                worst_mm = 1e3 * ideal_misses[:, :, good].reshape(len(when), -1).max(axis=1)
                ax.plot(when, worst_mm, color=SERIES[3], lw=1.1, ls="-.", label="worst without the\nmirror's offsets")
        ax.axhline(1e3 * limit, color=BAD, lw=0.9, ls="--", label=f"{1e3 * limit:g} mm")
        ax.set_yscale("log")
        ax.set_xlabel("time (s)")
        ax.set_ylabel("miss of the target (mm)")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure


def error_figure(track: CountTrack, errors: np.ndarray, shares: np.ndarray) -> Figure:
    """Linear counts less exact ones over the track, azimuth and elevation, of each point that is followed.

    track     followed track
    errors    (s, k, r, p, 2) counts, of `reduction.steering.tracking.count_errors`
    shares    (k,) position within each interval
    """
    good = track.status == Following.FOLLOWED
    inside = np.concatenate([[0.0], np.asarray(shares), [1.0]])  # at the nodes the error is zero
    when = (track.since[:-1, None] + inside * np.diff(track.since)[:, None]).ravel()
    with styled():
        figure = Figure(figsize=(8.6, 4.4), layout="constrained")
        panels = figure.subplots(2, 1, sharex=True)
        for axis, (ax, name) in enumerate(zip(panels, ("azimuth", "elevation"), strict=True)):
            between = errors[:, :, good, axis]
            whole = np.pad(between, ((0, 0), (1, 1), (0, 0))).reshape(len(when), -1)
            for k, line in enumerate(whole.T[:MOST_PAIRS]):
                ax.plot(when, line, color=SERIES[k % len(SERIES)], lw=0.9, label=f"point {k}")
            ax.axhline(0.0, color=FAINT, lw=0.7)
            ax.set_ylabel(f"{name} (counts)")
        panels[0].set_title("Linear counts between t0 and t1 less exact counts")
        panels[1].set_xlabel("time (s)")
        if good.any():
            panels[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.0))
        return figure


def mirror_figure(track: CountTrack, mirror_counts: np.ndarray) -> Figure:
    """Counts at t0 and t1 less those of an ideal mirror over the track, of each point that is followed.

    track           followed track of one ranger
    mirror_counts   (k + 1, p, 2) counts, of `reduction.steering.ground_track.GroundTrack`
    """
    good = track.status[0] == Following.FOLLOWED
    with styled():
        figure = Figure(figsize=(8.6, 4.4), layout="constrained")
        panels = figure.subplots(2, 1, sharex=True)
        for axis, (ax, name) in enumerate(zip(panels, ("azimuth", "elevation"), strict=True)):
            for k in np.flatnonzero(good)[:MOST_PAIRS]:
                ax.plot(track.since, mirror_counts[:, k, axis], color=SERIES[k % len(SERIES)], label=f"point {k}")
            ax.axhline(0.0, color=FAINT, lw=0.7)
            ax.set_ylabel(f"{name} (counts)")
        panels[0].set_title("Counts by the mirror's axis offsets, tilts and encoder errors")
        panels[1].set_xlabel("time (s)")
        if good.any():
            panels[0].legend(loc="center left", bbox_to_anchor=(1.0, 0.0))
        return figure


def search_figure(spot: Spot, zeros: tuple[float, float], title: str = "") -> Figure:
    """Places visited by a search, in order, coloured by return, and the spot's centre if found.

    spot     of `reduction.steering.finding.find`
    zeros    (na0, ne0) counts, for the size of counts on the sky: the figure has the sky's proportions
    title    replaces the status
    """
    with styled():
        figure = Figure(figsize=(7.4, 5.2), layout="constrained")
        ax = figure.subplots()
        na, ne = spot.looked_at.T if len(spot.looked_at) else (np.zeros(0), np.zeros(0))
        ax.plot(na, ne, color=GRID, lw=0.7, zorder=1)
        reached = np.isfinite(spot.seen)
        drawn = ax.scatter(na[reached], ne[reached], c=spot.seen[reached], s=16, cmap="viridis", linewidths=0, zorder=2)
        ax.plot(na[~reached], ne[~reached], "x", ms=4, color=FAINT, zorder=2)
        figure.colorbar(drawn, ax=ax, label="return (V)", shrink=0.85)
        if spot.found:
            _mark(ax, spot)
        if len(spot.looked_at):
            across, up = count_size(np.median(spot.looked_at, axis=0), zeros)
            ax.set_aspect(up / max(across, 0.02 * up))  # near the azimuth axis a count is tiny
        ax.set_xlabel("azimuth counts")
        ax.set_ylabel("elevation counts")
        ax.ticklabel_format(useOffset=False)
        ax.locator_params(axis="x", nbins=6)
        heading = title or (spot.status if len(spot.status) < 90 else f"{spot.status[:87]}...")
        ax.set_title(f"{heading}\n{_centre_text(spot)}" if spot.found else heading, fontsize=8.5)
        return figure


def _mark(ax, spot: Spot) -> None:
    """Draw the centre and the ellipse of three standard deviations."""
    values, vectors = np.linalg.eigh(spot.covariance)
    turn = np.linspace(0.0, 2.0 * np.pi, 120)
    ring = vectors @ (np.sqrt(values)[:, None] * ELLIPSE * np.stack([np.cos(turn), np.sin(turn)]))
    ax.plot(*spot.counts, "+", ms=10, color=BAD, mew=1.4, zorder=4)
    ax.plot(*(spot.counts[:, None] + ring), color=BAD, lw=1.0, zorder=4, label=f"centre, {ELLIPSE:g} u")


def _centre_text(spot: Spot) -> str:
    (na, ne), (u_na, u_ne) = spot.counts, spot.u_counts
    return f"{na:.2f} ± {u_na:.2f}, {ne:.2f} ± {u_ne:.2f} counts; {spot.amplitude:.2f} V, flatness {spot.flatness:.1f}"


def visibility_figure(visibility: Visibility) -> Figure:
    """Chart of rangers by retroreflectors, coloured by visibility or the reason against it."""
    rangers, targets = visibility.code.shape
    with styled():
        figure = Figure(figsize=(min(12.0, 3.2 + 0.16 * targets), 1.6 + 0.22 * rangers), layout="constrained")
        ax = figure.subplots()
        colours = mpl.colors.ListedColormap([SIGHTS[Sight(k)][0] for k in range(len(Sight))])
        ax.imshow(visibility.code, cmap=colours, vmin=-0.5, vmax=len(Sight) - 0.5, aspect="auto", interpolation="none")
        ax.set_yticks(range(rangers), visibility.rangers, fontsize=7.5)
        if targets <= MOST_LABELS:
            ax.set_xticks(range(targets), visibility.targets, rotation=90, fontsize=6.5)
        else:
            ax.set_xlabel(f"{targets} retroreflectors")
        ax.set_xticks(np.arange(0.5, targets), minor=True)
        ax.set_yticks(np.arange(0.5, rangers), minor=True)
        ax.grid(False)
        if targets <= MOST_LABELS:
            ax.grid(which="minor", color="white", lw=0.8)
        ax.tick_params(which="both", length=0)
        present = [sight for sight in SIGHTS if np.any(visibility.code == sight)]
        counts = {sight: int(np.sum(visibility.code == sight)) for sight in present}
        handles = [mpl.patches.Patch(color=SIGHTS[s][0], label=f"{SIGHTS[s][1]}: {counts[s]}") for s in present]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        return figure
