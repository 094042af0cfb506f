"""The commands of pointing: the series fitted, told, and the track under it."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, judge
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import POINTING_TERMS
from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError

if TYPE_CHECKING:
    from catseye.gateways.pose.pointing_series_objects import Observed
    from catseye.reduction.pose.pointing_fit import PointingFit, SeriesComparison

TERMS = POINTING_TERMS.replace("|", ",")
ZENITH = 89.999  # degrees: nearer, azimuth is not defined

pointing = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="The antenna's pointing series, from stars and from metrology.",
    epilog="\b\nExample: catseye pointing predict --azimuth-deg 145.3 --elevation-deg 30",
)
app.add_typer(pointing, name="pointing")

Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
]


def _terms(text: str) -> str:
    wanted = [t.strip().upper() for t in text.split(",")]
    if len(set(wanted)) != len(wanted) or not set(wanted) <= set(TERMS.split(",")):
        raise typer.BadParameter(f"{text!r} is not a selection of {TERMS}.")
    return ",".join(wanted)


def _above(value: float | None) -> float | None:
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise typer.BadParameter(f"{value} is not above zero.")
    return value


def _azimuth(value: float) -> float:
    if not -540.0 <= value <= 540.0:
        raise typer.BadParameter(f"{value} is not -540 to 540 degrees.")
    return value


def _elevation(value: float) -> float:
    if not -5.0 <= value <= ZENITH:
        raise typer.BadParameter(f"{value} is not -5 to {ZENITH} degrees.")
    return value


@pointing.command(
    epilog="\b\nExample: catseye pointing fit examples/pointing/stars.dat --against published --out pointing-report\n"
    "Layout of STARS.dat: docs/formats/star-offsets.md; POSE.json: catseye pose --pointing prime --out"
)
def fit(  # noqa: PLR0913 - its options are its command line
    files: Annotated[
        list[Path], typer.Argument(metavar="STARS.dat | POSE.json ...", help="A TPOINT file, or poses with pointing.")
    ],
    against: Annotated[
        str | None,
        typer.Option(
            "--against", metavar="published|MODEL.toml|STARS.dat", help="Compare with it: stars are fitted likewise."
        ),
    ] = None,
    terms: Annotated[str, typer.Option("--terms", callback=_terms, help="Which to fit.")] = TERMS,
    u_arcsec: Annotated[
        float | None,
        typer.Option("--u-arcsec", callback=_above, help="Of each coordinate of a star; from the scatter without."),
    ] = None,
    reject: Annotated[
        bool, typer.Option("--reject", help="Leave out observations with |w| beyond 4, one by one.")
    ] = False,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="MODEL.toml", help="Keep the series with its covariance.")
    ] = None,
    write_stars: Annotated[
        Path | None,
        typer.Option("--write-stars", metavar="USED.dat", help="The observations used, as TPOINT text; new file."),
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """The eight-term series by least squares, with covariance and what it cannot tell apart."""
    from catseye.gateways.pose.pointing_series_files import write_fit, write_model
    from catseye.gateways.pose.pointing_series_objects import fit_object
    from catseye.gateways.writers.output import atomic_directory, refuse_output
    from catseye.reduction.pose.verdicts import fit_verdict

    if out is not None:
        for file in files:
            refuse_output(out, file)
    for option, path in (("--write", write), ("--write-stars", write_stars)):
        if path is not None and any(path.resolve() == f.resolve() for f in files):
            raise InputError(f"{option} {path}: is an input (expected another file)")
    chosen = terms.split(",")
    pointing_fit, observed, compared = _fitted(files, against, chosen, u_arcsec, reject)
    if write_stars is not None and observed.stars is None:
        raise InputError(f"--write-stars {write_stars}: there are no stars in poses (expected a TPOINT file)")
    if out is not None:
        asked = {"terms": chosen, "u_arcsec": u_arcsec, "reject": reject, "against": against}
        with atomic_directory(out, files[0]) as directory:
            write_fit(pointing_fit, observed, compared, directory=directory, settings=asked)
    if write is not None:
        write_model(pointing_fit, write)
    if write_stars is not None and observed.stars is not None:
        _write_stars(pointing_fit, observed, write_stars)
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(fit_object(pointing_fit, observed, compared)))
    elif not quiet:
        _tell_fit(pointing_fit, observed, compared, out)
    judge(fit_verdict(pointing_fit), strict=strict)


def _tell_fit(
    pointing_fit: "PointingFit", observed: "Observed", compared: "SeriesComparison | None", out: Path | None
) -> None:
    """The fit in sentences, and its terms."""
    from catseye.gateways.pose.pointing_series_objects import fit_rows, fit_words
    from catseye.reduction.pose.verdicts import fit_verdict

    say(wrapped("Verdict", fit_verdict(pointing_fit).text))
    for title, text in fit_words(pointing_fit, observed, compared):
        say(wrapped(title, text))
    heads = ("term", "arcsec", "u", *(("difference", "u") if compared is not None else ()))
    for row in (heads, *fit_rows(pointing_fit, compared)):
        say(f"{'':<14}{row[0]:<6}" + "".join(f"{cell:>12}" for cell in row[1:]))
    if out is not None:
        say(wrapped("Written to", f"{out}/: report.html, observations.csv, pointing.json, pointing.toml"))


def _fitted(
    files: list[Path], against: str | None, terms: list[str], u_arcsec: float | None, reject: bool
) -> "tuple[PointingFit, Observed, SeriesComparison | None]":
    from dataclasses import replace

    from catseye.gateways.pose.pointing_series_objects import read_observed, read_series
    from catseye.reduction.pose.pointing_fit import compare_series, fit_pointing
    from catseye.reduction.pose.verdicts import fit_verdict

    def fitted(observed: "Observed") -> "PointingFit":
        found = fit_pointing(
            observed.azimuth,
            observed.elevation,
            observed.correction,
            covariance=observed.covariance,
            u=None if observed.covariance is not None or u_arcsec is None else u_arcsec * ARCSECOND,
            terms=terms,
            reject=reject,
            where=observed.where,
        )
        return replace(found, sources=observed.sources)

    observed = read_observed(files)
    pointing_fit = fitted(observed)
    if against is None:
        return pointing_fit, observed, None
    if against == "published" or against.endswith(".toml"):
        other, hashes, judged = read_series(against)
    else:
        second = read_observed([Path(against)])
        other_fit = fitted(second)
        other, hashes, judged = other_fit.series, second.hashes, fit_verdict(other_fit)
    observed.hashes.update(hashes)
    pointing_fit = replace(pointing_fit, sources={**pointing_fit.sources, against: judged})
    return pointing_fit, observed, compare_series(other, pointing_fit.series)


def _write_stars(pointing_fit: "PointingFit", observed: "Observed", path: Path) -> None:
    from dataclasses import replace

    from catseye.gateways.writers.output import atomic_file
    from catseye.records.laboratory.star_offsets import MARK, star_offsets_text

    stars, keep = observed.stars, pointing_fit.used
    assert stars is not None
    columns = ("azimuth", "elevation", "azimuth_encoder", "elevation_encoder", "auxiliary")
    kept = replace(stars, **{name: getattr(stars, name)[keep] for name in columns})
    with atomic_file(path, "--write-stars", MARK) as pieces:
        pieces.append(star_offsets_text(kept))


@pointing.command(
    epilog="\b\nExample: catseye pointing predict --azimuth-deg 145.3 --elevation-deg 30 --model published"
)
def predict(
    azimuth_deg: Annotated[
        float, typer.Option("--azimuth-deg", callback=_azimuth, help="On the sky, clockwise from north.")
    ],
    elevation_deg: Annotated[float, typer.Option("--elevation-deg", callback=_elevation, help="On the sky.")],
    model: Annotated[str, typer.Option("--model", metavar="published|MODEL.toml", help="The series.")] = "published",
    json: Json = False,
) -> None:
    """Predict the encoders' corrections for a direction on the sky."""
    import numpy as np

    from catseye.gateways.pose.pointing_series_objects import read_series
    from catseye.gateways.writers.objects import json_line
    from catseye.verdict import Verdict

    series, _, judged = read_series(model)
    verdict = Verdict("good", "the series of the model").resting_on({model: judged})
    a, e = azimuth_deg * DEGREE, elevation_deg * DEGREE
    correction, spread = series.correction(a, e), series.covariance_of_correction(a, e)
    encoder = series.encoders(a, e)
    known = bool(np.any(series.covariance != 0.0))
    u = np.sqrt(np.diag(spread))
    if json:
        answer = {
            "verdict": verdict.to_object(),
            "model": model,
            "order": ["azimuth times cos E", "elevation"],
            "correction": correction,
            "covariance": spread if known else None,
            "encoders": {"azimuth_deg": encoder[0] / DEGREE, "elevation_deg": encoder[1] / DEGREE},
        }
        say(json_line(answer))
        return
    if verdict.word != "good":
        say(wrapped("Verdict", verdict.text))
    for name, value, w in zip(("azimuth times cos E", "elevation"), correction, u, strict=True):
        u_text = f"   u {w / ARCSECOND:.3f}" if known else "   u unknown"
        say(f"{name:<22}{value / ARCSECOND:+12.3f} arcsec{u_text}")
    say(f"{'encoders':<22}{encoder[0] / DEGREE:12.6f} {encoder[1] / DEGREE:12.6f} deg")


