"""A patch of the dish, a tool, and crews, for tests of the panel setting instrument."""

from functools import cache
from pathlib import Path

import numpy as np

from catseye.geometry.antenna.panel_surface import warps
from catseye.records.files.reading import read_record
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import PanelLayout, layout_of_site
from catseye.records.panels.readings import PanelReadings, PanelSurvey, read_panel_readings
from catseye.records.site.folder import read_site
from catseye.reduction.panels.model import corner_places
from catseye.simulator.laboratory.panels import SolidPanels, screwed, solid_panels
from repository import ROOT

EXAMPLE = ROOT / "examples" / "panels"
GBT = ROOT / "examples" / "sites" / "gbt"


@cache
def dish() -> PanelLayout:
    """All panels of the bundled site."""
    return layout_of_site(read_site(GBT))


def patch(tiers=("T20", "T21", "T22"), side=3) -> PanelLayout:
    """Some panels about the plane of symmetry."""
    whole = dish()
    return whole.only(np.array([k for k, n in enumerate(whole.panels) if n[:3] in tiers and int(n[4:]) <= side]))


def tool(**panel) -> PanelInstrument:
    """The example's tool, with other knowledge of the panels."""
    sheet = read_record(EXAMPLE / "tool.toml", PanelInstrument)
    return sheet.model_copy(update={"panel": sheet.panel.model_copy(update=panel)})


def read(rows, path: Path, layout: PanelLayout, sheet: PanelInstrument) -> PanelReadings:
    path.write_text("\n".join(rows) + "\n", "utf-8")
    return read_panel_readings(path, layout, sheet)


def survey(stands, u, rng) -> PanelSurvey:
    """All shafts, found with a standard uncertainty u (m), the stand included."""
    return PanelSurvey(np.arange(len(stands)), stands + rng.normal(0.0, u, len(stands)), np.full(len(stands), u), "")


def standing_by_chance(layout: PanelLayout, sheet: PanelInstrument, rng) -> SolidPanels:
    """Panels drawn from what the sheet claims to know: each corner by u_set, the warp by twist and shape besides."""
    prior = sheet.panel
    null = warps(corner_places(layout))
    square = np.sum(null**2, axis=1)
    e = rng.normal(0.0, prior.u_set_um * 1e-6, (len(layout.panels), 4))
    other = (prior.u_twist_um**2 + prior.u_shape_um**2 * square) * 1e-12
    u = np.sqrt(1.0 / (1.0 / other + 1.0 / ((prior.u_set_um * 1e-6) ** 2 * square)))
    e += null / square[:, None] * (rng.normal(0.0, u) - np.sum(null * e, axis=1))[:, None]
    return screwed(solid_panels(layout, rng, piston=0.0, slope=0.0, twist=0.0), e)
