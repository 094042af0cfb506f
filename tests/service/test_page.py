"""Settings and address of a page, and its child, which is restarted at the same port."""

import asyncio
import json
import os
import signal
import sys

import pytest
from pydantic import ValidationError

from catseye.errors import InputError
from catseye.service import page as page_module
from catseye.service.page import PageAddress, PageChild, PageSettings, read_settings

TOKEN = "f3b0c44298fc1c14"
SITE = {"kind": "site", "listen": ["127.0.0.1", 5261], "site": "gbt", "coordinator": ["127.0.0.1", 5260]}
SPEAKS = (
    "import json, os, sys; line = json.loads(sys.stdin.readline()); "
    "print(json.dumps({'listening': [line['listen'][0], line['listen'][1] or 4321]}), flush=True); "
    "sys.stderr.write(json.dumps(line) + '\\n'); sys.stderr.flush(); sys.stdin.read()"
)


def test_settings_come_back_from_their_line():
    settings = PageSettings(**SITE, token=TOKEN, rangers={"ZY101": ("127.0.0.1", 24111)})
    assert read_settings(settings.model_dump_json()) == settings


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"listen": ["0.0.0.0", 5261]}, "other machines"),
        ({"listen": ["0.0.0.0", 5261], "token": TOKEN, "certificate": "c"}, "other machines"),
        ({"certificate": "c"}, "one is missing"),
        ({"token": "short"}, "token"),
        ({"token": "with a blank, and long"}, "token"),
        ({"kind": "journal"}, "the subject of kind journal is missing"),
        ({"kind": "result"}, "the subject of kind result is missing"),
        ({"site": None}, "the subject of kind site is missing"),
        ({"kind": "moon"}, "kind"),
        ({"more": 1}, "more"),
        ({"listen": "here"}, "listen"),
    ],
)
def test_settings_that_are_refused(change, words):
    with pytest.raises(InputError, match=words) as refusal:
        read_settings(json.dumps(SITE | change))
    assert "\n" not in str(refusal.value)
    assert TOKEN not in str(refusal.value)


@pytest.mark.parametrize("line", ["", "[]", "{", "[" * 10_000])
def test_a_line_without_settings(line):
    with pytest.raises(InputError, match="settings"):
        read_settings(line)


def test_the_token_is_in_no_text_of_settings_or_address():
    assert TOKEN not in repr(PageSettings(**SITE, token=TOKEN)) + repr(PageAddress("127.0.0.1", 1, TOKEN))
    with pytest.raises(ValidationError) as refusal:
        PageSettings(**SITE, token=TOKEN, moon=1)
    assert TOKEN not in str(refusal.value)


@pytest.mark.parametrize(
    ("address", "url"),
    [
        (PageAddress("127.0.0.1", 5261), "http://127.0.0.1:5261/"),
        (PageAddress("::1", 5261), "http://[::1]:5261/"),
        (PageAddress("0.0.0.0", 443, TOKEN, "c", "k", ("site.example",)), "https://site.example:443/"),
        (PageAddress("site.example", 443, TOKEN, "c", "k"), "https://site.example:443/"),
    ],
)
def test_the_address_for_a_browser(address, url):
    assert address.url() == url
    assert address.link() == (f"{url}#token={TOKEN}" if address.token else url)


def test_a_certificate_that_cannot_be_used(tmp_path):
    (tmp_path / "bad.pem").write_text("no certificate")
    for name in ("bad.pem", "missing.pem"):
        with pytest.raises(InputError, match="cannot be used"):
            page_module.refuse_files(
                PageAddress("0.0.0.0", 1, TOKEN, tmp_path / name, tmp_path / "bad.pem", ("localhost",))
            )


def test_missing_packages_are_named(monkeypatch):
    monkeypatch.setattr(page_module, "find_spec", lambda name: None if name == "uvicorn" else True)
    assert page_module.missing_packages() == ("uvicorn",)


def test_a_child_that_dies_comes_back_at_the_port_it_had(monkeypatch):
    monkeypatch.setattr(page_module, "PROGRAM", (sys.executable, "-c", SPEAKS))
    monkeypatch.setattr("catseye.service.child.FIRST_WAIT", 0.05)
    heard, logged = [], []

    async def story():
        page = PageChild(
            PageAddress("127.0.0.1", 0, TOKEN),
            lambda at: at.settings("site", site="gbt", coordinator=("127.0.0.1", 5260)),
            listening=heard.append,
            warned=logged.append,
        )
        keeping = asyncio.create_task(page.child.keep())
        await until(lambda: len(logged) == 1)
        os.kill(page.child.pid, signal.SIGKILL)
        await until(lambda: len(logged) == 3)
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)

    async def until(condition):
        async with asyncio.timeout(20.0):
            while not condition():
                await asyncio.sleep(0.01)

    asyncio.run(story())
    assert [address.port for address in heard] == [4321]
    first, ended, second = logged
    assert [json.loads(line)["listen"][1] for line in (first, second)] == [0, 4321]
    assert json.loads(first)["token"] == TOKEN
    assert "restarting" in ended
