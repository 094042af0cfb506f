"""A journal held against its chain: what was changed, what is missing, what was put in, and from where on."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256

from sqlalchemy import Connection, func, select

from catseye.coordinator.journal.chain import Head, LinkKind, event_cells, link_of, run_link
from catseye.coordinator.journal.reader import PIECE, JournalReader, highest_seq, next_seq
from catseye.coordinator.journal.rows import MOST_WHOLE
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
MOST_TOLD = 20  # problems in words
Progress = Callable[[str, int, int], None]
Stored = list[tuple[JournalTable, Mapping[str, object]]]


@dataclass
class ChainReport:
    """What checking one run came to.

    run, uuid   of the run; "" where its own record cannot be read
    chained     whether it has a chain: one written before version 2 has none, and nothing of it was checked; without
                problems it is one of those
    ended       whether its chain has an end: without one it lasts, was killed, or was cut
    events      stored, by their links
    given       heads that it was held against
    heads       of those, that are in the chain
    problems    one line each: the first 20
    count       of all problems
    bad         events that are not as they were written, or cannot be read
    unvouched   of those, that have no link, or no samples: put in, robbed of them, or pages were lost
    ended_ticks when, by the run's record
    first       the first event from which on something is wrong; None where nothing is
    head        the last link; None without a chain
    begins, last   seq and link of the file before with which this one begins, (0, b"") of none; of its last link
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
        """Whether all is as it was written, as far as a chain can tell."""
        return self.chained and not self.count

    def wrong(self, seq: int, text: str, *, bad: bool = False) -> None:
        """Note a problem at an event; `bad`: the event itself."""
        self.count += 1
        if len(self.problems) < MOST_TOLD:
            self.problems.append(text)
        self.first = seq if self.first is None else min(self.first, seq)
        if bad:
            self.bad.add(seq)


def check_whole(
    reader: JournalReader, run: int, *, heads: Sequence[Head] = (), progress: Progress = lambda what, done, of: None
) -> ChainReport:
    """`check_run` of a run in all its files, and whether each goes on where the one before ends; one report.

    A file of the run that is missing, or named in a circle, is a problem of this one, of which the rest is checked.
    """
    try:
        parts = reader.parts(run)
    except InputError as problem:
        report = check_run(reader, run, heads=heads, progress=progress)
        report.wrong(report.last[0] + 1, f"the run's other files cannot be read: {problem}")
        return report
    if len(parts) == 1:
        return check_run(reader, run, heads=heads, progress=progress)
    starts = [_begin(part, run) for part in parts]
    reports = []
    for part, after, upto in zip(parts, starts, [*starts[1:], None], strict=True):
        mine = [head for head in heads if after < head.seq and (upto is None or head.seq <= upto)]
        reports.append(check_run(part, run, heads=mine, progress=progress))
    whole = reports[0]
    for part, report in zip(parts[1:], reports[1:], strict=True):
        if report.begins != whole.last:
            text = f"{part.place} does not go on where the file before it ends, at event {whole.last[0]}"
            whole.wrong(whole.last[0] + 1, text)
        whole.problems += [f"{part.place}: {text}" for text in report.problems]
        del whole.problems[MOST_TOLD:]
        whole.count += report.count
        whole.bad |= report.bad
        whole.unvouched |= report.unvouched
        firsts = [first for first in (whole.first, report.first) if first is not None]
        whole.first = min(firsts) if firsts else None
        whole.events, whole.heads = whole.events + report.events, whole.heads + report.heads
        whole.given += report.given
        whole.ended, whole.last, whole.head = report.ended, report.last, report.head or whole.head
    return whole


def check_run(
    reader: JournalReader, run: int, *, heads: Sequence[Head] = (), progress: Progress = lambda what, done, of: None
) -> ChainReport:
    """Each event of a run held against its link.

    heads   links that were told at the time and kept elsewhere: another history, or a cut one, does not have them

    Nothing is raised for a damaged journal: what cannot be read is a problem like others, and what is whole is counted.
    """
    report = ChainReport(run, given=len(heads))
    if reader.version < FIRST_CHAINED:
        _before_chains(reader, report, heads)
        return report
    if not _chain_there(reader, report):
        return report
    first, stored, last = _of_the_run(reader, report)
    if first is None and not (last and _count(reader, run)):
        _without_chain(reader, report, heads)
        return report
    if first is None:
        report.wrong(0, "the run's first link is missing, though links of its events are there")
    elif stored is not None and first != stored:
        report.wrong(0, "the run's own record, or the list of its files, is not what was written")
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
            before = ()  # what this link was made from is gone; the next one tells
        before, at = _link(report, seq, kind, link, rows, before), seq
        if link is not None and any(head.seq == seq for head in heads):
            links[seq] = link
    if report.ended_ticks is not None and not report.ended:
        report.wrong(at + 1, f"the run ended, and its chain stops at event {at}: what stood behind is missing")
    _heads(report, heads, links, at)
    return report


