"""Verification of a journal against its chain."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256

from sqlalchemy import Connection, func, select

from catseye.aliases import Progress
from catseye.coordinator.journal.chain import Head, LinkKind, event_cells, link_of, run_link
from catseye.coordinator.journal.reader import PIECE, JournalReader, highest_seq, next_seq
from catseye.coordinator.journal.rows import LARGEST_INTEGER
from catseye.coordinator.journal.tables import (
    BUFFERS,
    CHAIN,
    EVENTS,
    FIRST_CHAINED,
    METADATA,
    PARTS,
    RUN_FILES,
    RUNS,
    SHOTS,
    TEXTS,
    JournalTable,
)
from catseye.errors import InputError

STORED = (*EVENTS, BUFFERS)
MOST_PROBLEMS = 20  # problems reported in words
Stored = list[tuple[JournalTable, Mapping[str, object]]]


@dataclass
class ChainReport:
    """Result of the verification of one run.

    run, uuid   of the run; "" if its own record is unreadable
    chained     True if it has a chain: one written before version 2 has none, and was not verified; without problems it
                is such a run
    ended       True if its chain has an end: otherwise it is running, was killed, or was cut
    events      stored, by their links
    given       heads given for the verification
    heads       number of those in the chain
    problems    one line each: the first 20
    count       of all problems
    bad         altered or unreadable events
    unvouched   of those, the ones without a link, or without samples: inserted, stripped, or pages were lost
    ended_ticks by the run's record
    first       the first event from which on something is wrong; None if nothing is
    head        the last link; None without a chain
    begins, last   seq and link of the previous file with which this one begins, (0, b"") if none; of its last link
    """

    run: int
    uuid: str = ""
    chained: bool = True
    ended: bool = False
    events: int = 0
    given: int = 0
    heads: int = 0
    problems: list[str] = field(default_factory=list)
    count: int = 0
    bad: set[int] = field(default_factory=set)
    unvouched: set[int] = field(default_factory=set)
    first: int | None = None
    ended_ticks: int | None = None
    head: Head | None = None
    begins: tuple[int, bytes] = (0, b"")
    last: tuple[int, bytes] = (0, b"")

    @property
    def intact(self) -> bool:
        """True if everything verifies, as far as a chain can tell."""
        return self.chained and not self.count

    def wrong(self, seq: int, text: str, *, bad: bool = False) -> None:
        """Add a problem at an event; `bad`: the event itself."""
        self.count += 1
        if len(self.problems) < MOST_PROBLEMS:
            self.problems.append(text)
        self.first = seq if self.first is None else min(self.first, seq)
        if bad:
            self.bad.add(seq)


def verify_run(
    reader: JournalReader, run: int, *, heads: Sequence[Head] = (), progress: Progress = lambda what, done, of: None
) -> ChainReport:
    """Verify a run in all its files and their continuity; one report.

    A file of the run that is missing, or named in a circle, is a problem of this one, whose remainder is verified.
    """
    try:
        parts = reader.parts(run)
    except InputError as problem:
        report = check_run(reader, run, heads=heads, progress=progress)
        report.wrong(report.last[0] + 1, f"the run's other files are unreadable: {problem}")
        return report
    if len(parts) == 1:
        return check_run(reader, run, heads=heads, progress=progress)
    starts = [_begin(part, run) for part in parts]
    reports = []
    for part, after, upto in zip(parts, starts, [*starts[1:], None], strict=True):
        mine = [head for head in heads if after < head.seq and (upto is None or head.seq <= upto)]
        reports.append(check_run(part, run, heads=mine, progress=progress))
    total = reports[0]
    for part, report in zip(parts[1:], reports[1:], strict=True):
        if report.begins != total.last:
            text = f"{part.place} does not continue where the previous file ends, at event {total.last[0]}"
            total.wrong(total.last[0] + 1, text)
        total.problems += [f"{part.place}: {text}" for text in report.problems]
        del total.problems[MOST_PROBLEMS:]
        total.count += report.count
        total.bad |= report.bad
        total.unvouched |= report.unvouched
        firsts = [first for first in (total.first, report.first) if first is not None]
        total.first = min(firsts) if firsts else None
        total.events, total.heads = total.events + report.events, total.heads + report.heads
        total.given += report.given
        total.ended, total.last, total.head = report.ended, report.last, report.head or total.head
    return total


def check_run(
    reader: JournalReader, run: int, *, heads: Sequence[Head] = (), progress: Progress = lambda what, done, of: None
) -> ChainReport:
    """Verify each event of a run against its link.

    heads   links published at the time and kept elsewhere: a rewritten or cut history does not have them

    Nothing is raised for a damaged journal: unreadable parts are problems like others, and intact ones are counted.
    """
    report = ChainReport(run, given=len(heads))
    if reader.version < FIRST_CHAINED:
        _before_chains(reader, report, heads)
        return report
    if not _chain_exists(reader, report):
        return report
    first, stored, last = _of_the_run(reader, report)
    if first is None and not (last and _count(reader, run)):
        _without_chain(reader, report, heads)
        return report
    if first is None:
        report.wrong(0, "the run's first link is missing, but its events have links")
    elif stored is not None and first != stored:
        report.wrong(0, "the run's record, or the list of its files, was altered")
    _files(reader, report)
    last = min(last or 0, _numbers(reader, report))
    before, at = tuple(link for link in (first, stored) if link is not None), 0
    links = {} if first is None else {0: first}
    for seq, kind, link, rows in _links(reader, report, last, progress):
        if kind == LinkKind.PART.value and at == 0 and link is not None:
            report.begins = seq, link
            before = ()
        elif seq > at + 1:
            report.wrong(at + 1, _missing(at + 1, seq - 1))
            before = ()  # the predecessor of this link is missing; the next one can be verified
        before, at = _link(report, seq, kind, link, rows, before), seq
        if link is not None and any(head.seq == seq for head in heads):
            links[seq] = link
    if report.ended_ticks is not None and not report.ended:
        report.wrong(at + 1, f"the run ended, but its chain stops at event {at}: later events are missing")
    _heads(report, heads, links, at)
    return report


def _before_chains(reader: JournalReader, report: ChainReport, heads: Sequence[Head]) -> None:
    """Report a run of version 1: unchained, unless the version was set back."""
    report.chained = False
    later = sorted({CHAIN.name, PARTS.name} & reader.tables)
    if later:
        text = f"its version is {reader.version}, but it has the table {later[0]!r} of version {FIRST_CHAINED}"
        report.wrong(0, f"{text}: the version was set back")
    _unverified_heads(report, heads)


def _chain_exists(reader: JournalReader, report: ChainReport) -> bool:
    """True if there are links to verify against; each missing table is a problem."""
    missing = sorted(set(METADATA.tables) - reader.tables)
    for name in missing:
        report.wrong(0, f"table {name!r} is missing (expected in a journal of version {reader.version})")
    report.chained = CHAIN.name not in missing
    return report.chained


def _existing_tables(reader: JournalReader) -> list[JournalTable]:
    """Tables of events and links that exist: the others are verified though one is missing."""
    return [table for table in (*STORED, CHAIN) if table.name in reader.tables]


def _without_chain(reader: JournalReader, report: ChainReport, heads: Sequence[Head]) -> None:
    """Report a run without links in a journal with chains.

    It is from before the conversion to version 2, or its chain was removed. The first link of the first run with a
    chain was made from nothing if no run before it had one.
    """
    report.chained = False
    try:
        with reader.reading() as connection:
            first = connection.execute(
                select(CHAIN.c.run, CHAIN.c.link).where(CHAIN.c.seq == 0).order_by(CHAIN.c.run).limit(1)
            ).first()
            converted = first is not None and first.run > report.run and first.link == run_link(connection, first.run)
    except InputError as problem:
        report.wrong(0, f"the journal's chains are unreadable: {problem}")
        return
    if not converted:
        report.wrong(0, f"the run has no chain in a journal of version {reader.version}: it was removed")
    _unverified_heads(report, heads)


def _unverified_heads(report: ChainReport, heads: Sequence[Head]) -> None:
    for head in heads:
        report.wrong(head.seq, f"head {head} was given, but the run has no chain")


def _numbers(reader: JournalReader, report: ChainReport) -> int:
    """Highest possible number of an event; impossible numbers are problems.

    Text, bytes, a number below the first, or far above the last.
    """
    most = min(LARGEST_INTEGER, max(0, _begin(reader, report.run)) + reader.most_events)
    for table in _existing_tables(reader):
        seq, least = table.c.seq, 0 if table is CHAIN else 1
        try:
            with reader.reading() as connection:
                strange = seq < least
                if connection.dialect.name == "sqlite":
                    strange |= seq > LARGEST_INTEGER
                row = connection.execute(select(seq).where(table.c.run == report.run, strange).limit(1)).first()
                far = select(seq).where(table.c.run == report.run, seq > most, seq <= LARGEST_INTEGER).limit(PIECE)
                excessive = [int(str(number).partition(".")[0]) for number in connection.scalars(far)]
        except InputError as problem:
            report.wrong(0, f"table {table.name!r} is unreadable: {problem}")
            continue
        if row is not None:
            report.wrong(0, f"a row of {table.name!r} has the impossible number {row[0]!r}: it was inserted")
        for number in excessive:
            text = f"event {number} is beyond the file's capacity (at most {most}): it was inserted"
            report.wrong(number, text, bad=True)
    return most


def has_head(reader: JournalReader, run: int, head: Head) -> bool:
    """True if a run, in any of its files, has the link of a head."""
    for part in reader.parts(run):
        if CHAIN.name not in part.tables:
            continue
        with part.reading() as connection:
            link = connection.scalar(select(CHAIN.c.link).where(CHAIN.c.run == run, CHAIN.c.seq == head.seq))
        if isinstance(link, bytes) and head.fits(link):
            return True
    return False


def _heads(report: ChainReport, heads: Sequence[Head], links: Mapping[int, bytes], last: int) -> None:
    """Compare given heads with the links of their events."""
    for head in heads:
        link = links.get(head.seq)
        if head.seq > last:
            report.wrong(last + 1, f"the chain ends at event {last}, but a head of event {head.seq} was given")
        elif link is None or not head.fits(link):
            has = "no link" if link is None else link.hex()[: len(head.digits)]
            report.wrong(head.seq, f"another history: event {head.seq} has {has}, but {head.digits} was given")
        else:
            report.heads += 1


def _begin(reader: JournalReader, run: int) -> int:
    """Seq of the first link of a later file; -1 for the first file."""
    try:
        with reader.reading() as connection:
            first = select(CHAIN.c.seq, CHAIN.c.kind).where(CHAIN.c.run == run, CHAIN.c.seq > 0)
            row = connection.execute(first.order_by(CHAIN.c.seq).limit(1)).first()
    except InputError:
        return -1
    seq = None if row is None or row.kind != LinkKind.PART.value else row.seq
    return seq if isinstance(seq, int) else -1


def parted(one: JournalReader, second: JournalReader, uuid: str) -> tuple[int | None, int]:
    """First event at which two chains of a run differ, and last common event.

    The first is None if they do not differ.

    Raises InputError: one of them lacks the run, or has no chain of it.
    """
    chains = []
    for reader in (one, second):
        number = reader.run(uuid).run
        with reader.reading() as connection:
            rows = connection.execute(select(CHAIN.c.seq, CHAIN.c.link).where(CHAIN.c.run == number))
            chains.append({row.seq: row.link for row in rows})
        if not chains[-1]:
            raise InputError(f"journal {reader.place}: run {uuid} has no chain (expected one to compare)")
    common = sorted(set(chains[0]) & set(chains[1]))
    differing = [seq for seq in common if chains[0][seq] != chains[1][seq]]
    return (differing[0] if differing else None), (common[-1] if common else 0)


def _of_the_run(reader: JournalReader, report: ChainReport) -> tuple[bytes | None, bytes | None, int | None]:
    """First link as stored and as computed, and last seq of a run.

    None each if unavailable.
    """
    first, stored, last = None, None, None
    try:
        with reader.reading() as connection:
            row = connection.execute(select(RUNS.c.uuid, RUNS.c.ended_ticks).where(RUNS.c.run == report.run)).first()
            if row is not None:
                report.uuid, report.ended_ticks = str(row.uuid), row.ended_ticks
            first = connection.scalar(select(CHAIN.c.link).where(CHAIN.c.run == report.run, CHAIN.c.seq == 0))
            last = max(highest_seq(connection, table, report.run) for table in _existing_tables(reader))
            stored = run_link(connection, report.run)
            _integrity(connection, report)
    except InputError as problem:
        report.wrong(0, f"the run's record is unreadable: {problem}")
    return (first if isinstance(first, bytes) else None), stored, last


def _integrity(connection: Connection, report: ChainReport) -> None:
    """Report SQLite's own check of its file, in one line."""
    if connection.dialect.name == "sqlite":
        answer = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
        if answer != "ok":
            report.wrong(0, f"the file is damaged: {' '.join(str(answer).split())[:160]}")


