"""Quantities of every argument of `catseye.api`: converted, or refused with the argument's name; never stripped.

Pandas and xarray are not needed here either: two classes stand for what of theirs is looked at.
"""

import inspect
import pkgutil
import re
from importlib import import_module
from typing import Annotated, Any

import astropy.units as u
import numpy as np
import pytest
from astropy.table import Column, MaskedColumn
from astropy.time import Time, TimeDelta
from astropy.units import cds, imperial
from astropy.utils.masked import Masked

import catseye
import catseye.api
from catseye.api.units import In, declared, plain, plain_arguments, unit_of_name, with_units
from catseye.errors import InputError
from catseye.reduction.baseline.settings import BaselineSettings

NUMBERS = re.compile(r"\b(float|int|complex|object|Any|ndarray|NDArray|ArrayLike|number|Number|Quantity)\b")
OUR_OWN = {  # functions that people do not call: what goes in is catseye's own numbers, or a command line's
    *(f"catseye.api.journal.{name}" for name in ("run_of", "mjd_argument")),
    *(
        f"catseye.api.live.serving.{name}"
        for name in ("zy", "coordinator_orders", "mjd_start", "within", "twin_options", "twin_world")
    ),
    *(
        f"catseye.api.live.{name}"
        for name in ("address.page_address", "beside.site_page", "limits.within", "watching.watch_site")
    ),
    *(f"catseye.api.telescope.displacement.{name}" for name in ("postures_of", "antenna_from", "site_from")),
    *(
        f"catseye.api.telescope.inputs.{name}"
        for name in ("InputFiles.read", "InputFiles.points", "InputFiles.ranger", "points_of", "refuse_alone")
    ),
    *(f"catseye.api.telescope.inputs.{name}" for name in ("posture_of", "mjd_of_argument", "telescope_of")),
    "catseye.api.telescope.model_fit.free_components",
    *(f"catseye.api.triplet.ranges.{name}" for name in ("triplets_of", "require_zero")),
    "catseye.api.result.json_text",
    "catseye.api.result.quantities",
    *(f"catseye.api.units.{name}" for name in ("with_units", "plain_arguments", "declared", "plain", "unit_of_name")),
}
OTHER = {  # unit of ours -> another unit, and what one of ours is in it, by hand
    "m": ("km", 1e-3),
    "mm": ("m", 1e-3),
    "um": ("nm", 1e3),
    "hPa": ("kPa", 0.1),
    "percent": ("", 0.01),
    "ppm": ("percent", 1e-4),
    "deg": ("arcmin", 60.0),
    "arcsec": ("mas", 1e3),
    "deg / s": ("arcmin / s", 60.0),
    "m2": ("mm2", 1e6),
    "s": ("min", 1.0 / 60.0),
    "mrad": ("rad", 1e-3),
    "rad": ("mrad", 1e3),
    "MHz": ("kHz", 1e3),
    "rad / s": ("mrad / s", 1e3),
    "m / s": ("km / h", 3.6),
    "m / s2": ("mm / s2", 1e3),
    "mW": ("W", 1e-3),
    "uW": ("mW", 1e-3),
    "V": ("mV", 1e3),
    "mmHg": ("hPa", 1.33322387415),
    "min": ("s", 60.0),
    "GHz": ("MHz", 1e3),
    "Hz": ("kHz", 1e-3),
    "mrad / h(1/2)": ("rad / h(1/2)", 1e-3),
    "": ("percent", 100.0),
    "mjd": ("h", 24.0),
}


def functions():
    """Every public function and method of every module of `catseye.api`, of today and of later."""
    for found in pkgutil.walk_packages(catseye.api.__path__, "catseye.api."):
        module = import_module(found.name)
        for name, value in vars(module).items():
            if name.startswith("_") or getattr(value, "__module__", "") != found.name:
                continue
            if inspect.isfunction(value):
                yield f"{found.name}.{name}", value
            elif inspect.isclass(value):
                methods = {n: m for n, m in vars(value).items() if inspect.isfunction(m) and not n.startswith("_")}
                yield from ((f"{found.name}.{name}.{n}", m) for n, m in methods.items())


