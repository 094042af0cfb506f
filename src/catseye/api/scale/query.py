"""`query`: questions to an archive of nights."""

import os
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from catseye.aliases import Progress
from catseye.api.reading import place_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.archive.reading import ArchiveFolder
    from catseye.reduction.query.again import ReReduction
    from catseye.reduction.query.span import ArchiveSpan

Question = Literal["nights", "point", "ranger", "surface", "pose", "certificates", "sql", "again"]
QueryFrame = Literal["ground", "reflector"]
SPANNED = ("nights", "point", "ranger", "surface", "pose")  # questions that a span of time limits


@dataclass(frozen=True, eq=False, repr=False)
class QueryResult(Result):
    """Answer to one question to an archive.

    question   "nights", "point", "ranger", "surface", "pose", "certificates", "sql" or "again"
    answer     everything: arrays in SI units, with the fields of its class
    archive    directory
    nights     number of nights in the archive
    index      SHA-256 over identifiers and inputs of all nights
    """

    question: Question
    answer: Any
    archive: Path
    nights: int
    index: str

    @property
    def table(self) -> "QTable":
        """Main table: a row a night; of certificates, points or a statement's rows."""
        return self.to_table()

    def passages(self) -> "Sequence[Passage]":
        """Answer in sentences."""
        from catseye.gateways.query.answer import FORMS

        return FORMS[self.question].passages(self.answer)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye query --json`: a list of rows for each table."""
        from catseye.gateways.query.answer import answer_object

        return {**self._about(), **answer_object(self.question, self.answer)}

    def tables(self) -> "dict[str, QTable]":
        """Tables of the answer, docs/formats/query.md, under the names of their files without .csv; of SQL `rows`."""
        from catseye.gateways.query.answer import answer_quantities

        found = answer_quantities(self.question, self.answer)
        return {name: quantities(columns) for name, columns in found.items()}

    def figures(self) -> "dict[str, Figure]":
        """Figures: series against `date`, `elevation` and `temperature`; `prisms`; `differences`; none of the rest."""
        from catseye.gateways.query.answer import answer_figures

        return answer_figures(self.question, self.answer)

    def lines(self) -> list[str]:
        """Main table for a terminal; the middle of a long one is left out."""
        from catseye.gateways.query.answer import answer_lines

        return answer_lines(self.question, self.answer)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write result.json, the tables as CSV, the figures as SVG into an empty directory."""
        from catseye.gateways.query.answer import write_answer

        if self.question == "sql":
            self.write_files(directory, progress)
        else:
            write_answer(self.question, self.answer, directory, self.inputs(), self._about(), progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 over identifiers and inputs of the archive's nights."""
        return {"index": self.index}

    def sources(self) -> tuple[Path, ...]:
        """Directory of the archive."""
        return (self.archive,)

    def _about(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict.to_object(),
            "question": self.question,
            "archive": str(self.archive),
            "archived_nights": self.nights,
        }


@with_units
def query(
    directory: "str | os.PathLike[str]",
    *,
    point: str | None = None,
    frame: QueryFrame = "ground",
    ranger: str | None = None,
    surface: bool = False,
    site: "str | os.PathLike[str]" = "gbt",
    pose: str | None = None,
    certificates: str | None = None,
    sql: str | None = None,
    again: str | None = None,
    calibrations: "str | os.PathLike[str] | None" = None,
    since: Annotated[Any, In("mjd", one=True, text=True)] = None,
    until: Annotated[Any, In("mjd", one=True, text=True)] = None,
    progress: Progress | None = None,
) -> QueryResult:
    """Answer of an archive to one question; without one, its nights.

    directory      of the archive, as `archive` writes it
    point          name: its coordinates night by night, in the
    frame          "ground", or "reflector" at the nominal place of each night
    ranger         name: its zero and other parameters, and their drift
    surface        focal length, half-path errors, Zernike terms and prisms of the dish
    site           records with the dish's design, for `surface`
    pose           body, such as "dish": its motion against posture, temperature and date
    certificates   night, or the beginning of its name: records that its result stood on, and their validity
    sql            one SELECT over the archive's tables, docs/formats/archive.md
    again          night: reduced again, and the difference point by point with its uncertainty
    calibrations   site with today's records, for `again`; the night's own without
    since, until   UTC as text, or MJD, of the first and the first excluded night; None for no limit
    progress       called with (what, done, of how many)

    Raises InputError: no archive, an unknown name or night, a damaged file, a statement that is no SELECT;
    ArgumentError: arguments that do not fit together; EstimationError: no answer of a re-reduction.
    """
    from catseye.records.archive.reading import open_archive
    from catseye.reduction.query.span import ArchiveSpan

    named: dict[Question, Any] = {
        "point": point, "ranger": ranger, "surface": surface or None, "pose": pose, "certificates": certificates,
        "sql": sql, "again": again,
    }  # fmt: skip
    question = _question(named)
    _refuse_others(question, frame=frame, calibrations=calibrations, since=since, until=until)
    archive = open_archive(Path(directory))
    span = ArchiveSpan(archive, _mjd("since", since), _mjd("until", until))
    if question == "again":
        answer: Any = _again(archive, str(again), calibrations, progress)
    elif question == "surface":
        answer = _surface(span, site, progress)
    else:
        answer = _answer(span, question, named.get(question), frame)
    return QueryResult(
        verdict=_verdict(question, answer),
        question=question,
        answer=answer,
        archive=Path(directory),
        nights=len(archive.nights),
        index=_digest(archive),
    )


def _question(named: "dict[Question, Any]") -> Question:
    """The one question that is asked; "nights" without one."""
    asked = [name for name, value in named.items() if value is not None]
    if len(asked) > 1:
        raise ArgumentError(f"{' and '.join(asked)} are several questions (expected one)", *asked)
    return asked[0] if asked else "nights"


def _refuse_others(question: Question, *, frame: str, calibrations: Any, since: Any, until: Any) -> None:
    """Raise ArgumentError for what does not belong to the question."""
    if frame not in get_args(QueryFrame):
        raise ArgumentError(f"frame = {frame!r} (expected one of {', '.join(get_args(QueryFrame))})", "frame")
    if frame != "ground" and question != "point":
        raise ArgumentError("frame goes with point only", "frame", "point")
    if calibrations is not None and question != "again":
        raise ArgumentError("calibrations goes with again only", "calibrations", "again")
    for name, value in (("since", since), ("until", until)):
        if value is not None and question not in SPANNED:
            raise ArgumentError(f"{name} does not go with {question}", name, question)


def _mjd(name: str, value: Any) -> float | None:
    if value is None:
        return None
    from catseye.api.journal import mjd_argument

    return mjd_argument(name, value)


def _answer(span: "ArchiveSpan", question: Question, name: Any, frame: QueryFrame) -> Any:
    if question == "point":
        from catseye.reduction.query.point import point_series

        return point_series(span, name, frame)
    if question == "ranger":
        from catseye.reduction.query.ranger import ranger_series

        return ranger_series(span, name)
    if question == "pose":
        from catseye.reduction.query.pose import pose_series

        return pose_series(span, name)
    if question == "certificates":
        from catseye.reduction.query.certificates import night_certificates

        return night_certificates(span, name)
    if question == "sql":
        from catseye.records.query.sql import run_sql

        return run_sql(span.archive, name)
    from catseye.reduction.query.nights import night_rows

    return night_rows(span)


def _surface(span: "ArchiveSpan", site: "str | os.PathLike[str]", progress: Progress | None) -> Any:
    from catseye.records.site.folder import read_site
    from catseye.reduction.query.surface import surface_series
    from catseye.reduction.surface.shape import LitAperture

    aperture = LitAperture.of(read_site(place_of(site)).site.paraboloid)
    return surface_series(span, aperture, progress)


def _again(
    archive: "ArchiveFolder",
    night: str,
    calibrations: "str | os.PathLike[str] | None",
    progress: Progress | None,
) -> "ReReduction":
    """Night restored into a temporary directory and reduced there."""
    from catseye.gateways.archive.restored import write_restored
    from catseye.records.night.campaign import read_campaign
    from catseye.records.site.folder import read_site
    from catseye.reduction.query.again import archived_points, reduced_again

    site = None if calibrations is None else read_site(place_of(calibrations))
    archived = archived_points(archive, night)
    with TemporaryDirectory(prefix="catseye-query-") as place:
        folder = Path(place) / "night"
        write_restored(archive, archived.night, folder)
        return reduced_again(archived, read_campaign(folder), site, progress)


def _verdict(question: Question, answer: Any) -> Any:
    from catseye.verdict import Verdict

    if question != "sql":
        return answer.verdict
    return Verdict("good", f"{answer.count} rows by one SELECT, which judges nothing")


def _digest(archive: "ArchiveFolder") -> str:
    """SHA-256 over identifiers and inputs of all nights."""
    from hashlib import sha256

    lines = (f"{entry.night} {entry.inputs_sha256}\n" for entry in archive.entries.values())
    return sha256("".join(lines).encode()).hexdigest()
