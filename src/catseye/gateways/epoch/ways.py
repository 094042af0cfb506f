"""Where the dish is by each command, as a table of the report."""

from html import escape

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.writers.page import paragraph, table
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.pose.dish_ways import dish_ways


def ways_table(reduction: Reduction) -> str:
    """The answers of three commands to where the dish is, with why they differ."""
    ways = dish_ways(reduction)
    fitted = "".join(f"<li>{escape(way.command)}: {escape(way.fitted)}</li>" for way in ways)
    rows = [
        *(
            (f"vertex off along {axis} (mm)", *(_both(w.translation[k], w.u[k], MILLIMETRE, 2) for w in ways))
            for k, axis in enumerate("xyz")
        ),
        *(
            (f"turned about {axis} (″)", *(_both(w.rotation[k], w.u[3 + k], ARCSECOND, 1) for w in ways))
            for k, axis in enumerate("xyz")
        ),
        *(
            (f"axis leans {which} elevation (″)", *(_both(w.axis[k], w.u_axis[k], ARCSECOND, 1) for w in ways))
            for k, which in enumerate(("across", "in"))
        ),
    ]
    return "\n".join(
        (
            "<h3>The dish, as each command has it</h3>",
            paragraph(
                "All against the nominal posture, ground axes, about the nominal vertex. What is fitted differs, not "
                "the sign: a paraboloid does not show a turn about the dish's own axis and sets it to zero, points "
                "held against their design show it, and their places across the surface count, too; a focal length "
                "that is free takes part of an offset dish's turn with it. Compare the last two rows, how far the "
                "dish's axis leans: that is what pointing feels. Unless the focal length is free they agree within "
                "their uncertainties."
            ),
            f'<ul class="notes">{fitted}</ul>',
            table(("", *(way.command.removeprefix("catseye ") for way in ways)), rows, "t" + "n" * len(ways)),
        )
    )


def _both(value: float, u: float, unit: float, places: int) -> str:
    return f"{value / unit:+.{places}f} ± {u / unit:.{places}f}"
