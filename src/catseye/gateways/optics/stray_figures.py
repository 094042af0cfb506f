"""Stray light as JSON, text and a figure."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from catseye.gateways.writers.drawing import FAINT, INK, SERIES, Figure, styled

if TYPE_CHECKING:
    from catseye.reduction.optics.stray import StrayLight

MICROMETRES = 1e6


def stray_object(light: "StrayLight") -> dict[str, Any]:
    """JSON object of `catseye stray --json`."""
    size = light.feedback
    return {
        "verdict": light.verdict.to_object(),
        "distance": light.distance,
        "wavelength": light.wavelength,
        "limit": light.limit,
        "largest_share": light.share,
        "largest": light.largest,
        "effects": [
            {"name": e.name, "at": e.at, "largest": e.largest, "mean": e.mean, "orders": e.orders.tolist()}
            for e in light.effects
        ],
        "feedback": None
        if size is None
        else {
            "parameter": size.parameter,
            "contrast": size.contrast,
            "largest_phase": size.largest_phase,
            "u_range": size.u_range,
            "u_mean": size.u_mean,
        },
    }


def stray_rows(light: "StrayLight") -> Iterator[str]:
    """Causes as lines of text, µm."""
    if light.effects:
        yield f"{'cause, µm of range':<28}{'here':>10}{'largest':>10}{'mean':>10}{'order 1':>10}{'order 2':>10}"
    for e in light.effects:
        numbers = (e.at, e.largest, e.mean, e.orders[0], e.orders[1])
        yield f"{e.name:<28}" + "".join(f"{MICROMETRES * v:>10.3f}" for v in numbers)
    if (size := light.feedback) is not None:
        yield f"{'light back into the laser':<28}C {size.parameter:.3g}, contrast {size.contrast:.3g}, u of a shot " + (
            f"{MICROMETRES * size.u_range:.3g} µm, of the mean {MICROMETRES * size.u_mean:.3g} µm"
        )


def stray_figures(light: "StrayLight") -> dict[str, Figure]:
    """Range error by each cause over half a modulation wavelength, and the fringe of the light itself."""
    fringe = None if light.feedback is None or not light.feedback.fringe.size else light.feedback
    count = bool(light.effects) + (fringe is not None)
    if not count:
        return {}
    with styled():
        figure = Figure(figsize=(8.4, 0.6 + 2.8 * count), layout="constrained")
        axes = list(figure.subplots(count, 1, squeeze=False)[:, 0])
        if light.effects:
            _causes(axes[0], light)
        if fringe is not None:
            axes[-1].plot(MICROMETRES * fringe.moved, MICROMETRES * fringe.fringe, color=SERIES[0], lw=1.4)
            axes[-1].set_title("Light back into the laser")
            axes[-1].set_xlabel("movement of the target (µm)")
            axes[-1].set_ylabel("range too long (µm)")
    return {"stray": figure}


def _causes(panel: Any, light: "StrayLight") -> None:
    for k, effect in enumerate(light.effects):
        color = SERIES[k % len(SERIES)]
        panel.plot(1e3 * light.moved, MICROMETRES * effect.curve, label=effect.name, color=color, lw=1.3)
    if len(light.effects) > 1:
        total = sum(effect.curve for effect in light.effects)
        panel.plot(1e3 * light.moved, MICROMETRES * total, label="together", color=INK, lw=2.0)
    for sign, label in ((1.0, "limit"), (-1.0, None)):
        panel.axhline(sign * MICROMETRES * light.limit, color=FAINT, lw=0.9, ls="--", label=label)
    panel.set_title("Stray light")
    panel.set_xlabel(f"target beyond {light.distance:g} m (mm)")
    panel.set_ylabel("range too long (µm)")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
