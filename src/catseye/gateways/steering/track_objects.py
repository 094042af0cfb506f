"""Tracks of a mirror as text."""

from collections.abc import Sequence

import numpy as np

from catseye.gateways.writers.cells import aligned
from catseye.gateways.writers.passage import Passage
from catseye.reduction.steering.ground_track import GroundTrack

MOST_NODES = 12  # intervals printed


def track_passages(followed: GroundTrack) -> Sequence[Passage]:
    """Sentences of a track: points followed, largest errors, limits."""
    since, good = followed.track.since, followed.followed
    text = f"{followed.ranger.mirror.zp} on {followed.ranger.name}: {int(good.sum())} of {len(good)} points followed "
    text += f"over {np.ptp(since):g} s in {len(since) - 1} intervals"
    if good.any():
        worst, counts = 1e3 * followed.worst[good].max(), followed.worst_counts[good].max(axis=0)
        text += f"; beams pass them by {worst:.3g} mm at most, counts not rounded"
        text += f"; between t0 and t1 linear counts are off by {counts[0]:.2g} in azimuth, {counts[1]:.2g} in elevation"
        text += f"; {_uncertainty(followed, good)}"
    bad = [f"point {k}: {why}" for k, why in enumerate(followed.status) if not good[k]]
    passages = [Passage("The track", text + "."), *(Passage("Not followed", line) for line in bad[:5])]
    if followed.ideal is not None and good.any():
        changed = np.abs(followed.mirror_counts[:, good]).max(axis=(0, 1))
        text = "the mirror's axis offsets, tilts and encoder errors are in these counts, up to "
        text += f"{changed[0]:.2g} in azimuth and {changed[1]:.2g} in elevation; at the counts without them "
        text += f"the beam would pass its targets by {1e3 * followed.worst_ideal[good].max():.3g} mm at most"
        passages.append(Passage("The mirror", text + "."))
    return passages


def _uncertainty(followed: GroundTrack, good: np.ndarray) -> str:
    """Largest standard uncertainties of the counts, or the keys that the records lack."""
    if followed.lacking:
        return f"u of the counts is unknown: the records lack {', '.join(followed.lacking)}"
    u = np.max(followed.u_counts[:, good], axis=(0, 1))
    most = [f"{v:.2g}" if np.isfinite(v) else "unknown" for v in u]
    return f"u of the counts is at most {most[0]} in azimuth, {most[1]} in elevation, all but common to t0 and t1"


def track_lines(followed: GroundTrack) -> list[str]:
    """Tables as text: a line a point, then a line a node of the first point that is followed.

    With the miss at an ideal mirror's counts where the record has offsets, tilts or encoder errors.
    """
    counts, prime = followed.counts, followed.track.prime[0]
    heading = ("point", "pointing", "N_a start", "N_a end", "N_e start", "N_e end", "error N_a", "error N_e", "miss mm")
    imperfect = followed.ideal is not None
    rows: list[tuple[str, ...]] = [(*heading, "ideal mm") if imperfect else heading]
    for k, good in enumerate(followed.followed):
        if not good:
            rows.append((str(k), "not followed", *("",) * (len(rows[0]) - 2)))
            continue
        ends = (counts[0, k, 0], counts[-1, k, 0], counts[0, k, 1], counts[-1, k, 1])
        worst = (*followed.worst_counts[k], 1e3 * followed.worst[k])
        if imperfect:
            worst = (*worst, 1e3 * followed.worst_ideal[k])
        pointing = "prime" if prime[k] else "direct"
        rows.append((str(k), pointing, *(f"{v:.3f}" for v in ends), *(f"{v:.2g}" for v in worst)))
    lines = aligned(rows)
    if followed.followed.any():
        k = int(np.flatnonzero(followed.followed)[0])
        since, listed = followed.track.since, min(MOST_NODES, len(followed.track.since) - 1)
        nodes: list[tuple[str, ...]] = [(f"point {k}", "t0 s", "t1 s", "N_a t0", "N_a t1", "N_e t0", "N_e t1")]
        for i in range(listed):
            at = (counts[i, k, 0], counts[i + 1, k, 0], counts[i, k, 1], counts[i + 1, k, 1])
            nodes.append((str(i), f"{since[i]:.3f}", f"{since[i + 1]:.3f}", *(f"{v:.3f}" for v in at)))
        lines += ["", *aligned(nodes)]
        more = len(since) - 1 - listed
        if more:
            lines.append(f"... and {more} more: nodes.csv of --out")
    return lines
