"""Every page of a living site, wide and narrow, in light and dark."""

import re

import pytest

from browser.scene import ROOT

LISTED = re.compile(r'name: "(\w+)", title: "[^"]+", .*?kinds: (SITE|\["site")')
PAGES = [name for name, _ in LISTED.findall((ROOT / "front" / "src" / "pages.ts").read_text())]
QUERIES = {"ranger": "?ranger=ZY101", "shot": "?shot={shot}", "point": "?point={point}"}


@pytest.fixture(scope="module")
def details(site):
    """A shot and a point of the last epoch, for the pages that show one."""
    epoch = site.get(f"epochs/{site.get('state')['epoch']['number']}")
    return {"shot": epoch["beams"]["shot"][0], "point": epoch["points"]["name"][0]}


def test_list_of_pages_is_read():
    assert len(PAGES) >= 16


@pytest.mark.parametrize("width", ["laptop", "phone"])
@pytest.mark.parametrize("name", PAGES)
def test_page_is_legible_and_keeps_to_its_service(site, details, watched, name, width):
    watch = watched(f"{site.url}/#/{name}{QUERIES.get(name, '').format(**details)}", width=width)
    watch.page.wait_for_selector("main h1")
    watch.settle()
    for scheme in ("light", "dark"):
        watch.page.emulate_media(color_scheme=scheme)
        watch.picture(f"{name}-{width}-{scheme}")
        assert watch.axe() == []
    assert watch.too_wide() <= 0
    assert "could not be shown" not in watch.page.inner_text("main")
    watch.assert_clean()
