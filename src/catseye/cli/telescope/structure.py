"""The command of the structure: flexible models of groups of points, and vibration."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, cast

import typer

from catseye.cli.commands import Json, Quiet, Threads, app
from catseye.cli.live.replay import RunName, run_of
from catseye.cli.networks import Out
from catseye.cli.results import Strict, judge
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.cli.vocabularies import OWN_FUNCTIONS, SERIES_FRAMES, one_of
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.gateways.structure.epochs import ReadEpochs
    from catseye.reduction.structure.series import GroupSeries, Prediction, SeriesModel, StructureFit
    from catseye.reduction.structure.vibration import Vibration


def _pivot(text: str | None) -> str | None:
    if text is not None:
        try:
            good = len([float(v) for v in text.split(",")]) == 3
        except ValueError:
            good = False
        if not good:
            raise typer.BadParameter(f"{text!r} is not x,y,z in metres.")
    return text


@app.command(
    epilog="\b\nExample: catseye structure at-15 at-30 at-45 at-60 at-75 at-85 --points 'DP*' --predict 50 --out dish\n"
    "         catseye structure --epochs epochs.csv --points 'ZEG*' --harmonics 2 --hysteresis --out feed-arm\n"
    "         catseye structure --vibration night.db --points ZEG41040L --out shaking\n"
    "at-15: catseye night night-15 --elevation-deg 15; catseye reduce night-15 --out at-15; the others likewise"
)
def structure(  # noqa: PLR0913 - its options are its command line
    sources: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[REDUCTION]...", help="Directories of `catseye reduce`, or one that holds them."),
    ] = None,
    epochs: Annotated[
        Path | None,
        typer.Option(
            "--epochs",
            metavar="LIST.csv",
            help="reduction,azimuth_deg,elevation_deg[,temperature_c,mjd_utc]: reductions and how the telescope stood.",
        ),
    ] = None,
    journal: Annotated[
        str | None, typer.Option("--journal", metavar="JOURNAL", help="A journal's solutions as epochs.")
    ] = None,
    vibration: Annotated[
        str | None, typer.Option("--vibration", metavar="JOURNAL", help="Spectra and modes of its ranges, instead.")
    ] = None,
    run: RunName = None,
    every_s: Annotated[float, typer.Option("--every-s", help="Of a journal: least between two epochs, s.")] = 0.0,
    points: Annotated[
        list[str] | None, typer.Option("--points", metavar="NAME", help="Point, or pattern such as 'ZEG*'; repeats.")
    ] = None,
    group: Annotated[str, typer.Option("--group", help="Name of the group, for the report.")] = "group",
    frame: Annotated[
        str,
        typer.Option("--frame", metavar=SERIES_FRAMES, callback=one_of(SERIES_FRAMES), help="That carries the points."),
    ] = "reflector",
    pivot: Annotated[
        str | None,
        typer.Option("--pivot", metavar="X,Y,Z", callback=_pivot, help="Of turns, m, in the frame.  [default: middle]"),
    ] = None,
    harmonics: Annotated[int, typer.Option("--harmonics", min=1, max=2, help="Of elevation.")] = 1,
    temperature: Annotated[bool, typer.Option("--temperature/--no-temperature", help="A coefficient of it.")] = True,
    hysteresis: Annotated[bool, typer.Option("--hysteresis", help="Does it matter which way it moved last?")] = False,
    own: Annotated[
        str,
        typer.Option(
            "--own",
            metavar=OWN_FUNCTIONS,
            callback=one_of(OWN_FUNCTIONS),
            help="Each point: its place, or all functions.",
        ),
    ] = "place",
    scatter: Annotated[
        bool, typer.Option("--scatter/--no-scatter", help="Estimate what is new in each epoch (wind).")
    ] = True,
    independent: Annotated[
        bool, typer.Option("--independent", help="Take points of an epoch as independent: for many hundred.")
    ] = False,
    folds: Annotated[int, typer.Option("--folds", min=0, help="Stretches of epochs left out in turn; 0: none.")] = 5,
    predict: Annotated[
        list[float] | None, typer.Option("--predict", metavar="ELEVATION", help="Degrees; repeats.")
    ] = None,
    temperature_c: Annotated[
        float | None, typer.Option("--temperature-c", help="Of the prediction; the mean of the epochs.")
    ] = None,
    way: Annotated[float, typer.Option("--way", min=-1, max=1, help="Of the prediction: 1 risen, -1 fallen.")] = 0.0,
    stretch_s: Annotated[
        float | None, typer.Option("--stretch-s", help="Of a spectrum, s; resolution is 1.5 over it.")
    ] = None,
    less: Annotated[
        str | None,
        typer.Option("--less", metavar="RANGER:TARGET", help="Vibration: taken off each other series of its ranger."),
    ] = None,
    out: Out = None,
    threads: Threads = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Gravity and temperature: how a group of points moves, foretold; and its vibration."""
    if not points:
        raise typer.BadParameter("is needed: a name or a pattern such as 'ZEG*'.", param_hint="'--points'")
    to = _Answer(out, json, quiet, ProgressLine(quiet), strict)
    _refuse(out, [*(sources or []), *([epochs] if epochs else []), *(Path(j) for j in (journal, vibration) if j)])
    try:
        if vibration is not None:
            _vibration(vibration, points, run, stretch_s, less, to)
            return
        given = _read(sources, epochs, journal, run, every_s)
        import numpy as np

        from catseye.reduction.structure.group import group_series
        from catseye.reduction.structure.series import SeriesModel

        kind = cast(Literal["place", "each"], own)
        model = SeriesModel(harmonics, temperature, hysteresis, kind, scatter)
        where = None if pivot is None else np.array([float(v) for v in pivot.split(",")])
        asked = {"elevation_deg": predict or [], "temperature_c": temperature_c, "way": way}
        series = group_series(given.epochs, points, group=group, frame=frame, pivot=where, correlated=not independent)
        source = Path(journal) if journal else (sources or [epochs or Path()])[0]
        _structure(given, series, model, folds, asked, source, to)
    finally:
        to.progress.clear()


