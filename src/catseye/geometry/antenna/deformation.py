"""Shift and turn of telescope frames or groups with posture.

Causes are gravity, temperature and the track.

A motion has six components, three shifts (m) and a rotation vector (rad), in the nominal axes of the frame that moves,
and a pivot in the same axes. It moves a point x of the frame to

    x' = pivot + shift + exp([turn] x) (x - pivot).

Each component is linear in its coefficients, with the same functions of posture for all six: either

    terms    products of sin, cos of azimuth A and elevation E (and of twice, ... them), powers of E in radians and of
             t, degrees C from the reference temperature: "1", "sinE", "cos2E", "E^2*t", "sinA"
    table    the values themselves over a grid of elevation and temperature, joined by a cubic spline both ways (fewer
             knots: a parabola, a line, a constant; not-a-knot ends)

so that a table's value between its knots, too, is a weighted sum of the table. Their uncertainty has two parts: the
coefficients' covariance, common to all postures, and the model's residual, independent in each posture.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.constants import DEGREE
from catseye.errors import ValidityError
from catseye.geometry.frames.rotation import from_vector, skew

COMPONENTS = ("shift_x", "shift_y", "shift_z", "turn_x", "turn_y", "turn_z")
WAVE = re.compile(r"(sin|cos)([2-9]?)([AE])")
POWER = re.compile(r"([Et])(?:\^([2-4]))?")
SMALL_ANGLE = 1e-4  # rad: below it the series of the left Jacobian is exact to rounding


@dataclass(frozen=True, eq=False)
class TelescopePosture:
    """Telescope posture and structure temperature; arrays (...) that broadcast.

    azimuth         rad, clockwise from north
    elevation       rad
    temperature_c   degrees C of the structure
    """

    azimuth: ArrayLike
    elevation: ArrayLike
    temperature_c: ArrayLike

    @property
    def shape(self) -> tuple[int, ...]:
        return np.broadcast_shapes(*(np.shape(v) for v in (self.azimuth, self.elevation, self.temperature_c)))


@dataclass(frozen=True, eq=False)
class Validity:
    """Range of posture and temperature of a model; ends included.

    elevation       (low, high), rad
    temperature_c   (low, high), degrees C
    """

    elevation: tuple[float, float]
    temperature_c: tuple[float, float]

    def refuse_outside(self, posture: TelescopePosture) -> None:
        """Raise ValidityError for the first posture outside; models are not extrapolated."""
        slack = 1e-12  # rad or degrees C: rounding of a conversion from degrees is not outside
        for name, value, (low, high), scale, unit in (
            ("elevation", posture.elevation, self.elevation, DEGREE, "deg"),
            ("temperature", posture.temperature_c, self.temperature_c, 1.0, "C"),
        ):
            values = np.asarray(value, dtype=float)
            bad = ~((values >= low - slack) & (values <= high + slack))
            if np.any(bad):
                first = float(values[bad].flat[0]) / scale
                raise ValidityError(
                    f"{name} {first:.6g} {unit} is outside {low / scale:.6g} to {high / scale:.6g} {unit}, where the "
                    "structural model holds: use a model that covers it"
                )


def factors(term: str) -> list[Callable[[TelescopePosture, float], NDArray[np.float64]]]:
    """Factors whose product a term is: functions of posture and temperature.

    Raises ValidityError for a factor that is not known.

    >>> posture = TelescopePosture(0.0, np.pi / 6, 25.0)
    >>> [float(f(posture, 15.0).round(12)) for f in factors("sinE*t^2")]
    [0.5, 100.0]
    """
    functions: list[Callable[[TelescopePosture, float], NDArray[np.float64]]] = []
    for factor in term.replace(" ", "").split("*"):
        wave, power = WAVE.fullmatch(factor), POWER.fullmatch(factor)
        if wave:
            functions.append(_wave(np.sin if wave[1] == "sin" else np.cos, int(wave[2] or 1), wave[3]))
        elif power:
            functions.append(_power(power[1], int(power[2] or 1)))
        elif factor != "1":
            raise ValidityError(
                f"term {term!r}: {factor!r} is not known (expected 1, sinE, cosE, sin2E, sinA, ..., E, E^2, t, t^2, "
                "joined by *)"
            )
    return functions


def _wave(function: np.ufunc, multiple: int, angle: str) -> Callable[[TelescopePosture, float], NDArray[np.float64]]:
    def value(posture: TelescopePosture, _reference_c: float) -> NDArray[np.float64]:
        return function(multiple * np.asarray(posture.azimuth if angle == "A" else posture.elevation, dtype=float))

    return value


def _power(quantity: str, exponent: int) -> Callable[[TelescopePosture, float], NDArray[np.float64]]:
    def value(posture: TelescopePosture, reference_c: float) -> NDArray[np.float64]:
        if quantity == "E":
            return np.asarray(posture.elevation, dtype=float) ** exponent
        return (np.asarray(posture.temperature_c, dtype=float) - reference_c) ** exponent

    return value


@dataclass(frozen=True, eq=False)
class PostureTerms:
    """Functions of posture given by name.

    names         such as ("1", "sinE", "cosE", "t")
    reference_c   degrees C at which t is 0
    """

    names: tuple[str, ...]
    reference_c: float

    def __post_init__(self) -> None:
        for name in self.names:
            factors(name)

    def __len__(self) -> int:
        return len(self.names)

    def rows(self, posture: TelescopePosture) -> NDArray[np.float64]:
        """Values of the functions of posture, (..., k)."""
        columns = []
        for name in self.names:
            value: NDArray[np.float64] = np.ones(posture.shape)
            for factor in factors(name):
                value = value * factor(posture, self.reference_c)
            columns.append(value)
        return np.stack(columns, axis=-1)


@dataclass(frozen=True, eq=False)
class KnotTable:
    """Weights of grid knots over elevation and temperature.

    elevation       (n,), rad, rising
    temperature_c   (m,), degrees C, rising; a single one makes the table independent of temperature

    Raises ValidityError for knots that do not increase, and outside the knots: a table is not extrapolated.
    """

    elevation: NDArray[np.float64]
    temperature_c: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("elevation", "temperature_c"):
            knots = np.asarray(getattr(self, name), dtype=float)
            if knots.ndim != 1 or not len(knots) or not np.all(np.diff(knots) > 0.0):
                raise ValidityError(f"knots of {name} {knots.tolist()} do not increase (expected an increasing list)")
            object.__setattr__(self, name, knots)

    def __len__(self) -> int:
        return len(self.elevation) * len(self.temperature_c)

    @cached_property
    def limits(self) -> Validity:
        """Range of the knots; any temperature if there is one only."""
        warm = self.temperature_c
        ends = (float(warm[0]), float(warm[-1])) if len(warm) > 1 else (-np.inf, np.inf)
        return Validity((float(self.elevation[0]), float(self.elevation[-1])), ends)

    def rows(self, posture: TelescopePosture) -> NDArray[np.float64]:
        """Weights (..., n m) of the table's values, elevation by elevation."""
        self.limits.refuse_outside(posture)
        by_elevation = _weights(self.elevation, posture.elevation)
        by_temperature = _weights(self.temperature_c, posture.temperature_c)
        weights = by_elevation[..., :, None] * by_temperature[..., None, :]
        return np.broadcast_to(weights.reshape(*weights.shape[:-2], -1), (*posture.shape, len(self)))


