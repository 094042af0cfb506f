"""Poses of the dish by each command, as a table of the report."""

from html import escape

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.writers.page import paragraph, table
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.pose.dish_ways import dish_ways


def dish_estimates_table(reduction: Reduction) -> str:
    """Dish poses of three commands, with the reasons why they differ."""
    ways = dish_ways(reduction)
    fitted = "".join(f"<li>{escape(estimate.command)}: {escape(estimate.fitted)}</li>" for estimate in ways)
    rows = [
        *(
            (f"vertex off along {axis} (mm)", *(_value_and_u(w.translation[k], w.u[k], MILLIMETRE, 2) for w in ways))
            for k, axis in enumerate("xyz")
        ),
        *(
            (f"turned about {axis} (″)", *(_value_and_u(w.rotation[k], w.u[3 + k], ARCSECOND, 1) for w in ways))
            for k, axis in enumerate("xyz")
        ),
        *(
            (f"axis leans {which} elevation (″)", *(_value_and_u(w.axis[k], w.u_axis[k], ARCSECOND, 1) for w in ways))
            for k, which in enumerate(("across", "in"))
        ),
    ]
    return "\n".join(
        (
            "<h3>Dish pose by each command</h3>",
            paragraph(
                "All against the nominal posture, ground axes, about the nominal vertex. The fits differ, not the sign "
                "convention: a paraboloid does not show a rotation about the dish's own axis and sets it to zero; "
                "points compared with their design do show it, and their positions across the surface contribute, "
                "too; a free focal length absorbs part of an offset dish's rotation. Compare the last two rows, the "
                "tilt of the dish's axis, which affects pointing. Unless the focal length is free they agree within "
                "their uncertainties."
            ),
            f'<ul class="notes">{fitted}</ul>',
            table(("", *(estimate.command.removeprefix("catseye ") for estimate in ways)), rows, "t" + "n" * len(ways)),
        )
    )


def _value_and_u(value: float, u: float, unit: float, places: int) -> str:
    return f"{value / unit:+.{places}f} ± {u / unit:.{places}f}"