def _before_chains(reader: JournalReader, report: ChainReport, heads: Sequence[Head]) -> None:
    """A run of version 1: without a chain, unless the version was set back."""
    report.chained = False
    later = sorted({CHAIN.name, PARTS.name} & reader.tables)
    if later:
        text = f"its version is {reader.version} and it has the table {later[0]!r} of version {FIRST_CHAINED}"
        report.wrong(0, f"{text}: the version was set back")
    _unheld(report, heads)


def _chain_there(reader: JournalReader, report: ChainReport) -> bool:
    """True where there are links to hold the rest against; each missing table is a problem."""
    missing = sorted(set(METADATA.tables) - reader.tables)
    for name in missing:
        report.wrong(0, f"table {name!r} is missing (expected in a journal of version {reader.version})")
    report.chained = CHAIN.name not in missing
    return report.chained


def _there(reader: JournalReader) -> list[JournalTable]:
    """Tables of events and links that are there: what the others hold is checked though one was taken away."""
    return [table for table in (*STORED, CHAIN) if table.name in reader.tables]


def _without_chain(reader: JournalReader, report: ChainReport, heads: Sequence[Head]) -> None:
    """A run without links in a journal that has chains: of before it was carried to version 2, or robbed.

    The first link of the first run with a chain was made from nothing where no run before it had one.
    """
    report.chained = False
    try:
        with reader.reading() as connection:
            first = connection.execute(
                select(CHAIN.c.run, CHAIN.c.link).where(CHAIN.c.seq == 0).order_by(CHAIN.c.run).limit(1)
            ).first()
            carried = first is not None and first.run > report.run and first.link == run_link(connection, first.run)
    except InputError as problem:
        report.wrong(0, f"the journal's chains cannot be read: {problem}")
        return
    if not carried:
        report.wrong(0, f"the run has no chain in a journal of version {reader.version}: it was taken away")
    _unheld(report, heads)


def _unheld(report: ChainReport, heads: Sequence[Head]) -> None:
    for head in heads:
        report.wrong(head.seq, f"head {head} was told, and the run has no chain")


def _numbers(reader: JournalReader, report: ChainReport) -> int:
    """The highest number that an event of the file can have; rows whose numbers none has are problems.

    Text, bytes, a number below the first, or far above the last.
    """
    most = min(MOST_WHOLE, max(0, _begin(reader, report.run)) + reader.most_events)
    for table in _there(reader):
        seq, least = table.c.seq, 0 if table is CHAIN else 1
        try:
            with reader.reading() as connection:
                strange = seq < least
                if connection.dialect.name == "sqlite":
                    strange |= seq > MOST_WHOLE
                row = connection.execute(select(seq).where(table.c.run == report.run, strange).limit(1)).first()
                far = select(seq).where(table.c.run == report.run, seq > most, seq <= MOST_WHOLE).limit(PIECE)
                beyond = [int(str(each).partition(".")[0]) for each in connection.scalars(far)]
        except InputError as problem:
            report.wrong(0, f"table {table.name!r} cannot be read: {problem}")
            continue
        if row is not None:
            report.wrong(0, f"a row of {table.name!r} has the number {row[0]!r}, which no event has: it was put in")
        for each in beyond:
            text = f"event {each} is beyond what the file can hold (at most {most}): it was put in"
            report.wrong(each, text, bad=True)
    return most


def held_by(reader: JournalReader, run: int, head: Head) -> bool:
    """True where a run, in any of its files, has the link of a head."""
    for part in reader.parts(run):
        if CHAIN.name not in part.tables:
            continue
        with part.reading() as connection:
            link = connection.scalar(select(CHAIN.c.link).where(CHAIN.c.run == run, CHAIN.c.seq == head.seq))
        if isinstance(link, bytes) and head.fits(link):
            return True
    return False


