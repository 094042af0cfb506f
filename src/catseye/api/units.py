"""Quantities with units at the door of `catseye.api`: converted, or refused; never stripped.

A function says what its arguments are in its signature, `temperature_c: Annotated[Any, In("deg_C")]`, and
`with_units` holds each call to it: astropy's quantities, columns and times, and what pandas and xarray say in
`attrs["units"]`, become plain numbers in that unit; another dimension, a masked value and text are refused. A plain
number is in the unit of the argument's name, as everywhere. Neither astropy nor pandas nor xarray is imported for it:
what is none of theirs needs none of them.
"""

import functools
import inspect
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Annotated, Any, ParamSpec, TypeVar, get_args, get_origin

import numpy as np

from catseye.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")

UNITS_OF_NAMES = {  # ending of a name -> its unit as astropy spells it; the longest that fits counts
    "_mm": "mm",
    "_um": "um",
    "_nm": "nm",
    "_m": "m",
    "_c": "deg_C",
    "_k": "K",
    "_hpa": "hPa",
    "_mb": "hPa",
    "_mmhg": "mmHg",
    "_percent": "percent",
    "_pct": "percent",
    "_ppm": "ppm",
    "_deg_per_s": "deg / s",
    "_deg": "deg",
    "_arcsec": "arcsec",
    "_rad": "rad",
    "_mrad": "mrad",
    "_rad_per_s": "rad / s",
    "_s": "s",
    "_hz": "Hz",
    "_khz": "kHz",
    "_mhz": "MHz",
    "_ghz": "GHz",
    "_db": "dB",
    "_mjd": "mjd",
    "_mw": "mW",
    "_uw": "uW",
    "_v": "V",
    "_volt": "V",
}
DIFFERENCES = ("u_", "warmer_")  # beginnings of names of intervals of temperature
SPELLINGS = {  # as files and other programs write units, in lower case; some of them are others in astropy ("mb", "C")
    "deg_C": ("degc", "deg_c", "c", "celsius", "°c", "degree_celsius", "degrees_celsius", "degree celsius", "oc"),
    "K": ("k", "kelvin", "degk", "degree_kelvin"),
    "deg_F": ("degf", "deg_f", "f", "fahrenheit", "°f", "degree_fahrenheit"),
    "mbar": ("mb", "mbar", "millibar", "millibars"),
    "hPa": ("hpa", "hectopascal", "hectopascals"),
    "mmHg": ("mmhg", "mm hg", "torr"),
    "ppm": ("ppm", "ppmv", "umol/mol", "1e-6"),
    "percent": ("%", "percent", "pct"),
    "m": ("m", "metre", "metres", "meter", "meters"),
    "mm": ("mm", "millimetre", "millimetres", "millimeter", "millimeters"),
    "um": ("um", "µm", "micron", "microns", "micrometre", "micrometer"),
    "deg": ("deg", "degree", "degrees", "°", "degrees_north", "degrees_east", "degree_north", "degree_east"),
    "": ("", "1", "none", "dimensionless"),
}
STEPS_K = {"K": 1.0, "deg_C": 1.0, "deg_F": 5.0 / 9.0, "deg_R": 5.0 / 9.0}  # K a degree of each scale
SPELLED = {text: unit for unit, texts in SPELLINGS.items() for text in texts}


@dataclass(frozen=True)
class In:
    """Unit of an argument.

    unit         as astropy spells it; "" of a pure number; "mjd" of a time, Modified Julian Day in UTC; "name" where
                 the names of keywords, or of the fields of settings, say it
    difference   an interval of temperature: 0.3 K is 0.3 °C
    one          a single number is wanted
    many         a sequence is wanted: it comes back as a tuple
    whole        a whole number is wanted
    text         words are welcome, too, and pass as they are
    """

    unit: str
    difference: bool = False
    one: bool = False
    many: bool = False
    whole: bool = False
    text: bool = False


