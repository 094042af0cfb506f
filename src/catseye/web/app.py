"""The application: routes, errors as one line of JSON, guard."""

from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI, HTTPException, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException as AnyHttpError
from starlette.responses import Response

from catseye.errors import ArgumentError, CatseyeError
from catseye.web.access import AccessPolicy
from catseye.web.answers import StaticFile, json_answer, static_files
from catseye.web.guard import PageGuard
from catseye.web.live import router as live_router
from catseye.web.metrics import PageMetrics
from catseye.web.refusals import RefusalLog, printable
from catseye.web.routes import command_router, router
from catseye.web.subject import PageSubject

API_VERSION = "1"
DESCRIPTION = (
    "State, history and commands of a laser metrology site, or a finished result. SI units where a name has no "
    "suffix, MJD (UTC) for instants, arrays are columns, null is an unknown number."
)
BODY_INVALID = 400  # of the framework: a body that is no JSON at all


def application(subject: PageSubject, policy: AccessPolicy, refusals: RefusalLog) -> PageGuard:
    """ASGI application of a subject behind its guard."""
    metrics = PageMetrics(subject, refusals)
    return PageGuard(routes(subject, policy, refusals, metrics), policy, refusals, metrics.measured)


def routes(subject: PageSubject, policy: AccessPolicy, refusals: RefusalLog, metrics: PageMetrics) -> FastAPI:
    """Routes of the API, of the metrics and of the page."""
    app = FastAPI(
        title="catseye",
        version=API_VERSION,
        description=DESCRIPTION,
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
    )
    app.state.subject, app.state.policy, app.state.refusals = subject, policy, refusals
    for part in (router, command_router, live_router):
        app.include_router(part)
    files = static_files()

    @app.get("/metrics", tags=["service"], summary="Metrics for Prometheus", response_class=Response)
    async def prometheus() -> Response:
        return metrics.answer()

    @app.api_route("/{path:path}", methods=["GET", "HEAD"], include_in_schema=False)
    async def page(path: str, request: Request) -> Response:
        return static_answer(files, path, request)

    for kind in (RequestValidationError, AnyHttpError, CatseyeError, Exception):
        app.add_exception_handler(kind, error_answer)
    return app


def static_answer(files: dict[str, StaticFile], path: str, request: Request) -> Response:
    """File of the page, by its name alone.

    Raises HTTPException 404 for any other path.
    """
    if path not in files:
        raise HTTPException(404, f"{printable('/' + path)[:80]} is not a path of this service")
    return files[path].answer(request)


async def error_answer(request: Request, problem: Exception) -> Response:
    """JSON of an error in one line; nothing of a fault leaves but that there was one."""
    status, text = status_and_text(problem)
    answer = json_answer({"error": printable(text)}, status)
    if isinstance(problem, AnyHttpError):
        answer.headers.update(problem.headers or {})
    return answer


def status_and_text(problem: Exception) -> tuple[int, str]:
    """Status and line of an error."""
    if isinstance(problem, RequestValidationError):
        return 422, invalid_words(problem.errors())
    if isinstance(problem, AnyHttpError):
        return (422 if problem.status_code == BODY_INVALID else problem.status_code), str(problem.detail)
    if isinstance(problem, CatseyeError):
        return (422 if isinstance(problem, ArgumentError) else 404), str(problem)
    return 500, "internal error of the service; its log has a line about it"


def invalid_words(errors: Sequence[Any]) -> str:
    """First invalid part of a request in words.

    >>> invalid_words([{"loc": ("query", "limit"), "msg": "Input should be a valid integer"}])
    'query limit: Input should be a valid integer'
    """
    first = errors[0]
    return f"{' '.join(map(str, first['loc']))}: {first['msg']}"
