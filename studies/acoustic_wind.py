"""Can sound tell the temperature of a path to 0.1 °C in the wind? One direction, two directions, an array.

python studies/acoustic_wind.py DIRECTORY    makes acoustic.svg there and prints the numbers of docs/studies/acoustic.md
"""

import sys
from pathlib import Path

import numpy as np

from catseye.atmosphere.index.air import group_refractivity
from catseye.atmosphere.sound.dispersion import dispersion
from catseye.atmosphere.sound.path import bent_ray_excess, travel_time
from catseye.atmosphere.sound.speed import sound
from catseye.estimation.shapes.tomography import FieldPrior, Scale
from catseye.gateways.writers.drawing import FAINT, SERIES, STYLE, Figure, mpl, svg
from catseye.reduction.air.acoustic import PathWind, SoundLine, StationAir, path_temperatures
from catseye.reduction.air.acoustic_field import FieldTimes, sound_field

LENGTH, T, P, H = 100.0, 15.0, 933.0, 60.0
STATION = StationAir(P, 0.3, humidity_percent=H, u_humidity_percent=3.0)
PATH = SoundLine(LENGTH, 1e-3)
C = float(sound(T, P, H, model="real_gas").speed)
LASER = np.array([[5.0, 5.0, 3.0], [75.0, 55.0, 12.0]])
NODES = (np.arange(400) + 0.5)[:, None] / 400


def found(forth, back, u_crosswind=0.0, **wind):
    return path_temperatures(forth, back, 5e-6, line=PATH, station=STATION, wind=PathWind(u_crosswind, **wind))


def by_wind() -> dict[str, np.ndarray]:
    """Temperature read less the true one, in winds of 0 to 10 m/s."""
    w, zero = np.linspace(0.2, 10.0, 50), np.zeros(50)
    forth, back = travel_time(LENGTH, C, w, zero), travel_time(LENGTH, C, -w, zero)
    mean = 0.5 * (forth + back)
    across = travel_time(LENGTH, C, zero, w)
    rows = {
        "one direction, wind along": found(forth, None, wind=0.0, u_wind=0.0),
        "mean of the two times, wind along": found(mean, mean),
        "two directions, wind along": found(forth, back),
        "two directions, wind across": found(across, across),
        "the same, anemometer to 0.5 m/s": found(across, across, crosswind=w, u_crosswind=0.5),
    }
    return {"wind": w, **{name: row.temperature_c - T for name, row in rows.items()}}


def air(p):
    """A sunlit patch with sharp edges, a warm layer on the ground."""
    x, y, z = np.moveaxis(p, -1, 0)
    return 16.0 + 1.2 * ((x > 35.0) & (y < 40.0)) * np.exp(-z / 8.0) - 0.4 * np.log((z + 0.5) / 5.0)


def array(count: int, rng: np.random.Generator, wind=(4.0, -2.0, 0.0)):
    """Miss and claim for the laser's path with `count` loudspeakers and microphones about it."""
    angle = 2.0 * np.pi * (np.arange(count) + rng.random()) / count
    places = np.stack([40.0 + 42.0 * np.cos(angle), 30.0 + 34.0 * np.sin(angle), rng.uniform(2.0, 15.0, count)], axis=1)
    source, receiver = np.array([(i, j) for i in range(count) for j in range(count) if i != j]).T
    true = places + 2e-3 * rng.standard_normal(places.shape)
    a, b = true[source], true[receiver]
    length = np.linalg.norm(b - a, axis=1)
    along = (b - a) @ np.array(wind) / length
    c = sound(air(a[:, None] + NODES * (b - a)[:, None]), P, H, model="real_gas").speed
    front = np.sqrt(c**2 - (np.dot(wind, wind) - along**2)[:, None])
    time = length * np.mean(1.0 / (front + along[:, None]), axis=1) + 1e-5 * rng.standard_normal(len(a))
    field = sound_field(
        places,
        FieldTimes(source, receiver, time, 1e-5),
        u_position=2e-3,
        weather=STATION,
        temperature=FieldPrior(15.0, 8.0, (Scale(1.0, (25.0, 25.0, 8.0)), Scale(0.4, (8.0, 8.0, 4.0)))),
        wind=FieldPrior(0.0, 6.0, (Scale(0.5, (40.0, 40.0, 6.0)),)),
    )
    told = field.along(*LASER)
    truth = air(LASER[0] + NODES * (LASER[1] - LASER[0]))
    n = np.mean(group_refractivity(truth, P, H))
    return (
        told.temperature_c[0] - np.mean(truth),
        told.u_temperature_c[0],
        told.group_refractivity[0] - n,
        told.u_group_refractivity[0],
    )


