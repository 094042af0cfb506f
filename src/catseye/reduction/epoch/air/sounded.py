"""Lines whose mean temperature sound measured (path_temperatures.csv).

Their mean temperature and its common error.
"""

from dataclasses import dataclass

import numpy as np

from catseye.constants import SECONDS_PER_DAY
from catseye.records.night.path_temperature import PathTemperatureTable

SOUND_NEAR = 600.0  # s from a shot to its line's nearest sounding, beyond which thermometers apply


@dataclass(frozen=True, eq=False)
class SoundedLine:
    """A line measured by sound, (k,) rows in order of time.

    ends            the two names; a line is the same from either end
    temperature_c   mean along the line
    u               °C, of each row; taken as an error common to all rows of the line
    """

    ends: frozenset[str]
    mjd_utc: np.ndarray
    temperature_c: np.ndarray
    u: np.ndarray

    @property
    def name(self) -> str:
        return " - ".join(sorted(self.ends))

    @property
    def sigma(self) -> float:
        """Standard uncertainty of the line's parameter, °C.

        A row with another u is affected in proportion.
        """
        return float(np.sqrt(np.mean(self.u**2)))

    def near(self, mjd_utc: np.ndarray) -> np.ndarray:
        """True (m,) where a row lies near enough in time."""
        return np.min(np.abs(mjd_utc[:, None] - self.mjd_utc), axis=1) * SECONDS_PER_DAY <= SOUND_NEAR

    def at(self, mjd_utc: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Temperature (m,) °C and share of the line's parameter.

        Linear between rows, constant before the first and after the last.

        Rows far apart are joined by a line, too: use it only for shots `near` one of them.
        """
        temperature = np.interp(mjd_utc, self.mjd_utc, self.temperature_c)
        return temperature, np.interp(mjd_utc, self.mjd_utc, self.u) / self.sigma

    def note(self, mjd_utc: np.ndarray, warm: tuple[float, float], w: float, critical: float) -> str:
        """Note on the line's effect, a sentence.

        mjd_utc    (m,) times of all its shots
        warm       estimated bias °C (positive: too warm), and u
        w          test statistic of that against its prior; beyond `critical` the ranges contradict it
        """
        near = self.near(mjd_utc)
        if not near.any():
            return (
                f"{self.name}: no shot within {SOUND_NEAR / 60.0:.0f} min of its path temperatures: they are not used"
            )
        late = f", {(~near).sum()} more too far in time" if not near.all() else ""
        doubt = (
            f"; rejected, the ranges contradict it (w {w:.1f}): check its length and delay" if abs(w) > critical else ""
        )
        return (
            f"{self.name}: air {self.at(mjd_utc[near])[0].mean():.2f} °C by sound for {near.sum()} shots{late}, "
            f"biased by {warm[0]:+.2f} °C (u {warm[1]:.2f} °C){doubt}"
        )


def sounded_lines(table: PathTemperatureTable | None) -> tuple[SoundedLine, ...]:
    """Lines of path_temperatures.csv by name; empty without the file."""
    if table is None:
        return ()
    pairs = [frozenset(pair) for pair in zip(table.ranger, table.target, strict=True)]
    lines = []
    for ends in dict.fromkeys(pairs):
        rows = np.array([k for k, pair in enumerate(pairs) if pair == ends])
        rows = rows[np.argsort(table.mjd_utc[rows])]
        lines.append(SoundedLine(ends, table.mjd_utc[rows], table.temperature_c[rows], table.u_temperature_c[rows]))
    return tuple(sorted(lines, key=lambda line: line.name))