def _count(reader: JournalReader, run: int) -> int:
    try:
        with reader.reading() as connection:
            return int(connection.scalar(select(func.count()).select_from(CHAIN).where(CHAIN.c.run == run)) or 0)
    except InputError:
        return 0


def _files(reader: JournalReader, report: ChainReport) -> None:
    """Verify the texts of a run's files by their hashes."""
    if not reader.tables.issuperset((RUN_FILES.name, TEXTS.name)):
        return  # reported by `_chain_exists`
    query = (
        select(RUN_FILES.c.path, RUN_FILES.c.sha256, TEXTS.c.text)
        .join(TEXTS, RUN_FILES.c.sha256 == TEXTS.c.sha256, isouter=True)
        .where(RUN_FILES.c.run == report.run)
    )
    try:
        with reader.reading() as connection:
            for row in connection.execute(query):
                text = row.text if isinstance(row.text, str) else ""
                if sha256(text.encode("utf-8", "surrogatepass")).hexdigest() != row.sha256:
                    report.wrong(0, f"file {row.path} of the run was altered")
    except InputError as problem:
        report.wrong(0, f"the run's files are unreadable: {problem}")


def _links(
    reader: JournalReader, report: ChainReport, last: int, progress: Progress
) -> Iterator[tuple[int, str, bytes | None, Stored]]:
    """Kind ("" without a link), link and rows of each number, in order.

    Unreadable ones are reported and skipped.
    """
    at = 0
    while at < last:
        upto, empty = min(at + PIECE, last), True
        for item in _span(reader, report, at, upto):
            empty = False
            yield item
        progress("events", upto, last)
        at = max(upto, _next(reader, report.run, upto) - 1) if empty else upto  # there may be a large gap of numbers


