"""Poses of the dish by each command, as a table of the report."""

from catseye.constants import ARCSECOND, MILLIMETRE
from catseye.gateways.writers.report import Block, Heading, Items, TableBlock, Text
from catseye.gateways.writers.report_parts import ReportTable, number, text, uncertainty
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.pose.dish_ways import dish_ways


def dish_estimates(reduction: Reduction) -> list[Block]:
    """Dish poses of three commands, with the reasons why they differ."""
    ways = dish_ways(reduction)
    rows = [
        *(
            (f"vertex off along {a} (mm)", *(v / MILLIMETRE for w in ways for v in (w.translation[k], w.u[k])))
            for k, a in enumerate("xyz")
        ),
        *(
            (f"turned about {a} (″)", *(v / ARCSECOND for w in ways for v in (w.rotation[k], w.u[3 + k])))
            for k, a in enumerate("xyz")
        ),
        *(
            (f"axis leans {which} elevation (″)", *(v / ARCSECOND for w in ways for v in (w.axis[k], w.u_axis[k])))
            for k, which in enumerate(("across", "in"))
        ),
    ]
    columns = [
        column
        for k, way in enumerate(ways)
        for column in (
            number(f"way_{k + 1}", way.command.removeprefix("catseye "), digits=2, u=f"u_{k + 1}"),
            uncertainty(f"u_{k + 1}", "u", digits=2),
        )
    ]
    return [
        Heading("Dish pose by each command"),
        Text(
            "All against the nominal posture, ground axes, about the nominal vertex. The fits differ, not the sign "
            "convention: a paraboloid does not show a rotation about the dish's own axis and sets it to zero; "
            "points compared with their design do show it, and their positions across the surface contribute, "
            "too; a free focal length absorbs part of an offset dish's rotation. Compare the last two rows, the "
            "tilt of the dish's axis, which affects pointing. Unless the focal length is free they agree within "
            "their uncertainties."
        ),
        Items([f"{way.command}: {way.fitted}" for way in ways]),
        TableBlock("dish-pose", ReportTable.of_rows(rows, text("component", "component"), *columns)),
    ]