def _weights(knots: NDArray[np.float64], at: ArrayLike) -> NDArray[np.float64]:
    """Weights (..., n) of values at the knots in the spline."""
    x = np.asarray(at, dtype=float)
    if len(knots) == 1:
        return np.ones((*x.shape, 1))
    from scipy.interpolate import make_interp_spline

    inside = np.minimum(np.maximum(x, knots[0]), knots[-1])  # rounding only: what is outside was refused
    return make_interp_spline(knots, np.eye(len(knots)), k=min(3, len(knots) - 1))(inside)


@dataclass(frozen=True, eq=False)
class PostureMotion:
    """Shift and turn of a frame as functions of posture.

    basis          Terms or Table, k functions
    coefficients   (6, k), m and rad: shift x, y, z, turn x, y, z
    pivot          (3,), m, in the frame's nominal axes
    covariance     (6k, 6k) of the coefficients, component by component; zero where they are exact
    u              (6,), m and rad, above zero: residual of the model, independent in each posture
    """

    basis: PostureTerms | KnotTable
    coefficients: NDArray[np.float64]
    pivot: NDArray[np.float64]
    u: NDArray[np.float64]
    covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        k = len(self.basis)
        covariance = self.covariance if self.covariance.size else np.zeros((6 * k, 6 * k))
        shapes = (np.shape(self.coefficients), np.shape(self.pivot), np.shape(self.u), covariance.shape)
        if shapes != ((6, k), (3,), (6,), (6 * k, 6 * k)):
            raise ValidityError(f"motion of {k} functions has shapes {shapes}, expected (6, {k}), (3,), (6,), (6k, 6k)")
        object.__setattr__(self, "covariance", covariance)

    def six(self, posture: TelescopePosture) -> NDArray[np.float64]:
        """Shift and turn (..., 6), m and rad."""
        return self.basis.rows(posture) @ self.coefficients.T

    def six_covariance(self, posture: TelescopePosture) -> NDArray[np.float64]:
        """Covariance (..., 6, 6) of shift and turn in one posture.

        It includes the coefficients and the residual.
        """
        rows = self.basis.rows(posture)
        k = len(self.basis)
        shared = np.einsum("...a,iajb,...b->...ij", rows, self.covariance.reshape(6, k, 6, k), rows)
        return shared + np.diag(self.u**2)