def _next(reader: JournalReader, run: int, after: int) -> int:
    """Next number of any row; the following one if unreadable."""
    try:
        with reader.reading() as connection:
            return next_seq(connection, _existing_tables(reader), run, after)
    except InputError:
        return after + 1


def _span(
    reader: JournalReader, report: ChainReport, first: int, last: int
) -> Iterator[tuple[int, str, bytes | None, Stored]]:
    """Links between two numbers; unreadable ones are located by bisection."""
    spans = [(first, last)]
    while spans:
        after, upto = spans.pop()
        try:
            piece = _piece(reader, report.run, after, upto)
        except InputError as problem:
            if upto - after > 1:
                middle = (after + upto) // 2
                spans += [(middle, upto), (after, middle)]
            else:
                report.wrong(upto, f"event {upto} is unreadable: {problem}", bad=True)
                yield upto, "", None, []
            continue
        yield from piece


def _piece(reader: JournalReader, run: int, after: int, upto: int) -> list[tuple[int, str, bytes | None, Stored]]:
    rows: dict[int, Stored] = {}
    with reader.reading() as connection:

        def read(table: JournalTable) -> list[Mapping[str, object]]:
            query = select(table).where(table.c.run == run, table.c.seq > after, table.c.seq <= upto)
            return [dict(row) for row in connection.execute(query).mappings()]

        links = {_seq(row): row for row in read(CHAIN)}
        for table in _existing_tables(reader):
            for row in read(table) if table is not CHAIN else ():
                rows.setdefault(_seq(row), []).append((table, row))
    items = []
    for seq in sorted(set(links) | set(rows)):
        link = links.get(seq)
        stored_link = link["link"] if link is not None else None
        kind = str(link["kind"]) if link is not None else ""
        items.append((seq, kind, stored_link if isinstance(stored_link, bytes) else None, rows.get(seq, [])))
    return items


