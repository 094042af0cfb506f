"""Tables of docs/evidence/how-good.md from the measured data."""

from hostile.outcome import OUTCOMES
from hostile.rows import HONEST
from repository import ROOT

PAGE = ROOT / "docs" / "evidence" / "how-good.md"
DATA = ROOT / "docs" / "evidence" / "how-good.json"
TITLES = {
    "ground": "ground rangers",
    "arm": "feed arm",
    "ball": "balls",
    "triplet prism": "triplet prisms",
    "dish": "dish prisms",
    "struct": "structure",
    "surface": "surface",
    "pose": "pose",
    "thermometers": "thermometers",
}


def table(head, rows):
    """Markdown table."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows))


def run_text(data):
    """Sentence about the run."""
    run = data["run"]
    return (
        f"Run of {run['date']} by catseye {run['version']} ({run['revision']}) on {run['processor']}, "
        f"{run['cores']} cores, Python {run['python']}, numpy {run['numpy']}: {run['processor_s'] / 60:.1f} minutes of "
        "processor time."
    )


def nights_text(data):
    """Table of scatter by class, and of shots."""
    nights = data["nights"]
    counts = [n["seeds"][1] - n["seeds"][0] + 1 for n in nights]
    head = ["", *(f"{n['prisms']} prisms, {k} nights" for n, k in zip(nights, counts, strict=True))]
    rows = []
    for kind, title in TITLES.items():
        cells = []
        for night in nights:
            c = night["classes"][kind]
            mean = f"{c['mean']:.2f}" if c["low"] < c["mean"] < c["high"] else f"**{c['mean']:.2f}**"
            cells.append(f"{mean} ({c['low']:.2f} to {c['high']:.2f}); {c['mean'] ** -0.5:.2f}")
        rows.append([title, *cells])
    rows.append(["bad shots rejected with the right reason", *(f"{n['right']} of {n['bad']}" for n in nights)])
    rows.append(["good shots rejected with them", *(f"{n['lost']} of {n['good']}" for n in nights)])
    rows.append(["correct thermometers named as biased", *(str(n["innocent_thermometers_named"]) for n in nights)])
    return table(head, rows)


def records_text(data):
    """Table of hostile nights."""
    head = ["what is wrong", "sizes", "nights", *OUTCOMES, "accused", "mean square, class"]
    rows = [r for r in data["wrong_records"] if r["row"] != HONEST]
    (honest,) = (r for r in data["wrong_records"] if r["row"] == HONEST)
    body = []
    for r in rows:
        sizes = ", ".join(f"{size:g}" for size in r["sizes"] if size)
        kind = TITLES.get(r["worst_class"], r["worst_class"])
        square = "" if r["mean_square"] is None else f"{r['mean_square']:.1f}, {kind}"
        counts = [str(r[key] or "") for key in ("nights", *OUTCOMES, "accused")]
        body.append([r["row"], f"{sizes} {r['unit']}".strip(), *counts, square])
    sums = {key: sum(r[key] for r in rows) for key in ("nights", *OUTCOMES, "accused", "refused")}
    body.append(["all", "", *(str(sums[key]) for key in ("nights", *OUTCOMES, "accused")), ""])
    answered = sum(sums[word] for word in OUTCOMES[:3])
    return (
        f"{table(head, body)}\n\n"
        f"{answered} of {sums['nights']} hostile nights are named, covered or listed; {sums['refused']} were refused. "
        f"Of {honest['nights']} nights without a lie {honest['alarmed']} raised an alarm, {honest['accused']} accused "
        f"a record, and {100.0 * honest['listed_share']:.1f} % of their points were listed as unchecked."
    )


def networks_text(data):
    """Tables of networks with known answers and with known variance factors."""
    first = table(
        ["network", "answer by", "points", "degrees of freedom", "largest difference", "in u", "of u itself"],
        [
            [
                r["network"],
                r["source"],
                str(r["points"]),
                str(r["degrees_of_freedom"]),
                f"{1e6 * r['largest_difference_m']:.2g} µm",
                f"{r['in_u']:.1g}",
                f"{100 * r['largest_difference_of_u']:.1g} %",
            ]
            for r in data["networks"]
        ],
    )
    second = table(
        ["network", "variance factor, GNU Gama", "catseye"],
        [[r["network"], f"{r['printed']:g}", f"{r['ours']:.4f}"] for r in data["variance_factors"]],
    )
    return f"{first}\n\n{second}"


def baseline_text(data):
    """Table of the baseline."""
    b = data["baseline"]
    rows = [
        ["standard deviation of a distance", f"{1e3 * b['s_m']:.3f} mm, {b['degrees_of_freedom']} degrees of freedom",
         f"{1e6 * b['s_difference_m']:.1f} µm"],
        ["zero", f"{1e3 * b['zero_m']:.3f} ± {1e3 * b['u_zero_m']:.3f} mm", f"{1e6 * b['zero_difference_m']:.1f} µm"],
        ["distances of the pillars", "", f"{1e6 * b['distance_difference_m']:.0f} µm at most"],
    ]  # fmt: skip
    return table([b["baseline"], "catseye", "beside plain least squares, all shots"], rows)


TEXTS = {
    "run": run_text,
    "nights": nights_text,
    "records": records_text,
    "networks": networks_text,
    "baseline": baseline_text,
}


def filled(page, data):
    """Page with its tables made of the data, each between its two markers."""
    for name, text in TEXTS.items():
        start, end = f"<!-- {name}: written by make evidence -->", f"<!-- end of {name} -->"
        count = min(page.count(start), page.count(end))
        assert count == 1, f"{PAGE.name} has {count} places for {name}, expected 1"
        before, after = page.partition(start)[0], page.partition(end)[2]
        page = f"{before}{start}\n{text(data)}\n{end}{after}"
    return page
