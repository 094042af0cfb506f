"""Networks with answers from elsewhere, and how far ours are from them."""

import csv

import numpy as np

from catseye.api.network import adjust
from catseye.estimation.network.adjustment import adjust_network
from catseye.records.network.any_file import read_network
from repository import TESTS

NETWORKS = TESTS / "vectors" / "networks"
KNOWN = {  # folder/file of the network -> file of its answers, whose they are, True for u a posteriori
    "baumann3d/network.gkf": (
        "expected.csv",
        "Baumann, Vermessungskunde 2, section 23.3.4",
        True,
    ),
    "monitoring/phase-0-1TK.gkf": ("expected-phase-0-1TK.csv", "a metro tunnel, first epoch: two programs", False),
    "monitoring/phase-1-1TK.gkf": ("expected-phase-1-1TK.csv", "the same, second epoch: two programs", False),
    "ranging-18x500": (
        "expected.csv",
        "500 targets by ranges: an independent solver, two programs",
        False,
    ),
}
FACTORS = {  # file -> datum asked for, variance factor that GNU Gama 2.33 prints, degrees of freedom
    "plane-held.gkf": ("free", 1.1956, 7),
    "plane-datum.gkf": (None, 1.1956, 7),
    "levels.gkf": ("free", 0.0833, 1),
    "inner-blanks.gkf": (None, 0.834, 16),
}


def answers(path):
    """Names, coordinates and standard uncertainties in m, as printed by others."""
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    name = next(iter(rows[0]))
    keys, unit = (("sx_mm", "sy_mm", "sz_mm"), 1e-3) if "sx_mm" in rows[0] else (("u_x", "u_y", "u_z"), 1.0)
    x = np.array([[float(row[k]) for k in "xyz"] for row in rows])
    return [row[name] for row in rows], x, unit * np.array([[float(row[k]) for k in keys] for row in rows])


def ours(solution, names):
    """The same of a solution, in the axes of the file."""
    axes, rows = solution.network.axes, [solution.index[name] for name in names]
    covariance = axes.T @ solution.covariance[rows] @ axes
    return solution.x[rows] @ axes, np.sqrt(np.einsum("nii->ni", covariance))


def compared():
    """A row for each network with a known answer."""
    rows = []
    for file, (expected, source, posterior) in KNOWN.items():
        path = NETWORKS / file
        solution = adjust_network(read_network(path))
        folder = path if path.is_dir() else path.parent
        names, x, u = answers(folder / expected)
        found, claimed = ours(solution, names)
        claimed = claimed * (np.sqrt(solution.variance_factor) if posterior else 1.0)
        off, known = np.abs(found - x), u > 0.0
        rows.append(
            {
                "network": file.removesuffix(".gkf"),
                "source": source,
                "points": len(names),
                "degrees_of_freedom": int(solution.degrees_of_freedom),
                "largest_difference_m": float(off.max()),
                "in_u": float((off[known] / u[known]).max()),
                "largest_difference_of_u": float(np.abs(claimed[known] / u[known] - 1.0).max()),
            }
        )
    return rows


def factors():
    """A row for each network with a printed variance factor."""
    rows = []
    for file, (datum, printed, degrees) in FACTORS.items():
        answer = adjust(NETWORKS / "dimensions" / file, datum=datum)
        assert answer.degrees_of_freedom == degrees
        rows.append({"network": file.removesuffix(".gkf"), "printed": printed, "ours": float(answer.variance_factor)})
    return rows
