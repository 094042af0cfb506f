"""CITATION.cff, SECURITY.md and the templates of a forge agree with the package and load."""

import re
import tomllib

import pytest
import yaml

from catseye import __version__
from catseye.bibliography import SOURCES
from repository import ROOT

CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
PAGES = [ROOT / name for name in ("SECURITY.md", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md", "CHANGELOG.md")]
LINK = re.compile(r"\]\((?!https?:|#)([^)#]+)[^)]*\)")


def test_citation_names_the_version_and_licence_of_the_package():
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["version"] == __version__
    assert CITATION["license"] == PROJECT["license"]
    assert CITATION["title"].startswith(PROJECT["name"])


def test_citation_has_what_its_format_requires():
    assert CITATION["type"] == "software"
    for work in (CITATION, *CITATION["references"]):
        assert work["title"]
        assert work["authors"]
        assert all({"name"} <= set(author) or {"family-names"} <= set(author) for author in work["authors"])
    assert CITATION["message"]


def test_citation_refers_to_the_two_documents_as_the_bibliography_does():
    for work, key in zip(CITATION["references"], ("PARKER04", "GOLDMAN00"), strict=True):
        [author] = work["authors"]
        initial, name, year = author["given-names"][0], author["family-names"], work["date-released"][:4]
        assert SOURCES[key].title.startswith(f"{initial}. ")
        assert SOURCES[key].title.endswith(f" {name}, {work['title']}, {year}")


def test_security_supports_the_minor_release_of_the_package():
    minor = ".".join(__version__.split(".")[:2])
    assert f"| the newest minor release ({minor}) | yes |" in (ROOT / "SECURITY.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.stem)
def test_issue_forms_load_and_name_each_field_once(form):
    content = yaml.safe_load(form.read_text(encoding="utf-8"))
    if form.stem == "config":
        assert set(content) == {"blank_issues_enabled"}
        return
    assert {"name", "description", "body"} <= set(content)
    fields = [field["id"] for field in content["body"]]
    assert len(set(fields)) == len(fields)
    for field in content["body"]:
        assert field["type"] in ("textarea", "input", "checkboxes")
        assert field["attributes"]["label"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_of_the_root_pages_lead_to_files(page):
    text = page.read_text(encoding="utf-8")
    assert [target for target in LINK.findall(text) if not (ROOT / target).exists()] == []
