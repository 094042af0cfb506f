"""Reports opened from disk with the network off: the demo's, and one of the whole dish with 2209 prisms."""

import re
import subprocess
import sys

import pytest


def catseye(*arguments):
    subprocess.run([sys.executable, "-P", "-m", "catseye", *map(str, arguments)], check=True, capture_output=True)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    where = tmp_path_factory.mktemp("demo") / "night"
    catseye("demo", where)
    return where / "report.html"


@pytest.fixture(scope="module")
def whole_dish(tmp_path_factory):
    where = tmp_path_factory.mktemp("dish")
    catseye("night", where / "night")
    catseye("reduce", where / "night", "--out", where / "out", "--quiet")
    return where / "out" / "report.html"


@pytest.fixture(params=["demo", "whole_dish"])
def report(request, watched):
    """A report, opened; its size has been held to what travels by mail."""
    path = request.getfixturevalue(request.param)
    assert path.stat().st_size < {"demo": 500_000, "whole_dish": 1_500_000}[request.param]
    watch = watched(path.as_uri(), offline=True)
    watch.page.wait_for_selector("#catseye-report h2")
    watch.picture(f"report-{request.param}")
    return watch


def scene_of(watch):
    """The network's scene, which is drawn once it comes near."""
    watch.page.locator("#network").scroll_into_view_if_needed()
    scene = watch.page.locator("#network canvas").first
    scene.wait_for()
    scene.scroll_into_view_if_needed()
    return scene


def test_verdict_stands_on_top_and_the_page_is_clean(report):
    assert report.page.locator(".verdict").first.bounding_box()["y"] < 400
    assert report.axe() == []
    report.assert_clean()


def test_hover_names_a_point_with_its_uncertainty(report):
    scene = scene_of(report)
    box = scene.bounding_box()

    def hovered(across, down):
        report.page.mouse.move(box["x"] + box["width"] * across / 100, box["y"] + box["height"] * down / 100)
        return report.page.locator("#network .ce-tip").inner_text().replace("\n", " ")

    texts = (hovered(across, down) for down in range(30, 80, 5) for across in range(10, 90, 2))
    seen = next((text for text in texts if "\u00b1" in text), "nothing")
    assert re.search(r"\w+ .*\d \u00b1 \d", seen)


def test_table_sorts_and_filters(report):
    report.page.locator("#points").scroll_into_view_if_needed()
    part = report.page.locator("#points .ce-table").first
    part.scroll_into_view_if_needed()
    box = part.get_by_placeholder(re.compile("Filter"))
    button = part.locator("th button").first
    button.click()
    first = part.locator("tbody tr[data-at]").first.inner_text()
    button.click()
    assert part.locator("tbody tr[data-at]").first.inner_text() != first
    assert part.locator("th[aria-sort=descending]").count() == 1
    before = part.locator("tbody tr[data-at]").count()
    box.fill("ZY10")
    report.page.wait_for_timeout(400)
    rows = part.locator("tbody tr[data-at]").all_inner_texts()
    assert 0 < len(rows) <= before
    assert all("ZY10" in row for row in rows if row.strip())


def test_scene_turns_by_mouse_and_by_key(report):
    scene = scene_of(report)
    views = [scene.screenshot()]
    box = scene.bounding_box()
    report.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    report.page.mouse.down()
    report.page.mouse.move(box["x"] + box["width"] / 2 + 120, box["y"] + box["height"] / 2 + 30, steps=4)
    report.page.mouse.up()
    report.page.wait_for_timeout(1500)
    views.append(scene.screenshot())
    scene.focus()
    for _ in range(4):
        report.page.keyboard.press("ArrowLeft")
    report.page.wait_for_timeout(1500)
    views.append(scene.screenshot())
    assert len(set(views)) == 3


def test_paper_has_every_row(report):
    """Open tables print whole; the longest are folded, and the paper says so."""
    pdf = report.page.pdf(format="A4")
    assert pdf.startswith(b"%PDF")
    assert pdf.count(b"/Type /Page") > 3
    report.assert_clean()


def test_it_is_legible_on_a_phone(demo, watched):
    watch = watched(demo.as_uri(), width="phone", scheme="dark", offline=True)
    watch.page.wait_for_selector("#catseye-report h2")
    watch.picture("report-phone-dark")
    assert watch.too_wide() <= 0
    assert watch.axe() == []
    watch.assert_clean()
