"""The WebSocket /api/live: a first message with token and kinds, then events."""

import asyncio
from contextlib import suppress
from typing import Annotated

from fastapi import APIRouter, WebSocket
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.websockets import WebSocketDisconnect

from catseye.web.access import AccessPolicy
from catseye.web.feed import KINDS, MOST_CLIENTS, LiveClient, encoded
from catseye.web.refusals import RefusalLog
from catseye.web.subject import PageSubject

FIRST_SECONDS = 5.0  # s until the first message
POLICY, TOO_MANY, NO_TOKEN, NOTHING_LIVE = 1008, 1013, 4401, 4404  # codes of a close


class FirstMessage(BaseModel):
    """First message of a client."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    token: str | None = None
    kinds: Annotated[list[str], Field(max_length=16)] = list(KINDS)


class Closed(Exception):
    """End of a WebSocket by the service: a code and a reason."""

    def __init__(self, code: int, reason: str):
        super().__init__(reason)
        self.code, self.reason = code, reason


router = APIRouter()


@router.websocket("/api/live")
async def live(websocket: WebSocket) -> None:
    """Serve the events to one client."""
    subject: PageSubject = websocket.app.state.subject
    await websocket.accept()
    try:
        if subject.watch is None:
            raise Closed(NOTHING_LIVE, "a result has no events")
        client = await welcomed(websocket, subject, websocket.app.state.policy)
        await served(websocket, subject, client)
    except Closed as end:
        refusals: RefusalLog = websocket.app.state.refusals
        refusals.refused("websocket", websocket.scope.get("client"), end.reason, what="WebSocket /api/live")
        with suppress(RuntimeError, WebSocketDisconnect):
            await websocket.close(end.code, end.reason)
    except WebSocketDisconnect:
        return


async def welcomed(websocket: WebSocket, subject: PageSubject, policy: AccessPolicy) -> LiveClient:
    """Client after its first message.

    Raises Closed: no valid message within 5 s, no token where one is needed, too many clients.
    """
    try:
        text = await asyncio.wait_for(text_of(websocket), FIRST_SECONDS)
        first = FirstMessage.model_validate_json(text)
    except TimeoutError:
        raise Closed(POLICY, f"no first message within {FIRST_SECONDS:g} s") from None
    except ValidationError:
        raise Closed(POLICY, 'invalid first message (expected {"token": text or null, "kinds": [...]})') from None
    if unknown := sorted(set(first.kinds) - set(KINDS)):
        raise Closed(POLICY, f"unknown kind {unknown[0][:20]!a} (expected some of {', '.join(KINDS)})")
    if policy.exposed and not policy.accepts((first.token or "").encode()):
        raise Closed(NO_TOKEN, "the token is missing or wrong")
    if len(subject.feed.clients) >= MOST_CLIENTS:
        raise Closed(TOO_MANY, f"more than {MOST_CLIENTS} clients")
    return LiveClient(first.kinds)


async def text_of(websocket: WebSocket) -> str:
    """Text message of a client.

    Raises Closed for a binary one, WebSocketDisconnect at the end.
    """
    message = await websocket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005))
    text = message.get("text")
    if text is None:
        raise Closed(POLICY, "a binary message (expected text)")
    return str(text)


async def served(websocket: WebSocket, subject: PageSubject, client: LiveClient) -> None:
    """Send events until the client leaves.

    Raises Closed for a second message, WebSocketDisconnect at the end.
    """
    leaving = asyncio.ensure_future(text_of(websocket))
    sending = asyncio.ensure_future(sent(websocket, subject, client))
    subject.feed.clients.add(client)
    try:
        await asyncio.wait([leaving, sending], return_when=asyncio.FIRST_COMPLETED)
        for task in (leaving, sending):
            if task.done():
                task.result()
        raise Closed(POLICY, "a second message (expected none)")
    finally:
        subject.feed.clients.discard(client)
        for task in (leaving, sending):
            task.cancel()
        await asyncio.gather(leaving, sending, return_exceptions=True)


async def sent(websocket: WebSocket, subject: PageSubject, client: LiveClient) -> None:
    """Send the state, then all that comes."""
    if "state" in client.kinds:
        state = await asyncio.to_thread(subject.site().state)
        await websocket.send_text(encoded("state", state).text)
    while True:
        for text in await client.take():
            await websocket.send_text(text)
