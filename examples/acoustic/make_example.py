"""Makes the recordings and travel times of this directory, from a seed: the truth is what this file says.

python examples/acoustic/make_example.py
"""

from pathlib import Path

import numpy as np

from catseye.records.night.recording import wav_bytes
from catseye.signal.delay.waveform import chirp
from catseye.simulator.laboratory.acoustic import Recorder, SoundPath

HERE = Path(__file__).parent
SEED = 20261121
SAMPLING_HZ, SAMPLES = 16_000, 9_120
LENGTH, PRESSURE_HPA, HUMIDITY_PERCENT = 62.417, 930.4, 71.0
START_MJD, EVERY_S, SHOT_S = 61_365.10, 600.0, 0.3
AMPLIFIER, TRANSDUCERS = 1.25e-3, 85e-6  # s: the loop-back sees the first, the sheet states the second
SIGNAL = {"start_hz": 1500.0, "stop_hz": 5000.0, "duration": 0.02}
DISPERSION_PPM = 55.0
CROSSTALK_M = 25.0  # distance that the own loudspeaker, shielded, seems to have


def air(minutes: float, gust: float) -> SoundPath:
    """Warm at the ranger, cold at the target, cooling; wind from the ranger to the target with gusts."""
    start = 15.4 - 0.03 * minutes
    return SoundPath(
        LENGTH,
        lambda share: start - 1.6 * share + 0.5 * np.sin(np.pi * share),
        lambda share: 3.0 + gust + 0.8 * share,
        lambda share: 1.5 + 0.0 * share,
        pressure_hpa=PRESSURE_HPA,
        humidity_percent=HUMIDITY_PERCENT,
        dispersion_ppm=DISPERSION_PPM,
    )


def truth() -> list[tuple[float, float, float, float, float]]:
    """MJD, mean temperature °C, mean wind m/s, travel times s, of every shot: eight recorded, then 24 in the table."""
    rng = np.random.default_rng(SEED)
    moments = [(EVERY_S * file + SHOT_S * shot) for file in range(4) for shot in range(2)]
    moments += [3600.0 + 60.0 * row for row in range(24)]
    found = []
    for second in moments:
        gust = rng.normal(0.0, 0.7)
        path = air(second / 60.0, gust)
        found.append((START_MJD + second / 86_400.0, path.mean_temperature_c(), 3.4 + gust, *path.travel_times()))
    return found


def recording(file: int, shots: list[tuple[float, float, float, float, float]]) -> np.ndarray:
    """Channels (3, n) int16: microphone at the target, microphone at the ranger, loop-back."""
    rng = np.random.default_rng([SEED, file])
    microphone = Recorder(
        SAMPLING_HZ, noise_volt=2e-3, rumble_volt=0.01, delay=AMPLIFIER + TRANSDUCERS, echoes=((1.3, 0.06),)
    )
    wire = Recorder(SAMPLING_HZ, noise_volt=1e-4, delay=AMPLIFIER)
    emissions = [0.02 + SHOT_S * k for k in range(len(shots))]

    def signal(time):
        return chirp(time, **SIGNAL)

    common = {"samples": SAMPLES, "rng": rng}
    there = microphone.volts(signal, emissions, travel_time=[s[3] for s in shots], distance=LENGTH, **common)
    back = microphone.volts(signal, emissions, travel_time=[s[4] for s in shots], distance=LENGTH, **common)
    back += Recorder(SAMPLING_HZ, noise_volt=0.0, delay=AMPLIFIER).volts(
        signal, emissions, travel_time=1.0 / 340.0, distance=CROSSTALK_M, **common
    )
    loop = wire.volts(signal, emissions, travel_time=0.0, distance=0.0, **common)
    return np.stack([microphone.codes(v) for v in (there, back, loop)]).astype(np.int16)


def main() -> None:
    shots = truth()
    for file in range(4):
        codes = recording(file, shots[2 * file : 2 * file + 2])
        (HERE / f"evening-{file + 1}.wav").write_bytes(wav_bytes(codes, SAMPLING_HZ))
    rng = np.random.default_rng([SEED, 99])
    lines = ["mjd_utc,time_ab_s,time_ba_s,u_time_us"]
    for mjd, _, _, ab, ba in shots[8:]:
        noise = rng.normal(0.0, 8e-6, 2)
        lines.append(f"{mjd:.8f},{ab + TRANSDUCERS + noise[0]:.7f},{ba + TRANSDUCERS + noise[1]:.7f},8")
    (HERE / "night.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (HERE / "station.csv").write_text("\n".join(station()) + "\n", encoding="utf-8")


def station() -> list[str]:
    """Lines of the mast's logger at the ranger, every five minutes: its sensors scatter, pressure and humidity hold."""
    rng = np.random.default_rng([SEED, 7])
    lines = ["mjd_utc,temperature_c,pressure_hpa,humidity_percent"]
    for step in range(-3, 21):
        t, p, h = rng.normal(0.0, (0.1, 0.05, 0.4))
        values = f"{15.4 - 0.15 * step + t:.2f},{PRESSURE_HPA + p:.2f},{HUMIDITY_PERCENT + h:.1f}"
        lines.append(f"{START_MJD + step * 300.0 / 86_400.0:.6f},{values}")
    return lines


if __name__ == "__main__":
    main()
