"""What tables of readings in tests have in common: provenance, weather, and the index that goes with it."""

from datetime import date

import pytest

RUNS = [pytest.param(27, id="quick"), pytest.param(1500, id="long", marks=pytest.mark.slow)]  # of a Monte Carlo
C = 299_792_458.0
PROVENANCE = {
    "instrument": "ZP1",
    "serial": "7",
    "measured_on": date(2026, 9, 1),
    "valid_until": date(2027, 9, 1),
    "by": "a",
    "report": "r",
}
WEATHER = {
    "modulation_hz": 1.5e9,
    "u_modulation_ppm": 0.0,
    "temperature_c": 20.0,
    "pressure_hpa": 933.0,
    "humidity_percent": 50.0,
    "u_temperature_c": 0.0,
    "u_pressure_hpa": 0.0,
    "u_humidity_percent": 0.0,
    "air_model": "rueger1990",
}
GROUP_INDEX = 1.000253246815  # of rueger1990 at this weather: the project's table of recomputed numbers, P 1.49
HALF = C / (2 * GROUP_INDEX * 1.5e9)
