"""A living site in the browser: its values, a command, and parts that die, freeze and come back."""

import json
import math
import re
import socket
from contextlib import suppress

import pytest

from browser.scene import TOKEN, wait_for

SILENT = "No data since"
NOTICED = 4000  # ms: two for the page, as much again for a busy machine


@pytest.fixture
def overview(site, watched):
    """The overview of a connected site, with the token of its link."""
    watch = watched(f"{site.url}/#token={TOKEN}")
    watch.page.wait_for_selector("main:not(.silent) h1")
    watch.page.wait_for_selector("text=ZY101")
    return watch


def asked(site, line):
    """First reply of the coordinator's port, asked by a stranger to the service."""
    with socket.create_connection(("127.0.0.1", site.port), 5.0) as connection:
        connection.sendall(f"1\t{line}\n".encode())
        lines = connection.makefile()
        return next(each for each in lines if each.startswith("1\t")).rstrip("\n").split("\t")[2]


def rounded(shot):
    """A range to the second digit of its u, as people read it."""
    places = 1 - math.floor(math.log10(shot["u_range"]))
    return f"{shot['range']:.{places}f}"


def test_token_of_the_link_leaves_the_address_and_is_remembered(overview):
    assert TOKEN not in overview.page.url
    assert overview.page.evaluate("sessionStorage.getItem('catseye-token')") == TOKEN


def test_values_are_those_of_the_api(site, overview):
    """While nothing is fired: each ranger's last range and shots, the epoch, the weather."""
    wait_for(lambda: sum(bool(r["last"] and r["last"]["range"]) for r in site.get("state")["rangers"]) > 12)
    site.command("MODE", "hold")
    try:
        wait_for(lambda: overview.page.locator("main", has_text="no shots are taken").count())

        missing = ["not compared"]

        def agree():
            state = site.get("state")
            text = overview.page.inner_text("main").replace("\u2212", "-").replace("\u00a0", " ")
            values = [f"epoch {state['epoch']['number']}", *(ranger["name"] for ranger in state["rangers"])]
            values += [f"{w['pressure_hpa']:.2f} hPa" for w in state["weather"]]
            values += [f"{ranger['shots']} shots" for ranger in state["rangers"]]
            values += [
                rounded(ranger["last"]) for ranger in state["rangers"] if ranger["last"] and ranger["last"]["range"]
            ]
            assert len(values) > 45
            missing[:] = [value for value in values if value not in text]
            return not missing

        with suppress(AssertionError):
            wait_for(agree, 20.0)
        assert missing == []
    finally:
        site.command("MODE", "active")
    overview.assert_clean()


def test_command_asks_once_is_sent_and_the_site_obeys(site, overview):
    page = overview.page
    try:
        for mode in ("hold", "active"):
            page.click("button:has-text('Mode')")
            dialog = page.locator("dialog[open]")
            dialog.locator("select").select_option(mode)
            dialog.get_by_label("Your name").fill("anna")
            dialog.get_by_role("button", name="Send MODE").click()
            dialog.get_by_text("done").wait_for(timeout=10_000)
            assert asked(site, "MODE") == f"MODE 1, {mode}"
            dialog.locator("button.main", has_text="Close").click()
    finally:
        site.command("MODE", "active")
    assert "anna" in json.dumps(site.get("events?limit=1000"))  # whose lease may be older than this command
    overview.assert_clean()


def test_dialog_says_from_whom_the_lease_is_taken(site, overview):
    with socket.create_connection(("127.0.0.1", site.port), 5.0) as other:
        other.sendall(b"1\tLEASE bert\n")
        wait_for(lambda: "bert" in (site.get("state")["lease"] or ""))
        overview.page.click("button:has-text('Mode')")
        dialog = overview.page.locator("dialog[open]")
        dialog.get_by_text(re.compile("bert.* commands now")).wait_for(timeout=10_000)
        dialog.locator("select").select_option("active")
        dialog.get_by_label("Your name").fill("anna")
        dialog.get_by_role("button", name="Send MODE").click()
        dialog.get_by_text("the lease was taken from bert").wait_for(timeout=10_000)
    overview.assert_clean()


