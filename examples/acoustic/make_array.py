"""Makes the array's tables of this directory, from a seed: the truth is what this file says.

python examples/acoustic/make_array.py
"""

from pathlib import Path

import numpy as np

from catseye.simulator.laboratory.acoustic import SoundPath

HERE = Path(__file__).parent
SEED = 20261128
STATIONS = {
    "S1": (0.0, 0.0, 2.0), "S2": (40.0, -5.0, 6.0), "S3": (80.0, 0.0, 2.5), "S4": (85.0, 30.0, 8.0),
    "S5": (80.0, 60.0, 2.0), "S6": (40.0, 65.0, 6.0), "S7": (0.0, 60.0, 3.0), "S8": (-5.0, 30.0, 9.0),
}  # fmt: skip
U_POSITION, U_TIME, DELAY = 2e-3, 10e-6, 85e-6
PRESSURE_HPA, HUMIDITY_PERCENT = 930.6, 62.0  # the sheet says 930.4 and 60
DISPERSION_PPM = 40.0
LASERS = {"ZY103": ((5.0, 5.0, 3.0), (75.0, 55.0, 12.0)), "ZY104": ((5.0, 55.0, 3.0), (75.0, 5.0, 8.0))}
SHARES = (np.arange(400) + 0.5) / 400.0


def temperature_c(points):
    """Warm over a sunlit patch, cooler with height, °C at points (..., 3)."""
    x, y, z = np.moveaxis(points, -1, 0)
    return 16.0 + 1.5 * np.exp(-((x - 55.0) ** 2 + (y - 20.0) ** 2) / 2.0 / 22.0**2) * np.exp(-z / 15.0) - 0.02 * z


def wind(points):
    """Wind that grows with height, and a slow turn, m/s."""
    x, y, z = np.moveaxis(points, -1, 0)
    up = 1.0 + 0.04 * (z - 5.0)
    return np.stack([3.0 * up - 0.008 * (y - 30.0), -1.5 * up + 0.008 * (x - 40.0), 0.0 * z], axis=-1)


def travel_time(start, end, temperature=temperature_c, blowing=wind, **air):
    """Time of sound from start to end, s."""
    way = end - start
    length = float(np.linalg.norm(way))

    def at(share):
        return start + np.asarray(share)[..., None] * way

    def across(share):
        w = blowing(at(share))
        return np.sqrt(np.maximum(np.sum(w**2, axis=-1) - (w @ way / length) ** 2, 0.0))

    path = SoundPath(
        length, lambda share: temperature(at(share)), lambda share: blowing(at(share)) @ way / length, across, **air
    )
    return path.travel_times()[0]


def line_mean(start, end, temperature=temperature_c):
    """Mean temperature along a line, °C."""
    start, end = np.asarray(start), np.asarray(end)
    return float(np.mean(temperature(start + SHARES[:, None] * (end - start))))


def main() -> None:
    rng = np.random.default_rng(SEED)
    names, nominal = list(STATIONS), np.array(list(STATIONS.values()))
    true = nominal + U_POSITION * rng.standard_normal(nominal.shape)
    air = {"pressure_hpa": PRESSURE_HPA, "humidity_percent": HUMIDITY_PERCENT, "dispersion_ppm": DISPERSION_PPM}
    rows = ["source,receiver,time_s,u_time_us"]
    for i, source in enumerate(names):
        for j, receiver in enumerate(names):
            if i != j:
                time = travel_time(true[i], true[j], **air) + DELAY + U_TIME * rng.standard_normal()
                rows.append(f"{source},{receiver},{time:.7f},10")
    (HERE / "array-times.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    places = [f"{name},{x:g},{y:g},{z:g}" for name, (x, y, z) in STATIONS.items()]
    (HERE / "array-stations.csv").write_text("\n".join(["station,x_m,y_m,z_m", *places]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
