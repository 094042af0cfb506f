"""Structural model as JSON and text: displacements of points, beam."""

from typing import Any

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.gateways.writers.passage import Passage
from catseye.reduction.structure.beam import BeamOffset
from catseye.reduction.structure.displacement import ModelDisplacements

MOST_ROWS = 60  # points that a terminal lists


def displacement_object(displaced: ModelDisplacements, beam: BeamOffset | None) -> dict[str, Any]:
    """Object that `catseye model displace --json` prints."""
    a, e = (np.asarray(v, dtype=float) / DEGREE for v in (displaced.posture.azimuth, displaced.posture.elevation))
    return {
        "verdict": displaced.verdict.to_object(),
        "model": displaced.antenna.record.title,
        "postures": [
            {
                "azimuth_deg": float(a[k]),
                "elevation_deg": float(e[k]),
                "temperature_c": float(np.asarray(displaced.posture.temperature_c)[k]),
                "points": {
                    point.name: {
                        "kind": point.kind,
                        "frame": point.frame,
                        "rigid": displaced.rigid[k, i],
                        "displacement": displaced.ground[k, i],
                        "covariance": displaced.covariance[k, i],
                        "body_displacement": displaced.body[k, i],
                        "body_covariance": displaced.body_covariance[k, i],
                    }
                    for i, point in enumerate(displaced.points)
                },
                "beam": None if beam is None else _beam(beam, k),
            }
            for k in range(len(a))
        ],
        "notes": list(displaced.notes),
    }


def _beam(beam: BeamOffset, k: int) -> dict[str, Any]:
    return {
        "azimuth_cos_e": beam.offset[k, 0],
        "elevation": beam.offset[k, 1],
        "focus": beam.offset[k, 2],
        "covariance": beam.covariance[k],
    }


def displacement_passages(displaced: ModelDisplacements, beam: BeamOffset | None) -> list[Passage]:
    """Passages on the model, the largest displacement of each frame, the beam, notes."""
    record = displaced.antenna.record
    passages = [Passage("Model", f"{record.title}; {len(displaced.points)} points in {len(displaced.rigid)} postures")]
    length = np.linalg.norm(displaced.ground, axis=2)
    k, i = divmod(int(np.argmax(length)), length.shape[1])
    u = float(np.sqrt(np.trace(displaced.covariance[k, i])))
    at = f"azimuth {_deg(displaced.posture.azimuth, k)}, elevation {_deg(displaced.posture.elevation, k)}"
    text = f"{displaced.names[i]} by {length[k, i] / MILLIMETRE:.2f} mm (u {u / MILLIMETRE:.2f} mm) at {at}"
    passages.append(Passage("Moves most", text))
    for n in range(0 if beam is None else len(displaced.rigid)):
        assert beam is not None
        az, el, focus = beam.offset[n] / [ARCSECOND, ARCSECOND, MILLIMETRE]
        u_az, u_el, u_focus = np.sqrt(np.diag(beam.covariance[n])) / [ARCSECOND, ARCSECOND, MILLIMETRE]
        text = (
            f"at azimuth {_deg(displaced.posture.azimuth, n)}, elevation {_deg(displaced.posture.elevation, n)} off by "
            f'{az:+.2f}" (u {u_az:.2f}") in azimuth times cos E, {el:+.2f}" (u {u_el:.2f}") in elevation; focus '
            f"{focus:+.2f} mm (u {u_focus:.2f} mm)"
        )
        passages.append(Passage("Beam" if n == 0 else "", text))
    return passages + [Passage("Note", note) for note in displaced.notes]


def _deg(angle: Any, k: int) -> str:
    return f"{np.asarray(angle, dtype=float)[k] / DEGREE:.1f}°"


def displacement_lines(displaced: ModelDisplacements) -> list[str]:
    """Lines of a terminal: displacement of each point with u, ground axes and the frame's."""
    lines = []
    for k in range(len(displaced.rigid)):
        warm = float(np.asarray(displaced.posture.temperature_c)[k])
        lines += [
            "",
            f"azimuth {_deg(displaced.posture.azimuth, k)}, elevation {_deg(displaced.posture.elevation, k)}, "
            f"{warm:.1f} °C",
            f"{'point':<12}{'frame':<14}{'ground x, y, z, mm':^27}{'u':^21}   {'frame x, y, z, mm':^27}",
        ]
        for i, point in enumerate(displaced.points[:MOST_ROWS]):
            ground, body = (
                " ".join(f"{v:8.3f}" for v in d[k, i] / MILLIMETRE) for d in (displaced.ground, displaced.body)
            )
            u = " ".join(f"{v:6.3f}" for v in np.sqrt(np.diag(displaced.covariance[k, i])) / MILLIMETRE)
            lines.append(f"{point.name:<12}{point.frame:<14}{ground} {u}   {body}")
        if len(displaced.points) > MOST_ROWS:
            lines.append(f"... and {len(displaced.points) - MOST_ROWS} more: --json, or --out")
    return lines
