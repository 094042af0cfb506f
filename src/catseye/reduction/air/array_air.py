"""Air among an array of loudspeakers and microphones: map, chosen lines, residuals, verdict."""

from dataclasses import dataclass

import numpy as np

from catseye.atmosphere.sound.speed import THERMOMETRY
from catseye.errors import ValidityError
from catseye.estimation.shapes.tomography import FieldPrior, Scale
from catseye.names import AIR_MODEL
from catseye.records.laboratory.sound_array import SoundArray, SoundArraySheet
from catseye.reduction.air.acoustic import StationAir
from catseye.reduction.air.acoustic_field import FieldTimes, LineAir, SoundField, sound_field
from catseye.verdict import Verdict

INTERVALS = 16  # of the map's longer side
LEAST_USED = 0.8  # share of the times below which a field is doubtful
LEAST_RESOLUTION = 0.5  # of a line, below which the prior is most of it
SUSPECT = "used, contradicts the others"


@dataclass(frozen=True, eq=False)
class ArrayAir:
    """Temperature and wind among the stations of an array, m times.

    array       stations, times and sheet as read
    field       estimate
    grid        (g, 3) m, points of the map, x fastest
    shape       rows and columns of the map
    map         air at its points
    lines       air along the chosen lines; None without any
    model       formula of the speed of sound
    air_model   formula of the index
    """

    array: SoundArray
    field: SoundField
    grid: np.ndarray
    shape: tuple[int, int]
    map: LineAir
    lines: LineAir | None
    model: str
    air_model: str

    @property
    def windy(self) -> bool:
        """True where the wind is estimated: some pair has both directions and the air is not still."""
        return self.field.tomogram.vector is not None and self.array.both_ways > 0

    @property
    def status(self) -> tuple[str, ...]:
        """Text of each time: used, used but suspect, or the reason of rejection."""
        suspects = set(self.field.suspects.tolist())
        return tuple(SUSPECT if k in suspects else text for k, text in enumerate(self.field.status))

    @property
    def standardised(self) -> np.ndarray:
        """Each time against all others, in standard deviations, (m,); nan where not used."""
        return self._each(self.field.tomogram.standardised)

    @property
    def residual_c(self) -> np.ndarray:
        """Temperature by each time less that predicted by all others, (m,) °C; nan where not used."""
        tomogram = self.field.tomogram
        return self._each(tomogram.observations.observed - tomogram.predicted)

    def _each(self, values: np.ndarray) -> np.ndarray:
        rows = np.full(len(self.array.time), np.nan)
        rows[self.field.used] = values
        return rows

    @property
    def verdict(self) -> Verdict:
        """Verdict on the fit, suspects, unused times, the wind, and lines that the sound does not reach."""
        total, used = len(self.array.time), len(self.field.used)
        chi_square = self.field.tomogram.chi_square
        doubts = []
        if self.field.fit != "fits":
            doubts.append(self.field.fit)
        if len(self.field.suspects):
            first = int(self.field.suspects[0])
            names = self.array.names
            doubts.append(
                f"{len(self.field.suspects)} of {used} times contradict the others, first that from "
                f"{names[self.array.source[first]]} to {names[self.array.receiver[first]]}"
            )
        if used < LEAST_USED * total:
            doubts.append(f"{used} of {total} times are used")
        if self.field.tomogram.vector is not None and not self.array.both_ways:
            doubts.append("no pair of stations has both directions: the wind is in the temperature as its prior allows")
        if self.lines is not None and (self.lines.resolution < LEAST_RESOLUTION).any():
            k = int(np.argmin(self.lines.resolution))
            doubts.append(
                f"the line {self.array.sheet.lines[k].name} rests on its prior: the sound resolves "
                f"{100.0 * self.lines.resolution[k]:.0f} % of its variance"
            )
        return Verdict("good", f"chi-square {chi_square:.1f} of {used} times, none contradicts the others").hearing(
            doubts
        )


def array_air(array: SoundArray, *, model: str = THERMOMETRY, air_model: str = AIR_MODEL) -> ArrayAir:
    """Air among the stations of an array.

    array       stations, times, sheet
    model       formula of the speed of sound, a name in `atmosphere.sound.speed.MODELS`
    air_model   formula of the index, a name in `atmosphere.index.air.MODELS`

    Source: [PARKER04] chapter 4, which asks for the mean temperature along many paths, without a formula for the
    field; `reduction.air.acoustic_field` is ours. Raises EstimationError where no time remains, ValidityError for
    stations too close or too far.
    """
    sheet = array.sheet
    field = sound_field(
        array.places,
        FieldTimes(
            source=array.source,
            receiver=array.receiver,
            time=array.time,
            u_time=array.u_time,
            delay=1e-6 * sheet.delay_us,
            u_delay=1e-6 * sheet.u_delay_us,
        ),
        u_position=1e-3 * sheet.u_position_mm,
        weather=StationAir(
            sheet.pressure_hpa,
            sheet.u_pressure_hpa,
            humidity_percent=sheet.humidity_percent,
            u_humidity_percent=sheet.u_humidity_percent,
            co2_ppm=sheet.co2_ppm,
        ),
        temperature=_prior(
            sheet.temperature_c, sheet.u_temperature_c, sheet.variation_c, sheet.variation_m, sheet.variation_z_m
        ),
        wind=_wind(sheet),
        frequency_hz=sheet.frequency_hz,
        model=model,
    )
    grid, shape = map_points(array.places, sheet.map_z_m)
    lines = None
    if sheet.lines:
        start, end = (np.array([getattr(line, name) for line in sheet.lines]) for name in ("start", "end"))
        lines = field.along(start, end, wavelength_um=sheet.wavelength_um, air_model=air_model)
    return ArrayAir(
        array=array,
        field=field,
        grid=grid,
        shape=shape,
        map=field.along(grid, grid, wavelength_um=sheet.wavelength_um, air_model=air_model),
        lines=lines,
        model=model,
        air_model=air_model,
    )


def map_points(places: np.ndarray, height: float | None) -> tuple[np.ndarray, tuple[int, int]]:
    """Points (g, 3) of a level map over the stations, square meshes, x fastest; rows and columns.

    places   (n, 3) m
    height   m; None: mean height of the stations

    >>> points, shape = map_points(np.array([[0.0, 0.0, 2.0], [16.0, 8.0, 4.0]]), None)
    >>> shape, points[-1].tolist()
    ((9, 17), [16.0, 8.0, 3.0])
    """
    low, high = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    step = float(np.max(high - low)) / INTERVALS
    if step == 0.0:
        raise ValidityError("all stations stand above one point: there is no map")
    count = np.maximum(np.ceil((high - low) / step - 1e-9).astype(int), 1)
    x, y = (low[k] + step * np.arange(count[k] + 1) for k in range(2))
    z = float(places[:, 2].mean()) if height is None else height
    across, up = np.meshgrid(x, y)
    return np.stack([across.ravel(), up.ravel(), np.full(across.size, z)], axis=1), (len(y), len(x))


def _wind(sheet: SoundArraySheet) -> FieldPrior | None:
    if sheet.u_wind_m_per_s == 0.0:
        return None
    return _prior(0.0, sheet.u_wind_m_per_s, sheet.wind_variation_m_per_s, sheet.wind_m, sheet.wind_z_m)


def _prior(mean: float, u_mean: float, sigma: float, across: float, up: float) -> FieldPrior:
    """Prior of a field with one scale, or none if sigma is 0."""
    return FieldPrior(mean, u_mean, (Scale(sigma, (across, across, up)),) if sigma > 0.0 else ())
