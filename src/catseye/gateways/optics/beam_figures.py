"""Beam train as figure, text, JSON and files; coatings as curves."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from catseye.aliases import Progress
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.errors import ValidityError
from catseye.gateways.optics.tables import PLACES, RETURNED
from catseye.gateways.writers.drawing import BAD, FAINT, INK, SERIES, STYLE, Figure, Svg, mpl, svg
from catseye.gateways.writers.objects import json_page
from catseye.gateways.writers.written import Files, origin, write_files
from catseye.optics import coating
from catseye.reduction.optics.beam import BeamPath, beam_profile, read_beam
from catseye.reduction.optics.receiving import ReceivingOptics

FORMAT = "catseye-beam-1"
DRAWN = ("gold", "silver", "aluminium", "protected-aluminium", "dielectric")
ANGLES = np.arange(0.0, 80.5, 0.5)  # degrees
BAND_UM = (0.65, 0.95)
STYLES = ("-", (0, (3, 2)))  # of x and y, which may be alike
APART = 0.04  # of a panel's width: nearer names share a line
WIDTHS = (10, 17, 19, 9, 9, 9)
POLARIZATIONS: tuple[coating.Polarization, ...] = ("s", "p")


def beam_figure(beam_path: BeamPath) -> Svg:
    """SVG text: beam radii along the path, and returned power by distance.

    beam_path   a reduced beam train
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=(12.0, 6.6))  # fixed margins: automatic ones are not reproducible to the last digit
        edges = {"left": 0.06, "right": 0.985, "bottom": 0.08, "top": 0.95, "hspace": 0.38, "wspace": 0.2}
        grid = figure.add_gridspec(2, 3, width_ratios=[1.0, 1.5, 1.0], **edges)
        profile = beam_profile(beam_path.train)
        distances, radii = profile["outward"]
        outward = figure.add_subplot(grid[0, 0])
        _leg(outward, beam_path, "outward", (distances / MILLIMETRE, radii))
        outward.set(title="Laser to mirror", xlabel="from the laser (mm)", ylabel="radius at 1/e² (mm)")
        _range(figure.add_subplot(grid[0, 1]), beam_path, profile)
        distances, radii = profile["inward"]
        inward = figure.add_subplot(grid[0, 2])
        _leg(inward, beam_path, "inward", ((distances - distances[0]) / MILLIMETRE, radii), distances[0])
        inward.set(title="Mirror to detector", xlabel="from the first inward element (mm)")
        _power(figure.add_subplot(grid[1, :]), beam_path)
        return svg(figure)


def _leg(ax, beam_path: BeamPath, leg: str, profile: tuple, start: float = 0.0) -> None:
    """Radii in both planes, apertures and names of the elements, within a head."""
    distances, radii = profile
    for k, style in enumerate(STYLES):
        ax.plot(distances, radii[:, k] / MILLIMETRE, color=SERIES[k], lw=1.6, ls=style)
    stops = [place for place in beam_path.places if place.leg == leg and np.isfinite(place.aperture)]
    top = 1.15 * max([float(np.max(radii)), *(place.aperture for place in stops)]) / MILLIMETRE
    for place in stops:
        at, edge = (place.way - start) / MILLIMETRE, place.aperture / MILLIMETRE
        ax.plot([at, at], [edge, top], color=INK, lw=2.2, solid_capstyle="butt")
    ax.set_ylim(0.0, top)
    ax.margins(x=0.09)
    for at, name in _names(beam_path, leg, start, apart=APART * float(np.ptp(distances))).items():
        ax.axvline(at, color=FAINT, lw=0.5)
        text = {"rotation": 90.0, "fontsize": 6.5, "color": INK, "va": "top", "ha": "right"}
        ax.annotate(name, (at, 0.98 * top), xytext=(-2.0, 0.0), textcoords="offset points", **text)


def _names(beam_path: BeamPath, leg: str, start: float, *, apart: float) -> dict[float, str]:
    """Names of a leg's elements, and of the detector, by place, mm; those nearer than `apart` share a line."""
    names: dict[float, str] = {}
    for place in beam_path.places:
        if place.leg == leg or (leg == "inward" and place.leg == "detector"):
            at = (place.way - start) / MILLIMETRE
            near = [other for other in names if abs(other - at) < apart]
            if near:
                names[near[0]] += f" | {place.name}"
            else:
                names[at] = place.name
    return names