def _heads(report: ChainReport, heads: Sequence[Head], links: Mapping[int, bytes], last: int) -> None:
    """What was told at the time against the links of its events, and the last event."""
    for head in heads:
        link = links.get(head.seq)
        if head.seq > last:
            report.wrong(last + 1, f"the chain ends at event {last}, and a head of event {head.seq} was told")
        elif link is None or not head.fits(link):
            has = "no link" if link is None else link.hex()[: len(head.digits)]
            report.wrong(head.seq, f"another history: event {head.seq} has {has}, and {head.digits} was told")
        else:
            report.heads += 1


def _begin(reader: JournalReader, run: int) -> int:
    """Seq of the link with which a later file of a run begins; -1 of the first file, or where it cannot be read."""
    try:
        with reader.reading() as connection:
            first = select(CHAIN.c.seq, CHAIN.c.kind).where(CHAIN.c.run == run, CHAIN.c.seq > 0)
            row = connection.execute(first.order_by(CHAIN.c.seq).limit(1)).first()
    except InputError:
        return -1
    seq = None if row is None or row.kind != LinkKind.PART.value else row.seq
    return seq if isinstance(seq, int) else -1


def parted(one: JournalReader, other: JournalReader, uuid: str) -> tuple[int | None, int]:
    """The first event at which two journals' chains of a run differ, None if nowhere; and the last that both have.

    Raises InputError: one of them does not hold the run, or has no chain of it.
    """
    chains = []
    for reader in (one, other):
        number = reader.run(uuid).run
        with reader.reading() as connection:
            rows = connection.execute(select(CHAIN.c.seq, CHAIN.c.link).where(CHAIN.c.run == number))
            chains.append({row.seq: row.link for row in rows})
        if not chains[-1]:
            raise InputError(f"journal {reader.place}: run {uuid} has no chain (expected one to compare)")
    both = sorted(set(chains[0]) & set(chains[1]))
    differing = [seq for seq in both if chains[0][seq] != chains[1][seq]]
    return (differing[0] if differing else None), (both[-1] if both else 0)


def _of_the_run(reader: JournalReader, report: ChainReport) -> tuple[bytes | None, bytes | None, int | None]:
    """The run's first link as stored, as its record gives it, and its last seq; None each where it cannot be had."""
    first, stored, last = None, None, None
    try:
        with reader.reading() as connection:
            row = connection.execute(select(RUNS.c.uuid, RUNS.c.ended_ticks).where(RUNS.c.run == report.run)).first()
            if row is not None:
                report.uuid, report.ended_ticks = str(row.uuid), row.ended_ticks
            first = connection.scalar(select(CHAIN.c.link).where(CHAIN.c.run == report.run, CHAIN.c.seq == 0))
            last = max(highest_seq(connection, table, report.run) for table in _there(reader))
            stored = run_link(connection, report.run)
            _integrity(connection, report)
    except InputError as problem:
        report.wrong(0, f"the run's record cannot be read: {problem}")
    return (first if isinstance(first, bytes) else None), stored, last


def _integrity(connection: Connection, report: ChainReport) -> None:
    """What SQLite itself says of its file, in one line."""
    if connection.dialect.name == "sqlite":
        said = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
        if said != "ok":
            report.wrong(0, f"the file is damaged: {' '.join(str(said).split())[:160]}")


def _count(reader: JournalReader, run: int) -> int:
    try:
        with reader.reading() as connection:
            return int(connection.scalar(select(func.count()).select_from(CHAIN).where(CHAIN.c.run == run)) or 0)
    except InputError:
        return 0


def _files(reader: JournalReader, report: ChainReport) -> None:
    """The texts of a run's files against their hashes."""
    if not reader.tables.issuperset((RUN_FILES.name, TEXTS.name)):
        return  # which has been told
    wanted = (
        select(RUN_FILES.c.path, RUN_FILES.c.sha256, TEXTS.c.text)
        .join(TEXTS, RUN_FILES.c.sha256 == TEXTS.c.sha256, isouter=True)
        .where(RUN_FILES.c.run == report.run)
    )
    try:
        with reader.reading() as connection:
            for row in connection.execute(wanted):
                text = row.text if isinstance(row.text, str) else ""
                if sha256(text.encode("utf-8", "surrogatepass")).hexdigest() != row.sha256:
                    report.wrong(0, f"file {row.path} of the run is not what was written")
    except InputError as problem:
        report.wrong(0, f"the run's files cannot be read: {problem}")


