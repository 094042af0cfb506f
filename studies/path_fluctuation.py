"""Does a path's departure from smooth air repeat with the shot? Differences of repeated shots of one path decide.

python studies/path_fluctuation.py [CAMPAIGN]
"""

import sys
from pathlib import Path

import numpy as np

from catseye.constants import PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch

DEFAULT = Path(__file__).parents[1] / "examples" / "night-01"


def main(directory: str) -> None:
    """Mean square of the differences over what samples and electronics explain, with and without a draw a shot."""
    campaign = read_campaign(directory)
    reduction = reduce_epoch(campaign)
    ranges = reduction.coordinates.ranges
    per_radian = SPEED_OF_LIGHT / campaign.site.ranging.modulation_hz / (2 * TWO_PI)
    fluctuation = campaign.site.ranging.path_index_fluctuation_ppm * PPM
    known, with_draw = [], []
    for ranger, electronics in reduction.electronics.items():
        rows = {int(k): i for i, k in enumerate(electronics.shots)}
        latest: dict[str, int] = {}
        for row in np.flatnonzero((np.array(ranges.ranger) == ranger) & ranges.used):
            target = ranges.target[row]
            if target in latest:
                i, j = rows[int(ranges.shot[latest[target]])], rows[int(ranges.shot[row])]
                c = electronics.covariance
                noise = reduction.phases.u_phase[electronics.shots[[i, j]]]
                variance = per_radian**2 * (np.sum(noise**2) + c[i, i] + c[j, j] - 2 * c[i, j])
                difference = ranges.residual[row] - ranges.residual[latest[target]]
                known.append(difference**2 / variance)
                with_draw.append(difference**2 / (variance + 2 * (fluctuation * ranges.range_[row]) ** 2))
            latest[target] = row
    scatter = np.sqrt(2 / len(known))
    sys.stdout.write(
        f"{len(known)} differences between repeats; expectation 1, scatter {scatter:.2f}\n"
        f"  the fluctuation repeats with the path: {np.mean(known):.2f}\n"
        f"  it is drawn anew with every shot:      {np.mean(with_draw):.2f}\n"
    )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(DEFAULT))
