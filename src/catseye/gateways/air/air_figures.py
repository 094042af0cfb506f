"""Figure of the index of air as SVG text, with its uncertainty and the other models.

The index varies by tens of ppm where its uncertainty is a tenth. So each variable has two panels: the index above;
below, enlarged, the other models' differences from the chosen one, with its uncertainty as bands.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.atmosphere.index.air import MODELS, AirState, air
from catseye.atmosphere.index.model import IndexModel
from catseye.atmosphere.limit import ValidInterval
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.constants import PPM
from catseye.gateways.writers.drawing import FAINT, INK, SERIES, STYLE, Figure, Svg, mpl, svg
from catseye.names import AIR_MODEL

WIDTH, HEIGHT = 9.4, 10.4  # inches
POINTS = 121
COLOURS = {name: SERIES[i % len(SERIES)] for i, name in enumerate(MODELS)}
DISTANCE = 100.0  # m, for the micrometres beside the bars
UNCERTAINTIES = {
    "u_temperature_c": ValidInterval(
        "u of temperature", "C", 0.0, 100.0, "the notion of a small standard uncertainty", 1
    ),
    "u_pressure_hpa": ValidInterval(
        "u of pressure", "hPa", 0.0, 1000.0, "the notion of a small standard uncertainty", 1
    ),
    "u_humidity_percent": ValidInterval(
        "u of humidity", "%", 0.0, 100.0, "the notion of a small standard uncertainty", 1
    ),
}


@dataclass(frozen=True)
class Variable:
    """Variable of the figure.

    key      argument name of the model
    name     on the axis
    unit     of the axis
    around   half the width drawn around the state; None for `ends`
    ends     fixed ends, extended to include the state
    """

    key: str
    name: str
    unit: str
    around: float | None
    ends: tuple[float, float] = (0.0, 0.0)

    def values(self, state: float, model: IndexModel) -> NDArray[np.float64]:
        """Values drawn, within the model's limits."""
        low, high = self.ends if self.around is None else (state - self.around, state + self.around)
        limit = model.limits[self.key]
        return np.linspace(max(min(low, state), limit.lower), min(max(high, state), limit.upper), POINTS)


VARIABLES = (
    Variable("temperature_c", "temperature", "°C", 15.0),
    Variable("pressure_hpa", "pressure", "hPa", 50.0),
    Variable("humidity_percent", "relative humidity", "%", None, (0.0, 100.0)),
    Variable("wavelength_um", "wavelength", "µm", None, (0.4, 1.6)),
    Variable("co2_ppm", "carbon dioxide", "ppm", None, (300.0, 1000.0)),
)


@dataclass(frozen=True)
class StateUncertainty:
    """Standard uncertainties of a state of air, at least 0, uncorrelated.

    temperature_c      °C
    pressure_hpa       hPa
    humidity_percent   % over liquid water
    """

    temperature_c: float = 0.0
    pressure_hpa: float = 0.0
    humidity_percent: float = 0.0


CERTAIN = StateUncertainty()