def carried(six: ArrayLike, pivot: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (..., 3, 3) and translation (..., 3) m of a shift and turn.

    six     (..., 6), m and rad
    pivot   (3,), m

    Source: the formula at the top of this file; [SHUSTER93] for the rotation. Exact.

    >>> rotation, translation = carried([0.0, 0.0, 0.0, 0.0, 0.0, np.pi], [1.0, 0.0, 0.0])
    >>> (rotation @ [3.0, 0.0, 0.0] + translation).round(12).tolist()
    [-1.0, 0.0, 0.0]
    """
    motion, p = np.asarray(six, dtype=float), np.asarray(pivot, dtype=float)
    rotation = from_vector(motion[..., 3:])
    return rotation, p + motion[..., :3] - np.einsum("...ij,j->...i", rotation, p)


def motion_jacobian(six: ArrayLike, pivot: ArrayLike, points: ArrayLike) -> NDArray[np.float64]:
    """Derivatives (..., 3, 6) of moved points by shift (1) and turn (m/rad).

    six      (..., 6), m and rad
    pivot    (3,), m
    points   (..., 3), m, before the motion

    Source: [SHUSTER93]; the turn's own change enters through the left Jacobian. Exact.

    >>> motion_jacobian(np.zeros(6), np.zeros(3), [2.0, 0.0, 0.0])[:, 5].tolist()
    [0.0, 2.0, 0.0]
    """
    motion = np.asarray(six, dtype=float)
    rotation = from_vector(motion[..., 3:])
    arm = np.einsum("...ij,...j->...i", rotation, np.asarray(points, dtype=float) - np.asarray(pivot, dtype=float))
    turns = -skew(arm) @ left_jacobian(motion[..., 3:])
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=-1)


def left_jacobian(turn: ArrayLike) -> NDArray[np.float64]:
    """Matrix (..., 3, 3) from a rotation vector's change to a small turn.

    The small turn is in fixed axes.

    turn    (..., 3), rad, shorter than a turn

    exp([w + dw]) = exp([J dw]) exp([w]), J = 1 + (1 - cos w)/w^2 [w] + (w - sin w)/w^3 [w]^2.

    Source: [SHUSTER93], kinematics of the rotation vector. Exact.

    >>> left_jacobian([0.0, 0.0, 0.0]).tolist() == np.eye(3).tolist()
    True
    """
    w = np.asarray(turn, dtype=float)
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    k = skew(w)
    safe = np.where(angle > SMALL_ANGLE, angle, 1.0)
    third = np.where(angle > SMALL_ANGLE, (safe - np.sin(safe)) / safe**3, 1.0 / 6.0 - angle**2 / 120.0)
    return np.eye(3) + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * k + third * (k @ k)
