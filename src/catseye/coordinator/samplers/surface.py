"""Sampler SURFACE: shape of the dish of each epoch that saw enough of its prisms, computed beside the loop."""

import asyncio
from collections.abc import Callable

import numpy as np

from catseye.coordinator.journal.entries import Entry, EpochSolution
from catseye.coordinator.samplers.pose_rows import Row, number_word
from catseye.coordinator.samplers.rings import plain
from catseye.errors import CatseyeError
from catseye.ranger.line import stamp_text
from catseye.records.site.folder import SiteFolder
from catseye.reduction.surface.epoch_surface import dish_rows, epoch_surface

FEWEST = 12  # prisms: twice the parameters of a paraboloid


class SurfaceWatch:
    """Shapes of a site's dish, one at a time; an epoch that comes meanwhile is passed over.

    put   receives each row
    """

    def __init__(self, site: SiteFolder, put: Callable[[Row], None]):
        self._site, self._put = site, put
        self._task: asyncio.Task[None] | None = None

    def entry(self, entry: Entry) -> None:
        """Begin the shape of a solution, if it has enough prisms."""
        if not isinstance(entry, EpochSolution) or entry.covariance is None:
            return
        if self._task is not None and not self._task.done():
            return
        if len(dish_rows(entry.answer.get("names") or (), self._site)) >= FEWEST:
            self._task = asyncio.get_running_loop().create_task(self._shape(entry), name="surface")

    async def stop(self) -> None:
        """Leave what is being computed."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _shape(self, entry: EpochSolution) -> None:
        row = await asyncio.get_running_loop().run_in_executor(None, surface_row, entry, self._site)
        self._put(row)


def surface_row(entry: EpochSolution, site: SiteFolder) -> Row:
    """Row of the sampler for a solution; its text says why there is no shape."""
    answer = entry.answer
    names, covariance = answer["names"], np.asarray(entry.covariance)
    first = (stamp_text(entry.ticks), number_word(answer["number"]), str(len(dish_rows(names, site))))
    try:
        result = epoch_surface(
            names,
            np.array(answer["x"], dtype=float),
            covariance,
            site=site,
            posture=(answer["azimuth"], answer["elevation"]),
            source=f"epoch {answer['number']}",
        )
    except CatseyeError as problem:
        return (*first, *["none"] * 4, "failed", plain(str(problem)))
    fit = result.shapes[0].fit
    deviation, u = fit.deviation, np.diag(fit.deviation_covariance)
    roots = (np.sqrt(np.mean(deviation**2)), np.sqrt(np.mean(np.maximum(u, 0.0))))
    numbers = (*roots, fit.focal_length, fit.u_focal_length)
    return (*first, *(number_word(float(v)) for v in numbers), result.verdict.word, plain(result.verdict.why or "none"))
