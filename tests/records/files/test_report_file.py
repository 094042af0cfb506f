"""Reports read back: what is refused, and in which words."""

import base64
import gzip
import json

import pytest

from catseye.errors import InputError
from catseye.gateways.writers.report_page import report_page
from catseye.records.files import report_file
from catseye.records.files.report_file import DATA, read_report, report_in
from gateways.report_scene import every_part


@pytest.fixture(scope="module")
def good():
    return report_in(report_page(every_part()), "page")


def packed(report):
    raw = report if isinstance(report, bytes) else json.dumps(report).encode()
    return f"<title>catseye: x</title>{DATA}{base64.b64encode(gzip.compress(raw)).decode()}</script>"


def changed(report, *path, value):
    """A copy of the report with another value at a path."""
    copy = json.loads(json.dumps(report))
    part = copy
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    return copy


def test_what_was_written_is_read(good, tmp_path):
    page = report_page(every_part())
    (tmp_path / "report.html").write_text(page, encoding="utf-8")
    assert read_report(tmp_path) == read_report(tmp_path / "report.html") == good
    assert "shared" not in good


COLUMN = ("tables", "points", "columns", 1)
MISSHAPEN = {
    "another format": (("format",), "catseye-report-2", "format = 'catseye-report-2' (expected catseye-report-1"),
    "no title": (("title",), 5, "title or subtitle is no text"),
    "an unknown verdict": (("verdict",), {"word": "fine", "why": ""}, "verdict is none"),
    "cards that are none": (("cards",), [{"name": "a"}], "cards are misshapen"),
    "passages that are none": (("passages",), {}, "passages are misshapen"),
    "no tables": (("tables",), None, "tables are missing"),
    "sections that are none": (("sections",), [{"id": "a"}], "sections are misshapen"),
    "blocks that are none": (("sections", 0, "blocks"), [5], "section first"),
    "an unknown block": (("sections", 0, "blocks", 0, "kind"), "video", "block of kind 'video'"),
    "a block without its table": (("sections", 0, "blocks", 4, "table"), "b", "table 'b' is missing"),
    "a block with a list for a key": (("sections", 0, "blocks", 4, "table"), [], "is missing"),
    "a list of numbers": (("sections", 0, "blocks", 3, "items"), [1], "a list is misshapen"),
    "text among numbers": ((*COLUMN, "values"), [1.0, "<b>"], "column x of table points"),
    "a flag among numbers": ((*COLUMN, "values"), [1.0, True], "column x of table points"),
    "a shorter column": ((*COLUMN, "values"), [1.0], "columns of table points have different lengths"),
    "an unknown kind of column": ((*COLUMN, "kind"), "html", "column x of table points"),
    "a name that is no column": (("tables", "points", "name"), "z", "name of table points"),
    "a scene without frame": (("scenes", "network", "frame"), None, "scene network"),
    "a scene of different lengths": (("scenes", "network", "points", "x"), [1.0], "scene network"),
    "a group that is none": (("scenes", "network", "points", "group"), [0, 1], "scene network"),
    "a beam to nowhere": (("scenes", "network", "beams", "to"), [2], "scene network"),
    "an unknown chart": (("charts", "w", "type"), "pie", "chart w"),
    "a chart of different lengths": (("charts", "w", "u"), [1.0], "chart w has arrays of different lengths"),
    "a chart's names too few": (("charts", "w", "name"), ["1"], "names of chart w"),
    "a drawing that is a number": (("drawings", "drawing"), 5, "a drawing is no text"),
}


@pytest.mark.parametrize("what", MISSHAPEN)
def test_misshapen_data_are_refused_in_one_line(good, what):
    path, value, said = MISSHAPEN[what]
    with pytest.raises(InputError) as problem:
        report_in(packed(changed(good, *path, value=value)), "report.html")
    assert said in str(problem.value)
    assert str(problem.value).startswith("report.html")
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<title>catseye: night-01</title><table>", "written by catseye before 0.2"),
        ("<title>Cats</title>", "is not a report of catseye"),
        ("", "is not a report of catseye"),
        (f"{DATA}###</script>", "its data are damaged"),
        (f"{DATA}AAAA</script>", "its data are damaged"),
        (DATA, "its data are cut off"),
        (packed(b"{"), "its data are not JSON"),
        (packed(b"[1]"), "format = "),
        (packed(b'{"format": NaN}'), "its data are not JSON"),
        (packed(b"[" * 100_000), "its data are not JSON"),
        (packed(b'{"format": "catseye-report-1", "shared": 5}'), "shared lists are misshapen"),
    ],
    ids=["older", "foreign", "empty", "letters", "bytes", "nothing", "json", "list", "nan", "deep", "shared"],
)
def test_other_pages_are_refused_in_one_line(text, said):
    with pytest.raises(InputError) as problem:
        report_in(text, "report.html")
    assert said in str(problem.value)
    assert len(str(problem.value)) < 250


def test_a_shared_list_that_is_missing_is_refused(good):
    wrong = changed(good, *COLUMN, "values", value={"shared": 3})
    with pytest.raises(InputError, match="shared list 3 is missing"):
        report_in(packed(wrong), "report.html")


def test_cut_off_data_are_refused():
    page = report_page(every_part())
    start = page.index(DATA) + len(DATA)
    end = page.index("</script>", start)
    with pytest.raises(InputError, match="cut off"):
        report_in(page[: start + (end - start) // 8 * 4] + page[end:], "report.html")


def test_data_beyond_the_limit_are_not_unpacked(monkeypatch):
    monkeypatch.setattr(report_file, "MOST", 1_000_000)
    with pytest.raises(InputError, match="its data hold more than 1000000 bytes"):
        report_in(packed(b" " * 50_000_000), "report.html")


def test_shared_lists_cannot_multiply_without_limit(good, monkeypatch):
    monkeypatch.setattr(report_file, "MOST", 800_000)
    columns = [
        {"key": f"c{k}", "label": "", "unit": "", "kind": "number", "values": {"shared": 0}} for k in range(1000)
    ]
    bomb = changed(good, "tables", "points", value={"columns": columns}) | {"shared": [[0] * 1000]}
    with pytest.raises(InputError, match="more than 100000 values"):
        report_in(packed(bomb), "report.html")


def test_a_missing_file_a_folder_without_a_report_and_a_large_one(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="missing"):
        read_report(tmp_path / "none.html")
    with pytest.raises(InputError, match=r"no report\.html in it"):
        read_report(tmp_path)
    (tmp_path / "report.html").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8"):
        read_report(tmp_path)
    monkeypatch.setattr(report_file, "MOST", 2)
    with pytest.raises(InputError, match="holds 3 bytes"):
        read_report(tmp_path)