def test_alarm_is_acknowledged_with_who_and_when(site, overview):
    page = overview.page
    page.click("button:has-text('Drop')")
    dialog = page.locator("dialog[open]")
    dialog.locator("select").select_option("ZY105")
    dialog.get_by_label("Your name").fill("anna")
    dialog.get_by_role("button", name="Send DROP").click()
    dialog.get_by_text("done").wait_for(timeout=10_000)
    dialog.locator("button.main", has_text="Close").click()
    row = page.locator("main li, main tr", has_text=re.compile("ZY105: left out")).first
    row.get_by_role("button", name="Acknowledge").click(timeout=10_000)

    def acknowledged():
        problems = {problem["id"]: problem for problem in site.get("state")["problems"]}
        return problems["left-out:ZY105"]["acknowledged_by"] == "anna"

    wait_for(acknowledged, 15.0)
    page.get_by_text(re.compile("acknowledged.*anna")).first.wait_for(timeout=10_000)
    page.click("button:has-text('Take')")
    dialog.locator("select").select_option("ZY105")
    dialog.get_by_role("button", name="Send TAKE").click()
    dialog.get_by_text("done").wait_for(timeout=10_000)
    overview.assert_clean()


def test_frozen_coordinator_greys_the_page_until_it_goes_on(site, overview):
    with site.coordinator.frozen():
        overview.page.wait_for_selector("main.silent", timeout=NOTICED)
        band = overview.page.inner_text(".band.dead")
        assert re.search(SILENT + r" \d\d:\d\d:\d\d UTC", band)
        assert "coordinator" in band
        overview.picture("frozen")
    overview.page.wait_for_selector("main:not(.silent) h1", timeout=20_000)
    overview.assert_clean()


def test_frozen_service_greys_the_page_and_nothing_else(site, overview):
    before = int(asked(site, "STATUS").split(", ")[3])
    with site.service.frozen():
        overview.page.wait_for_selector("main.silent", timeout=NOTICED)
        assert "service" in overview.page.inner_text(".band.dead")
        wait_for(lambda: int(asked(site, "STATUS").split(", ")[3]) > before)  # the site measures on
    overview.page.wait_for_selector("main:not(.silent) h1", timeout=20_000)
    overview.assert_clean()


def test_killed_coordinator_is_noticed_and_its_successor_shown(site, overview):
    epoch = site.get("state")["epoch"]["number"]
    site.coordinator.kill()
    overview.page.wait_for_selector("main.silent", timeout=NOTICED)
    assert SILENT in overview.page.inner_text(".band.dead")
    site.start_coordinator()
    overview.page.wait_for_selector("main:not(.silent) h1", timeout=60_000)
    wait_for(lambda: site.get("state")["epoch"])
    assert epoch >= 1
    assert overview.elsewhere == []


def test_link_reopens_the_same_view(site, watched):
    number = site.get("epochs?limit=1")["epochs"][0]["number"]
    watch = watched(f"{site.url}/#/network?epoch={number}")
    watch.page.wait_for_selector("main canvas")
    watch.settle()
    point = site.get(f"epochs/{number}")["points"]["name"][0]
    watch.page.get_by_role("searchbox").or_(watch.page.get_by_placeholder(re.compile("Filter"))).first.fill(point)
    watch.page.locator("main table").get_by_text(point, exact=True).first.click()
    watch.page.wait_for_function(f"location.hash.includes('point={point}')")
    again = watched(watch.page.url)
    again.page.wait_for_selector("main canvas")
    again.page.get_by_text(re.compile(rf"{point} ·|{point}:")).first.wait_for(timeout=10_000)
    for each in (watch, again):
        each.assert_clean()


def test_chart_is_downloaded_as_values_and_as_a_picture(site, watched):
    watch = watched(f"{site.url}/#/residuals")
    watch.page.wait_for_selector("main canvas")
    watch.settle()
    for button, start in (("CSV", b""), ("PNG", b"\x89PNG")):
        with watch.page.expect_download() as awaited:
            watch.page.get_by_role("button", name=re.compile(button)).first.click()
        with open(awaited.value.path(), "rb") as file:
            content = file.read()
        assert content.startswith(start)
        assert len(content) > 200
    watch.assert_clean()