def _seq(row: Mapping[str, object]) -> int:
    seq = row["seq"]
    if not isinstance(seq, int):
        raise InputError(f"a row has the number {seq!r} (expected a whole one)")
    return seq


def _link(
    report: ChainReport, seq: int, kind: str, link: bytes | None, rows: Stored, before: tuple[bytes, ...]
) -> tuple[bytes, ...]:
    """Verify one number against its link; possible predecessors of the next.

    They are the stored link, or the expected one.
    """
    if link is None:
        if rows:
            report.wrong(seq, f"event {seq} has no link: it was inserted, or its link was removed", bad=True)
            report.unvouched.add(seq)
        return ()
    if report.ended:
        report.wrong(seq, f"event {seq} follows the run's end", bad=True)
    report.events += kind == LinkKind.EVENT.value
    report.head, report.last = Head.of(seq, link), (seq, link)
    report.ended = report.ended or kind == LinkKind.END.value
    expected = (
        []
        if kind == LinkKind.EVENT.value and not rows
        else _expected_links(seq, kind, rows, before, report.ended_ticks)
    )
    if kind == LinkKind.EVENT.value and not rows:
        report.wrong(seq, f"event {seq} is missing", bad=True)
    elif kind != LinkKind.EVENT.value and rows:
        was = "refused" if kind == LinkKind.REFUSED.value else "never written"
        report.wrong(seq, f"event {seq} was {was}, but exists", bad=True)
    elif (
        before and kind != LinkKind.PART.value and link not in expected
    ):  # cannot be verified without its predecessor, which is reported
        what = "the end" if kind == LinkKind.END.value else f"event {seq}"
        report.wrong(seq, f"{what} or its link was altered", bad=True)
        if {table.name for table, _ in rows} == {SHOTS.name}:
            report.unvouched.add(seq)
    return (link,) if link in expected else (link, *expected[:1])


def _expected_links(
    seq: int, kind: str, rows: Stored, before: tuple[bytes, ...], ended_ticks: int | None
) -> list[bytes]:
    """Expected links by each possible predecessor.

    None for a cell or a kind that was never written.
    """
    try:
        cells: list[object] = event_cells(rows) if kind == LinkKind.EVENT.value else []
        if kind == LinkKind.END.value:
            cells = [ended_ticks]
        return [link_of(predecessor, LinkKind(kind), seq, cells) for predecessor in before]
    except (TypeError, ValueError):
        return []


def _missing(first: int, last: int) -> str:
    return f"event {first} is missing" if first == last else f"events {first} to {last} are missing"