def unit_of_name(name: str) -> In | None:
    """Unit that a name's ending says; None where it says none.

    >>> unit_of_name("u_temperature_c"), unit_of_name("path_length_m").unit
    (In(unit='deg_C', difference=True, one=False, many=False, whole=False, text=False), 'm')
    """
    endings = [ending for ending in UNITS_OF_NAMES if name.endswith(ending) or name == ending[1:]]
    if not endings:
        return None
    return In(UNITS_OF_NAMES[max(endings, key=len)], difference=name.startswith(DIFFERENCES) and name.endswith("_c"))


def with_units(function: Callable[P, R]) -> Callable[P, R]:
    """A function of `catseye.api` whose declared arguments may carry units."""

    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        plain_args, plain_kwargs = plain_arguments(function, *args, **kwargs)
        return function(*plain_args, **plain_kwargs)

    return called


def plain_arguments(function: Callable[..., Any], *args: Any, **kwargs: Any) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """The arguments of a call as plain numbers in the units that the function declares.

    Raises InputError naming the argument; TypeError, as Python does, where the call does not fit the signature.
    """
    bound = _signature(function).bind(*args, **kwargs)
    for name, unit in declared(function).items():
        if name not in bound.arguments:
            continue
        value = bound.arguments[name]
        if unit.unit != "name":
            bound.arguments[name] = plain(value, unit, f"{function.__name__}: {name}")
            continue
        bound.arguments[name] = _named(value, function.__name__)
    return bound.args, bound.kwargs


def _named(values: Any, function: str) -> Any:
    """Keywords, or the fields of settings, each in the unit that its own name says."""
    if not isinstance(values, Mapping):
        if not is_dataclass(values) or isinstance(values, type):
            return values
        said = {field.name: getattr(values, field.name) for field in fields(values)}
        changed = {name: each for name, each in _named(said, function).items() if each is not said[name]}
        return replace(values, **changed) if changed else values
    found = {}
    for name, each in values.items():
        bare = each is None or isinstance(each, str | bool | os.PathLike)
        unit = unit_of_name(name) or In("", text=True)
        found[name] = each if bare else plain(each, unit, f"{function}: {name}")
    return found


@functools.cache
def _signature(function: Callable[..., Any]) -> inspect.Signature:
    return inspect.signature(function)


@functools.cache
def declared(function: Callable[..., Any]) -> Mapping[str, In]:
    """Units of a function's arguments, by name."""
    found = {}
    for name, parameter in _signature(function).parameters.items():
        if get_origin(parameter.annotation) is Annotated:
            units = [each for each in get_args(parameter.annotation)[1:] if isinstance(each, In)]
            if units:
                found[name] = units[0]
    return found


def plain(value: Any, unit: In, name: str) -> Any:
    """A value as a plain number, or an array of them, in a unit.

    value   number, array, list, astropy's Quantity, Column or Time, a column of pandas or xarray; None passes
    name    for refusals: function and argument

    What carries no unit passes as it is. Raises InputError: another dimension, an unknown unit, masked, no number.
    """
    if value is None or isinstance(value, bool | int | float):
        return _whole(value, name) if unit.whole and isinstance(value, float) else value
    if isinstance(value, str | bytes | os.PathLike):
        if unit.text and not isinstance(value, bytes):
            return value
        raise InputError(f"{name} = {str(value)[:60]!r} is text (expected {_wanted(unit)})")
    found = _stripped(value, unit, name)
    if unit.whole:
        return _whole(found, name)
    if unit.one and np.ndim(found):
        raise InputError(f"{name} has the shape {np.shape(found)} (expected one number)")
    if unit.many and np.ndim(found) > 1:
        raise InputError(f"{name} has the shape {np.shape(found)} (expected a row of numbers)")
    if unit.many and isinstance(found, np.ndarray):
        return tuple(np.atleast_1d(found).tolist())
    if found is value:
        return value
    array = np.asarray(found, dtype=float)
    return array.item() if array.ndim == 0 else array


