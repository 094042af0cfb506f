"""Parts of the service: its log from any thread, the names it is called by, its standard input."""

import asyncio
import logging
import os
import socket
import subprocess
import threading

import pytest

from web import page_scene  # isort: skip - skips where the extra is absent
from catseye.errors import InputError
from catseye.service.page import PageAddress, read_settings, refuse_files
from catseye.web import refusals as refusals_module
from catseye.web import service
from catseye.web.refusals import MOST_LINES, RefusalLog
from catseye.web.subject import PageSubject


def test_lines_of_other_threads_are_bounded_too_and_the_rest_is_counted(monkeypatch):
    monkeypatch.setattr(refusals_module, "PERIOD", 0.2)
    lines = []

    async def story():
        handler = service.OneLineHandler(RefusalLog(lines.append), asyncio.get_running_loop())
        record = logging.LogRecord("a", logging.WARNING, "", 0, "first\nsecond \x1b[31m %s", ("part",), None)
        threads = [threading.Thread(target=handler.emit, args=(record,)) for _ in range(MOST_LINES + 7)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        async with asyncio.timeout(10.0):
            while len(lines) < MOST_LINES + 1:
                await asyncio.sleep(0.01)
        handler.emit(record)
        while len(lines) < MOST_LINES + 2:
            await asyncio.sleep(0.01)

    asyncio.run(story())
    assert lines[0] == "first second [31m part"
    assert lines[MOST_LINES] == "7 more lines like these in 0.2 s were not written"
    assert lines[MOST_LINES + 1] == lines[0]


def test_a_fault_is_one_line_without_its_trace():
    lines = []

    async def story():
        handler = service.OneLineHandler(RefusalLog(lines.append), asyncio.get_running_loop())
        try:
            raise ValueError("bad\nnews")
        except ValueError as problem:
            error = (type(problem), problem, problem.__traceback__)
        handler.emit(logging.LogRecord("a", logging.ERROR, "", 0, "a callback failed", (), error))
        await asyncio.sleep(0.05)

    asyncio.run(story())
    assert lines == ["a callback failed: ValueError: bad news"]


@pytest.mark.parametrize(
    ("host", "more", "names"),
    [
        ("127.0.0.1", [], {"127.0.0.1", "localhost", "::1"}),
        ("127.0.8.1", ["Site.Example"], {"127.0.8.1", "127.0.0.1", "localhost", "::1", "site.example"}),
        ("0.0.0.0", ["site.example"], {"0.0.0.0", "site.example", socket.gethostname().lower()}),
        ("site.example", [], {"site.example"}),
    ],
)
def test_the_names_it_is_called_by(host, more, names):
    files = '"certificate": "c", "key": "k"'
    listed = ", ".join(f'"{name}"' for name in more)
    line = f'{{"kind": "journal", "journal": "j", "listen": ["{host}", 1], "token": "{page_scene.TOKEN}", {files}, '
    policy = service.policy_of(read_settings(line + f'"names": [{listed}]}}'), PageSubject("journal", "j"))
    assert policy.names == names
    assert policy.exposed is (not host.startswith("127."))
    assert policy.commanding is False


def test_an_unknown_host_is_named():
    with pytest.raises(InputError, match="cannot listen at no such host port 1"):
        service.listening_socket("no such host", 1)


def test_the_first_line_is_read_alone(monkeypatch):
    ours, theirs = os.pipe()
    with os.fdopen(ours) as stream:
        monkeypatch.setattr("sys.stdin", stream)
        os.write(theirs, b'{"kind": 1}\nmore')
        assert service.first_line() == '{"kind": 1}\n'
        assert os.read(ours, 10) == b"more"
        os.close(theirs)
        with pytest.raises(InputError, match="no settings"):
            service.first_line()


def test_a_key_with_a_password_is_refused_and_nobody_is_asked(tmp_path):
    certificate, key = tmp_path / "certificate.pem", tmp_path / "key.pem"
    command = f"openssl req -x509 -newkey rsa:2048 -days 2 -subj /CN=localhost -passout pass:secret -out {certificate}"
    subprocess.run([*command.split(), "-keyout", str(key)], check=True, capture_output=True)
    with pytest.raises(InputError, match="certificate or key cannot be used"):
        refuse_files(PageAddress("0.0.0.0", 1, page_scene.TOKEN, certificate, key))
