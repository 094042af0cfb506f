"""Keep-out boxes as solids: no beam passes one, and no ranger stands in one."""

from catseye.constants import DEGREE, MILLIMETRE
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.solids import BoxRecord, Solids


def with_keep_out(solids: Solids, keep_out: KeepOut) -> Solids:
    """Solids with the boxes of a keep-out file, for beams of any length.

    >>> from catseye.records.site.keep_out import KeepOutBox
    >>> box = KeepOutBox(name="hut", why="windows", centre_mm=(0.0, 0.0, 0.0), size_mm=(4e3, 3e3, 2e3))
    >>> with_keep_out(Solids(), KeepOut(box=(box,))).box[0].size_mm
    (4000.0, 3000.0, 2000.0)
    """
    boxes = []
    for zone in keep_out.boxes():
        x, y, z = zone.centre / MILLIMETRE
        length, width, height = zone.size / MILLIMETRE
        boxes.append(
            BoxRecord(
                name=f"keep-out {zone.name}"[:60],
                frame="ground",
                centre_mm=(float(x), float(y), float(z)),
                size_mm=(float(length), float(width), float(height)),
                turn_deg=float(zone.turn / DEGREE),
            )
        )
    return solids.model_copy(update={"box": (*solids.box, *boxes)})
