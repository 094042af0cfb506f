"""Look-up table of Zernike terms by elevation, temperature and direction.

    coefficient(E) = constant + gravity_sin sin E + gravity_cos cos E + thermal (T - mean T) ± hysteresis / 2

A linear elastic structure turned in gravity deforms by sin E and cos E only: gravity's components along its own axes.
Hysteresis is the excess of a term when elevation rises over when it falls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import DEGREE
from catseye.errors import EstimationError
from catseye.optics.zernike import Term
from catseye.reduction.surface.shape import SurfaceShape

APART_DEG = 1.0  # elevations nearer than this count as one
APART_C = 0.5  # temperatures that differ by less do not determine a thermal term
STEP_DEG = 5.0  # of the table
CONSTANT, SIN, COS, THERMAL, HYSTERESIS = "constant", "gravity_sin", "gravity_cos", "thermal", "hysteresis"


@dataclass(frozen=True, eq=False)
class TermModel:
    """Zernike term as a function of elevation.

    And of direction and temperature where the epochs have them.

    value, covariance   (p,) m (thermal m/°C), (p, p), as measured by the epochs' covariances
    residual            (T,) m, observed minus predicted
    standardised        (T,) over the residual's own standard uncertainty
    variance_factor     [pvv] / degrees of freedom, expectation 1; nan without redundancy
    """

    term: Term
    value: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    standardised: np.ndarray
    variance_factor: float

    @property
    def raised(self) -> float:
        """Factor of the standard uncertainties.

        Root of the variance factor where the epochs scatter more than claimed, else 1.
        """
        return float(np.sqrt(max(1.0, self.variance_factor))) if np.isfinite(self.variance_factor) else 1.0


@dataclass(frozen=True, eq=False)
class Lookup:
    """Look-up table of the terms.

    columns        of the model, in their order
    left_out       column: reason that it is not in the model
    elevation_deg  (T,) of the epochs, in input order
    rising         (T,) +1 where elevation rose to the epoch, -1 where it fell
    temperature_c  (T,), or None
    measured       (T, t) m
    u_measured     (T, t) m
    models         t
    table_deg      (e,) elevations of the table
    table          (e, t, 3) m: rising, mean, falling
    u_table        (e, t, 3) m
    """

    shapes: tuple[SurfaceShape, ...]
    columns: tuple[str, ...]
    left_out: dict[str, str]
    elevation_deg: np.ndarray
    rising: np.ndarray
    temperature_c: np.ndarray | None
    measured: np.ndarray
    u_measured: np.ndarray
    models: tuple[TermModel, ...]
    table_deg: np.ndarray
    table: np.ndarray
    u_table: np.ndarray


def lookup_of(shapes: Sequence[SurfaceShape]) -> Lookup:
    """Look-up table of several epochs.

    In the order in which the telescope came to them.

    shapes   two epochs or more, each with its elevation; all with the same terms and the same free parts

    Each term separately, least squares weighted by the epochs' uncertainties. No prediction beyond the measured
    elevations. Raises EstimationError for fewer epochs and for one without an elevation.
    """
    elevation = _elevations(shapes)
    rising = directions(elevation)
    temperature = _temperatures(shapes)
    columns, left_out = _columns(elevation, rising, temperature)
    design = _design(columns, elevation, rising, temperature, None)
    measured = np.array([shape.expansion.value for shape in shapes])
    u = np.array([np.sqrt(np.diag(shape.expansion.covariance)) for shape in shapes])
    if not (u > 0.0).all():
        raise EstimationError("a Zernike term of an epoch has no uncertainty; give the prisms' coordinates theirs")
    models = tuple(_model(term, design, measured[:, k], u[:, k]) for k, term in enumerate(shapes[0].expansion.terms))
    low, high = elevation.min(), elevation.max()
    inner = np.arange(np.ceil(low / STEP_DEG), np.floor(high / STEP_DEG) + 0.5) * STEP_DEG
    table_deg = np.unique(np.concatenate([[low], inner, [high]]).round(9))
    ways = (1.0, 0.0, -1.0) if HYSTERESIS in columns else (0.0, 0.0, 0.0)
    table = np.empty((len(table_deg), len(models), 3))
    u_table = np.empty_like(table)
    for position, direction in enumerate(ways):
        rows = _design(columns, table_deg, np.full(len(table_deg), direction), None, temperature)
        for k, model in enumerate(models):
            table[:, k, position] = rows @ model.value
            variance = np.einsum("ea,ab,eb->e", rows, model.covariance, rows)
            u_table[:, k, position] = model.raised * np.sqrt(variance)
    return Lookup(
        shapes=tuple(shapes),
        columns=columns,
        left_out=left_out,
        elevation_deg=elevation,
        rising=rising,
        temperature_c=temperature,
        measured=measured,
        u_measured=u,
        models=models,
        table_deg=table_deg,
        table=table,
        u_table=u_table,
    )


def directions(elevation_deg: np.ndarray) -> np.ndarray:
    """Direction (T,) of elevation before each epoch, +1 rising, -1 falling.

    The first epoch takes the direction to the second.

    elevation_deg   (T,), T at least 2

    A repeat keeps the direction in which it was reached.

    >>> directions(np.array([10.0, 50.0, 80.0, 80.0, 40.0])).tolist()
    [1.0, 1.0, 1.0, 1.0, -1.0]
    """
    direction = np.sign(np.diff(elevation_deg))
    direction = np.concatenate([direction[:1], direction])
    moved = np.flatnonzero(direction)
    if not len(moved):
        return np.ones(len(elevation_deg))
    direction[: moved[0]] = direction[moved[0]]
    for k in range(1, len(direction)):
        if direction[k] == 0.0:
            direction[k] = direction[k - 1]
    return direction


def _elevations(shapes: Sequence[SurfaceShape]) -> np.ndarray:
    if len(shapes) < 2:
        raise EstimationError(f"a look-up table needs 2 epochs at least, not {len(shapes)}")
    result: list[float] = []
    for shape in shapes:
        if shape.prisms.elevation_deg is None:
            raise EstimationError(f"{shape.prisms.source}: unknown elevation; set it by elevation_deg")
        result.append(shape.prisms.elevation_deg)
    return np.array(result)


def _temperatures(shapes: Sequence[SurfaceShape]) -> np.ndarray | None:
    result = [shape.prisms.temperature_c for shape in shapes if shape.prisms.temperature_c is not None]
    return np.array(result) if len(result) == len(shapes) else None


def _columns(
    elevation: np.ndarray, rising: np.ndarray, temperature: np.ndarray | None
) -> tuple[tuple[str, ...], dict[str, str]]:
    """Columns that these epochs determine, and reasons for the others."""
    places = 1 + int(np.count_nonzero(np.diff(np.sort(elevation)) > APART_DEG))
    columns = [CONSTANT]
    left_out: dict[str, str] = {}
    if places >= 3:
        columns += [SIN, COS]
    else:
        left_out |= dict.fromkeys((SIN, COS), f"{places} elevations more than {APART_DEG:g}° apart (3 are needed)")
    if temperature is None:
        left_out[THERMAL] = "the temperature of an epoch is unknown"
    elif np.ptp(temperature) < APART_C:
        left_out[THERMAL] = f"temperatures within {np.ptp(temperature):.2f} °C"
    else:
        columns.append(THERMAL)
    if len(set(rising.tolist())) < 2:
        left_out[HYSTERESIS] = "elevation moved in one direction only"
    else:
        columns.append(HYSTERESIS)
    while len(columns) > len(elevation) or _loose(columns, elevation, rising, temperature):
        last = columns.pop()
        left_out[last] = f"{len(elevation)} epochs do not determine it beside {', '.join(columns)}"
    return tuple(columns), left_out


def _loose(columns: list[str], elevation: np.ndarray, rising: np.ndarray, temperature: np.ndarray | None) -> bool:
    design = _design(tuple(columns), elevation, rising, temperature, None)
    return bool(np.linalg.cond(design / np.linalg.norm(design, axis=0)) > 1e6)


def _design(
    columns: tuple[str, ...],
    elevation_deg: np.ndarray,
    rising: np.ndarray,
    temperature: np.ndarray | None,
    mean_of: np.ndarray | None,
) -> np.ndarray:
    """Design matrix (T, p).

    A table, without temperatures, holds at the mean of `mean_of`.
    """
    e = elevation_deg * DEGREE
    thermal = np.zeros(len(e)) if temperature is None or mean_of is not None else temperature - temperature.mean()
    values = {CONSTANT: np.ones(len(e)), SIN: np.sin(e), COS: np.cos(e), THERMAL: thermal, HYSTERESIS: rising / 2.0}
    return np.column_stack([values[name] for name in columns])


def _model(term: Term, design: np.ndarray, measured: np.ndarray, u: np.ndarray) -> TermModel:
    rows = design / u[:, None]
    size = np.linalg.norm(rows, axis=0)
    gain = np.linalg.pinv(rows / size) / size[:, None]
    value = gain @ (measured / u)
    residual = measured - design @ value
    covariance = gain @ gain.T
    residual_variance = u**2 - np.einsum("ta,ab,tb->t", design, covariance, design)
    freedom = len(u) - design.shape[1]
    checked = residual_variance > 1e-9 * u**2
    standardised = np.where(checked, residual / np.sqrt(np.where(checked, residual_variance, 1.0)), np.nan)
    factor = float(np.sum((residual / u) ** 2) / freedom) if freedom else float("nan")
    return TermModel(
        term=term,
        value=value,
        covariance=covariance,
        residual=residual,
        standardised=standardised,
        variance_factor=factor,
    )
