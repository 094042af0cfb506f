"""systemd notification: readiness and watchdog (Type=notify, WatchdogSec)."""

import asyncio
import os
import socket
from collections.abc import Mapping
from contextlib import suppress

SHARE = 0.3  # of the watchdog's timeout between two signals


def notify(text: str, environment: Mapping[str, str] = os.environ) -> bool:
    """Notify the service manager as sd_notify(3) does; True if sent.

    It does not wait for a manager that does not read its socket.

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
    """Watchdog timeout of this process, s; None if there is none."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None
    text = environment.get("WATCHDOG_USEC", "")
    return int(text) * 1e-6 if text.isdecimal() and int(text) > 0 else None


async def live(environment: Mapping[str, str] = os.environ) -> None:
    """Send watchdog signals from the event loop until cancelled.

    A loop that hangs sends none, and the process is restarted.
    """
    notify("READY=1", environment)
    timeout = watchdog_seconds(environment)
    try:
        while timeout is not None:
            notify("WATCHDOG=1", environment)
            await asyncio.sleep(SHARE * timeout)
        await asyncio.Event().wait()
    finally:
        notify("STOPPING=1", environment)