class _Answer(NamedTuple):
    """Outputs of a command: a directory, one JSON object or text, and the progress line."""

    out: Path | None
    json: bool
    quiet: bool
    progress: ProgressLine
    strict: bool


def _refuse(out: Path | None, inputs: list[Path]) -> None:
    """Before hours of work: the place to write must be none of the inputs."""
    from catseye.gateways.writers.output import refuse_output

    for source in inputs if out is not None else []:
        refuse_output(cast(Path, out), source)


def _read(
    sources: list[Path] | None, epochs: Path | None, journal: str | None, run: str | None, every_s: float
) -> "ReadEpochs":
    from catseye.gateways.structure.epochs import read_epochs, read_journal_epochs

    if journal is not None:
        if sources or epochs:
            raise InputError("--journal stands alone (expected no reductions and no --epochs beside it)")
        return read_journal_epochs(journal, run=run_of(run), every_s=every_s)
    return read_epochs(sources or [], epochs)


def _structure(
    given: "ReadEpochs",
    series: "GroupSeries",
    model: "SeriesModel",
    folds: int,
    asked: dict[str, Any],
    source: Path,
    to: _Answer,
) -> None:
    """The model fitted, checked by epochs left out, foretold where asked; written and told."""
    from dataclasses import replace

    import numpy as np

    from catseye.constants import DEGREE
    from catseye.gateways.structure.objects import structure_object
    from catseye.reduction.structure.check import left_out
    from catseye.reduction.structure.series import fit_structure
    from catseye.reduction.structure.verdict import structure_verdict

    notes, doubts = given.notes, given.doubts
    if series.spread.full is None:  # the command was asked to take points as independent
        doubts += ("Points of an epoch were taken as independent: what they share makes the claims too small.",)
    if model.temperature and not np.isfinite(np.asarray(series.posture.temperature_c)).any():
        notes += ("No epoch says a temperature: the model has no coefficient of it.",)
        model = replace(model, temperature=False)
    fit = fit_structure(series, model)
    check = left_out(series, model, folds=folds, progress=to.progress) if folds else None
    predicted = None
    if asked["elevation_deg"]:
        e = np.array(asked["elevation_deg"]) * DEGREE
        predicted = fit.predict(e, temperature_c=asked["temperature_c"], way=asked["way"])
        doubts += predicted.outside
    verdict = structure_verdict(check, sources=given.sources, doubts=doubts)
    answer = structure_object(fit, check, predicted, asked=asked, notes=(*doubts, *notes), verdict=verdict)
    if to.out is not None:
        from catseye.gateways.structure.files import write_structure
        from catseye.gateways.writers.output import atomic_directory

        with atomic_directory(to.out, source) as directory:
            write_structure(
                fit,
                directory,
                answer=answer,
                check=check,
                predicted=predicted,
                inputs=given.inputs,
                progress=to.progress,
            )
    if to.json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(answer))
    elif not to.quiet:
        say(wrapped("Verdict", verdict.text))
        _tell(fit, answer, predicted, to.out)
    judge(verdict, strict=to.strict)