def air_plot(
    temperature_c: float,
    pressure_hpa: float,
    humidity_percent: float,
    *,
    wavelength_um: float = 0.780,
    model: str = AIR_MODEL,
    co2_ppm: float = 450.0,
    uncertainty: StateUncertainty = CERTAIN,
) -> tuple[Svg, dict[str, Any]]:
    """Group index around one state of air: SVG text and a summary in numbers.

    temperature_c, pressure_hpa, humidity_percent   the state: °C, hPa, % over liquid water
    wavelength_um   vacuum wavelength, um
    model           a name in MODELS
    co2_ppm         carbon dioxide, ppm, where a model has it
    uncertainty     of the state

    Source: the models'; uncertainty by the law of propagation, [JCGM100] eq. 10. Other models are drawn only where they
    are valid, and listed in `not_drawn` where they are valid nowhere in the figure.

    Raises ValidityError for values outside the chosen model's limits, and for invalid uncertainties.
    """
    u = {f"u_{name}": value for name, value in asdict(uncertainty).items()}
    for key, value in u.items():
        UNCERTAINTIES[key].check(value)
    state = {
        "temperature_c": float(temperature_c),
        "pressure_hpa": float(pressure_hpa),
        "humidity_percent": float(humidity_percent),
        "wavelength_um": float(wavelength_um),
        "co2_ppm": float(co2_ppm),
    }
    chosen = air(**state, model=model)
    parts = _parts(chosen, u)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        panels = figure.subplots(4, 3, height_ratios=(1.0, 0.9, 1.0, 0.9))
        pairs = [(panels[row, column], panels[row + 1, column]) for row in (0, 2) for column in range(3)]
        drawn: set[str] = set()
        for variable, (above, below) in zip(VARIABLES, pairs, strict=False):
            drawn |= _draw(above, below, variable, state, model, u)
        _draw_parts(figure, pairs[-1], parts)
        pairs[0][0].set_ylabel("group refractivity (ppm)")
        pairs[3][0].set_ylabel("group refractivity (ppm)")
        pairs[0][1].set_ylabel("other models − this (ppm)")
        pairs[3][1].set_ylabel("other models − this (ppm)")
        not_drawn = sorted(set(MODELS) - drawn - {model})
        figure.suptitle(_title(state, chosen, not_drawn), x=0.01, ha="left", fontweight="bold", fontsize=10.5)
        figure.legend(*_key(pairs), loc="outside lower left", ncols=3)
        text = svg(figure)
    return text, _summary(state, chosen, parts, not_drawn)


def _parts(chosen: AirState, u: dict[str, float]) -> dict[str, float]:
    """Standard uncertainty of the index by cause, ppm."""
    slope = chosen.sensitivity
    return {
        "formula": float(chosen.standard_uncertainty) / PPM,
        "temperature": abs(float(slope.temperature_c)) * u["u_temperature_c"] / PPM,
        "pressure": abs(float(slope.pressure_hpa)) * u["u_pressure_hpa"] / PPM,
        "humidity": abs(float(slope.humidity_percent)) * u["u_humidity_percent"] / PPM,
        "together": float(chosen.combined_uncertainty(**u)) / PPM,
    }


def _draw(above, below, variable: Variable, state: dict[str, float], model: str, u: dict[str, float]) -> set[str]:
    """Draw the index above and differences of other models below; names of those drawn."""
    x = variable.values(state[variable.key], MODELS[model])
    x = x[_inside(MODELS[model], state | {variable.key: x}, x.shape)]
    swept = air(**(state | {variable.key: x}), model=model)
    index = np.broadcast_to(swept.group_refractivity / PPM, x.shape)
    u_total = np.broadcast_to(swept.combined_uncertainty(**u) / PPM, x.shape)
    formula = np.full(x.shape, swept.standard_uncertainty / PPM)
    colour = COLOURS[model]
    above.fill_between(x, index - u_total, index + u_total, color=colour, alpha=0.25, lw=0)
    above.plot(x, index, color=colour, lw=1.4)
    for ax in (above, below):
        ax.axvline(state[variable.key], color=FAINT, lw=0.8, ls=":")
        ax.set_xlim(x[0], x[-1])
        ax.ticklabel_format(useOffset=False)
    above.tick_params(labelbottom=False)
    above.set_title(_slope(variable, state, model), fontweight="normal", fontsize=8.5)
    if np.any(u_total > formula):
        below.fill_between(x, -u_total, u_total, color=colour, alpha=0.16, lw=0, label="u with inputs")
    below.fill_between(x, -formula, formula, color=colour, alpha=0.28, lw=0, label="u of formula")
    below.axhline(0.0, color=colour, lw=1.4, label=MODELS[model].label)
    drawn = set()
    for name in MODELS:
        if name == model:
            continue
        inside = _inside(MODELS[name], state | {variable.key: x}, x.shape)
        if np.any(inside):
            refractivity = np.full(x.shape, np.nan)
            valid = {key: np.broadcast_to(value, x.shape)[inside] for key, value in (state | {variable.key: x}).items()}
            refractivity[inside] = air(**valid, model=name).group_refractivity / PPM
            below.plot(x, refractivity - index, color=COLOURS[name], lw=1.2, label=MODELS[name].label)
            drawn.add(name)
    below.set_xlabel(f"{variable.name} ({variable.unit})")
    return drawn