def _range(ax, beam_path: BeamPath, profile: dict) -> None:
    clipped = next(place for place in beam_path.places if place.leg == "reflector")
    for leg in ("range", "back"):
        distances, radii = profile[leg]
        along = distances - profile["range"][0][0]
        for k, axis in enumerate("xy"):
            label = axis if leg == "range" else None
            ax.plot(along, radii[:, k] / MILLIMETRE, color=SERIES[k], ls=STYLES[k], lw=1.6, label=label)
    at, edge = beam_path.train.distance_m, clipped.aperture / MILLIMETRE
    ax.axvline(at, color=FAINT, lw=0.7)
    ax.plot([at, at], [edge, 10.0 * edge], color=INK, lw=2.2, solid_capstyle="butt")
    colour = BAD if clipped.clipped > 0.01 else INK
    missed = f"{100 * clipped.clipped:.2g} %" if clipped.clipped > 1e-7 else "nothing"
    text = f"{clipped.name}  \n{missed} misses it  "
    ax.text(at, 1.05 * edge, text, fontsize=7.5, color=colour, va="bottom", ha="right")
    ax.set_ylim(0.0, 1.25 * max(edge, float(max(np.max(profile[leg][1]) for leg in ("range", "back"))) / MILLIMETRE))
    ax.set(title="To the reflector and back, unclipped", xlabel="path from the mirror (m)")
    ax.legend(loc="upper right", ncols=1)


def _power(ax, beam_path: BeamPath) -> None:
    good = [row for row in beam_path.returned if row.status == "ok"]
    ax.plot([r.distance for r in good], [100.0 * r.hit for r in good], "o-", ms=4, color=SERIES[2], label="hits it")
    collected = [100.0 * r.hit * r.collected for r in good]
    ax.plot([r.distance for r in good], collected, "s-", ms=4, color=SERIES[0], label="on the detector")
    for row in beam_path.returned:
        if row.status != "ok":
            ax.axvline(row.distance, color=BAD, lw=1.0, ls=":")
    ax.set(title="Share of the beam", xlabel="distance to the reflector (m)", ylabel="share (%)")
    ax.set_ylim(max(0.0, min(90.0, 1.1 * min(collected, default=0.0) - 10.0)), 101.0)
    ax.legend(loc="lower left")