def undeclared(function):
    """Parameters that may be numbers and do not say in which unit."""
    units = declared(function)
    return [
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if name not in units and name not in ("self", "cls")
        if parameter.annotation is inspect.Parameter.empty
        or NUMBERS.search(re.sub(r"Callable\[\[.*?\], \w+\]", "", str(parameter.annotation)))
    ]


EVERY = [(name, function) for name, function in functions() if name not in OUR_OWN]
ARGUMENTS = [
    pytest.param(function, argument, unit, id=f"{function.__name__}-{argument}")
    for _, function in EVERY
    for argument, unit in declared(function).items()
    if unit.unit != "name"
]


@pytest.mark.parametrize(("name", "function"), EVERY, ids=[name for name, _ in EVERY])
def test_every_number_of_the_api_says_its_unit_and_is_held_to_it(name, function):
    assert undeclared(function) == [], f"{name}: give these Annotated[Any, In(unit)]"
    if declared(function):
        assert hasattr(function, "__wrapped__"), f"{name}: put @with_units above it"


def test_an_argument_without_a_unit_is_found():
    def later(path: str, weight: float, height_m: Annotated[Any, In("m")], *, by: np.ndarray | None = None, what=1): ...

    assert undeclared(later) == ["weight", "by", "what"]


@pytest.mark.parametrize(("function", "argument", "unit"), ARGUMENTS)
def test_the_unit_declared_is_the_one_of_the_name(function, argument, unit):
    said = unit_of_name(argument)
    if said is not None:
        assert (unit.unit, unit.difference) == (said.unit, said.difference)
    else:
        assert unit.unit in (
            "",
            "V",
            "m",
            "m2",
            "s",
            "m / s",
            "m / s2",
            "min",
            "mrad / h(1/2)",
            "mjd",
        )  # no ending: SI, a pure number, or said whole


def arguments(function, argument, value):
    """A call with one argument as given; the others it cannot do without are plain."""
    units = declared(function)
    call = {}
    for name, parameter in inspect.signature(function).parameters.items():
        needed = parameter.default is inspect.Parameter.empty and parameter.kind not in (
            inspect.Parameter.VAR_KEYWORD,
            inspect.Parameter.VAR_POSITIONAL,
        )
        if needed:
            call[name] = 1.0 if name in units else "night-01"
    return {**call, argument: value}


@pytest.mark.parametrize(("function", "argument", "unit"), ARGUMENTS)
def test_another_dimension_is_refused_by_the_function_itself(function, argument, unit):
    wrong = 3.0 * (u.K if unit.unit == "" else u.kg)
    for value in (wrong, [wrong, wrong], Column([1.0], unit="kg"), 3.0 * u.m / u.kg):
        with pytest.raises(InputError, match=f"^{function.__name__}: {argument} has the unit "):
            function(**arguments(function, argument, value))


@pytest.mark.parametrize(("function", "argument", "unit"), ARGUMENTS)
def test_masked_values_are_refused_by_the_function_itself(function, argument, unit):
    masked = [
        np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False]),
        Masked([1.0, 2.0] * u.kg, mask=[False, True]),
        MaskedColumn([1.0, 2.0], mask=[True, False]),
        PandasLike([1.0, NAType(), 3.0]),
        XarrayLike(np.ma.array([1.0, 2.0], mask=[True, True])),
        np.ma.masked,
    ]
    for value in masked:
        with pytest.raises(InputError, match=f"^{function.__name__}: {argument} .*masked"):
            function(**arguments(function, argument, value))


@pytest.mark.parametrize(("function", "argument", "unit"), ARGUMENTS)
def test_a_quantity_of_another_unit_comes_in_as_ours(function, argument, unit):
    numbers = [3.0] if unit.one or unit.whole else [3.0, 7.0, 41.0]
    for value in forms(numbers, unit):
        got = taken(function, argument, value)
        np.testing.assert_allclose(np.ravel(got), numbers, rtol=1e-12)
        assert type(got) in (float, int, tuple, np.ndarray)
        assert not hasattr(got, "unit")


