"""Guard before the routes: access, size of a body, headers of an answer, and no word of a fault but its number."""

import json
import time
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from catseye.web.access import AccessPolicy, Refusal
from catseye.web.headers import HEADERS, NO_STORE
from catseye.web.refusals import RefusalLog, request_words

MOST_BODY = 65_536  # bytes
MOST_HEADER = 16_384  # bytes of headers and path
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Any, Receive, Send], Awaitable[None]]
Measured = Callable[[str, int, float], None]


class PageGuard:
    """ASGI application that lets through what the policy allows.

    app        the routes
    policy     access
    refusals   log
    measured   called with the route's path, the status and the seconds of each answer
    """

    def __init__(self, app: Application, policy: AccessPolicy, refusals: RefusalLog, measured: Measured):
        self._app, self._policy, self._refusals, self._measured = app, policy, refusals, measured

    async def __call__(self, scope: Any, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
        elif scope["type"] == "http":
            await self._request(scope, receive, send)

    async def _websocket(self, scope: Any, receive: Receive, send: Send) -> None:
        refusal = self._policy.refusal(scope)
        if refusal is None:
            await self._app(scope, receive, send)
            return
        self._refuse(scope, refusal)
        headers = [*HEADERS, (b"content-type", b"application/json")]
        await send({"type": "websocket.http.response.start", "status": refusal.status, "headers": headers})
        await send({"type": "websocket.http.response.body", "body": error_body(refusal.text)})

    async def _request(self, scope: Any, receive: Receive, send: Send) -> None:
        began = time.perf_counter()
        answer = _Answer(send)
        try:
            refusal = self._policy.refusal(scope) or declared_size(scope)
            body = None if refusal is not None else await whole_body(receive)
            if refusal is None and body is None:
                refusal = Refusal(413, "size", f"the body is longer than {MOST_BODY} bytes")
            if refusal is not None:
                self._refuse(scope, refusal)
                await answer.refuse(refusal)
            else:
                await self._app(scope, once(body or b"", receive), answer.send)
        except ConnectionError:  # the client left
            return
        except Exception as fault:  # noqa: BLE001 - the last place where a fault of ours can become an answer
            self._refusals.counts["fault"] += 1
            self._refusals.say(f"internal error in {request_words(scope)}: {type(fault).__name__}: {fault}")
            await answer.refuse(Refusal(500, "fault", "internal error of the service; its log has a line about it"))
        route = getattr(scope.get("route"), "path", "other")
        self._measured(route, answer.status, time.perf_counter() - began)

    def _refuse(self, scope: Any, refusal: Refusal) -> None:
        text = f"{refusal.text} ({refusal.status})"
        self._refusals.refused(refusal.reason, scope.get("client"), text, what=request_words(scope))


class _Answer:
    """One answer under way, with the headers of all answers."""

    def __init__(self, send: Send):
        self._send = send
        self.status = 0

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            own = {name for name, _ in message["headers"]}
            common = (NO_STORE, *HEADERS)
            message["headers"] = [*message["headers"], *(pair for pair in common if pair[0] not in own)]
        await self._send(message)

    async def refuse(self, refusal: Refusal) -> None:
        """Answer with an error, unless an answer has begun."""
        if self.status:
            return
        body = error_body(refusal.text)
        headers = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
        if refusal.status == 401:
            headers.append((b"www-authenticate", b"Bearer"))
        if refusal.status in (413, 431):
            headers.append((b"connection", b"close"))
        await self.send({"type": "http.response.start", "status": refusal.status, "headers": headers})
        await self.send({"type": "http.response.body", "body": body})


def error_body(text: str) -> bytes:
    """JSON of an error, in UTF-8."""
    return json.dumps({"error": text}).encode()


def declared_size(scope: Any) -> Refusal | None:
    """Refusal of a request with too long headers, or that announces too long a body, before it is read."""
    size = sum(len(name) + len(value) for name, value in scope["headers"]) + len(scope["raw_path"])
    if size + len(scope["query_string"]) > MOST_HEADER:
        return Refusal(431, "size", f"the headers have more than {MOST_HEADER} bytes")
    for name, value in scope["headers"]:
        if name == b"content-length" and int(value) > MOST_BODY:
            return Refusal(413, "size", f"the body has {int(value)} bytes (expected {MOST_BODY} at most)")
    return None


async def whole_body(receive: Receive) -> bytes | None:
    """Body of a request; None if it is too long."""
    body = b""
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise ConnectionError("the client left")
        body += message.get("body", b"")
        if len(body) > MOST_BODY:
            return None
        if not message.get("more_body", False):
            return body


def once(body: bytes, receive: Receive) -> Receive:
    """Receiver that gives a body, then what comes from the connection."""
    pending = [body]

    async def received() -> Message:
        if pending:
            return {"type": "http.request", "body": pending.pop(), "more_body": False}
        return await receive()

    return received