def _links(
    reader: JournalReader, report: ChainReport, last: int, progress: Progress
) -> Iterator[tuple[int, str, bytes | None, Stored]]:
    """Each number's kind ("" without a link), link and rows, in order; what cannot be read is noted and passed over."""
    at = 0
    while at < last:
        upto, empty = min(at + PIECE, last), True
        for found in _span(reader, report, at, upto):
            empty = False
            yield found
        progress("events", upto, last)
        at = max(upto, _next(reader, report.run, upto) - 1) if empty else upto  # a number may be far above the others


def _next(reader: JournalReader, run: int, after: int) -> int:
    """The first number behind one that any row has; the one behind it where that cannot be read."""
    try:
        with reader.reading() as connection:
            return next_seq(connection, _there(reader), run, after)
    except InputError:
        return after + 1


def _span(
    reader: JournalReader, report: ChainReport, first: int, last: int
) -> Iterator[tuple[int, str, bytes | None, Stored]]:
    """Those between two numbers; what cannot be read is looked for by halves."""
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
                report.wrong(upto, f"event {upto} cannot be read: {problem}", bad=True)
                yield upto, "", None, []
            continue
        yield from piece


def _piece(reader: JournalReader, run: int, after: int, upto: int) -> list[tuple[int, str, bytes | None, Stored]]:
    rows: dict[int, Stored] = {}
    with reader.reading() as connection:

        def read(table: JournalTable) -> list[Mapping[str, object]]:
            wanted = select(table).where(table.c.run == run, table.c.seq > after, table.c.seq <= upto)
            return [dict(row) for row in connection.execute(wanted).mappings()]

        links = {_seq(row): row for row in read(CHAIN)}
        for table in _there(reader):
            for row in read(table) if table is not CHAIN else ():
                rows.setdefault(_seq(row), []).append((table, row))
    found = []
    for seq in sorted(set(links) | set(rows)):
        link = links.get(seq)
        kept = link["link"] if link is not None else None
        kind = str(link["kind"]) if link is not None else ""
        found.append((seq, kind, kept if isinstance(kept, bytes) else None, rows.get(seq, [])))
    return found


def _seq(row: Mapping[str, object]) -> int:
    seq = row["seq"]
    if not isinstance(seq, int):
        raise InputError(f"a row has the number {seq!r} (expected a whole one)")
    return seq


def _link(
    report: ChainReport, seq: int, kind: str, link: bytes | None, rows: Stored, before: tuple[bytes, ...]
) -> tuple[bytes, ...]:
    """One number held against its link; what the next may be made from: the stored link, or what it should be."""
    if link is None:
        if rows:
            report.wrong(seq, f"event {seq} has no link: it was put in, or its link was taken out", bad=True)
            report.unvouched.add(seq)
        return ()
    if report.ended:
        report.wrong(seq, f"event {seq} stands behind the run's end", bad=True)
    report.events += kind == LinkKind.EVENT.value
    report.head, report.last = Head.of(seq, link), (seq, link)
    report.ended = report.ended or kind == LinkKind.END.value
    wanted = [] if kind == LinkKind.EVENT.value and not rows else _wanted(seq, kind, rows, before, report.ended_ticks)
    if kind == LinkKind.EVENT.value and not rows:
        report.wrong(seq, f"event {seq} is missing", bad=True)
    elif kind != LinkKind.EVENT.value and rows:
        was = "refused" if kind == LinkKind.REFUSED.value else "never written"
        report.wrong(seq, f"event {seq} was {was}, and is there", bad=True)
    elif (
        before and kind != LinkKind.PART.value and link not in wanted
    ):  # without the one before nothing can be said, which has been told
        what = "the end" if kind == LinkKind.END.value else f"event {seq}"
        report.wrong(seq, f"{what} is not what was written, or its link is not", bad=True)
        if {table.name for table, _ in rows} == {SHOTS.name}:
            report.unvouched.add(seq)
    return (link,) if link in wanted else (link, *wanted[:1])


def _wanted(seq: int, kind: str, rows: Stored, before: tuple[bytes, ...], ended: int | None) -> list[bytes]:
    """What a link should be by each of what it may be made from; none of a cell or a kind that was never written."""
    try:
        cells: list[object] = event_cells(rows) if kind == LinkKind.EVENT.value else []
        if kind == LinkKind.END.value:
            cells = [ended]
        return [link_of(each, LinkKind(kind), seq, cells) for each in before]
    except (TypeError, ValueError):
        return []


def _missing(first: int, last: int) -> str:
    return f"event {first} is missing" if first == last else f"events {first} to {last} are missing"