def taken(function, argument, value):
    """What the function is given in the end."""
    args, kwargs = plain_arguments(function, **arguments(function, argument, value))
    return inspect.signature(function).bind(*args, **kwargs).arguments[argument]


def forms(numbers, unit):
    """The same numbers as people may have them; one of a kind where one is wanted."""
    if unit.unit == "deg_C":
        factor, shift, other = (1.8, 0.0, imperial.deg_F) if unit.difference else (1.8, 32.0, imperial.deg_F)
        text = "degF"
    elif unit.unit == "dB":
        yield numbers[0] * u.dB
        yield 10.0 ** (numbers[0] / 10.0) * u.one
        return
    else:
        text, factor = OTHER[unit.unit]
        shift, other = 0.0, u.Unit(text)
    values = [factor * each + shift for each in numbers]
    if unit.one or unit.whole:
        yield values[0] * other
        yield Masked(values[0] * other, mask=False)
        return
    yield values * other
    yield [each * other for each in values]
    yield tuple(each * other for each in values)
    yield np.array([each * other for each in values], dtype=object)
    yield Column(values, unit=other)
    yield MaskedColumn(values, unit=other)
    yield Masked(values * other, mask=False)
    if text and unit.unit != "mjd":
        yield PandasLike(values, units=text)
        yield XarrayLike(values, units=text)
        yield XarrayLike(values * other)
    yield PandasLike(numbers)
    yield XarrayLike(numbers)


class NAType:
    """As pandas.NA."""


class PandasLike:
    """What is looked at of a pandas.Series: `to_numpy`, `attrs`; it iterates, and has no `data`."""

    def __init__(self, values, **attrs):
        self.values, self.attrs = values, attrs

    def to_numpy(self):
        return np.array(self.values)

    def __iter__(self):
        return iter(self.values)


class XarrayLike(PandasLike):
    """What is looked at of an xarray.DataArray: the same, the array beneath as `data`, and attributes by name."""

    @property
    def data(self):
        return self.values if isinstance(self.values, np.ndarray) else np.array(self.values)

    def __getattr__(self, name):
        try:
            return self.__dict__["attrs"][name]
        except KeyError:
            raise AttributeError(name) from None


def test_the_air_of_the_trial_loses_no_unit():
    """700 mm of mercury are 700 x 133.322387415 Pa; read as hPa they were 63 ppm too little."""
    answer = catseye.air(20 * u.deg_C, 700 * cds.mmHg, 50)
    assert float(answer.group_index) == float(catseye.air(20.0, 7.0 * 133.322387415, 50.0).group_index)
    assert 62e-6 < float(answer.group_index - catseye.air(20.0, 700.0, 50.0).group_index) < 64e-6
    assert answer.pressure_hpa == pytest.approx(933.256711905, rel=1e-12)


def test_kelvin_and_fractions_are_the_same_air_and_the_same_sound():
    for function, found in ((catseye.air, "group_index"), (catseye.sound, "speed")):
        ours = getattr(function([10.0, 20.0], 933.0, 50.0, u_temperature_c=0.3, u_pressure_hpa=0.2), found)
        theirs = function(
            [283.15, 293.15] * u.K, 93.3 * u.kPa, 0.5 * u.one, u_temperature_c=0.3 * u.K, u_pressure_hpa=20.0 * u.Pa
        )
        np.testing.assert_allclose(getattr(theirs, found), ours, rtol=1e-14)
        assert theirs.to_table()["temperature"].unit == u.deg_C


def test_millimetres_are_located_and_pointed_at_as_metres():
    stations = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 1.0], [0.0, 50.0, 2.0], [50.0, 50.0, 9.0]])
    target = np.array([20.0, 10.0, 30.0])
    ranges = np.linalg.norm(target - stations, axis=1)
    there = catseye.locate(1e3 * stations * u.mm, 1e3 * ranges * u.mm, 0.1 * u.mm, near=[20.0, 10.0, 31.0] * u.m)
    np.testing.assert_allclose(there.x, [target], atol=1e-9)
    np.testing.assert_allclose(there.covariance, catseye.locate(stations, ranges, 1e-4).covariance, rtol=1e-9)
    records = ("night-01/monuments/ZY103.toml", "night-01/mirrors/ZP103.toml")
    more = {"posture_deg": [0.5, 1.0] * u.rad, "solids": "solids.toml"}
    pointed = catseye.point(*records, [[0.0, 0.0, 50_000.0]] * u.mm, **more)
    np.testing.assert_array_equal(pointed.counts, catseye.point(*records, [0.0, 0.0, 50.0]).counts)


