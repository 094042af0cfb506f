"""Answers in JSON, compressed where asked, and the static files of the page."""

import asyncio
import gzip
import hashlib
import json
import mimetypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi import HTTPException, Request
from starlette.responses import Response

from catseye.web.headers import NO_CACHE

STATIC = Path(__file__).with_name("static")
SMALLEST = 2048  # bytes that are compressed
LEVEL = 4  # of gzip: 4 ms and 30 % for 100 kB of columns; 9 takes 30 ms for 28 %
THREADS = 4  # that read the journal
MOST_WAITING = 64  # queries
TYPES = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".html": "text/html"}


class QueryDesk:
    """Queries of a journal, in a few threads beside the loop."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(THREADS, "query")
        self._waiting = 0

    async def answer(self, request: Request, work: Callable[[], Any]) -> Response:
        """JSON answer of a function that may block.

        Raises HTTPException 503: too many wait.
        """
        if self._waiting >= MOST_WAITING:
            raise HTTPException(503, f"more than {MOST_WAITING} queries wait (try again in a second)")
        gzipped = takes_gzip(request)
        self._waiting += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(
                self._pool, lambda: json_answer(work(), gzipped=gzipped)
            )
        finally:
            self._waiting -= 1

    def close(self) -> None:
        """Take no more queries, and wait for none."""
        self._pool.shutdown(wait=False, cancel_futures=True)


def json_answer(value: Any, status: int = 200, *, gzipped: bool = False) -> Response:
    """JSON of a value; NaN is refused."""
    body = json.dumps(value, allow_nan=False, separators=(",", ":"), ensure_ascii=False).encode()
    headers = {"vary": "Accept-Encoding"}
    if gzipped and len(body) >= SMALLEST:
        headers["content-encoding"] = "gzip"
        body = compressed(body)
    return Response(body, status, headers, "application/json")


def compressed(body: bytes) -> bytes:
    """The bytes by gzip, always the same."""
    return gzip.compress(body, LEVEL, mtime=0)


def takes_gzip(request: Request) -> bool:
    """True if the client takes gzip; a weight of 0 refuses it."""
    for part in request.headers.get("accept-encoding", "").split(","):
        name, _, weight = part.partition(";")
        if name.strip().lower() in ("gzip", "*"):
            return weight.replace(" ", "") not in ("q=0", "q=0.", "q=0.0", "q=0.00", "q=0.000")
    return False


@dataclass(frozen=True)
class StaticFile:
    """A file of the page in memory, with its ETag."""

    body: bytes
    small: bytes
    kind: str
    etag: str

    def answer(self, request: Request) -> Response:
        """The file, or 304 if the client has it."""
        headers = {"etag": self.etag, NO_CACHE[0].decode(): NO_CACHE[1].decode(), "vary": "Accept-Encoding"}
        if self.etag in (tag.strip() for tag in request.headers.get("if-none-match", "").split(",")):
            return Response(b"", 304, headers)
        if len(self.small) < len(self.body) and takes_gzip(request):
            return Response(self.small, 200, {**headers, "content-encoding": "gzip"}, self.kind)
        return Response(self.body, 200, headers, self.kind)


def static_files(folder: Path = STATIC) -> dict[str, StaticFile]:
    """Files of the page by their path in an address; no path leads elsewhere."""
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    found = {name: StaticFile(body, compressed(body), media_type(name), etag_of(body)) for name, body in files.items()}
    return found | ({"": found["index.html"]} if "index.html" in found else {})


def media_type(name: str) -> str:
    """Media type of a file by its ending, with its encoding if it is text."""
    kind = TYPES.get(Path(name).suffix) or mimetypes.guess_type(name)[0] or "application/octet-stream"
    return f"{kind}; charset=utf-8" if kind.startswith("text/") else kind


def etag_of(body: bytes) -> str:
    """Tag of a file's content."""
    return f'"{hashlib.sha256(body).hexdigest()[:24]}"'