def _stripped(value: Any, unit: In, name: str) -> Any:
    """A value's numbers in a unit; itself where it is plain already."""
    if hasattr(value, "to_numpy"):  # a column of pandas, xarray or the like
        return _column(value, unit, name)
    if isinstance(value, np.ma.MaskedArray):
        _refuse_masked(np.ma.getmaskarray(value), name)
    quantity = _as_quantity(value, unit, name)
    if quantity is not None:
        return _converted(quantity, unit, name)
    if isinstance(value, np.ma.MaskedArray):
        return np.asarray(value.data)
    if isinstance(value, Sequence):
        return _sequence(value, unit, name)
    for mark in ("units", "unit"):  # pint, unyt, cf-units and others: not known here, so not stripped
        if getattr(value, mark, None) is not None:
            told = f"{type(value).__name__} with the unit {getattr(value, mark)}"
            raise InputError(f"{name} is a {told}, which catseye cannot convert (expected {_wanted(unit)})")
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind == "O":
            return np.array(_stripped(value.tolist(), unit, name), dtype=float)
        if value.dtype.kind not in "iufb" and not (unit.text and value.dtype.kind == "U"):
            raise InputError(f"{name} holds {value.dtype} (expected {_wanted(unit)})")
        return value
    if hasattr(value, "__array__"):
        return _stripped(np.asarray(value), unit, name)
    if hasattr(value, "__float__") or hasattr(value, "__index__"):
        return float(value)
    raise InputError(f"{name} is a {type(value).__name__} (expected {_wanted(unit)})")


def _sequence(values: Any, unit: In, name: str) -> Any:
    """Numbers of a list, which may be nested; itself where all are plain. Raises InputError: units here and there."""
    if any(isinstance(each, str) for each in values):
        if unit.text:
            return values
        raise InputError(f"{name} holds text (expected {_wanted(unit)})")
    found = [each if isinstance(each, int | float | np.number) else _stripped(each, unit, name) for each in values]
    changed = [new is not old for new, old in zip(found, values, strict=True)]
    if not any(changed):
        return values
    if not all(changed) and any(_has_unit(each) for each in values):
        raise InputError(f"{name} has values with a unit and values without (expected one or the other)")
    return found


