"""One word, one meaning: class names, docstrings, plain names, and no text read back into a value."""

import ast
import re
import statistics
from collections import Counter, defaultdict

import pytest

from repository import ROOT

SOURCE = ROOT / "src" / "catseye"
TREES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))}
SHORTEST = 24  # characters of a docstring
READERS = {"partition", "rpartition", "split", "rsplit", "startswith", "endswith", "removeprefix", "removesuffix"}
VALUES = re.compile(r"\b(reasons?|parameters?|rejected|unresolved|layout\.names|state\.names)\b")


def test_public_class_names_stand_once():
    places = defaultdict(list)
    for path, tree in TREES.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(str(path.relative_to(SOURCE)))
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


def test_docstrings_say_what_is_returned():
    short = [
        f"{path.relative_to(SOURCE)}: {node.name}: {said}"
        for path, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        and (said := ast.get_docstring(node)) is not None
        and len(said) < SHORTEST
    ]
    assert short == []


def read_back(tree):
    """Places where the text of a reason or of a parameter's name is taken apart."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in READERS:
            value = node.func.value
        elif isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice) and isinstance(node.value, ast.Name):
            value = node.value
        else:
            continue
        text = ast.unparse(value)
        whole = isinstance(node, ast.Subscript)  # slices of arrays of parameters are none
        if text in ("reason", "parameter") or (not whole and VALUES.search(text)):
            yield f"line {node.lineno}: {ast.unparse(node)}"


ROOMS = sorted(path.name for path in SOURCE.iterdir() if path.is_dir() and path.name not in ("ranger", "__pycache__"))


@pytest.mark.parametrize("room", ROOMS)  # but for the rangers': parameters are words of their language there
def test_no_reason_and_no_parameter_is_read_from_its_text(room):
    found = {
        str(path.relative_to(SOURCE)): places
        for path, tree in TREES.items()
        if path.is_relative_to(SOURCE / room) and (places := list(read_back(tree)))
    }
    assert found == {}


SENTENCES = {"status", "why", "reason", "message", "note", "notes", "doubt", "doubts", "texts"}  # names of sentences
SEARCHES = {*READERS, "replace", "find", "index", "search", "match", "fullmatch", "findall", "finditer"}
OF_OTHERS = {  # sentences of other libraries, whose errors carry no data
    "records/files/reading.py: str(problem).rpartition(' (at ')",  # tomllib of Python 3.11: line and column
    "records/files/refusal.py: message.startswith('expected')",  # pydantic's, before it is quoted
}


def is_sentence(node, problems):
    """True for text of a caught error, or for something named as a sentence, or a part of either."""
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "str" and node.args:
        return isinstance(node.args[0], ast.Name) and node.args[0].id in problems
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        return node.func.attr in {*SEARCHES, "lower", "strip", "rstrip"} and is_sentence(node.func.value, problems)
    if isinstance(node, ast.Subscript):
        return is_sentence(node.value, problems)
    name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
    return name in SENTENCES


def decided_by_sentence(tree):
    """Places where code looks into a sentence: it should ask for a value."""
    problems = {node.name for node in ast.walk(tree) if isinstance(node, ast.ExceptHandler) and node.name}
    loops = {  # names that run over sentences
        node.target.id: node.iter
        for node in ast.walk(tree)
        if isinstance(node, ast.For | ast.comprehension) and isinstance(node.target, ast.Name)
    }
    running = {name for name, over in loops.items() if is_sentence(over, problems)}

    def spoken(node):
        return is_sentence(node, problems) or (isinstance(node, ast.Name) and node.id in running)

    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in SEARCHES:
            looks = spoken(node.func.value) or any(spoken(each) for each in node.args)
            if looks and (node.args or node.func.attr not in ("split", "rsplit")):  # split() only mends spaces
                yield ast.unparse(node)
        elif isinstance(node, ast.Compare) and any(isinstance(each, ast.In | ast.NotIn) for each in node.ops):
            left = node.left
            fixed = isinstance(left, ast.Constant | ast.JoinedStr) or (isinstance(left, ast.Name) and left.id.isupper())
            if fixed and any(spoken(each) for each in node.comparators):
                yield ast.unparse(node)


def test_no_sentence_is_read_back():
    found = {
        f"{path.relative_to(SOURCE).as_posix()}: {place}"
        for path, tree in TREES.items()
        if not path.is_relative_to(SOURCE / "ranger")  # answers of rangers are words of their language
        for place in decided_by_sentence(tree)
    }
    assert found == OF_OTHERS


def test_sentences_read_back_are_seen():
    for text in (
        "solution.status.startswith(CONVERGED)",
        "any(note.startswith('no paraboloid') for note in found.notes)",
        "[t for t in allowance.texts if not t.startswith('the stations differ')]",
        "'needs' in outcome.message",
        "try: f()\nexcept E as problem: why = str(problem).replace('no ranger', 'no feed')",
        "try: f()\nexcept E as problem: found = re.search('number ([0-9]+)', str(problem))",
    ):
        assert list(decided_by_sentence(ast.parse(text))), text
    for text in ("name.startswith('ZBM')", "why.split()", "status in (FOUND, LOST)", "kind in reply.text"):
        assert not list(decided_by_sentence(ast.parse(text))), text


def test_such_reading_is_seen():
    for text in ("reason.partition(':')", "row.reason.startswith('blocked')", "parameter[:-2]", "reasons[k].split()"):
        assert list(read_back(ast.parse(text))), text
    assert not list(read_back(ast.parse("name.partition(' ')")))


def annotations(tree):
    """Of arguments, returns and fields, with the names they belong to."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            for one in [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]:
                if one is not None and one.annotation is not None:
                    yield node.lineno, f"{node.name}({one.arg})", one.annotation
            if node.returns is not None:
                yield node.lineno, node.name, node.returns
        elif isinstance(node, ast.ClassDef):
            for field in node.body:
                if isinstance(field, ast.AnnAssign):
                    yield field.lineno, f"{node.name}.{ast.unparse(field.target)}", field.annotation


