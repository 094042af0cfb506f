"""One normal form of names: blanks, Unicode and decimals that a spreadsheet adds make no second point; said once."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.api.network import adjust
from catseye.errors import InputError
from catseye.estimation.network.names import PointIndex, name_key, spelled
from catseye.records.network.any_file import read_network
from catseye.records.network.gama import gama_network

WAYS = [("P 5", "P   5"), ("S\u00fcd", "Su\u0308d"), ("1", "1.0"), ("1.0", "1"), ("7.00", "7"), ("A b", " A  b ")]
NAMES = st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=8)


@given(NAMES)
def test_key_is_invariant_under_spelling(name):
    assert name_key(name_key(name)) == name_key(name)
    for form in ("NFC", "NFD"):
        assert name_key(f" {unicodedata.normalize(form, name)} ") == name_key(name)
    assert name_key(spelled(name)) == name_key(name)


@given(st.integers(0, 10**6), st.integers(1, 3))
def test_zero_decimals_are_ignored_in_names(number, zeros):
    assert name_key(f"{number}.{'0' * zeros}") == str(number)
    assert name_key(f"{number}.{'0' * zeros}1") != str(number)
    assert name_key(f"{number}.10") != name_key(f"{number}.1")


def folder(tmp_path, first, second):
    """A point by one way in points.csv, by another in ranges.csv."""
    stations = {"S1": (0, 0, 0), "S2": (40, 3, 1), "S3": (20, 38, 2), "S4": (-5, 25, -1)}
    place = (12.0, 9.0, 3.0)
    points = "point,x,y,z,role\n" + "".join(f"{n},{x},{y},{z},fixed\n" for n, (x, y, z) in stations.items())
    rows = "from,to,distance,sigma\n"
    for n, xyz in stations.items():
        d = sum((a - b) ** 2 for a, b in zip(xyz, place, strict=True)) ** 0.5
        rows += f"{n},{second},{d:.4f},0.001\n"
    (tmp_path / "points.csv").write_text(f"{points}{first},12.01,9.01,3.0,free\n", encoding="utf-8")
    (tmp_path / "ranges.csv").write_text(rows, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(("first", "second"), WAYS)
def test_two_spellings_of_a_name_are_one_point_and_noted_once(tmp_path, first, second):
    network = read_network(folder(tmp_path, first, second))
    assert network.points.names == ("S1", "S2", "S3", "S4", spelled(first))
    assert len(network.notes) == 1
    assert "one normal form" in network.notes[0]
    result = adjust(network, relative=[(second, "S1")])
    assert result.x[4] == pytest.approx((12, 9, 3), abs=1e-3)
    assert sum("one normal form" in passage.text for passage in result.passages()) == 1


@pytest.mark.parametrize(("first", "second"), WAYS)
def test_two_ways_to_write_a_name_are_one_point_of_our_own_file_and_of_gamas(tmp_path, first, second):
    file = tmp_path / "network.toml"
    file.write_text(
        f'format = "catseye-network-1"\n[[point]]\nname = "{first}"\nz_m = 100.0\nfixed = "z"\n'
        f'[[point]]\nname = "B"\n[[observation]]\nkind = "height_difference"\nfrom = "{second}"\nto = "B"\n'
        f'value_m = 2.5\nu_mm = 1\n[[observation]]\nkind = "height_difference"\nfrom = "{first}"\nto = "B"\n'
        "value_m = 2.501\nu_mm = 1\n",
        encoding="utf-8",
    )
    text = (
        f'<gama-local><network><points-observations><point id="{first}" z="100" fix="z"/><point id="B" adj="z"/>'
        f'<height-differences><dh from="{second}" to="B" val="2.5005" stdev="1"/></height-differences>'
        "</points-observations></network></gama-local>"
    )
    for network in (read_network(file), gama_network(text.encode(), "network.gkf")):
        assert network.points.names == (spelled(first), "B")
        assert adjust(network).x[1, 2] == pytest.approx(102.5005)


@pytest.mark.parametrize(("first", "second"), WAYS)
def test_point_with_two_spellings_is_a_duplicate(tmp_path, first, second):
    path = folder(tmp_path, first, first)
    with (path / "points.csv").open("a", encoding="utf-8") as file:
        file.write(f"{second},12.01,9.01,3.0,free\n")
    with pytest.raises(InputError, match="in line 6 already"):
        read_network(path)


def test_consistent_names_give_no_note(tmp_path):
    assert read_network(folder(tmp_path, "P 5", "P 5")).notes == ()
    assert "Q" not in PointIndex(["P", "R"])


def test_every_invalid_key_is_named(tmp_path):
    file = tmp_path / "network.toml"
    file.write_text(
        'format = "catseye-network-1"\n[[point]]\nname = "A"\nx_mm = 1\ncolour = "red"\nfixd = "z"\n', encoding="utf-8"
    )
    with pytest.raises(InputError) as refused:
        read_network(file)
    assert all(key in str(refused.value) for key in ("'x_mm'", "'colour'", "'fixd'", "perhaps fixed"))
    path = folder(tmp_path, "P", "P")
    (path / "ranges.csv").write_text("from,to,distance,sigma,who,when\nS1,P,1,1,a,b\n", encoding="utf-8")
    with pytest.raises(InputError, match="'who', 'when' are unknown"):
        read_network(path)


@pytest.mark.parametrize(
    "rows",
    [
        "from,to,value_m\nA,B,2.5\nC,B,1.25\n",
        "from;to;value_m\nA;B;2,5\nC;B;1,25\n",
        "from;to;value_m\nA;B;2.5\nC;B;1.25\n",
    ],
    ids=["commas", "decimal-comma", "semicolons"],
)
def test_table_of_a_toml_file_reads_as_a_folder(tmp_path, rows):
    (tmp_path / "levels.csv").write_text(rows, encoding="utf-8")
    file = tmp_path / "network.toml"
    file.write_text(
        'format = "catseye-network-1"\n[[points]]\ncolumns = ["name", "z_m"]\nrole = "fixed"\n'
        'rows = [["A", 100.0], ["C", 101.25]]\n[[point]]\nname = "B"\n'
        '[[observations]]\nkind = "height_difference"\nu_mm = 1\nfile = "levels.csv"\n',
        encoding="utf-8",
    )
    network = read_network(file)
    assert network.groups[0].observed.tolist() == [2.5, 1.25]
    answer = adjust(network)
    assert answer.x[answer.names.index("B"), 2] == pytest.approx(102.5)
