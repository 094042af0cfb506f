"""`stray`: range errors by light that goes another way, or back into the laser."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from catseye.api.result import Result, SinglePage, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.optics.stray import StrayLight

MICROMETRE = 1e-6
MARK = "catseye stray"  # in its figure


@dataclass(frozen=True, eq=False, repr=False)
class StrayResult(Result):
    """Stray light of a range.

    light   its causes, each as a curve over half a modulation wavelength
    """

    light: "StrayLight"

    def passages(self) -> "Sequence[Passage]":
        """Size of all together, and the share that the limit allows."""
        from catseye.gateways.writers.passage import Passage

        result = [
            Passage("together", f"{self.light.largest * 1e6:.3g} µm at most about their mean"),
            Passage("a single path", f"stays within the limit below {self.light.share:.2e} of the light"),
        ]
        if (size := self.light.feedback) is not None:
            text = f"feedback parameter {size.parameter:.3g}, up to {size.largest_phase * 1e3:.3g} mrad of phase"
            result.append(Passage("laser", text))
        return result

    def rows(self) -> Iterator[str]:
        """Causes as lines of text."""
        from catseye.gateways.optics.stray_figures import stray_rows

        yield from stray_rows(self.light)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye stray --json`."""
        from catseye.gateways.optics.stray_figures import stray_object

        return stray_object(self.light)

    def tables(self) -> "dict[str, QTable]":
        """Causes, and their curves over half a modulation wavelength."""
        effects = self.light.effects
        causes = {
            "cause": ([e.name for e in effects], ""),
            "at": ([e.at for e in effects], "m"),
            "largest": ([e.largest for e in effects], "m"),
            "mean": ([e.mean for e in effects], "m"),
        }
        causes |= {f"order_{k + 1}": ([float(e.orders[k]) for e in effects], "m") for k in range(4)}
        curves = {"moved": (self.light.moved, "m")}
        curves |= {f"cause_{k + 1}": (e.curve, "m") for k, e in enumerate(effects)}
        return {"causes": quantities(causes), "curves": quantities(curves)}

    def figures(self) -> "dict[str, Figure]":
        """Range error by each cause over half a modulation wavelength, under `stray`."""
        from catseye.gateways.optics.stray_figures import stray_figures

        return stray_figures(self.light)

    def pages(self) -> dict[str, SinglePage]:
        """`figure`, in the format of its name: .svg, .pdf or .png."""
        from catseye.gateways.writers.drawing import picture_file, refuse_picture, svg

        def text(now: datetime, path: Path) -> bytes:
            return picture_file(svg(self.figures()["stray"]), path, "out", mark=MARK)

        return {"figure": SinglePage(MARK, text, refuse=lambda now, path: refuse_picture(path, "out"))}


@with_units
def stray(
    distance: Annotated[Any, In("m", one=True)],
    *,
    path: Annotated[Any, In("")] = (),
    reflector: Annotated[Any, In("")] = (),
    second_pass: Annotated[Any, In("", one=True)] = 0.0,
    leakage: Annotated[Any, In("", one=True)] = 0.0,
    gain: Annotated[Any, In("", one=True)] = 0.0,
    skew_mrad: Annotated[Any, In("mrad", one=True)] = 0.0,
    feedback: Annotated[Any, In("", one=True)] = None,
    coherence: Annotated[Any, In("", one=True)] = 1.0,
    regulation_rad: Annotated[Any, In("rad", one=True)] = 0.0,
    facet: Annotated[Any, In("", one=True)] = 0.32,
    enhancement: Annotated[Any, In("", one=True)] = 5.0,
    laser_path_mm: Annotated[Any, In("mm", one=True)] = 1.0,
    shots: Annotated[Any, In("", whole=True)] = 1,
    movement_um: Annotated[Any, In("um", one=True)] = 0.0,
    wavelength_um: Annotated[Any, In("um", one=True)] = 0.780,
    modulation_hz: Annotated[Any, In("Hz", one=True)] = 1.5e9,
    group_index: Annotated[Any, In("", one=True)] = 1.00026,
    limit_um: Annotated[Any, In("um", one=True)] = 10.0,
) -> StrayResult:
    """Range errors by light that goes another way, or back into the laser.

    distance         ranger to target, m
    path             share of the light and full detour, mm, of paths that move with the target
    reflector        share of the light and separation beyond the target, mm, of further retroreflectors
    second_pass      share of the light that the detector sends out and the target returns once more
    leakage          amplitude over the light's, of what never left the head
    gain, skew_mrad  of the sine channel over the cosine channel, less 1; departure from quadrature
    feedback         power that returns into the laser's mode over the emitted; None: none
    coherence        0 to 1: contrast that linewidth, chirp and speckle leave
    regulation_rad   phase for each unit of relative power, by the regulation of the power
    facet, enhancement, laser_path_mm   reflectance of the laser's facet, linewidth enhancement, its optical path
    shots            averaged
    movement_um      standard deviation of the path's change from shot to shot
    wavelength_um    of the light in air
    modulation_hz, group_index   of the modulation; of the air
    limit_um         range error allowed, 1 to 20 000

    Raises ArgumentError without any cause, or for a limit outside; ValidityError for shares that are none.

    >>> round(stray(100.0, leakage=0.001).light.largest * 1e6, 1)
    15.9
    """
    from catseye.atmosphere.index.wavelength import modulation_wavelength
    from catseye.reduction.optics.stray import LaserFeedback, StrayCauses, stray_light

    laser = None
    if feedback is not None:
        laser = LaserFeedback(
            returned=feedback,
            coherence=coherence,
            regulation=regulation_rad,
            laser_path=laser_path_mm * MILLIMETRE,
            facet=facet,
            enhancement=enhancement,
            optical_wavelength=wavelength_um * MICROMETRE,
            shots=shots,
            movement=movement_um * MICROMETRE,
        )
    causes = StrayCauses(
        paths=[(share, excess * MILLIMETRE) for share, excess in path],
        reflectors=[(share, separation * MILLIMETRE) for share, separation in reflector],
        second_pass=second_pass,
        leakage=leakage,
        gain=gain,
        skew=1e-3 * skew_mrad,
        feedback=laser,
    )
    wavelength = float(modulation_wavelength(modulation_hz, group_index))
    light = stray_light(distance, causes, wavelength=wavelength, limit=limit_um * MICROMETRE)
    return StrayResult(light.verdict, light)
