"""Tables of every kind of calibration from the simulated laboratory, and one column of them spoiled at a time.

A laboratory of another seed has other noise than the shipped examples; limits were set on those and are checked on it.
"""

import csv
import importlib.util
import re
import sys

import numpy as np

import lab_scene
from catseye.api.laboratory import calibrate
from catseye.errors import CatseyeError
from repository import ROOT

FAR, WIDE = 5.0, 10.0  # u off the honest value, times the honest u: no good calibration
SCATTER_KEYS = {  # by which a sheet states the scatter of its readings
    "reference-distance": ("u_distance_mm", "u_phase_rad"), "leakage": ("u_volt",), "leakage-lit": ("u_volt",),
    "linearity": ("u_range_mm",), "retroreflector": ("u_range_mm", "u_seating_mm"),
    "amplitude-to-phase": ("u_phasor_volt", "u_phase_rad"), "prism-constant": ("u_reading_mm",),
    "ball-constant": ("u_reading_mm",), "gauge-blocks": ("u_reading_mm",), "spacers": ("u_reading_mm",),
    "invar-wire": ("u_reading_mm",), "autocollimation": ("u_reading_arcsec",), "height-gauge": ("u_reading_mm",),
    "both-faces": ("u_distance_mm",), "both-faces-pointing": ("u_counts",), "encoder": ("u_reading_arcsec",),
    "limits": ("u_touch_counts",), "alignment": ("u_spot_mm",), "detector-focus": ("u_amplitude_share",),
    "monument-azimuth": ("u_direction_arcsec",), "plate-levels": ("u_level_arcsec",), "inclinometer": ("u_volt",),
    "hydrostatic-level": ("u_reading_mm",), "reference-cube": ("u_amplitude_volt",),
    "mounting-plate": ("u_direction_arcsec",),
}  # fmt: skip
# What no file can show: the spoiled table is as good a table of another thing. Kind, columns, ways, and why.
UNSEEN = (
    ("leakage", "real_volt imaginary_volt", "negated exchanged", "a leakage of another phase is as likely"),
    ("leakage", "real_volt imaginary_volt", "doubled", "of few buffers two scatters may differ by two thirds"),
    ("reference-distance", "phase_reference_rad", "constant", "electronics as steady as a reading exist"),
    ("leakage-lit", "amplitude_volt", "doubled", "a return of 4 V with a leakage of 60 mV exists"),
    ("retroreflector", "range_m", "doubled", "retroreflectors of twice the constant exist"),
    ("oscillator", "phase_rad", "doubled", "an oscillator of twice the noise exists"),
    ("repeatability", "range_m", "doubled", "a ranger of twice the scatter exists"),
    ("repeatability", "set", "shifted", "a pointing may end a reading later; its scatter is what is sought"),
    ("prism-constant", "height_mm", "doubled", "a prism of twice the height exists"),
    ("ball-constant", "radius_mm", "doubled", "a ball of twice the size exists"),
    ("spacers", "spacer reads_mm", "shifted", "A, B, C in turn: names of spacers are nothing but names"),
    ("spacers", "reads_mm", "doubled", "spacers of twice the length exist"),
    ("invar-wire", "temperature_c", "negated doubled", "wires hang in frost and in heat; Invar hardly feels it"),
    ("alignment", "path_m", "negated doubled", "where a screen stands is known from this column alone"),
    ("alignment", "azimuth_counts", "shifted", "a full circle turned by a step is a full circle"),
    ("detector-focus", "position_mm", "negated doubled shifted", "the scale of the stage is known from it alone"),
    ("detector-focus", "amplitude_volt", "shifted", "equal steps: a run that begins a step later"),
    ("plate-levels", "orientation_deg", "negated shifted", "a mount that leans another way is as likely"),
    ("plate-levels", "reading_arcsec", "negated doubled", "a mount that leans otherwise is as likely"),
    ("monument-place", "point x_m y_m z_m", "negated doubled shifted constant exchanged", "one row: nothing checks it"),
    ("inclinometer", "temperature_c", "negated shifted doubled", "tables stand in the cold; zeros hardly feel it"),
    ("hydrostatic-level", "from to", "exchanged", "hills for valleys, and a constant of the other sign"),
)  # fmt: skip