def _slope(variable: Variable, state: dict[str, float], model: str) -> str:
    if variable.key == "co2_ppm" and not MODELS[model].co2_slope:
        return f"fixed at {MODELS[model].co2_ppm:.0f} ppm in this model"
    unit = variable.unit
    slope = float(getattr(air(**state, model=model).sensitivity, variable.key)) / PPM
    if variable.key == "co2_ppm":  # per 100 ppm: the effect of 1 ppm is too small to read
        slope, unit = 100.0 * slope, f"100 {unit}"
    return f"{slope:+.4f} ppm per {unit} here".replace("-", "−")


def _inside(model: IndexModel, values: dict[str, Any], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """True where a model is valid: within its limits and below vapour saturation."""
    inside = np.ones(shape, bool)
    for key, value in values.items():
        inside &= (model.limits[key].lower <= value) & (value <= model.limits[key].upper)
    t, p, h = (values[key] for key in ("temperature_c", "pressure_hpa", "humidity_percent"))
    return inside & (vapour_pressure_hpa(t, p, h, model.vapour_formula) <= p)


def _draw_parts(figure: Figure, pair, parts: dict[str, float]) -> None:
    """Draw the uncertainty's contributions at the state as bars, over both panels."""
    grid = pair[0].get_gridspec()
    for ax in pair:
        ax.remove()
    ax = figure.add_subplot(grid[2:, 2])
    names, values = list(parts), list(parts.values())
    at = np.arange(len(names))
    ax.barh(at, values, 0.6, color=[*(FAINT,) * (len(names) - 1), INK])
    ax.set_yticks(at, names)
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    ax.set_xlim(0.0, 1.55 * max(values))
    for row, value in zip(at, values, strict=True):
        ax.annotate(
            f"{value:.3f} ppm\n{value * PPM * DISTANCE * 1e6:.1f} µm", (value, row), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize=8,
        )  # fmt: skip
    ax.set_title(f"u at this state; µm in {DISTANCE:.0f} m")
    ax.set_xlabel("standard uncertainty (ppm)")


def _key(pairs) -> tuple[list, list]:
    """Handles and labels of the lower panels' curves, without duplicates."""
    handles: dict[str, Any] = {}
    for _, below in pairs[:-1]:
        for handle, label in zip(*below.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    return list(handles.values()), list(handles)


def _title(state: dict[str, float], chosen: AirState, not_drawn: list[str]) -> str:
    text = (
        f"{MODELS[chosen.model].label} at {state['temperature_c']:g} °C, {state['pressure_hpa']:g} hPa, "
        f"{state['humidity_percent']:g} %, {state['wavelength_um']:g} µm: group refractivity "
        f"{float(chosen.group_refractivity) / PPM:.3f} ppm"
    )
    names = "; ".join(MODELS[name].label for name in not_drawn)
    return f"{text}\nnot drawn, outside their limits: {names}" if not_drawn else text


def _summary(
    state: dict[str, float], chosen: AirState, parts: dict[str, float], not_drawn: list[str]
) -> dict[str, Any]:
    differences = {}
    for name, model in MODELS.items():
        if name != chosen.model and bool(_inside(model, state, ()).all()):
            refractivity = float(air(**state, model=name).group_refractivity)
            differences[name] = (refractivity - float(chosen.group_refractivity)) / PPM
    return {
        "model": chosen.model,
        "group_refractivity_ppm": float(chosen.group_refractivity) / PPM,
        "u_group_refractivity_ppm": parts["together"],
        **{f"u_of_{name}_ppm": value for name, value in parts.items() if name != "together"},
        "other_less_this_ppm": differences,
        "not_drawn": not_drawn,
    }
