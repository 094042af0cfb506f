"""A process of many browsers' ends: listeners.py PORT COUNT STUCK. Each reads all it gets; so many take nothing.

It answers each line of standard input with one of JSON: bytes and events received, clients connected, and how often a
stuck one was cut off. It ends with its standard input.
"""

import asyncio
import json
import os
import socket
import sys

UPGRADE = (
    "GET /api/live HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
FIRST = json.dumps({"token": None}).encode()
FRAME = bytes([0x81, 0x80 | len(FIRST)]) + bytes(4) + FIRST  # masked with zeros
PONG = bytes([0x8A, 0x80 | 4]) + bytes(4)  # to a ping of four bytes
EVENT = b'{"kind":'
STUCK_BUFFER = 4096  # bytes
AGAIN = 1.0  # s until a new connection


class Listeners:
    """Clients of one page."""

    def __init__(self, port):
        self.port, self.bytes, self.events, self.open, self.cut = port, 0, 0, 0, 0

    async def connected(self, stuck):
        """A welcomed client's socket."""
        sock = socket.socket()
        if stuck:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, STUCK_BUFFER)
        sock.setblocking(False)
        loop = asyncio.get_running_loop()
        await loop.sock_connect(sock, ("127.0.0.1", self.port))
        await loop.sock_sendall(sock, UPGRADE.format(port=self.port).encode())
        head = b""
        while b"\r\n\r\n" not in head:
            head += await loop.sock_recv(sock, 1)
        assert b" 101 " in head, head
        await loop.sock_sendall(sock, FRAME)
        return sock

    async def listen(self):
        """Read all, for ever; answer pings."""
        loop = asyncio.get_running_loop()
        while True:
            sock = await self.connected(stuck=False)
            self.open += 1
            try:
                while data := await loop.sock_recv(sock, 262_144):
                    self.bytes += len(data)
                    self.events += data.count(EVENT)
                    at = data.find(b"\x89\x04")
                    if at >= 0 and len(data) >= at + 6 and data[at + 6 : at + 7] in (b"", b"\x81"):
                        await loop.sock_sendall(sock, PONG + data[at + 2 : at + 6])
            except ConnectionError:
                pass
            self.open -= 1
            sock.close()
            await asyncio.sleep(AGAIN)

    async def stick(self):
        """Take nothing until it is cut off, for ever."""
        while True:
            sock = await self.connected(stuck=True)
            while not is_cut(sock):
                await asyncio.sleep(0.5)
            self.cut += 1
            sock.close()
            await asyncio.sleep(AGAIN)


def is_cut(sock):
    """True when the other end has reset the connection, though nothing of it was read."""
    return sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) != 0 or state_of(sock) != ESTABLISHED


ESTABLISHED = 1  # of tcp_info


def state_of(sock):
    """State of a TCP connection."""
    return sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0]


async def main(port, count, stuck):
    clients = Listeners(port)
    tasks = [asyncio.create_task(clients.stick() if k < stuck else clients.listen()) for k in range(count)]
    loop = asyncio.get_running_loop()
    while await loop.run_in_executor(None, sys.stdin.readline):
        for task in tasks:
            if task.done():
                task.result()
        row = {"bytes": clients.bytes, "events": clients.events, "open": clients.open, "cut": clients.cut}
        sys.stdout.write(json.dumps(row) + "\n")
        sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    os.nice(19)  # browsers have machines of their own
    asyncio.run(main(*map(int, sys.argv[1:])))
