"""Data sheet of a panel setting instrument, with priors of panels and screws: SHEET.toml."""

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from catseye.records.files.record import Certificate, Name, Pair, Record, Version, Within, broken_rule

GAUGES = ("a", "b", "c", "d")
Micrometres = Annotated[float, Within(0, 1e4, above=True)]
Slope = Annotated[float, Within(0, 1e5, above=True)]  # µrad


class PanelGauge(Record):
    """Displacement gauge.

    x_mm, y_mm      tip in the tool's axes, from the shaft's axis
    scale_ppm       scale error, positive if it reads too long
    zero_um_per_c   increase of the reading per °C above the flat's temperature
    sag_um          sag of the tip with the tool upright, compared with weightless
    linearity       pairs of a reading in mm and its correction in µm, to be added; sorted, linear between
    name            a, b, c or d: one in each quarter of the tool
    """

    name: Literal["a", "b", "c", "d"]
    x_mm: Annotated[float, Within(-1000, 1000)]
    y_mm: Annotated[float, Within(-1000, 1000)]
    scale_ppm: Annotated[float, Within(-1e5, 1e5)] = 0.0
    zero_um_per_c: Annotated[float, Within(-100, 100)] = 0.0
    sag_um: Annotated[float, Within(-1000, 1000)] = 0.0
    linearity: Annotated[tuple[Pair, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _has_a_sorted_linearity(self) -> "PanelGauge":
        at = [reading for reading, _ in self.linearity]
        if any(b <= a for a, b in pairwise(at)):
            raise broken_rule(f"linearity of gauge {self.name!r} is not sorted by reading (expected sorted readings)")
        return self


class PanelPrior(Record):
    """[panel]: prior knowledge of panels before the tool reads them.

    u_set_um               of a corner's height before its first setting
    u_shape_um             of the surface at a corner from the panel's best fit, without a map
    u_slope_urad           of the surface's slope near a corner from that of the complete panel, without a map
    u_map_um, u_map_slope_urad   the same with a map
    u_twist_um             of the warp that four screws force on the panel, at its corners
    """

    u_set_um: Micrometres
    u_shape_um: Micrometres
    u_slope_urad: Slope
    u_map_um: Micrometres
    u_map_slope_urad: Slope
    u_twist_um: Micrometres


class PanelScrew(Record):
    """[screw]: effect of a turn.

    pitch_mm    travel of a full turn
    clockwise   effect of a turn clockwise on the corner
    u_turn      standard uncertainty of a turn, in turns
    """

    pitch_mm: Annotated[float, Within(0.05, 20)]
    clockwise: Literal["raises", "lowers"]
    u_turn: Annotated[float, Within(0, 1, above=True)]


class PanelInstrument(Certificate):
    """Complete SHEET.toml.

    name                 name of the tool
    u_gauge_um           repeatability of one reading, with repositioning
    resolution_um        last digit of a reading
    travel_mm            range of a gauge; a reading beyond half of it is refused
    u_zero_um            drift of the zero of a gauge within a session
    u_flat_um            of the flat under one gauge
    u_lean_arcsec        of one reading of an inclinometer
    u_level_arcsec       of the zero of an inclinometer in a session, including the tilt of the telescope
    lean_limit_arcmin    largest lean of the shaft; placements beyond are named; over root three, u of an unread
                         lean
    flat_temperature_c   temperature at which the gauges were zeroed
    u_stand_um           of the shoulder of the shaft below its prism, added to surveyed heights
    goal_um              tolerance of a corner from the mean of its neighbours
    gauge                four displacement gauges
    panel                prior knowledge of the panels
    screw                effect of a turn
    """

    format: Annotated[str, Version("panel-instrument")]
    name: Name
    u_gauge_um: Micrometres
    resolution_um: Micrometres
    travel_mm: Annotated[float, Within(0.1, 100)]
    u_zero_um: Micrometres
    u_flat_um: Micrometres
    u_lean_arcsec: Annotated[float, Within(0, 3600, above=True)]
    u_level_arcsec: Annotated[float, Within(0, 3600, above=True)]
    lean_limit_arcmin: Annotated[float, Within(0, 60, above=True)]
    flat_temperature_c: Annotated[float, Within(-60, 60)]
    u_stand_um: Micrometres
    goal_um: Micrometres
    gauge: Annotated[tuple[PanelGauge, ...], Field(strict=False, min_length=4, max_length=4)]
    panel: PanelPrior
    screw: PanelScrew

    @model_validator(mode="after")
    def _has_a_gauge_in_each_quarter(self) -> "PanelInstrument":
        if tuple(g.name for g in self.gauge) != GAUGES:
            raise broken_rule(f"gauges are {[g.name for g in self.gauge]} (expected 'a', 'b', 'c', 'd' in this order)")
        quarters = {(g.x_mm > 0.0, g.y_mm > 0.0) for g in self.gauge if g.x_mm and g.y_mm}
        if len(quarters) != 4:
            raise broken_rule("gauges a to d are not in four quarters round the shaft (expected one over each panel)")
        return self
