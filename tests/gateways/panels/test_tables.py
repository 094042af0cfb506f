"""The tables of a crew's work: each number is the one in memory over the unit in its column's name."""

import numpy as np
import pytest

from catseye.gateways.panels.objects import screws
from catseye.gateways.panels.tables import actuators_csv, crew_csv, panels_csv, readings_csv, screws_csv
from catseye.reduction.panels.crew import members, sessions
from catseye.reduction.panels.job import PanelFiles, panel_work
from column_scene import assert_columns
from panel_scene import EXAMPLE, dish


@pytest.fixture(scope="module")
def work():
    given = ("as-found.csv", "tool.toml", "survey.csv", "maps", "as-left.csv")
    return panel_work(PanelFiles(*(EXAMPLE / name for name in given)), dish(), reject=True)


def test_every_column_of_the_screws_has_the_unit_of_its_name(work):
    found = work.latest
    told = {
        "panel": lambda s: s.panel,
        "corner": lambda s: s.corner,
        "x_m": lambda s: s.x,
        "y_m": lambda s: s.y,
        "readings": lambda s: s.readings,
        "height_um": lambda s: s.departure,
        "u_height_um": lambda s: s.u_departure,
        "relative_um": lambda s: s.relative,
        "u_relative_um": lambda s: s.u_relative,
        "probability_within": lambda s: s.probability_within,
        "turns_clockwise": lambda s: s.turns,
        "u_turns": lambda s: s.u_turns,
        "verdict": lambda s: s.verdict,
    }
    rows = list(screws(found))
    np.testing.assert_array_equal([s.departure for s in rows], found.departure.ravel())
    assert_columns(screws_csv(found), told, rows)


def test_every_column_of_the_actuators_has_the_unit_of_its_name(work):
    found = work.latest
    corners, shafts = found.layout.corners, found.model.columns.shaft(np.arange(len(found.layout.corners)))
    told = {
        "corner": lambda c: corners[c],
        "x_m": lambda c: found.layout.xy[c, 0],
        "y_m": lambda c: found.layout.xy[c, 1],
        "mean_height_um": lambda c: found.actuator[c],
        "u_mean_height_um": lambda c: found.u_actuator[c],
        "shaft_height_um": lambda c: found.solution.x[shafts[c]],
        "u_shaft_height_um": lambda c: found.solution.q.diagonal()[shafts[c]] ** 0.5,
    }
    assert_columns(actuators_csv(found), told, np.flatnonzero(np.isfinite(found.actuator)).tolist())


def test_every_column_of_the_panels_has_the_unit_of_its_name(work):
    found, maps = work.latest, work.maps
    names = found.layout.panels
    told = {
        "panel": lambda p: names[p],
        "piston_um": lambda p: found.fit[p, 0],
        "u_piston_um": lambda p: found.u_fit[p, 0],
        "slope_x_urad": lambda p: found.fit[p, 1],
        "slope_y_urad": lambda p: found.fit[p, 2],
        "u_slope_x_urad": lambda p: found.u_fit[p, 1],
        "u_slope_y_urad": lambda p: found.u_fit[p, 2],
        "map_rms_um": lambda p: maps[names[p]].rms if names[p] in maps else None,
        "map_outlying_points": lambda p: int(maps[names[p]].outlying.sum()) if names[p] in maps else None,
    }
    assert_columns(panels_csv(work), told, range(len(names)))


def test_every_column_of_the_readings_has_the_unit_of_its_name(work):
    found = work.found
    tips, readings, layout = found.model.tips, found.readings, found.layout
    rows = [
        (tip, fit, k)
        for fit, block in zip(found.solution.fits, found.model.blocks, strict=False)
        for k, tip in enumerate(block)
    ]

    def gauge(row):
        return found.sheet.gauge[tips.gauge[row[0]]].name

    rows.sort(key=lambda row: (tips.row[row[0]], gauge(row)))
    told = {
        "place": lambda r: readings.where[tips.row[r[0]]],
        "corner": lambda r: layout.corners[tips.corner[r[0]]],
        "panel": lambda r: layout.panels[tips.panel[r[0]]],
        "session": lambda r: readings.sessions[readings.session[tips.row[r[0]]]],
        "member": lambda r: readings.member[tips.row[r[0]]],
        "turn": lambda r: readings.turn[tips.row[r[0]]],
        "gauge": gauge,
        "reading_mm": lambda r: readings.reading[tips.row[r[0]], tips.gauge[r[0]]],
        "design_rise_um": lambda r: tips.rise[r[0]],
        "residual_um": lambda r: r[1].residual[r[2]],
        "w": lambda r: r[1].standardised[r[2]],
        "redundancy": lambda r: r[1].redundancy[r[2]],
        "status": lambda r: "used" if r[1].active[r[2]] else "left out",
    }
    assert_columns(readings_csv(found), told, rows)


def test_every_column_of_the_crew_has_the_unit_of_its_name(work):
    rows = [
        (when, kind, reader)
        for when, found in (("as found", work.found), ("as left", work.left))
        for kind, readers in (("member", members(found)), ("session", sessions(found)))
        for reader in readers
    ]
    told = {
        "when": lambda r: r[0],
        "kind": lambda r: r[1],
        "name": lambda r: r[2].name,
        "readings": lambda r: r[2].readings,
        "degrees_of_freedom": lambda r: r[2].degrees_of_freedom,
        "variance_factor": lambda r: r[2].variance_factor,
        "low": lambda r: r[2].low,
        "high": lambda r: r[2].high,
        "u_gauge_um": lambda r: r[2].u_gauge,
        "doubts": lambda r: r[2].doubts,
        **{f"closure_{'abcd'[g]}_um": lambda r, g=g: r[2].closure[g] for g in range(4)},
    }
    assert_columns(crew_csv(work), told, rows)