@pytest.mark.parametrize("room", ["reduction", "coordinator"])
def test_signatures_say_what_they_take(room):
    """mypy would refuse bare arrays, too, if it were asked in the reduction."""
    anything = [
        f"{path.relative_to(SOURCE)}:{line}: {name}: {ast.unparse(annotation)}"
        for path, tree in TREES.items()
        if path.is_relative_to(SOURCE / room)
        for line, name, annotation in annotations(tree)
        if re.search(r"\bAny\b", ast.unparse(annotation))
    ]
    assert anything == []


def known_names():
    """Everything that some module defines, uses or imports."""
    for tree in TREES.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                yield node.name
            elif isinstance(node, ast.Name):
                yield node.id
            elif isinstance(node, ast.Import | ast.ImportFrom):
                yield from ((each.asname or each.name).rpartition(".")[2] for each in node.names)


def strangers(text, names):
    """Classes in backticks that nobody knows."""
    return [name for name in re.findall(r"`([A-Z][a-z]+[A-Za-z]*)(?:\.\w+)?`", text) if name not in names]


def test_classes_that_docstrings_name_are_there():
    names = {*known_names(), "None"}
    assert strangers("as `Slews.position`", names) == ["Slews"]
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in (*TREES, ROOT / "CONTRIBUTING.md")}
    assert {path: gone for path, text in texts.items() if (gone := strangers(text, names))} == {}


BEGINNINGS = {"what", "whether", "how", "as", "of", "that", "which", "who", "where", "when"}  # of no noun and no verb
VAGUE = frozenset(  # participles, pronouns and adverbs, as whole names or their last part
    re.findall(
        r"\w+",
        """
        told given kept rest whole each way here own found seen asked stood risen said known wanted taken shown meant
        held left gone made done lasting standing carried begun began ended grown spoken heard lost lain put these those
        this that such same other others another every both none nobody nothing something someone again already beside
        beyond behind hence once ever yet so now then there believed doubted suspected
        """,
    )
)
MOST_VAGUE, MOST_BEGINNINGS, MEDIAN_WORDS = 0.01, 0.01, 10.0


def first_lines(tree):
    """First line of each docstring."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text:
                yield text.splitlines()[0]


def assigned_names(tree):
    """Names of functions, classes, arguments and variables."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name
            yield from (a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs))
        elif isinstance(node, ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def is_vague(name):
    parts = re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", name)
    return (parts[-1] if parts else name).lower() in VAGUE


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_begin_with_a_noun_or_a_verb(room):
    lines = [
        line for path, tree in TREES.items() if room in path.relative_to(SOURCE).parts for line in first_lines(tree)
    ]
    wrong = [line for line in lines if re.match(r"\W*(\w*)", line)[1].lower() in BEGINNINGS]
    assert len(wrong) <= MOST_BEGINNINGS * len(lines), wrong


def test_first_lines_are_short():
    assert statistics.median(len(line.split()) for tree in TREES.values() for line in first_lines(tree)) <= MEDIAN_WORDS


def test_names_are_nouns_of_the_field():
    names = [name for tree in TREES.values() for name in assigned_names(tree)]
    vague = Counter(name for name in names if is_vague(name))
    assert vague.total() <= MOST_VAGUE * len(names), vague.most_common(20)


@pytest.mark.parametrize(
    ("name", "vague"), [("found", True), ("points_at_rest", True), ("AsLeft", True), ("range_m", False)]
)
def test_vague_names_are_recognised(name, vague):
    assert is_vague(name) is vague