def main(directory: str) -> None:
    out = Path(directory)
    out.mkdir(parents=True, exist_ok=True)
    wind = by_wind()
    say = sys.stdout.write
    at = int(np.argmin(np.abs(wind["wind"] - 5.0)))
    for name, values in wind.items():
        if name != "wind":
            say(f"5 m/s  {name:36} {values[at]:+8.4f} °C\n")
    e = float(sound(T, P, H, model="real_gas").vapour_pressure_hpa)
    for f in (500.0, 2000.0, 5000.0, 10000.0):
        share = dispersion(T, P, e, frequency_hz=f)
        say(f"dispersion at {f:6.0f} Hz: {share.phase * C / 0.62:.3f} to {share.group * C / 0.62:.3f} °C\n")
    for gradient in (0.1, 0.3, 1.0):
        early = bent_ray_excess(LENGTH, C, 0.6 * gradient)
        say(f"bent by {gradient} °C/m over {LENGTH:.0f} m: {early * C / 0.62:.4f} °C\n")
    one = found(*(travel_time(LENGTH, C, s * 5.0, 0.0) for s in (1, -1)), u_crosswind=1.0)
    say("parts of u: " + ", ".join(f"{k} {v[0]:.4f}" for k, v in one.parts_c.items() if v[0] > 0) + " °C\n")
    say(f"u {one.u_temperature_c[0]:.3f} °C, {one.u_group_refractivity[0] * 1e6:.3f} ppm\n")
    rng = np.random.default_rng(1)
    counts, rows = (4, 6, 8, 10, 12), []
    for count in counts:
        values = np.array([array(count, rng) for _ in range(12)])
        miss, u, miss_n, u_n = np.sqrt(np.mean(values**2, axis=0))
        rows.append((miss, u))
        say(
            f"{count:2d} stations: rms miss {miss:.3f} °C (claimed {u:.3f}), "
            f"index {miss_n * 1e6:.3f} ({u_n * 1e6:.3f}) ppm\n"
        )
    (out / "acoustic.svg").write_text(figure(wind, counts, np.array(rows)), encoding="utf-8")


def figure(wind: dict[str, np.ndarray], counts: tuple[int, ...], rows: np.ndarray) -> str:
    """Departures against wind on a logarithmic scale; misses and claims against the size of the array."""
    with mpl.rc_context(STYLE):
        drawing = Figure(figsize=(9.6, 4.4), layout="constrained")
        left, right = drawing.subplots(1, 2)
        for (name, values), colour in zip(list(wind.items())[1:], SERIES, strict=False):
            if np.max(np.abs(values)) > 1e-4:
                left.plot(wind["wind"], np.abs(values), color=colour, label=name)
        left.axhline(0.1, color=FAINT, linestyle=":", linewidth=1.0)
        left.set(yscale="log", ylim=(1e-4, 300.0), xlabel="wind, m/s", ylabel="temperature off, °C")
        left.set_title("One path of 100 m")
        left.legend(loc="upper left")
        right.plot(counts, rows[:, 0], ".-", color=SERIES[0], label="rms miss of 12 arrays")
        right.plot(counts, rows[:, 1], ".--", color=SERIES[1], label="claimed standard uncertainty")
        right.set(ylim=(0.0, None), xlabel="stations in the array", ylabel="of the mean along a laser's path, °C")
        right.set_title("An array; sharp-edged field, 4.5 m/s of wind")
        right.legend()
        return svg(drawing)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python studies/acoustic_wind.py DIRECTORY")
    main(sys.argv[1])
