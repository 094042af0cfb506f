"""Arguments of pages: subjects, addresses, tokens, browsers."""

import inspect

import pytest

from catseye.api.live import address as addresses
from catseye.api.live import beside, view
from catseye.cli.commands import app, join_commands
from catseye.errors import ArgumentError, InputError


def address(**change):
    usual = {"certificate": None, "key": None, "token_file": None, "names": (), "commanding": True}
    host, port = change.pop("host", None), change.pop("port", 0)
    return addresses.page_address(host, port, **(usual | change))


def test_a_site_has_a_token_of_its_own_and_a_result_none():
    first, second = address(), address()
    assert first.host == "127.0.0.1"
    assert len(first.token) >= 32
    assert first.token != second.token
    assert address(commanding=False).token is None


def test_the_token_of_a_file(tmp_path):
    file = tmp_path / "token"
    file.write_text("f3b0c44298fc1c14\n")
    file.chmod(0o600)
    assert address(token_file=file).token == "f3b0c44298fc1c14"
    file.chmod(0o644)
    with pytest.raises(InputError, match="accessible by others"):
        address(token_file=file)
    with pytest.raises(InputError, match="cannot be read"):
        address(token_file=tmp_path / "missing")


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"host": "0.0.0.0"}, {"page_host", "page_certificate", "page_key"}),
        ({"host": "192.0.2.1", "commanding": False}, {"page_host", "page_certificate", "page_key"}),
        ({"host": "unix:/run/page"}, {"page_host"}),
        ({"certificate": "c.pem"}, {"page_certificate", "page_key"}),
        ({"port": 70_000}, {"page_port"}),
    ],
)
def test_arguments_that_are_refused(change, names):
    with pytest.raises(ArgumentError) as refusal:
        address(**change)
    assert set(refusal.value.names) == names


def test_a_link_is_printed_without_its_token_where_a_log_would_hold_it(monkeypatch):
    at = address(port=5261)
    monkeypatch.delenv("JOURNAL_STREAM", raising=False)
    assert addresses.page_words(at) == f"page: http://127.0.0.1:5261/#token={at.token}"
    monkeypatch.setenv("JOURNAL_STREAM", "8:1234")
    assert addresses.page_words(at) == "page: http://127.0.0.1:5261/"


def test_the_subject_is_a_journal_or_a_result(tmp_path):
    journal = tmp_path / "site.db"
    journal.write_bytes(b"SQLite format 3\x00 and more")
    assert view.page_subject(journal) == {"kind": "journal", "journal": str(journal)}
    assert view.page_subject("postgresql://me@here/site")["kind"] == "journal"
    assert view.page_subject(tmp_path) == {"kind": "result", "path": str(tmp_path)}
    with pytest.raises(InputError, match="missing"):
        view.page_subject(tmp_path / "nothing")


def test_a_browser_is_opened_only_where_its_user_is(monkeypatch):
    for name in ("SSH_CONNECTION", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert not view.has_browser()
    monkeypatch.setenv("DISPLAY", ":0")
    assert view.has_browser()
    monkeypatch.setenv("SSH_CONNECTION", "192.0.2.1 1 192.0.2.2 22")
    assert not view.has_browser()


def test_without_its_packages_there_is_no_page(monkeypatch, tmp_path):
    monkeypatch.setattr("catseye.service.page.missing_packages", lambda: ("fastapi",))
    said = []
    nothing = {"host": None, "port": 0, "certificate": None, "key": None, "token_file": None, "names": ()}
    assert beside.site_page(**nothing, announce=said.append, at_once=False) is None
    [line] = said
    assert "no page: fastapi not installed" in line
    assert "catseye[web]" in line
    with pytest.raises(InputError, match=r"fastapi, not installed here \(expected after pip install"):
        view.view(tmp_path)


def test_view_takes_every_option_of_its_command():
    join_commands()
    command = next(each.callback for each in app.registered_commands if each.callback.__name__ == "view")
    taken = set(inspect.signature(view.view).parameters)
    assert set(inspect.signature(command).parameters) - {"quiet"} <= taken
