"""Functions of posture, temperature and time that the nights of an archive separate."""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.geometry.antenna.deformation import PostureTerms, TelescopePosture

DAYS_PER_YEAR = 365.25
WAVES = ("sinE", "cosE", "sin2E", "cos2E")
CONSTANT, TEMPERATURE, YEAR = "1", "t", "year"
ANNUAL = ("sin(year)", "cos(year)")
SEPARATE = 0.02  # of a function's size: what the functions before it leave; its variance grows by 2500 at most
NIGHTS_EACH = 3  # per function
LEAST_ELEVATION = 0.05  # rad, standard deviation of the nights
LEAST_TEMPERATURE = 0.5  # degrees C, likewise
LEAST_SPAN = 30.0  # days, for a rate
LEAST_ANNUAL = 0.9  # years, for an annual wave


@dataclass(frozen=True)
class TrendFunctions:
    """Functions of a model over nights.

    names           the constant first
    omitted         names that the nights do not separate
    reference_c     temperature at which t is 0, degrees C
    reference_mjd   time at which the year is 0
    """

    names: tuple[str, ...]
    omitted: tuple[str, ...]
    reference_c: float
    reference_mjd: float

    def rows(self, elevation: Array, temperature_c: Array, mjd: Array) -> Array:
        """Values (..., k).

        elevation       (...) rad
        temperature_c   (...) degrees C
        mjd             (...) days
        """
        return _values(self.names, elevation, temperature_c, mjd, self.reference_c, self.reference_mjd)


def separated_functions(
    elevation: Array, temperature_c: Array, mjd: Array, *, posture: bool = True, harmonics: int = 1, annual: bool = True
) -> TrendFunctions:
    """Functions that these nights separate from each other, the most physical first.

    elevation       (T,) rad; NaN anywhere: no function of elevation
    temperature_c   (T,) degrees C; NaN anywhere: no function of temperature
    mjd             (T,) days
    posture         True for functions of elevation
    harmonics       of elevation, 1 or 2
    annual          True for an annual wave beside temperature
    """
    reference_c = float(np.mean(temperature_c)) if np.isfinite(temperature_c).all() and len(mjd) else 0.0
    reference_mjd = float(np.mean(mjd)) if len(mjd) else 0.0
    span = float(np.ptp(mjd)) if len(mjd) else 0.0
    asked = [TEMPERATURE, YEAR, *(WAVES[: 2 * harmonics] if posture else ()), *(ANNUAL if annual else ())]
    possible = {
        TEMPERATURE: bool(np.isfinite(temperature_c).all())
        and len(mjd) > 1
        and np.std(temperature_c) > LEAST_TEMPERATURE,
        YEAR: span >= LEAST_SPAN,
        **dict.fromkeys(ANNUAL, span >= LEAST_ANNUAL * DAYS_PER_YEAR),
        **dict.fromkeys(WAVES, len(mjd) > 1 and bool(np.std(elevation) > LEAST_ELEVATION)),
    }
    names, omitted = [CONSTANT], []
    values = {
        name: _values((name,), elevation, temperature_c, mjd, reference_c, reference_mjd)[..., 0] for name in asked
    }
    for group in _groups(asked):
        trial = [*names, *group]
        sound = all(possible[name] for name in group) and len(mjd) >= NIGHTS_EACH * len(trial)
        if sound and _separate(np.column_stack([np.ones(len(mjd)), *(values[n] for n in trial[1:])]), len(group)):
            names = trial
        else:
            omitted += group
    order = (CONSTANT, *WAVES, TEMPERATURE, YEAR, *ANNUAL)
    return TrendFunctions(
        tuple(sorted(names, key=order.index)), tuple(sorted(omitted, key=order.index)), reference_c, reference_mjd
    )


def _groups(names: list[str]) -> list[list[str]]:
    """Functions that stand or fall together: the two of a wave."""
    groups = [[name] for name in names if name not in (*WAVES, *ANNUAL)]
    pairs = [list(WAVES[:2]), list(WAVES[2:]), list(ANNUAL)]
    waves = [pair for pair in pairs if all(name in names for name in pair)]
    return [*waves[:1], *groups, *waves[1:]] if waves and waves[0][0] in WAVES else [*groups, *waves]


def _separate(rows: Array, count: int) -> bool:
    """True if the last functions are independent of those before them and of each other."""
    size = np.linalg.norm(rows - rows.mean(axis=0), axis=0)
    size[0] = 1.0
    if np.any(size <= 0.0):
        return False
    scaled = (rows - np.where(np.arange(rows.shape[1]) > 0, rows.mean(axis=0), 0.0)) / size
    normal = scaled[:, 1:].T @ scaled[:, 1:]
    try:
        inflation = np.diag(np.linalg.inv(normal))
    except np.linalg.LinAlgError:
        return False
    return bool(np.all(np.isfinite(inflation)) and np.all(inflation > 0.0) and np.max(inflation) < SEPARATE**-2)


def _values(
    names: tuple[str, ...], elevation: Array, temperature_c: Array, mjd: Array, reference_c: float, reference_mjd: float
) -> Array:
    elevation, temperature_c, mjd = np.broadcast_arrays(
        *(np.asarray(v, float) for v in (elevation, temperature_c, mjd))
    )
    posture = TelescopePosture(np.zeros_like(elevation), elevation, temperature_c)
    years = (mjd - reference_mjd) / DAYS_PER_YEAR
    columns = []
    for name in names:
        if name == YEAR:
            columns.append(years)
        elif name in ANNUAL:
            columns.append((np.sin if name == ANNUAL[0] else np.cos)(2.0 * np.pi * years))
        else:
            columns.append(PostureTerms((name,), reference_c).rows(posture)[..., 0])
    return np.stack(columns, axis=-1)
