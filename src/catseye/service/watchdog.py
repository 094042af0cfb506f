"""What systemd is told of a service: that it is ready, and again and again that it lives (Type=notify, WatchdogSec)."""

import asyncio
import os
import socket
from collections.abc import Mapping
from contextlib import suppress

SHARE = 0.3  # of the watchdog's time between two signs of life


def notify(text: str, environment: Mapping[str, str] = os.environ) -> bool:
    """Tell the service manager, as sd_notify(3) has it; whether it was told.

    One that does not read its socket is not waited for: the loop has other things to do.

    text   "READY=1", "WATCHDOG=1", "STOPPING=1"
    """
    place = environment.get("NOTIFY_SOCKET", "")
    if not place:
        return False
    address = f"\0{place[1:]}" if place.startswith("@") else place
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sock:
        sock.setblocking(False)
        sock.sendto(text.encode(), address)
        return True
    return False


def watchdog_seconds(environment: Mapping[str, str] = os.environ) -> float | None:
    """s within which the manager wants a sign of life of this process; None where it wants none."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    text = environment.get("WATCHDOG_USEC", "")
    return int(text) * 1e-6 if text.isdecimal() and int(text) > 0 else None


async def live(environment: Mapping[str, str] = os.environ) -> None:
    """Signs of life from the event loop until cancelled: one that hangs gives none, and is started again."""
    notify("READY=1", environment)
    every = watchdog_seconds(environment)
    try:
        while every is not None:
            notify("WATCHDOG=1", environment)
            await asyncio.sleep(SHARE * every)
        await asyncio.Event().wait()
    finally:
        notify("STOPPING=1", environment)
