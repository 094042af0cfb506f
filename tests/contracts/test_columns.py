"""Every table that a command writes is one `Table`, and its page has its columns."""

import ast
from collections import Counter
from fnmatch import fnmatch
from pathlib import Path

import pytest
import typer

from catseye.cli.commands import app
from catseye.gateways.writers.columns import Column, Table
from command_scene import command_line
from contracts.table_scene import HEAD, PAGES, described, records, rewritten, section, tables
from repository import ROOT

SOURCE = ROOT / "src" / "catseye"
ANEW = "`PYTHONPATH=src:tests python tests/contracts/table_scene.py` writes it"
OTHER_WRITERS = {  # what writes rows without a `Table`
    "gateways/writers/columns.py",
    "gateways/writers/written.py",  # `csv_text`
    "api/result.py",  # a QTable of any result, its units in the header
    "gateways/air/weather_objects.py",  # rows of records
    "gateways/journal/campaign.py",  # rows of records
    "records/site/folder.py",
    "simulator/night/sheets.py",
}
TABLES = tables()


def name_of(table):
    return f"{table.page}-{table.file}"


def test_there_are_tables_each_under_one_heading_of_its_page():
    assert len(TABLES) >= 40
    places = Counter((table.page, table.file) for table in TABLES)
    assert max(places.values()) == 1, places.most_common(1)


@pytest.mark.parametrize("table", TABLES, ids=name_of)
def test_the_page_has_the_columns(table):
    page = (PAGES / table.page).read_text(encoding="utf-8")
    where = f"docs/formats/{table.page}"
    assert section(page, table.file), f"{where}: no heading names `{table.file}`"
    missing = [c.name for c in table.columns if f"| `{c.name}` |" not in (described(page, table.file) or "")]
    assert missing == [], f"{where}, `{table.file}`: columns are missing; {ANEW}"
    assert described(page, table.file) == table.markdown(), f"{where}, `{table.file}`: not as in the code; {ANEW}"


@pytest.mark.parametrize("table", TABLES, ids=name_of)
def test_columns_have_distinct_names_that_end_in_their_unit_and_a_meaning(table):
    names = [column.name for column in table.columns]
    assert len(set(names)) == len(names)
    assert [c.name for c in table.columns if not c.name.endswith(c.suffix)] == []
    assert [c.name for c in table.columns if len(c.doc) < 4 or "|" in c.doc or c.doc[0].isspace()] == []


def test_no_page_describes_a_table_that_is_not_written():
    shown = {path.name: path.read_text(encoding="utf-8").splitlines().count(HEAD) for path in PAGES.glob("*.md")}
    by_hand = {name: sum(f"`{file}`" in line for line in heads(name) for file in records()) for name in shown}
    written = Counter(table.page for table in TABLES)
    for name, count in shown.items():
        assert written[name] <= count <= written[name] + by_hand[name], name


def heads(name):
    """Headings of a page."""
    lines = (PAGES / name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line.startswith("#")]


@pytest.mark.parametrize("file", sorted(records()))
def test_a_page_has_the_columns_that_are_read(file):
    """Tables that catseye reads, and writes for a campaign: rows of records."""
    fields = list(records()[file].model_fields)
    missing = {}
    for path in PAGES.glob("*.md"):
        page = path.read_text(encoding="utf-8")
        if where := section(page, file):
            text = "\n".join(page.splitlines()[slice(*where)])
            missing[path.name] = [field for field in fields if f"`{field}`" not in text]
    assert [] in missing.values(), f"{file}: no section has all of {fields}: {missing}"


def test_rows_are_written_by_tables_alone():
    found = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = isinstance(node, ast.Name) and node.id == "csv_text"
            if named or (isinstance(node, ast.Attribute) and ast.unparse(node) in ("csv.writer", "csv.DictWriter")):
                found.add(str(path.relative_to(SOURCE)))
    assert found <= OTHER_WRITERS, "a table is a `Table` of gateways.writers.columns"


