"""Texts, lines and JSON of triplets in use: reduced ranges, local net, bounds, aim."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from catseye.gateways.writers.objects import plain
from catseye.reduction.triplet.aiming import AimedMounts
from catseye.reduction.triplet.bounds import TripletBounds
from catseye.reduction.triplet.hollow import HollowRange
from catseye.reduction.triplet.local_net import LocalNet
from catseye.reduction.triplet.reduced_ranges import ReducedTriplets

MM, UM = 1e3, 1e6
Words = list[tuple[str, str]]
LISTED = 12  # rows of pairs that the command prints


def reduced_words(result: ReducedTriplets) -> Words:
    """Title and text of each paragraph on reduced ranges."""
    balls, n, k = result.balls, len(result.site.units), len(result.site.rangers)
    glass = np.nanmax(np.abs(balls.obliquity)[result.ranged]) * UM
    series = np.nanmax(np.abs(result.series - balls.d_mp)) * UM
    first = np.nanmax(np.abs(balls.d_bc_memo - balls.d_bc)) * 1e9
    words = [
        ("Pairs", f"{result.count} of {n} triplets and {k} rangers of the feed arm"),
        ("Incidence", f"up to {np.degrees(np.nanmax(result.incidence)):.2f} deg on a prism, dPc up to {glass:.3f} µm"),
        (
            "Memo",
            f"the series of figure 10 differs from the exact median by up to {series:.2f} µm, (e · n) H_corr to first "
            f"order by {first:.3g} nm",
        ),
    ]
    if result.table is not None:
        u = result.u_d_bc * UM
        off = np.nanmax(np.abs(balls.d_bc - result.by_places)) * MM
        words.append(("Distances", f"to the balls, u {np.nanmin(u):.1f} to {np.nanmax(u):.1f} µm"))
        words.append(("Places", f"of the records differ from these distances by up to {off:.1f} mm"))
        if result.sorted is not None and result.sorted.ignored:
            words.append(("Not used", f"{result.sorted.ignored} ranges to other targets or from other rangers"))
    return words


def reduced_rows(result: ReducedTriplets) -> Iterator[dict[str, Any]]:
    """Rows of the pairs, SI: names, ranges, incidences, corrections and distances."""
    balls = result.balls
    for i, unit in enumerate(result.site.units):
        for k, ranger in enumerate(result.site.rangers):
            yield {
                "triplet": unit.name,
                "ranger": ranger,
                "range_left": result.to_prisms[i, k, 0],
                "range_right": result.to_prisms[i, k, 1],
                "incidence_left": balls.incidence[i, k, 0],
                "incidence_right": balls.incidence[i, k, 1],
                "dPc_left": balls.obliquity[i, k, 0],
                "dPc_right": balls.obliquity[i, k, 1],
                "d_mp": balls.d_mp[i, k],
                "d_mp_series": result.series[i, k],
                "d_bc": balls.d_bc[i, k],
                "d_bc_memo": balls.d_bc_memo[i, k],
                "u_d_bc": result.u_d_bc[i, k],
                "d_bc_by_places": result.by_places[i, k],
            }


def reduced_lines(result: ReducedTriplets) -> Iterator[str]:
    """Lines of the first pairs for people."""
    yield f"{'triplet':10s}{'ranger':9s}{'D_MP (m)':>13s}{'D_BC (m)':>13s}{'u (µm)':>8s}{'incidence (deg)':>17s}"
    rows = [row for row, ranged in zip(reduced_rows(result), result.ranged.ravel(), strict=True) if ranged]
    for row in rows[:LISTED]:
        angle = f"{np.degrees(row['incidence_left']):.2f} {np.degrees(row['incidence_right']):.2f}"
        numbers = f"{row['d_mp']:13.7f}{row['d_bc']:13.7f}{row['u_d_bc'] * UM:8.1f}{angle:>17s}"
        yield f"{row['triplet']:10s}{row['ranger']:9s}{numbers}"
    if len(rows) > LISTED:
        yield f"and {len(rows) - LISTED} more: --json, or --out DIR"


def reduced_object(result: ReducedTriplets) -> dict[str, Any]:
    """JSON object of `catseye triplets reduce --json`."""
    units = {
        unit.name: {
            "left_prism": unit.prisms[0],
            "right_prism": unit.prisms[1],
            "mid_point": unit.prisms.mean(axis=0),
            **{key: getattr(unit, key) for key in ("ball", "normal", "axis", "h_corr", "d_12")},
        }
        for unit in result.site.units
    }
    return plain(
        {
            "verdict": result.verdict.to_object(),
            "frame": "reflector",
            "measured": result.table is not None,
            "triplets": units,
            "rangers": dict(zip(result.site.rangers, result.site.scan, strict=True)),
            "pairs": list(reduced_rows(result)),
            "covariance_d_bc": result.balls.covariance,
        }
    )


def net_words(net: LocalNet) -> Words:
    """Title and text of each paragraph on a local net."""
    factor, degrees = net.solution.variance_factor()
    k, n = len(net.site.rangers), len(net.site.units)
    u = net.u * UM
    balls = k + 3 * np.arange(n) + 2
    among = len(net.sorted.pairs)
    words = [
        ("Net", f"{len(net.observations)} ranges: {len(net.observations) - among} to prisms, {among} between rangers"),
        ("Fit", f"variance factor {factor:.3f} of {degrees:.1f} degrees of freedom"),
        ("Scan points", f"u {u[:k].min():.0f} to {u[:k].max():.0f} µm a coordinate, in the net's shape"),
        ("Balls", f"u {u[balls].min():.0f} to {u[balls].max():.0f} µm a coordinate, computed from prisms and H_corr"),
        ("Distances", f"scan points to balls, u {net.u_d_bc.min() * UM:.1f} to {net.u_d_bc.max() * UM:.1f} µm"),
        (
            "Zeros",
            ", ".join(f"{name} {z * UM:+.0f}" for name, z in zip(net.site.rangers, net.zeros, strict=True)) + " µm",
        ),
        ("Places", f"of the records are up to {net.moved.max() * MM:.1f} mm away"),
    ]
    for row in net.suspects:
        suspect = net.observations[row]
        words.append(
            ("Suspect", f"{suspect.ranger} to {suspect.target}: {suspect.residual * MM:+.3f} mm, w {suspect.w:+.1f}")
        )
    if net.sorted.ignored:
        words.append(("Not used", f"{net.sorted.ignored} ranges to other targets or from other rangers"))
    return words


def net_lines(net: LocalNet) -> Iterator[str]:
    """Lines of rangers and balls for people."""
    yield f"{'point':10s}{'x (m)':>13s}{'y (m)':>13s}{'z (m)':>13s}   {'u of x, y, z (µm)'}"
    k = len(net.site.rangers)
    for row, name in enumerate(net.points):
        if row < k or (row - k) % 3 == 2:
            u = net.u[row] * UM
            places = "".join(f"{value:13.6f}" for value in net.x[row])
            yield f"{name:10s}{places}   {u[0]:.0f}, {u[1]:.0f}, {u[2]:.0f}"


def net_object(net: LocalNet) -> dict[str, Any]:
    """JSON object of `catseye triplets adjust --json`."""
    factor, degrees = net.solution.variance_factor()
    blocks = net.covariance.reshape(len(net.points), 3, len(net.points), 3)
    points = {
        name: {**dict(zip("xyz", net.x[row], strict=True)), "covariance": blocks[row, :, row]}
        for row, name in enumerate(net.points)
    }
    names = [[unit.name, ranger] for unit in net.site.units for ranger in net.site.rangers]
    return plain(
        {
            "verdict": net.verdict.to_object(),
            "frame": "reflector",
            "datum": "typed places; the covariance is free of shifts and turns of the whole",
            "points": points,
            "covariance_order": list(net.points),
            "covariance": net.covariance,
            "zeros": dict(zip(net.site.rangers, net.zeros, strict=True)),
            "u_zeros": dict(zip(net.site.rangers, net.u_zeros, strict=True)),
            "d_bc_order": names,
            "d_bc": net.d_bc.ravel(),
            "u_d_bc": net.u_d_bc.ravel(),
            "covariance_d_bc": net.covariance_d_bc,
            "observations": [vars(row) for row in net.observations],
            "suspects": list(net.suspects),
            "critical_w": net.critical,
            "variance_factor": factor,
            "degrees_of_freedom": degrees,
        }
    )


def bounds_words(result: TripletBounds) -> Words:
    """Title and text of each paragraph on bounds."""
    d, w = result.dimensions, result.weather
    departures = f"{d.spacing * MM:g} mm in that, {d.along * MM:g} mm of the ball along, {d.across * MM:g} mm across"
    place = f"{d.aside * MM:g} mm along and {d.height * MM:g} mm up from the mid-point"
    air = f"{w.temperature_c:+g} °C, {w.pressure_hpa:+g} hPa, {w.humidity_percent:+g} %"
    printed = f"{result.memo_change * UM:+.3f}e-6 with D.4 as printed"
    prism, ball = f"{result.prism * UM:+.2f} µm", f"{result.ball * UM:+.2f} µm"
    return [
        ("Unit", f"prisms {d.d_12 * MM:g} mm apart; departures {departures}"),
        ("Scan point", f"{d.distance:g} m from the prisms' line, {place}"),
        (
            "Air",
            f"{air}: index {result.change * UM:+.3f}e-6 by D.5 ({printed}), {result.exact_change * UM:+.3f}e-6 by the "
            "formula",
        ),
        (
            "Glass",
            f"n changes by {result.ratio * UM:+.2f}e-6: with the tabulated P_c a prism is ranged {prism} too long, the "
            f"ball {ball}",
        ),
    ]


def bounds_lines(result: TripletBounds) -> Iterator[str]:
    """Lines of the three cases, and of every cause at its tolerance, for people."""
    yield f"{'appendix A':34s}{'exact (µm)':>12s}{'memo (µm)':>12s}{'bound (µm)':>12s}"
    for case in result.cases:
        memo = "" if np.isnan(case.memo) else f"{case.memo * UM:.4f}"
        yield f"{case.case:34s}{case.exact * UM:12.4f}{memo:>12s}{case.bound * UM:12.4f}  {case.equation}"
    yield ""
    yield f"{'largest effect of each cause':42s}{'size':>9s}{'H_corr':>9s}{'use':>9s}{'tie':>9s}  µm"
    for row in result.causes:
        numbers = "".join(f"{v * UM:9.2f}" for v in (row.calibration, row.use, row.tie))
        yield f"{row.cause:42s}{row.size:>9s}{numbers}"


def bounds_object(result: TripletBounds) -> dict[str, Any]:
    """JSON object of `catseye triplets bound --json`."""
    return plain(
        {
            "verdict": result.verdict.to_object(),
            "dimensions": vars(result.dimensions),
            "weather": vars(result.weather),
            "cases": [vars(case) for case in result.cases],
            "total": result.total,
            "refractivity_slopes": result.slopes._asdict(),
            "refractivity_change": result.change,
            "refractivity_change_memo": result.memo_change,
            "refractivity_change_exact": result.exact_change,
            "ratio_change": result.ratio,
            "prism_range_error": result.prism,
            "ball_range_error": result.ball,
            "causes": [row._asdict() for row in result.causes],
        }
    )


def aim_words(result: AimedMounts) -> Words:
    """Title and text of each paragraph on aimed mounts."""
    aim = ", ".join(f"{v * MM:.1f}" for v in result.aim)
    beside_a = np.hypot(*result.misaim.T) * 1e3
    return [
        (
            "Point A",
            f"{aim} mm in the reflector's frame, {result.off_centroid:.2f} m from the centroid of the scan points",
        ),
        ("Distance", f"{result.distance.min():.1f} to {result.distance.max():.1f} m"),
        ("Records", f"look up to {np.degrees(result.record.max()):.3f} deg beside A"),
        ("Scope", f"leaves up to {beside_a.max():.3f} mrad between the aimed normal and the direction ball to A"),
        ("Incidence", f"up to {np.degrees(result.incidence.max()):.2f} deg on an aimed plate"),
    ]


def aim_rows(result: AimedMounts) -> Iterator[dict[str, Any]]:
    """Row of each mount, in metres and radians."""
    for i, unit in enumerate(result.site.units):
        yield {
            "triplet": unit.name,
            "distance": result.distance[i],
            "swing": result.swing[i],
            "tip": result.tip[i],
            "normal": result.normal[i],
            "axis": result.axis[i],
            "misaim": result.misaim[i],
            "record_off": result.record[i],
            "incidence": dict(zip(result.site.rangers, result.incidence[i], strict=True)),
        }


def aim_lines(result: AimedMounts) -> Iterator[str]:
    """Lines of the mounts for people."""
    heads = f"{'swing (deg)':>13s}{'tip (deg)':>13s}{'to A (m)':>10s}{'most incidence (deg)':>22s}"
    yield f"{'triplet':10s}{heads}   normal"
    for i, row in enumerate(aim_rows(result)):
        normal = ", ".join(f"{v:.6f}" for v in row["normal"])
        angles = f"{np.degrees(row['swing']):13.4f}{np.degrees(row['tip']):13.4f}{row['distance']:10.3f}"
        yield f"{row['triplet']:10s}{angles}{np.degrees(result.incidence[i].max()):22.2f}   [{normal}]"


def aim_object(result: AimedMounts) -> dict[str, Any]:
    """JSON object of `catseye triplets aim --json`."""
    return plain(
        {
            "verdict": result.verdict.to_object(),
            "frame": "reflector",
            "aim": result.aim,
            "centroid": result.centroid,
            "triplets": list(aim_rows(result)),
        }
    )


def hollow_words(range_: HollowRange) -> Words:
    """Title and text of each paragraph on a range to a hollow target."""
    memo = (
        "does not apply: the phases differ by a turn"
        if range_.memo_cycles is None
        else f"gives N {range_.memo_cycles} and {range_.memo_distance:.6f} m"
    )
    u_zero = f", u {range_.u_zero_phase:.2g}" if range_.u_zero_phase else ""
    u = f", u {range_.u_distance * UM:.2g} µm" if range_.u_distance else ""
    return [
        ("Distance", f"{range_.distance:.6f} m{u}: scan point to corner, no glass"),
        ("Phi_Cal", f"{range_.zero_phase:.6f} rad{u_zero}"),
        ("Cycles", f"N {range_.cycles} of {range_.half * MM:.6f} mm, margin {range_.margin * MM:.2f} mm"),
        ("INT rule", memo),
    ]


def hollow_object(range_: HollowRange) -> dict[str, Any]:
    """JSON object of `catseye triplets range --json`."""
    return plain({"verdict": range_.verdict.to_object(), **vars(range_)})
