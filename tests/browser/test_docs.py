"""The built documentation, opened from disk: nothing is asked from elsewhere, formulas show, search and the dark work.

`make docs` builds it and runs this file.
"""

import os
from pathlib import Path

import pytest

from browser.scene import AXE, wait_for

BUILT = Path(os.environ.get("CATSEYE_DOCS", "not-built"))  # the site, of `make docs`
FORMULAS = ("why/how-it-works.html", "why/budget.html", "conventions.html")  # the first that has some is opened
READ = (
    *("index.html", "reference/python/night.html", "reference/python/formulas/atmosphere-weather.html"),
    *("formats/results.html", "references.html", "glossary.html"),
)
SECTIONS = ("tour", "howto", "why", "gallery")  # one page of each

if not (BUILT / "index.html").is_file():
    pytest.skip("the documentation is opened by `make docs`", allow_module_level=True)


def pages():
    """Pages to look at: some by name, and the first of each section."""
    found = [name for name in READ if (BUILT / name).is_file()]
    for section in SECTIONS:
        others = sorted(path for path in (BUILT / section).glob("*.html") if path.name != "index.html")
        found.append((others[0] if others else BUILT / section / "index.html").relative_to(BUILT).as_posix())
    return found


def page_of_formulas():
    """First page that holds formulas."""
    named = [BUILT / name for name in FORMULAS]
    for path in [*named, *sorted(BUILT.rglob("*.html"))]:
        if path.is_file() and 'class="math' in path.read_text(encoding="utf-8"):
            return path.relative_to(BUILT).as_posix()
    raise AssertionError("no page has a formula")


@pytest.fixture
def opened(watched):
    def open_page(name, **options):
        return watched(f"{BUILT.as_uri()}/{name}", root=BUILT.as_uri(), **options)

    return open_page


@pytest.mark.parametrize("width", ["laptop", "phone"])
@pytest.mark.parametrize("name", pages())
def test_page_fits_and_asks_nothing_of_others(opened, name, width):
    watch = opened(name, width=width)
    watch.page.wait_for_load_state("load")
    for scheme in ("light", "dark"):
        watch.page.emulate_media(color_scheme=scheme)
        watch.page.wait_for_timeout(300)  # colours fade into each other
        watch.picture(f"docs-{name.replace('/', '-').removesuffix('.html')}-{width}-{scheme}")
        if AXE.is_file():
            assert watch.axe(preload=False) == []
    assert watch.too_wide() <= 0
    watch.assert_clean()


@pytest.mark.parametrize("width", ["laptop", "phone"])
def test_formulas_are_drawn_by_the_copy_in_the_site(opened, width):
    watch = opened(page_of_formulas(), width=width)
    drawn = wait_for(lambda: watch.page.locator("mjx-container svg").count(), 30.0)
    assert drawn == watch.page.locator(".math").count()
    assert watch.page.locator("mjx-merror").count() == 0
    assert watch.too_wide() <= 0
    watch.picture(f"docs-formulas-{width}")
    watch.assert_clean()


def test_search_finds_a_formula_by_its_name(opened):
    watch = opened("search.html?q=ice_saturation")
    first = watch.page.locator("#search-results li a").first
    first.wait_for(timeout=30_000)
    first.click()
    watch.page.wait_for_load_state("load")
    assert "formulas/atmosphere-weather.html" in watch.page.url
    assert "Saturation" in watch.page.inner_text("main")
    watch.assert_clean()


def test_the_search_field_opens_and_leads_to_results(opened):
    watch = opened("index.html")
    watch.page.click(".search-button__button >> visible=true")
    watch.page.keyboard.type("retroreflector")
    watch.page.keyboard.press("Enter")
    watch.page.wait_for_url("**/search.html?q=retroreflector*")
    watch.page.locator("#search-results li a").first.wait_for(timeout=30_000)
    watch.assert_clean()


def test_the_dark_can_be_chosen(opened):
    watch = opened("index.html")
    background = "getComputedStyle(document.body).backgroundColor"
    light = watch.page.evaluate(background)
    watch.page.click(".theme-switch-button >> visible=true")
    watch.page.click('[data-mode="dark"].theme-change-button >> visible=true')
    wait_for(lambda: watch.page.evaluate(background) != light, 10.0)
    assert watch.page.get_attribute("html", "data-theme") == "dark"
    watch.assert_clean()