def files_of(tree):
    """Names of the CSV files that a module maps to what writes them, "*" where a name is made up."""
    for node in ast.walk(tree):
        keys = node.keys if isinstance(node, ast.Dict) else [node.slice] if isinstance(node, ast.Subscript) else []
        for key in keys:
            parts = key.values if isinstance(key, ast.JoinedStr) else [key]
            name = "".join(str(part.value) if isinstance(part, ast.Constant) else "*" for part in parts)
            if name.endswith(".csv"):
                yield name


def test_every_csv_that_is_written_is_a_table():
    named = [
        (path, name) for path in (SOURCE / "gateways").rglob("*.py") for name in files_of(ast.parse(path.read_text()))
    ]
    assert len(named) >= 30
    known = {pattern for table in TABLES for pattern in (table.file, *table.also)}
    for path, name in named:
        assert any(fnmatch(name, pattern) or fnmatch(pattern, name) for pattern in known), f"{path}: {name}"


def test_tables_are_defined_where_they_are_found():
    """At the top level of a module: what a function makes, `tables` does not see."""
    for path in (SOURCE / "gateways").rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        within = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.Lambda)]
        made = [node for function in within for node in ast.walk(function) if isinstance(node, ast.Call)]
        calls = [ast.unparse(node.func).partition("[")[0] for node in made]
        assert "Table" not in calls or path.relative_to(SOURCE).as_posix() == "gateways/journal/tables.py", path


def test_a_column_more_is_missed(tmp_path):
    """The page's check sees a column that is added, renamed, moved or given another meaning."""
    table = next(table for table in TABLES if table.file == "ranges.csv")
    page = (PAGES / table.page).read_text(encoding="utf-8")
    more = Column("dew_c", "deg_C", "dew point", len)
    for columns in ((*table.columns, more), table.columns[1:], table.columns[::-1]):
        changed = Table(table.file, table.page, columns)
        assert described(page, table.file) != changed.markdown()
        assert described(rewritten(page, changed), table.file) == changed.markdown()


