"""Links of a built site: broken ones are named, good ones are not."""

import pytest

from site_links import broken_links, main

GOOD = '<a href="sub/b.html#there">b</a> <a href="#here" id="here">h</a> <a href="https://doi.org/10.1/x">doi</a>'


@pytest.fixture
def site(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "_static").mkdir()
    (tmp_path / "a.html").write_text(f"<html>{GOOD}<img src='data:image/png;base64,AA=='></html>", encoding="utf-8")
    (tmp_path / "sub" / "b.html").write_text('<p id="there"><a href="../a.html?q=1#here">a</a></p>', encoding="utf-8")
    (tmp_path / "_static" / "macros.html").write_text('<a href="{{ nowhere }}">m</a>', encoding="utf-8")  # a template
    return tmp_path


def test_a_good_site_has_no_broken_link(site, capsys):
    assert list(broken_links(site)) == []
    assert main([str(site)]) == 0
    assert capsys.readouterr().out == "links: 0 broken in 2 pages\n"


@pytest.mark.parametrize(
    ("element", "problem"),
    [
        ('<a href="sub/c.html">c</a>', "no such file"),
        ('<a href="sub/b.html#nowhere">b</a>', "no such anchor"),
        ('<a href="#nowhere">b</a>', "no such anchor"),
        ('<img src="_images/x.svg">', "no such file"),
        ('<script src="https://cdn.example/x.js"></script>', "is loaded from elsewhere"),
        ('<link rel="stylesheet" href="//cdn.example/x.css">', "is loaded from elsewhere"),
        ('<a href="../outside.html">o</a>', "leads out of the site"),
        ('<a href="file:///etc/hosts">f</a>', "leads elsewhere"),
    ],
)
def test_a_broken_link_is_named(site, element, problem, capsys):
    (site / "d.html").write_text(f"<html>\n{element}</html>", encoding="utf-8")
    [line] = broken_links(site)
    assert line.startswith("d.html:2: ")
    assert line.endswith(problem)
    assert main([str(site)]) == 1


def test_an_empty_site_is_none(tmp_path):
    assert main([str(tmp_path)]) == 1
    assert main([str(tmp_path / "missing")]) == 2
