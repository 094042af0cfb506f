"""A network yet to be measured: values may be missing, and what of a sigma grows with the length follows the points."""

import json

import numpy as np
import pytest

from catseye.api.network import adjust
from catseye.api.planning import plan
from catseye.errors import InputError

POINTS = "point,x,y,z,role\nA,0,0,0,fixed\nB,400,0,3,fixed\nC,0,300,-2,fixed\nD,400,300,40,fixed\nP,180,130,25,free\n"
PLACES = {"A": (0, 0, 0), "B": (400, 0, 3), "C": (0, 300, -2), "D": (400, 300, 40), "P": (180, 130, 25)}
MM, PPM = 0.1, 3.0


def folder(tmp_path, ranges):
    path = tmp_path / "planned"
    path.mkdir()
    (path / "points.csv").write_text(POINTS, encoding="utf-8")
    (path / "ranges.csv").write_text(ranges, encoding="utf-8")
    return path


def by_hand(kind="slope"):
    """Covariance of P from ranges to the four corners with u = a + b D, in numpy."""
    normal = np.zeros((3, 3))
    for name in "ABCD":
        along = np.subtract(PLACES["P"], PLACES[name])
        d = np.linalg.norm(along)
        u = 1e-3 * MM + 1e-6 * PPM * d
        normal += np.outer(along / d, along / d) / u**2
    return np.linalg.inv(normal)


@pytest.mark.parametrize(
    "ranges",
    [
        "from,to\nA,P\nB,P\nC,P\nD,P\n",
        "from,to,distance\nA,P,\nB,P,\nC,P,\nD,P,\n",
        "from,to,distance,sigma\nA,P,,\nB,P,1.0,\nC,P,900,\nD,P,,\n",
    ],
    ids=["no-column", "blank", "typed-otherwise"],
)
def test_the_ppm_part_of_a_folder_follows_the_planned_distance(tmp_path, ranges):
    planned = plan(folder(tmp_path, ranges), sigma_mm=MM, sigma_ppm=PPM)
    assert planned.covariances[4] == pytest.approx(by_hand(), rel=1e-9)
    observed = {row["from"]: row["u"] for row in planned.to_object()["observations"]}
    for name in "ABCD":
        distance = np.linalg.norm(np.subtract(PLACES["P"], PLACES[name]))
        assert observed[name] == pytest.approx(1e-3 * MM + 1e-6 * PPM * distance, rel=1e-12)


@pytest.mark.parametrize("value", ["", "value_m = 1.0", "value_m = 5000.0"])
def test_the_ppm_part_of_our_own_file_follows_the_planned_distance(tmp_path, value):
    text = 'format = "catseye-network-1"\n'
    for name, xyz in PLACES.items():
        held = "" if name == "P" else 'fixed = "xyz"\n'
        text += f'[[point]]\nname = "{name}"\nxyz_m = {list(map(float, xyz))}\n{held}'
    for name in "ABCD":
        text += f'[[observation]]\nkind = "slope_distance"\nfrom = "{name}"\nto = "P"\nu_mm = {MM}\nu_ppm = {PPM}\n'
        text += value + "\n"
    file = tmp_path / "network.toml"
    file.write_text(text, encoding="utf-8")
    assert plan(file).covariances[4] == pytest.approx(by_hand(), rel=1e-9)


@pytest.mark.parametrize("typed", [250.0, 2500.0])
def test_other_programs_ppm_parts_follow_too(tmp_path, typed):
    lines = ["# catseye: distance_mm = 0.1, distance_ppm = 3", ".ORDER EN"]
    lines += [f"C {n} {x} {y} {z}" + " ! ! !" * (n != "P") for n, (x, y, z) in PLACES.items()]
    lines += [f"D {n}-P {typed}" for n in "ABCD"]
    dat = tmp_path / "network.dat"
    dat.write_text("\n".join(lines) + "\n", encoding="utf-8")
    points = "".join(
        f'<point id="{n}" x="{y}" y="{x}" z="{z}" {"adj" if n == "P" else "fix"}="xyz"/>'
        for n, (x, y, z) in PLACES.items()
    )
    seen = "".join(f'<s-distance from="{n}" to="P" val="{typed}"/>' for n in "ABCD")
    gkf = tmp_path / "network.gkf"
    gkf.write_text(
        '<gama-local><network axes-xy="ne"><points-observations distance-stdev="0.1 3">'
        f"{points}<obs>{seen}</obs></points-observations></network></gama-local>",
        encoding="utf-8",
    )
    swapped = by_hand()[np.ix_([1, 0, 2], [1, 0, 2])]
    assert plan(dat).covariances[4] == pytest.approx(by_hand(), rel=1e-9)
    assert plan(gkf).covariances[4] == pytest.approx(swapped, rel=1e-9)


def test_values_of_every_kind_may_be_missing(tmp_path):
    rows = {
        "slope_distance": "u_mm = 1.0", "horizontal_distance": "u_mm = 1.0", "direction": "u_arcsec = 3.0",
        "azimuth": "u_arcsec = 3.0", "zenith_angle": "u_arcsec = 3.0", "height_difference": "u_mm = 1.0",
        "inclination": "u_arcsec = 3.0", "vector": "u_mm = 1.0",
    }  # fmt: skip
    text = 'format = "catseye-network-1"\n'
    for name, xyz in PLACES.items():
        held = "" if name == "P" else 'fixed = "xyz"\n'
        text += f'[[point]]\nname = "{name}"\nxyz_m = {list(map(float, xyz))}\n{held}'
    for kind, u in rows.items():
        for name in "ABCD":
            text += f'[[observation]]\nkind = "{kind}"\nfrom = "{name}"\nto = "P"\n{u}\n'
    text += '[[observation]]\nkind = "angle"\nat = "P"\nbacksight = "A"\nforesight = "B"\nu_arcsec = 3.0\n'
    file = tmp_path / "network.toml"
    file.write_text(text, encoding="utf-8")
    planned = plan(file)
    assert np.isfinite(planned.u[4]).all()
    json.dumps(planned.to_object(), allow_nan=False)
    with pytest.raises(InputError, match="value is missing"):
        adjust(file)


def test_a_missing_distance_is_refused_where_it_is_adjusted(tmp_path):
    path = folder(tmp_path, "from,to,distance\nA,P,\nB,P,3\nC,P,4\n")
    with pytest.raises(InputError, match=r"distance = '' \(expected a finite number"):
        adjust(path, sigma_mm=1.0)