def _has_unit(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return any(_has_unit(each) for each in value)
    said = getattr(value, "attrs", None)
    return getattr(value, "unit", None) is not None or (isinstance(said, Mapping) and "units" in said)


def _column(value: Any, unit: In, name: str) -> Any:
    """Numbers of a column of pandas or xarray, in its `attrs["units"]` where it has that; a missing one is refused."""
    inner = getattr(value, "data", None)  # xarray keeps a quantity or a masked array as it is
    if hasattr(inner, "unit") or isinstance(inner, np.ma.MaskedArray):
        return _stripped(inner, unit, name)
    numbers = np.asarray(value.to_numpy())
    if numbers.dtype.kind == "O":  # pandas' own masked columns, and objects
        flat = numbers.ravel().tolist()
        _refuse_masked(np.array([each is None or type(each).__name__ in ("NAType", "NaTType") for each in flat]), name)
        numbers = np.array(_stripped(flat, unit, name), dtype=float).reshape(numbers.shape)
    if numbers.dtype.kind not in "iufb":
        raise InputError(f"{name} holds {numbers.dtype} (expected {_wanted(unit)})")
    attributes = getattr(value, "attrs", None)
    text = attributes.get("units", attributes.get("unit")) if isinstance(attributes, Mapping) else None
    return numbers if text is None else _converted(numbers * _unit_named(str(text), unit, name), unit, name)


def _unit_named(text: str, unit: In, name: str) -> Any:
    """Astropy's unit of a text as files write it."""
    from astropy import units

    spelled = SPELLED.get(text.strip().lower())
    try:
        return _unit(spelled) if spelled is not None else units.Unit(text)
    except (ValueError, TypeError):
        raise InputError(f"{name} has the unknown unit {text[:40]!r} (expected {_wanted(unit)})") from None


def _unit(text: str) -> Any:
    """Astropy's unit of a name of ours."""
    from astropy import units
    from astropy.units import cds, imperial

    ours = {"deg_F": imperial.deg_F, "mmHg": cds.mmHg, "ppm": units.Unit(1e-6), "": units.one}
    return ours[text] if text in ours else units.Unit(text)


def _as_quantity(value: Any, unit: In, name: str) -> Any:
    """Astropy's Quantity of what astropy made; None of all else and where there is no unit."""
    if "astropy.units" not in sys.modules:
        return None
    from astropy.units import Quantity, Unit, UnitBase

    if isinstance(value, UnitBase):  # `air(u.deg_C, ...)`: a unit is one of itself
        return 1.0 * value
    if isinstance(value, Quantity):
        if hasattr(value, "unmasked"):
            _refuse_masked(np.asarray(value.mask), name)
            return value.unmasked
        return value
    if "astropy.time" in sys.modules:
        from astropy.time import Time, TimeDelta

        if isinstance(value, Time):
            _refuse_masked(np.asarray(value.mask), name)
            if unit.unit != "mjd":
                raise InputError(f"{name} is a time (expected {_wanted(unit)})")
            return np.asarray(value.utc.mjd) * Unit("d")
        if isinstance(value, TimeDelta):
            return value.to("s")
    if isinstance(value, np.ndarray) and getattr(value, "unit", None) is not None:  # a column of a table
        column: Any = value
        return np.asarray(column) * Unit(column.unit)
    return None


def _converted(quantity: Any, unit: In, name: str) -> Any:
    """Numbers of a quantity in a unit. Raises InputError: another dimension."""
    from astropy import units

    try:
        if unit.unit == "deg_C":
            to = units.temperature()
            if not unit.difference:
                return quantity.to_value(units.deg_C, to)
            step = STEPS_K.get(str(quantity.unit))
            return quantity.to_value(units.K) if step is None else step * quantity.value
        if unit.unit == "dB" and quantity.unit.is_equivalent(units.one) and quantity.unit.physical_type != "unknown":
            return 10.0 * np.log10(quantity.to_value(units.one, units.logarithmic()))
        return quantity.to_value(_unit("d" if unit.unit == "mjd" else unit.unit))
    except (units.UnitsError, TypeError, ValueError, AttributeError):
        was = f"the unit {quantity.unit}" if str(quantity.unit) else "no dimension"
        raise InputError(f"{name} has {was} (expected {_wanted(unit)})") from None


def _refuse_masked(mask: np.ndarray, name: str) -> None:
    if mask.any():
        count, first = int(np.count_nonzero(mask)), int(np.flatnonzero(mask)[0])
        where = "is masked" if mask.ndim == 0 else f"has {count} of {mask.size} values masked, the first is {first}"
        raise InputError(f"{name} {where} (expected values throughout: leave those out, or fill them)")


def _whole(value: Any, name: str) -> Any:
    """A whole number. Raises InputError: a fraction, or several."""
    array = np.asarray(value)
    if array.ndim or not np.isfinite(array) or float(array) != round(float(array)):
        raise InputError(f"{name} = {str(value)[:40]} (expected a whole number)")
    return round(float(array))


def _wanted(unit: In) -> str:
    """Words for the values that an argument expects."""
    if unit.unit == "mjd":
        return "a Modified Julian Day, or astropy's Time"
    if unit.unit == "":
        return "a plain number" if not unit.whole else "a whole number"
    words = {"deg_C": "kelvin or °C" if unit.difference else "°C", "percent": "%"}.get(unit.unit, unit.unit)
    return f"numbers in {words}, or a quantity that converts to it"
