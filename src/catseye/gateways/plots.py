"""Summaries of the figures of `catseye plot`, in sentences."""

from collections.abc import Callable
from typing import Any

from catseye.gateways.writers.passage import Passage

Summary = dict[str, Any]


def plot_passages(kind: str, summary: Summary) -> list[Passage]:
    """Numbers of a figure in sentences; one line per number for a kind without its own text.

    kind      name in `catseye plot`
    summary   object of its `--json`
    """
    return PASSAGES.get(kind, _generic)(summary)


def _servo(s: Summary) -> list[Passage]:
    settled = "it does not settle" if s["settled_after_s"] is None else f"it settles after {s['settled_after_s']:.3f} s"
    off = " The motor switched itself off: the error grew beyond its limit." if s["motor_off"] else ""
    return [
        Passage(
            "The filter",
            f"kp {s['kp']}, ki {s['ki']}, kd {s['kd']}, il {s['il']}, interval {s['interval']}: phase margin "
            f"{s['phase_margin_deg']:.0f}°.",
        ),
        Passage("The move", f"it follows within {s['following_error_counts']:.1f} counts, and {settled}.{off}"),
        Passage("The axis", f"{s['axis']}."),
    ]


def _air(s: Summary) -> list[Passage]:
    parts = {name: s[f"u_of_{name}_ppm"] for name in ("formula", "temperature", "pressure", "humidity")}
    contributions = ", ".join(f"{name} {value:.3f}" for name, value in parts.items() if value)
    differences = "; ".join(f"{name} {value:+.3f}" for name, value in s["other_less_this_ppm"].items())
    passages = [
        Passage(
            "The air",
            f"group refractivity {s['group_refractivity_ppm']:.3f} ppm by {s['model']}, u "
            f"{s['u_group_refractivity_ppm']:.3f} ppm: {contributions} ppm.",
        ),
        Passage("Other models", f"minus this one: {differences} ppm."),
    ]
    if s["not_drawn"]:
        passages.append(Passage("Not drawn", f"{', '.join(map(str, s['not_drawn']))}: outside their limits."))
    return passages


def _polarization(s: Summary) -> list[Passage]:
    corners = [
        Passage(
            name,
            f"returns {100 * c['returned']:.1f} % of the light, {_span(c['crossed_least'], c['crossed_most'])} of it "
            f"cross-polarized; on the far-field axis {100 * c['far_field_axis']:.1f} %, back through splitter and "
            f"quarter wave {100 * c['through_splitter_and_quarter_wave']:.1f} %.",
        )
        for name, c in s["corners"].items()
    ]
    return [Passage("The light", f"{s['wavelength_um']:g} µm; {s['glass']} has the index {s['index']:.6f}."), *corners]


def _quadrant(s: Summary) -> list[Passage]:
    steps = s["settled_after_steps"]
    settled = "it does not settle within these steps" if steps is None else f"it settles after {steps} steps"
    um = {key: value * 1e6 for key, value in s.items() if key != "settled_after_steps"}
    return [
        Passage("The spot", f"{um['spot']:.4g} µm radius at 1/e²; near the centre the place is "
                f"{um['centre_slope']:.4g} µm times the difference of the halves over their sum."),
        Passage("Saturation", f"to first order a place reads 90 % or more out to {um['reads_90_percent_to']:.3g} µm."),
        Passage("The noise", f"u {um['u_place_centre']:.3g} µm of one reading at the centre."),
        Passage("The servo", f"{settled}; there u {um['u_settled']:.3g} µm remains."),
    ]  # fmt: skip


def _span(low: float, high: float) -> str:
    first, last = (f"{100 * v:.2g}" for v in (low, high))
    return f"{first} %" if first == last else f"{first} to {last} %"


def _generic(s: Summary) -> list[Passage]:
    """One line per number; a nested table lists its names before its numbers."""
    return [
        Passage(key.replace("_", " "), _text(value))
        for key, value in s.items()
        if value is not None and value != "" and value != []
    ]


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{str(name).replace('_', ' ')} {_text(item)}" for name, item in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


PASSAGES: dict[str, Callable[[Summary], list[Passage]]] = {
    "servo": _servo,
    "air": _air,
    "polarization": _polarization,
    "quadrant": _quadrant,
}
