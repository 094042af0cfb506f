"""Tables of two loggers, written from one simulated night each; both have the faults of real tables.

python examples/weather/make_example.py writes them beside this file.
"""

import math
from datetime import datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

HERE = Path(__file__).parent


def night(rng: np.random.Generator, count: int, step_s: float) -> np.ndarray:
    """Temperature (°C), pressure (hPa), humidity (%), one row a reading."""
    hours = np.arange(count) * step_s / 3600.0
    wander = np.cumsum(rng.normal(0.0, 0.02, (count, 3)), axis=0)
    temperature = 9.0 + 5.0 * np.cos(math.tau * (hours + 3.0) / 24.0) + wander[:, 0]
    pressure = 930.5 + 0.08 * hours + 0.3 * wander[:, 1]
    humidity = np.clip(78.0 - 4.0 * (temperature - 9.0) + 3.0 * wander[:, 2], 5.0, 99.0)
    noise = rng.normal(0.0, 1.0, (count, 3)) * (0.05, 0.03, 0.4)
    return np.column_stack([temperature, pressure, humidity]) + noise


def tower(rng: np.random.Generator) -> str:
    """Campbell's TOA5: four lines of heading, quoted times of the site's winter time, NAN, inches of mercury."""
    start, rows = datetime(2024, 2, 10, 18, 0), []
    for k, (t, p, h) in enumerate(night(rng, 720, 60.0)):
        when = start + timedelta(minutes=k)
        shown = f"{t * 1.8 + 32.0:.2f}"
        if k in (190, 191):
            shown = '"NAN"'
        if k == 402:
            shown = "109.40"
        rows.append(f'"{when}",{k},{shown},{p / 33.863886403:.4f},{h / 100.0:.4f}')
    rows.insert(301, rows[300])  # a row that was transmitted twice
    del rows[521:545]  # the battery was changed
    for k in range(600, 604):  # the clock was set back by five and a half minutes
        cells = rows[k].split(",")
        cells[0] = f'"{datetime.fromisoformat(cells[0].strip(chr(34))) - timedelta(seconds=330)}"'
        rows[k] = ",".join(cells)
    heading = (
        '"TOA5","tower","CR1000","12345","CR1000.Std.32","CPU:tower.CR1","4711","OneMin"\n'
        '"TIMESTAMP","RECORD","AirTF_Avg","BP_inHg","RH_Avg"\n"TS","RN","Deg F","inHg","fraction"\n'
        '"","","Avg","Smp","Avg"\n'
    )
    return heading + "\n".join(rows) + "\n"


def valley(rng: np.random.Generator) -> str:
    """A semicolon table with decimal commas, date and clock in two columns, through the end of summer time."""
    start = datetime(2024, 10, 26, 20, 0, tzinfo=ZoneInfo("UTC"))
    rows = ["Datum;Uhrzeit;Lufttemperatur [°C];Taupunkt [°C];QFF [hPa]"]
    for k, (t, p, h) in enumerate(night(rng, 61, 600.0)):
        local = (start + timedelta(minutes=10 * k)).astimezone(ZoneInfo("Europe/Berlin"))
        gamma = math.log(h / 100.0) + 17.62 * t / (243.12 + t)
        dew = 243.12 * gamma / (17.62 - gamma)
        below = t + 273.15 + 0.0065 * 760.0  # of the air that the service puts below the station
        sea = p * (1.0 - 0.0065 * 760.0 / below) ** -5.2559
        cells = [f"{value:.1f}".replace(".", ",") for value in (t, dew, sea)]
        rows.append(";".join([f"{local:%d.%m.%Y}", f"{local:%H:%M}", *cells]))
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    (HERE / "tower.dat").write_text(tower(np.random.default_rng(46)), encoding="utf-8")
    (HERE / "valley.csv").write_text(valley(np.random.default_rng(64)), encoding="utf-8")