def _maker(name):
    """A script of examples/calibrations as a module."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / "calibrations" / f"{name}.py")
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def write_laboratory(folder, seed, kinds=None):
    """KIND.csv and KIND.toml of each kind, or of those named, with noise of that seed."""
    length, monuments = _maker("make_examples"), _maker("make_monument_examples")
    for number, make in enumerate((*length.MAKERS, *monuments.MAKERS)):
        example = make(np.random.default_rng([seed, number]))
        if kinds is None or example.kind in kinds:
            length.write(example, folder)
    for kind in lab_scene.EXAMPLES:
        if kinds is None or kind in kinds:
            lab_scene.write_example(kind, folder, seed=[seed, sum(map(ord, kind))])


def table_of(folder, kind, stated=False):
    """Heading, rows and sheet of a table; the sheet without the scatter of readings unless it shall be stated."""
    head, *rows = list(csv.reader((folder / f"{kind}.csv").read_text(encoding="utf-8").splitlines()))
    sheet = (folder / f"{kind}.toml").read_text(encoding="utf-8")
    for key in () if stated else SCATTER_KEYS.get(kind, ()):
        sheet = re.sub(rf"^{key} *=.*\n", "", sheet, flags=re.MULTILINE)
    return head, rows[:2048], sheet  # of an oscillator's 8192 enough


def is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True


def spoiled(head, rows):
    """(column, way, rows) of each column in each way: words are not negated and not doubled."""
    columns = [list(column) for column in zip(*rows, strict=True)]
    numeric = [all(map(is_number, column)) for column in columns]
    for j, name in enumerate(head):
        column = columns[j]
        ways = {"shifted": column[-1:] + column[:-1], "constant": column[:1] * len(column)}
        if numeric[j]:
            ways["negated"] = [cell[1:] if cell.startswith("-") else f"-{cell}" for cell in column]
            ways["doubled"] = [repr(2.0 * float(cell)) for cell in column]
        for way, changed in ways.items():
            if changed != column:
                yield name, way, list(zip(*columns[:j], changed, *columns[j + 1 :], strict=True))
        other = j + 1 if j + 1 < len(head) else j - 1
        if len(head) > 1 and numeric[other] == numeric[j]:
            swapped = list(columns)
            swapped[j], swapped[other] = columns[other], columns[j]
            yield name, "exchanged", list(zip(*swapped, strict=True))


def calibrated(folder, kind, head, rows, sheet, *, reject=True):
    """The result, or None where it is refused."""
    path = folder / f"spoiled-{kind}.csv"
    with path.open("w", encoding="utf-8") as out:
        csv.writer(out, lineterminator="\n").writerows([head, *rows])
    path.with_suffix(".toml").write_text(sheet, encoding="utf-8")
    try:
        return calibrate(kind, path, reject=reject)
    except CatseyeError:
        return None


def is_wrong(honest, found):
    """Any quantity more than FAR u off, by the larger u, or with a u more than WIDE times the honest one."""
    before = dict(zip(honest.keys, zip(honest.values, honest.u, strict=True), strict=True))
    pairs = [(v, u, *before[k]) for k, v, u in zip(found.keys, found.values, found.u, strict=True) if k in before]
    return any(abs(v - v0) > FAR * max(u, u0) or u > WIDE * u0 for v, u, v0, u0 in pairs)


def unseen(kind, column, way):
    """Why no file can show it; "" where one can."""
    for name, columns, ways, why in UNSEEN:
        if kind == name and column in columns.split() and way in ways.split():
            return why
    return ""