EXAMPLES = ROOT / "examples"
NETWORK = EXAMPLES / "networks" / "feed-arm.toml"
BASELINE = EXAMPLES / "baselines" / "busselton"
HEIGHTS = ["--heights", BASELINE / "pillar-heights.csv"]
PANELS = EXAMPLES / "panels"
ACOUSTIC = EXAMPLES / "acoustic"
ZP103 = EXAMPLES / "night-01" / "mirrors" / "ZP103.toml"
COMMANDS = {  # directory -> the command that writes it; night: of the one before
    "night": ["reduce", EXAMPLES / "night-01"],
    "budget": ["budget", EXAMPLES / "night-01", "DP012"],
    "network": ["adjust", NETWORK],
    "epochs": ["adjust", NETWORK, NETWORK],
    "positions": ["locate", EXAMPLES / "positions" / "stations.csv", EXAMPLES / "positions" / "three-ranges.csv",
                  "--method", "averaging", "--near=0,0,30", "--both"],
    "movements": ["movements", EXAMPLES / "movements" / "before.csv", EXAMPLES / "movements" / "after.csv", "--points",
                  EXAMPLES / "movements" / "points.csv", "--constraints", EXAMPLES / "movements" / "constraints.toml"],
    "plan": ["plan", NETWORK, "--budget-s", 600, "--shot-s", 5],
    "design": ["design", EXAMPLES / "designs" / "structure-60m.toml", "--steps", 2, "--exchanges", 0, "--runs", 100,
               "--map-side", 3, "--vary", "rangers from 8 to 9 between 5 and 45 m"],
    "baseline": ["baseline", BASELINE / "ts30-baseline-observations.csv", *HEIGHTS],
    "acoustic": ["acoustic", ACOUSTIC / "evening-1.wav", "--sheet", ACOUSTIC / "evening.toml"],
    "array": ["acoustic-field", ACOUSTIC / "array-stations.csv", ACOUSTIC / "array-times.csv"],
    "weather": ["weather", EXAMPLES / "weather" / "tower.dat"],
    "path": ["path", EXAMPLES / "weather" / "stations.csv", "--start=0,0,3", "--end=100,0,40"],
    "refractometer": ["refractometer", EXAMPLES / "refractometer" / "path-a.csv"],
    "beam": ["beam", EXAMPLES / "beams" / "head.toml", "--distance-m", 120],
    "panels": ["panels", PANELS / "as-found.csv", "--instrument", PANELS / "tool.toml", "--layout", "gbt",
               "--as-left", PANELS / "as-left.csv"],
    "triplet": ["triplet", EXAMPLES / "triplets" / "TR99.toml"],
    "fit": ["pointing", "fit", EXAMPLES / "pointing" / "stars.dat"],
    "track": ["pointing", "track", "--tilts", EXAMPLES / "pointing" / "tilts.csv", "--harmonics", 3],
    "bent": ["model", "displace", EXAMPLES / "structural-model" / "telescope.toml", "--posture", "145,45",
             "--site", EXAMPLES / "sites" / "gbt"],
    "chosen": ["model", "choose", EXAMPLES / "structural-model" / "telescope.toml",
               "--site", EXAMPLES / "sites" / "gbt",
               "--count", 2, "--posture", "0,45", "--free", "feed_arm:turn_x"],
    "imported": ["model", "import", EXAMPLES / "structural-model" / "telescope.toml",
                 EXAMPLES / "finite-elements" / "elevations.csv",
                 "--nodes", EXAMPLES / "finite-elements" / "nodes.csv",
                 "--axes=-y,x,z", "--origin=0,54.839108,-4.99999"],
    "refined": ["model", "fit", EXAMPLES / "structural-model" / "telescope.toml",
                EXAMPLES / "structure" / "epochs.csv"],
    "servo": ["servo", "identify", EXAMPLES / "servo" / "moves.csv"],
    "scan": ["scan", "fit", EXAMPLES / "scans" / "azimuth.csv", "--mirror", ZP103],
    "pose": ["pose", "night", "--site", EXAMPLES / "night-01", "--group", "dish", "--frame", "reflector"],
    "surface": ["surface", "night", "--taper-db", 13, "--frequency-ghz", 86],
    "phase": ["phase", EXAMPLES / "buffers" / "clipped.csv"],
    "cycles": ["cycles", EXAMPLES / "cycles" / "three-frequencies.csv"],
    "change": ["surface", "night", "night"],
}  # fmt: skip
WITHOUT_TABLES = {"certificate", "frequencies", "plot", "stray"}  # commands with --out that write a page or a figure
ELSEWHERE = {
    "convert",
    "demo",
    "export",
    "follow",
    "query",
    "replay",
    "simulate",
    "structure",
    "subreflector",
    "track",
    "trends",
    "triplets",
}  # `demo` is `reduce`; `triplets` writes what `save` writes of any result; others: see tests/gateways


@pytest.mark.slow
def test_every_csv_of_the_examples_is_a_table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    catseye = command_line(capsys)
    for name, words in COMMANDS.items():
        assert catseye(*words, "--out", name)[0] == 0, name
    written = list(Path().rglob("*.csv"))
    assert len(written) > len(COMMANDS)
    for path in written:
        with path.open(encoding="utf-8") as stream:
            heads = stream.readline().rstrip("\n").split(",")
        assert any(could_write(table, path.name, heads) for table in TABLES), f"{path}: {heads}"


def could_write(table, name, heads):
    """True where a table writes files of that name with those columns, each of which may be optional."""
    columns = [column.name for column in table.columns]
    own = any(fnmatch(name, pattern) for pattern in (table.file, *table.also))
    return own and [column for column in columns if column in heads] == heads


def test_every_command_that_writes_is_among_them():
    def walk(command, *words):
        for name, inner in getattr(command, "commands", {}).items():
            yield from walk(inner, *words, name)
        if any("--out" in option.opts for option in command.params):
            yield words

    writing = {words[0] for words in walk(typer.main.get_command(app))}
    tried = {words[0] for words in COMMANDS.values()}
    assert writing - WITHOUT_TABLES - ELSEWHERE == tried
