"""Routes of the JSON API: each calls the method of the same name of a `SiteWatch`."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, HTTPException, Path, Query, Request
from starlette.responses import Response

from catseye.errors import ArgumentError, CatseyeError
from catseye.web import models
from catseye.web.answers import json_answer
from catseye.web.subject import PageSubject

if TYPE_CHECKING:
    from catseye.api.live.watching import SiteWatch

LATEST_MJD = 1e6
LARGEST = 2**53  # integers beyond are no numbers of JSON
MOST_NAMES = 64  # of series in an answer
LONGEST_COMMAND = 15.0  # s until a command's outcome is unknown
ERRORS: dict[int | str, dict[str, Any]] = {
    status: {"model": models.ErrorJson, "description": words}
    for status, words in {
        401: "No token, or a wrong one",
        403: "Wrong Host or Origin, or no commands here",
        404: "Unknown name or number, or nothing of the kind on this page",
        422: "Invalid value",
        503: "The site is not connected, or too many queries wait",
    }.items()
}
COMMAND_ERRORS = ERRORS | {
    409: {"model": models.ErrorJson, "description": "The site refuses; its words"},
    413: {"model": models.ErrorJson, "description": "Too long a body"},
}
At = Annotated[float | None, Query(ge=0.0, le=LATEST_MJD, allow_inf_nan=False, description="MJD; none: now")]
Since = Annotated[float | None, Query(ge=0.0, le=LATEST_MJD, allow_inf_nan=False, description="MJD of the first")]
Until = Annotated[float | None, Query(ge=0.0, le=LATEST_MJD, allow_inf_nan=False, description="MJD of the last")]
Limit = Annotated[int, Query(ge=1, le=20_000, description="so many of the latest")]
Text = Annotated[str | None, Query(max_length=64)]
Integer = Annotated[int | None, Query(ge=0, le=LARGEST)]
Number = Annotated[int, Path(ge=0, le=LARGEST)]
Name = Annotated[str, Path(min_length=1, max_length=64)]
SeriesNames = Annotated[str, Query(min_length=1, max_length=4000, description="names, separated by commas")]
Most = Annotated[int, Query(ge=10, le=20_000, description="values of a series")]


router = APIRouter(prefix="/api", responses=ERRORS)
command_router = APIRouter(prefix="/api", tags=["commands"], responses=COMMAND_ERRORS)


async def answer(request: Request, work: Callable[["SiteWatch"], Any]) -> Response:
    """Answer with what the watch gives, in a thread: it may read a journal."""
    subject: PageSubject = request.app.state.subject
    watch = subject.site()
    since, until = (request.query_params.get(name) for name in ("since", "until"))
    if since is not None and until is not None and float(since) > float(until):
        raise ArgumentError(f"since = {since}, until = {until} (expected an earlier and a later MJD)", "since", "until")
    return await subject.desk.answer(request, lambda: work(watch))


async def done(request: Request, work: Callable[["SiteWatch"], Awaitable[Any]]) -> Response:
    """Answer with the outcome of a command; the guard has seen its token.

    Raises HTTPException: 503 if the site is not connected or silent, 409 with its words if it refuses.
    """
    watch = request.app.state.subject.site()
    if not watch.state()["connected"]:
        raise HTTPException(503, "the site is not connected: nothing was commanded")
    try:
        async with asyncio.timeout(LONGEST_COMMAND):
            return json_answer(await work(watch))
    except TimeoutError:
        raise HTTPException(503, f"no answer within {LONGEST_COMMAND:g} s: the outcome is not known") from None
    except CatseyeError as problem:
        raise HTTPException(409, str(problem)) from problem


async def asked(request: Request, work: Callable[["SiteWatch"], Awaitable[Any]]) -> Response:
    """Answer with what the coordinator says to a question.

    Raises HTTPException: 503 if the site is not connected or silent, 404 with its words if there is no such thing.
    """
    watch = request.app.state.subject.site()
    if watch.state()["source"] == "live" and not watch.state()["connected"]:
        raise HTTPException(503, "the site is not connected")
    try:
        async with asyncio.timeout(LONGEST_COMMAND):
            return json_answer(await work(watch))
    except TimeoutError:
        raise HTTPException(503, f"no answer within {LONGEST_COMMAND:g} s") from None
    except CatseyeError as problem:
        raise HTTPException(404, str(problem)) from problem


@router.get("/service", tags=["service"], summary="The service", response_model=models.ServiceJson)
async def service(request: Request) -> Response:
    state = request.app.state
    return json_answer(state.subject.to_object(needs_token=state.policy.exposed))


@router.get("/site", tags=["site"], summary="Map of the site", response_model=models.SiteJson)
async def site(request: Request) -> Response:
    return await answer(request, lambda watch: watch.site())


@router.get("/state", tags=["site"], summary="State of the site", response_model=models.StateJson)
async def state(request: Request, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.state(at))


@router.get("/epochs", tags=["site"], summary="Epochs", response_model=models.EpochsJson)
async def epochs(request: Request, since: Since = None, until: Until = None, limit: Limit = 200) -> Response:
    return await answer(request, lambda watch: watch.epochs(since, until, limit))


@router.get("/epochs/{number}", tags=["site"], summary="An epoch", response_model=models.EpochJson)
async def epoch(request: Request, number: Number, run: Integer = None, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.epoch(number, run, at))


@router.get(
    "/epochs/{number}/residuals", tags=["site"], summary="Residuals of an epoch", response_model=models.ResidualsJson
)
async def residuals(request: Request, number: Number, run: Integer = None, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.residuals(number, run, at))


@router.get("/series/names", tags=["site"], summary="Series there are", response_model=models.SeriesNamesJson)
async def series_names(request: Request) -> Response:
    return await answer(request, lambda watch: watch.series_names())


@router.get("/series", tags=["site"], summary="Series over time", response_model=models.SeriesJson)
async def series(
    request: Request, names: SeriesNames, since: Since = None, until: Until = None, most: Most = 2000
) -> Response:
    chosen = [name for name in (part.strip() for part in names.split(",")) if name]
    if not 1 <= len(chosen) <= MOST_NAMES:
        raise ArgumentError(f"{len(chosen)} names (expected 1 to {MOST_NAMES})", "names")
    return await answer(request, lambda watch: watch.series(chosen, since, until, most))


@router.get("/dropped", tags=["site"], summary="Map of dropped channels", response_model=models.DroppedJson)
async def dropped(
    request: Request,
    since: Since = None,
    until: Until = None,
    bins: Annotated[int, Query(ge=1, le=1000, description="bins of time")] = 200,
) -> Response:
    return await answer(request, lambda watch: watch.dropped(since, until, bins))


@router.get("/shots", tags=["site"], summary="Shots", response_model=models.ShotsJson)
async def shots(
    request: Request,
    ranger: Text = None,
    target: Text = None,
    epoch: Integer = None,
    status: Text = None,
    since: Since = None,
    until: Until = None,
    limit: Limit = 500,
) -> Response:
    return await answer(
        request,
        lambda watch: watch.shots(
            ranger=ranger, target=target, epoch=epoch, status=status, since=since, until=until, limit=limit
        ),
    )


@router.get("/shots/{number}", tags=["site"], summary="A shot", response_model=models.ShotJson)
async def shot(request: Request, number: Number, run: Integer = None, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.shot(number, run, at))


@router.get("/shots/{number}/samples", tags=["site"], summary="Samples of a shot", response_model=models.SamplesJson)
async def samples(request: Request, number: Number, run: Integer = None, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.samples(number, run, at))


@router.get("/points/{name}", tags=["site"], summary="A point", response_model=models.PointJson)
async def point(request: Request, name: Name, since: Since = None, until: Until = None) -> Response:
    return await answer(request, lambda watch: watch.point(name, since, until))


@router.get("/rangers/{name}", tags=["site"], summary="A ranger", response_model=models.RangerJson)
async def ranger(request: Request, name: Name, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.ranger(name, at))


@router.get("/calibrations", tags=["site"], summary="Calibrations", response_model=models.CalibrationsJson)
async def calibrations(request: Request, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.calibrations(at))


@router.get("/air", tags=["site"], summary="Air along each path", response_model=models.AirJson)
async def air(request: Request, epoch: Integer = None, run: Integer = None, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.air(epoch, run, at))


@router.get("/comparison", tags=["site"], summary="Two epochs compared", response_model=models.ComparisonJson)
async def comparison(
    request: Request,
    first: Annotated[int, Query(ge=0, le=LARGEST)],
    second: Annotated[int, Query(ge=0, le=LARGEST)],
    run: Integer = None,
    at: At = None,
) -> Response:
    return await answer(request, lambda watch: watch.comparison(first, second, run, at))


@router.get("/surface", tags=["site"], summary="Surface of an epoch", response_model=models.SurfaceJson)
async def surface(request: Request, epoch: Integer = None, run: Integer = None, at: At = None) -> Response:
    return await answer(request, lambda watch: watch.surface(epoch, run, at))


@router.get("/events", tags=["site"], summary="Events", response_model=models.EventsJson)
async def events(
    request: Request,
    since: Since = None,
    until: Until = None,
    severity: Annotated[models.Severity | None, Query(description="the least")] = None,
    limit: Limit = 500,
) -> Response:
    return await answer(request, lambda watch: watch.events(since, until, severity, limit))


@router.get("/parameters", tags=["control"], summary="Parameters", response_model=models.ParametersJson)
async def parameters(request: Request) -> Response:
    return await asked(request, lambda watch: watch.parameters())


@router.get("/samplers", tags=["control"], summary="Samplers", response_model=models.SamplersJson)
async def samplers(request: Request) -> Response:
    return await asked(request, lambda watch: watch.samplers())


@router.get(
    "/samplers/{name}", tags=["control"], summary="Values of a sampler", response_model=models.SamplerValuesJson
)
async def sampler(
    request: Request,
    name: Name,
    limit: Annotated[int, Query(ge=1, le=4096, description="so many of the latest")] = 100,
    at: At = None,
) -> Response:
    return await asked(request, lambda watch: watch.sampler(name, limit, at))


@router.get("/report", tags=["result"], summary="Report of a result", response_model=models.ReportJson)
async def report(request: Request) -> Response:
    subject: PageSubject = request.app.state.subject
    if subject.report is None:
        raise HTTPException(404, f"this page shows a {subject.kind}, not a result")
    return await subject.desk.answer(request, lambda: subject.report)


@command_router.post("/commands", summary="Command the coordinator", response_model=models.CommandJson)
async def command(request: Request, body: models.CommandBody) -> Response:
    return await done(request, lambda watch: watch.command(body.command, body.parameters, body.who))


@command_router.post("/console/{ranger}", summary="A line to a ranger", response_model=models.ConsoleJson)
async def console(request: Request, ranger: Name, body: models.ConsoleBody) -> Response:
    return await done(request, lambda watch: watch.console(ranger, body.line, body.who))


@command_router.post("/alarms/{alarm}/acknowledge", summary="Acknowledge an alarm", response_model=models.CommandJson)
async def acknowledge(request: Request, alarm: Name, body: models.WhoBody) -> Response:
    return await done(request, lambda watch: watch.acknowledge(alarm, body.who))


@command_router.post("/alarms/{alarm}/shelve", summary="Shelve an alarm", response_model=models.CommandJson)
async def shelve(request: Request, alarm: Name, body: models.ShelfBody) -> Response:
    return await done(request, lambda watch: watch.shelve(alarm, body.who, body.minutes))


@command_router.post("/alarms/{alarm}/unshelve", summary="Unshelve an alarm", response_model=models.CommandJson)
async def unshelve(request: Request, alarm: Name, body: models.WhoBody) -> Response:
    return await done(request, lambda watch: watch.unshelve(alarm, body.who))