def _tell(fit: "StructureFit", answer: dict[str, Any], predicted: "Prediction | None", out: Path | None) -> None:
    import numpy as np

    s = fit.series
    low, high = answer["elevation_deg"]
    say(
        wrapped(
            "Structure",
            f"{len(s.names)} points of {s.group!r} in the frame {s.frame}, {len(s)} epochs, elevation {low:.1f} to "
            f"{high:.1f} degrees. Variance factor {fit.fit.variance_factor:.2f}, "
            f"{fit.fit.degrees_of_freedom} degrees of freedom.",
        )
    )
    six, q = fit.six_of()
    u = np.sqrt(np.maximum(np.diag(q), 0.0)).reshape(-1, 6).T
    say(f"{'':<14}{'function':<10}{'shift x, y, z, mm':>27}   {'turn x, y, z, arcsec':>27}")
    for k, name in enumerate(fit.model.functions):
        shift, turn = (" ".join(f"{v:8.3f}" for v in part) for part in (six[:3, k] * 1e3, six[3:, k] * 206264.806))
        u_shift, u_turn = (" ".join(f"{v:8.3f}" for v in part) for part in (u[:3, k] * 1e3, u[3:, k] * 206264.806))
        say(f"{'':<14}{name:<10} {shift}    {turn}")
        say(f"{'':<14}{'  u':<10} {u_shift}    {u_turn}")
    say(
        wrapped(
            "New each time",
            f"{1e3 * np.linalg.norm(fit.scatter.u_six[:3]):.3f} mm of the group's shift and "
            f"{fit.scatter.u_point * 1e3:.3f} mm of each coordinate are in no function (u).",
        )
    )
    if answer["left_out"] is not None:
        check = answer["left_out"]
        say(
            wrapped(
                "Left out",
                f"epochs not seen by the fit were met to {check['rms'] * 1e3:.3f} mm rms, {check['ratio']:.2f} of what "
                f"was claimed (1 is honest); {check['extrapolated_epochs']} of them by extrapolation.",
            )
        )
    if predicted is not None:
        for k, e in enumerate(answer["prediction"]["elevation_deg"]):
            for i, name in enumerate(predicted.names):
                x, y, z = predicted.place[k, i]
                u_x, u_y, u_z = np.sqrt(np.diag(predicted.covariance[k, i])) * 1e3
                head = f"At {e:g}°" if i == 0 else ""
                say(f"{head:<14}{name}  x {x:9.4f}  y {y:9.4f}  z {z:9.4f} m   u {u_x:.3f}, {u_y:.3f}, {u_z:.3f} mm")
    for note in answer["notes"]:
        say(wrapped("Note", note))
    if out is not None:
        names = "report.html, structure.json, coefficients.csv, residuals.csv, samplers.fits, provenance.json"
        say(wrapped("Written to", f"{out}/: {names}"))


def _vibration(
    journal: str, points: list[str], run: str | None, stretch_s: float | None, less: str | None, to: _Answer
) -> None:
    from catseye.gateways.structure.epochs import read_range_series
    from catseye.gateways.structure.objects import vibration_object
    from catseye.reduction.structure.vibration import difference
    from catseye.reduction.structure.vibration import vibration as found_in

    wanted = points if less is None else [*points, less.partition(":")[2]]
    to.progress("reading ranges", 0, 0)
    series, inputs, zero_mjd = read_range_series(journal, wanted, run=run_of(run))
    if less is not None:
        base = [s for s in series if s.name == less]
        if not base:
            held = ", ".join(s.name for s in series)
            raise InputError(f"--less {less}: no such series (the journal has {held})")
        others = [s for s in series if s.ranger == base[0].ranger and s.name != less]
        series = tuple(difference(s, base[0]) for s in others)
    to.progress("finding modes", 0, 0)
    vibration = found_in(series, stretch=stretch_s)
    if to.out is not None:
        from catseye.gateways.structure.files import write_vibration
        from catseye.gateways.writers.output import atomic_directory

        with atomic_directory(to.out, Path(journal)) as directory:
            write_vibration(vibration, directory, zero_mjd=zero_mjd, inputs=inputs, progress=to.progress)
    to.progress.clear()
    if to.json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(vibration_object(vibration)))
        return
    if not to.quiet:
        _tell_vibration(vibration, to.out)


def _tell_vibration(vibration: "Vibration", out: Path | None) -> None:
    for s in vibration.series:
        say(wrapped("Series", f"{s.name}: {len(s.seconds)} ranges, {s.rate_hz:.3f} a second"))
    for peak in vibration.peaks[:10]:
        where = f"{peak.likely_hz:.4g} Hz" if peak.decided else f"{peak.peak.frequency_hz:.4g} Hz, or an alias of it"
        say(wrapped("Peak", f"{where}: {peak.peak.over:.0f} times the background"))
    for mode in vibration.modes:
        say(
            wrapped(
                "Mode",
                f"{mode.frequency_hz:.4f} Hz, u {mode.u_frequency_hz:.4f} Hz; damping ratio {mode.damping_ratio:.4f}; "
                f"rms {mode.covariance[0, 0] ** 0.5 * 1e6:.1f} µm",
            )
        )
    for note in vibration.notes:
        say(wrapped("Note", note))
    if out is not None:
        say(wrapped("Written to", f"{out}/: report.html, vibration.json, spectra.csv, samplers.fits"))