def test_times_are_days_and_intervals_seconds():
    when = Time("2003-09-10T12:00:00", scale="utc")
    assert plain(when, In("mjd"), "x") == pytest.approx(52_892.5, abs=1e-9)
    assert plain(when.tai, In("mjd"), "x") == pytest.approx(52_892.5, abs=1e-9)  # another scale, the same time
    assert plain(TimeDelta(90.0, format="sec"), In("s"), "x") == pytest.approx(90.0, rel=1e-12)
    with pytest.raises(InputError, match="x is a time"):
        plain(when, In("s"), "x")


def test_settings_and_keywords_are_in_the_units_of_their_names():
    @with_units
    def reading(settings: Annotated[Any, In("name")] = None, **known: Annotated[Any, In("name")]):
        return settings, known

    settings, known = reading(BaselineSettings(specified_mm=600.0 * u.um), path_length_m=2.0 * u.km, air_model="x")
    assert settings.specified_mm == pytest.approx(0.6)
    assert known == {"path_length_m": 2000.0, "air_model": "x"}
    for call in ({"settings": BaselineSettings(u_scale_ppm=1.0 * u.m)}, {"path_length_m": 2.0 * u.s}):
        with pytest.raises(InputError, match=r"reading: .* has the unit"):
            reading(**call)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([1.0 * u.m, 2.0], "with a unit and values without"),
        ([[1.0 * u.m, 2.0 * u.m], [3.0, 4.0]], "with a unit and values without"),
        ("20", "is text"),
        (np.array(["1", "2"]), "holds <U1"),
        (["1", "2"], "holds text"),
        ([["1", "2"], [1.0, 2.0]], "holds text"),
        (1.0 + 2.0j, "is a complex"),
        (np.array([1j]), "holds complex128"),
        (np.timedelta64(5, "s"), "holds timedelta64"),
        (PandasLike([1.0], units="furlongs"), "unknown unit 'furlongs'"),
        (type("Pint", (), {"units": "metre", "magnitude": 1.0})(), "Pint with the unit metre, which catseye cannot"),
        (object(), "is a object"),
        ([1.0, None], "is a NoneType"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_what_is_no_number_in_a_known_unit_is_refused_in_one_line(value, said):
    with pytest.raises(InputError) as problem:
        plain(value, In("m"), "locate: ranges")
    assert said in str(problem.value)
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize("value", [2, 2.5, np.float64(2.0), [1.0, 2.0], (1, 2), np.arange(3.0), [[1.0], [2.0]]])
def test_plain_numbers_pass_as_they_are(value):
    assert plain(value, In("m"), "x") is value


def test_one_number_is_one_and_a_row_is_a_row():
    with pytest.raises(InputError, match=r"shape \(2,\) \(expected one number\)"):
        plain([1.0, 2.0], In("m", one=True), "x")
    with pytest.raises(InputError, match=r"shape \(1, 2\) \(expected a row"):
        plain([[1.0, 2.0]] * u.m, In("m", many=True), "x")
    assert plain(np.array([1.0, 2.0]), In("GHz", many=True), "x") == (1.0, 2.0)
    with pytest.raises(InputError, match="expected a whole number"):
        plain(2.5, In("", whole=True), "x")


@pytest.mark.parametrize("function", [catseye.air, catseye.sound])
def test_a_humidity_that_is_likely_a_fraction_is_doubtful_with_both_readings(function):
    verdict = function(20.0, 933.0, [0.5, 0.7]).verdict
    assert verdict.word == "doubtful"
    assert "0.5 %" in verdict.why
    assert "as a fraction it would be 50 %" in verdict.why
    for humidity in (0.0, 1.5, 50.0, [0.5, 40.0], 0.5 * u.one):
        assert function(20.0, 933.0, humidity).verdict.word == "good"