@pointing.command(
    epilog="\b\nExample: catseye pointing track --tilts examples/pointing/tilts.csv --harmonics 3\n"
    "Example: catseye pointing track pose-000/pose.json pose-090/pose.json --tilts tilts.csv --harmonics 2\n"
    "POSE.json: catseye pose --group alidade --frame alidade --out; TILTS.csv: docs/formats/star-offsets.md"
)
def track(
    poses: Annotated[
        list[Path] | None, typer.Argument(metavar="[POSE.json ...]", help="Poses of the alidade at several azimuths.")
    ] = None,
    tilts: Annotated[
        Path | None, typer.Option("--tilts", metavar="TILTS.csv", help="Readings of an inclinometer on the alidade.")
    ] = None,
    harmonics: Annotated[int, typer.Option("--harmonics", min=0, max=36, help="Waves a turn.")] = 2,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Tilt of the alidade against azimuth: poses and inclinometer in one Fourier series."""
    from dataclasses import replace

    import numpy as np

    from catseye.gateways.pose.objects import tilt_of_pose
    from catseye.gateways.pose.pointing_series_files import track_rows, track_words, write_track
    from catseye.gateways.pose.pointing_series_objects import track_object, track_verdict
    from catseye.gateways.writers.output import atomic_directory, refuse_output
    from catseye.records.files.reading import Folder
    from catseye.records.laboratory.tilts import read_tilts
    from catseye.reduction.pose.track_profile import track_profile

    if not poses and tilts is None:
        raise typer.BadParameter("needs poses, --tilts or both.", param_hint="'POSE.json'")
    sources = [*(poses or []), *([] if tilts is None else [tilts])]
    if out is not None:
        for source in sources:
            refuse_output(out, source)
    hashes: dict[str, str] = {}
    tilts_of_poses = []
    for path in poses or []:
        folder = Folder(path.parent)
        tilts_of_poses.append(tilt_of_pose(folder, path.name))
        hashes |= {str(path): digest for digest in folder.hashes.values()}
    readings = None if tilts is None else read_tilts(tilts)
    if readings is not None:
        hashes[str(tilts)] = readings.digest
    profile = track_profile(
        np.array([p.azimuth for p in tilts_of_poses]),
        np.array([p.turn for p in tilts_of_poses]).reshape(-1, 2),
        np.array([p.covariance for p in tilts_of_poses]).reshape(-1, 2, 2),
        tilts=readings,
        harmonics=harmonics,
        names=[str(p) for p in poses or []],
        partial=True,
    )
    profile = replace(profile, sources={str(p): t.verdict for p, t in zip(poses or [], tilts_of_poses, strict=True)})
    if out is not None:
        with atomic_directory(out, sources[0]) as directory:
            write_track(profile, directory, hashes)
    if json:
        from catseye.gateways.writers.objects import json_line

        say(json_line(track_object(profile)))
        return
    if quiet:
        return
    say(wrapped("Verdict", track_verdict(profile).text))
    for title, text in track_words(profile):
        say(wrapped(title, text))
    for name, value, u in track_rows(profile):
        say(f"{'':<14}{name:<16}{value:>10} arcsec   u {u}")
    if out is not None:
        say(wrapped("Written to", f"{out}/: report.html, tilt.csv, track.json"))
