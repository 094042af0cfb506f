"""`compare_scan`: measured amplitude or power by angle beside the theory of each kind of retroreflector."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.reading import place_of
from catseye.api.scans.tabled import TabledResult
from catseye.api.units import In, with_units
from catseye.constants import DEGREE
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from catseye.gateways.scans.files import Sources
    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.scans.angles import AngleComparison


@dataclass(frozen=True, eq=False, repr=False)
class AngleResult(TabledResult):
    """Returns of a retroreflector by angle, beside every kind's theory.

    kind         label of the judged kind
    values       (4,) return at normal incidence, background, in `unit`; incidence's and rotation's zero, rad
    covariance   (4, 4)
    unit         "V" or "mW"
    comparison   everything else: every kind's fit
    """

    COMMAND = "scan compare"
    kind: str
    values: np.ndarray
    covariance: np.ndarray
    unit: str
    comparison: "AngleComparison"

    def passages(self) -> "Sequence[Passage]":
        """Kind, its parameters, and the others."""
        from catseye.gateways.scans.angle_objects import comparison_passages

        return comparison_passages(self.comparison)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye scan compare --json`."""
        from catseye.gateways.scans.angle_objects import comparison_object

        return comparison_object(self.comparison)

    def _sources(self) -> "Sources":
        from catseye.gateways.scans.angle_objects import KINDS, RETURNS

        return {KINDS: self.comparison.fits, RETURNS: self.comparison}

    def figures(self) -> "dict[str, Figure]":
        """Returns by incidence and rotation."""
        from catseye.gateways.scans.angle_figures import angle_figure

        return {"angles": angle_figure(self.comparison)}


@with_units
def compare_scan(
    angles: "str | os.PathLike[str] | Sequence[str | os.PathLike[str]]",
    *,
    kind: str | None = None,
    noise: Annotated[Any, In("", one=True)] = 0.02,
    relative_percent: Annotated[Any, In("percent", one=True)] = 2.0,
    aperture_mm: Annotated[Any, In("mm", one=True)] = 25.4,
    height_mm: Annotated[Any, In("mm", one=True)] = 38.1,
    reflectance: Annotated[Any, In("", one=True)] = 0.97,
    polarization_deg: Annotated[Any, In("deg", one=True)] = None,
) -> AngleResult:
    """Measured amplitude or power by angle beside the theory of each kind of retroreflector.

    angles             ANGLES.csv of one retroreflector, or several
    kind               kind to judge: bare-prism, prism-with-silvered-faces, hollow-cube, ball; None: the likeliest
    noise              standard uncertainty of one reading without light, V or mW as in the table
    relative_percent   and of its size
    aperture_mm        radius of a corner's face
    height_mm          of a prism, face to corner
    reflectance        of each mirror, 0 to 1
    polarization_deg   of the light's field from the plane of incidence, counterclockwise as the ranger sees it; needed
                       with a column analyser_deg; None: theory of unpolarized light

    Raises InputError for an unusable file or an unknown kind, ArgumentError for invalid arguments, EstimationError for
    too few readings or none with light.

    >>> result = compare_scan(["scans/incidence.csv", "scans/rotation.csv"])
    >>> result.verdict.word, result.kind
    ('good', 'bare prism')
    >>> compare_scan("scans/analyser.csv", polarization_deg=30.0).kind
    'bare prism'
    """
    from catseye.records.laboratory.angle_table import read_angles
    from catseye.reduction.scans.angles import compare_angles, sizes_of

    for name, value in (("noise", noise), ("aperture_mm", aperture_mm), ("height_mm", height_mm)):
        if not 0.0 < value < np.inf:
            raise ArgumentError(f"{name} = {value:g} is not above 0", name)
    for name, value, most in (("relative_percent", relative_percent, 100.0), ("reflectance", reflectance, 1.0)):
        if not 0.0 <= value <= most:
            raise ArgumentError(f"{name} = {value:g} is not 0 to {most:g}", name)
    listed = [angles] if isinstance(angles, str | os.PathLike) else list(angles)
    if not listed:
        raise ArgumentError("angles has no file (expected one or more)", "angles")
    read = [place_of(item) for item in listed]
    readings, hashes = read_angles(read)
    sizes = sizes_of(aperture_mm=aperture_mm, height_mm=height_mm, reflectance=reflectance)
    if readings.analyser is not None and polarization_deg is None:
        raise ArgumentError("polarization_deg is missing: a table has a column analyser_deg", "polarization_deg")
    if polarization_deg is not None and not abs(polarization_deg) <= 180.0:
        raise ArgumentError(f"polarization_deg = {polarization_deg:g} is not -180 to 180", "polarization_deg")
    comparison = compare_angles(
        readings,
        sizes,
        noise=noise,
        relative=0.01 * relative_percent,
        kind=kind,
        polarization=None if polarization_deg is None else polarization_deg * DEGREE,
    )
    return AngleResult(
        verdict=comparison.verdict,
        kind=comparison.fit.kind,
        values=comparison.fit.values,
        covariance=comparison.fit.covariance,
        unit=readings.unit,
        comparison=comparison,
        hashes=hashes,
        read=tuple(read),
    )