def coating_figure(names: Sequence[str] = DRAWN, wavelength_um: float = 0.780, incidence: float = 0.0) -> Svg:
    """SVG text: reflectance by angle and wavelength, and the range error of a mirror by angle.

    names           of `coating.named`
    wavelength_um   design wavelength, um
    incidence       design incidence and that of the middle panel, rad
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        figure = Figure(figsize=(12.6, 4.6))
        edges = {"left": 0.055, "right": 0.985, "bottom": 0.2, "top": 0.92, "wspace": 0.22}
        by_angle, by_wavelength, path = figure.subplots(1, 3, gridspec_kw=edges)
        light = np.linspace(*BAND_UM, 601)
        for colour, name in zip(SERIES, names, strict=False):
            layers = coating.named(name, wavelength_um, incidence)
            for polarization, style in zip(POLARIZATIONS, ("-", (0, (3, 1.5))), strict=True):
                drawn = {"color": colour, "ls": style, "lw": 1.4}
                labelled = {**drawn, "label": name} if polarization == "s" else drawn
                across = coating.response(layers, wavelength_um, ANGLES * DEGREE, polarization=polarization)
                by_angle.plot(ANGLES, 100.0 * across.reflectance, **labelled)
                along = coating.response(layers, light, incidence, polarization=polarization)
                by_wavelength.plot(light * 1e3, 100.0 * along.reflectance, **drawn)
                added = coating.group_path(layers, wavelength_um, ANGLES * DEGREE, polarization=polarization)
                path.plot(ANGLES, np.where(across.reflectance > 0.5, 1e6 * added, np.nan), **drawn)
        by_angle.set(title=f"At {wavelength_um * 1e3:g} nm", xlabel="incidence (°)", ylabel="reflectance (%)")
        at = f"At {incidence / DEGREE:g}°, by wavelength"
        by_wavelength.set(title=at, xlabel="wavelength (nm)", ylabel="reflectance (%)")
        path.set(title="Increase of the range", xlabel="incidence (°)", ylabel="range (µm)", ylim=(-0.2, 2.6))
        for ax in (by_angle, by_wavelength):
            ax.set_ylim(-2.0, 102.0)
        figure.legend(*by_angle.get_legend_handles_labels(), loc="lower center", ncols=len(names))
        by_angle.text(0.03, 0.05, "full: s, dashed: p", transform=by_angle.transAxes, fontsize=8, color=FAINT)
        return svg(figure)


def beam_plot(file: Path) -> tuple[Svg, dict[str, Any]]:
    """Figure of a beam train as SVG text, with numbers.

    file   the record
    """
    beam_path = read_beam(file)[0]
    return beam_figure(beam_path), {"name": beam_path.train.name, "power_on_detector": beam_path.places[-1].power}


def coating_plot(
    names: Sequence[str] = DRAWN, wavelength_um: float = 0.780, incidence: float = 0.0
) -> tuple[Svg, dict[str, Any]]:
    """Coating curves as SVG text, with reflectance and range at the design angle.

    names           of `coating.named`, at most 6; an unknown one raises ValidityError
    wavelength_um   um
    incidence       rad
    """
    if len(names) > len(SERIES):
        raise ValidityError(f"{len(names)} coatings for one figure (expected at most {len(SERIES)})")
    summary: dict[str, Any] = {"wavelength_um": wavelength_um, "incidence": incidence}
    for name in names:
        layers = coating.named(name, wavelength_um, incidence)
        for polarization in POLARIZATIONS:
            how = f"{name}_{polarization}".replace("-", "_")
            response = coating.response(layers, wavelength_um, incidence, polarization=polarization)
            added = coating.group_path(layers, wavelength_um, incidence, polarization=polarization)
            summary[f"{how}_reflectance"], summary[f"{how}_range"] = float(response.reflectance), float(added)
    return coating_figure(names, wavelength_um, incidence), summary


def beam_object(beam_path: BeamPath) -> dict[str, Any]:
    """Object of a beam train, SI units.

    beam_path   a reduced beam train
    """
    keys = ("leg", "name", "way", "radius", "curvature", "aperture", "clipped", "power")
    rows = ("distance", "radius", "hit", "collected", "power", "status")
    return {
        "verdict": beam_path.verdict.to_object(),
        "name": beam_path.train.name,
        "distance": beam_path.train.distance_m,
        "status": beam_path.status,
        "places": [{key: getattr(place, key) for key in keys} for place in beam_path.places],
        "returned": [{key: getattr(row, key) for key in rows} for row in beam_path.returned],
        "smallest": {"waist": beam_path.smallest_waist[0], "radius": beam_path.smallest_waist[1]},
        "range_effects": beam_path.range_effects,
        "u_image": beam_path.u_image,
        "detector_lag": beam_path.detector_lag,
        "receiving": {
            "focal_length": beam_path.receiving.focal_length,
            "defocus": beam_path.receiving.defocus,
            "traced": None if beam_path.receiving.traced is None else asdict(beam_path.receiving.traced),
        },
        "laser": beam_path.laser,
    }


def lines(beam_path: BeamPath) -> Iterator[str]:
    """Tables as lines of text.

    beam_path   a reduced beam train
    """
    yield f"{beam_path.train.name}, reflector at {beam_path.train.distance_m:g} m"
    columns = (
        ("way", "radius x, y", "front R x, y", "aperture", "clipped", "power"),
        ("m", "mm", "m", "mm", "%", "mW"),
    )
    for words in columns:
        yield " " * 34 + " ".join(f"{word:>{width}}" for word, width in zip(words, WIDTHS, strict=True))
    for place in beam_path.places:
        size = " ".join(f"{_cell(r / MILLIMETRE, '8.4f'):>8}" for r in place.radius)
        front = " ".join(f"{_front(c):>9}" for c in place.curvature)
        edge, clipped = _cell(place.aperture / MILLIMETRE, ".2f"), _cell(100.0 * place.clipped, ".3g")
        power = _cell(place.power * 1e3, ".4f")
        yield f"{place.leg:<9} {place.name:<24.24} {place.way:9.3f} {size} {front} {edge:>9} {clipped:>9} {power:>9}"
    if beam_path.status != "ok":
        yield f"unknown after the reflector: {beam_path.status}"
    yield f"{'distance, m':<12} {'radius x, y, mm':>17} {'hits, %':>10} {'collected, %':>13} {'detector, mW':>13}"
    for row in beam_path.returned:
        size = " ".join(f"{r / MILLIMETRE:8.3f}" for r in row.radius)
        got = f"{100 * row.collected:13.4f} {row.power * 1e3:13.5f}" if row.status == "ok" else f"  {row.status}"
        yield f"{row.distance:<12g} {size:>17} {100 * row.hit:10.4f} {got}"
    waist, spot = (1e3 * v for v in beam_path.smallest_waist)
    yield f"smallest possible spot there: {spot:.3f} mm, from a waist of {waist:.3f} mm at the head"
    yield from _image(beam_path.receiving)
    for name, effect in beam_path.range_effects.items():
        yield f"range too long by {_cell(effect * 1e6, '.3f') or 'an unknown number of'} µm: {name}"
    if np.isfinite(beam_path.u_image):
        yield f"u of the range from the image's place: {beam_path.u_image * 1e6:.3f} µm"
        yield f"centre of the detector behind its rim: {beam_path.detector_lag * 1e3:.2f} mrad"
    for name, value in beam_path.laser.items():
        yield f"{name.replace('_', ' ')}: {f'{value * 1e6:.3f} µm' if name.startswith('range') else f'{value:.4g}'}"


def _image(receiving: ReceivingOptics) -> Iterator[str]:
    """Focal length, defocus and the image by exact rays."""
    for name, pair in (
        ("focal length of the receiving optics", receiving.focal_length),
        ("detector behind the waist of the image", receiving.defocus),
    ):
        sizes = list(dict.fromkeys(_cell(v / MILLIMETRE, ".3f") for v in pair if np.isfinite(v)))
        if sizes:
            yield f"{name}: {' x '.join(sizes)} mm"
    shift = float(np.mean(receiving.focal_length)) * ARCSECOND * 1e6
    if np.isfinite(shift):
        yield f"light 1 arcsec off the axis moves the image by {shift:.2f} µm"
    if receiving.traced is not None:
        image = receiving.traced
        yield (
            f"image by exact rays: rms radius {image.radius * 1e6:.2f} µm, {100.0 * image.share:.3f} % of the light on "
            "the detector"
        )


def write_beam(beam_path: BeamPath, directory: Path, inputs: dict[str, str], progress: Progress | None = None) -> None:
    """Write tables, figure, JSON, and the provenance with their hashes.

    beam_path   a reduced beam train
    directory   existing, from `writers.output.atomic_directory`
    inputs      hashes of the input files
    progress    called for each file
    """
    files: Files = {
        "beam.csv": lambda: PLACES.csv(beam_path.places),
        "returned.csv": lambda: RETURNED.csv(beam_path.returned),
        "beam.json": lambda: json_page(beam_object(beam_path)),
        "beam.svg": lambda: beam_figure(beam_path),
    }
    provenance = {"format": FORMAT, "made_by": "catseye beam", "settings": {"distance_m": beam_path.train.distance_m}}
    write_files(files, directory, {**provenance, **origin(datetime.now(UTC), inputs)}, progress=progress)


def _cell(value: float, form: str) -> str:
    return format(float(value), form) if np.isfinite(value) else ""


def _front(curvature: float) -> str:
    """Radius of a wavefront in metres; "flat" beyond 10 000 kilometres."""
    if not np.isfinite(curvature):
        return ""
    return "flat" if abs(curvature) < 1e-7 else f"{1.0 / curvature:.5g}"
