"""Parameters, corrections and health of a living site in the browser."""

import re

import pytest

from browser.scene import TOKEN, wait_for


@pytest.fixture
def panel(site, watched):
    """The page of parameters of a connected site, with the token of its link and a name."""
    watch = watched(f"{site.url}/#token={TOKEN}")
    watch.page.wait_for_selector("main:not(.silent) h1")
    watch.page.goto(f"{site.url}/#/parameters")
    watch.page.get_by_label("round_s", exact=True).wait_for()
    watch.page.get_by_label("Your name").fill("anna")
    yield watch
    site.command("DISCARD")


def parameters(site):
    return {row["name"]: row for row in site.get("parameters")["parameters"]}


def row_of(page, name):
    return page.locator("main li", has=page.get_by_label(name, exact=True))


def test_each_parameter_stands_there_with_value_limits_and_meaning(site, panel):
    rows = parameters(site)
    assert len(rows) >= 20
    for name, row in rows.items():
        text = row_of(panel.page, name).inner_text().replace("\u00a0", " ")
        assert row["value"] in text, name
        assert row["meaning"].split(";")[0] in text, name
        assert row["unit"].replace("deg", "°") in text, name
        assert row["legal"].split(";")[0].split()[0] in text, name
    panel.assert_clean()


def test_set_is_prepared_started_and_active_at_the_next_round(site, panel):
    page = panel.page
    try:
        page.get_by_label("round_s", exact=True).fill("12.0")
        page.get_by_label("corrections", exact=True).select_option("off")
        page.get_by_role("button", name="Set 2 and prepare").click()
        page.get_by_text("The set is prepared").wait_for()
        assert "round_s from 10 s to 12 s" in page.inner_text("main .changes").replace("\u00a0", " ")
        panel.picture("parameters-prepared")
        assert panel.axe() == []
        page.get_by_role("button", name="Start").click()
        page.get_by_text("The set is started").wait_for()
        wait_for(lambda: parameters(site)["round_s"]["value"] == "12", 40.0)
        page.get_by_text("No value waits").wait_for()
        wait_for(lambda: "12\u00a0s" in row_of(page, "round_s").inner_text(), 10.0)
        assert parameters(site)["corrections"]["value"] == "off"
        events = site.get("events?limit=200")
        assert any("round_s from 10 to 12" in text for text in events["text"])
    finally:
        for words in (("SET", "round_s", "10"), ("SET", "corrections", "on"), ("PREPARE",), ("START",)):
            site.command(*words)
        wait_for(lambda: parameters(site)["round_s"]["value"] == "10", 40.0)
    panel.assert_clean()


def test_refused_set_says_why_beside_the_parameter_and_changes_nothing(site, panel):
    page = panel.page
    page.get_by_label("round_s", exact=True).fill("100")
    page.get_by_role("button", name="Set 1 and prepare").click()
    why = "reference_every_s = 60 is shorter than round_s = 100"
    line = row_of(page, "round_s").locator("p", has_text=why)
    line.wait_for()
    assert line.inner_text().count("\n") == 0
    page.get_by_role("status").filter(has_text=why).wait_for()
    page.locator("main .locks li", has_text=why).get_by_text("refuses").wait_for()
    assert page.get_by_role("button", name="Start").is_disabled()
    panel.picture("parameters-refused")
    assert panel.axe() == []
    page.get_by_role("button", name="Discard").click()
    page.get_by_text("No value waits").wait_for()
    assert parameters(site)["round_s"]["waiting"] == "none"
    assert parameters(site)["round_s"]["value"] == "10"
    panel.errors[:] = [error for error in panel.errors if "409" not in error and "/api/commands" not in error]
    panel.assert_clean()


def test_illegal_value_is_refused_beside_its_field(site, panel):
    page = panel.page
    page.get_by_label("cycles", exact=True).fill("0")
    page.get_by_role("button", name="Set cycles").click()
    row_of(page, "cycles").get_by_text("cycles 0 is not legal (expected 1 to 65536").wait_for()
    assert page.get_by_label("cycles", exact=True).get_attribute("aria-invalid") == "true"
    assert parameters(site)["cycles"]["waiting"] == "none"


def test_parameters_without_the_token_are_read_only(site, watched):
    watch = watched(f"{site.url}/#/parameters")
    watch.page.get_by_text("Setting needs the token").wait_for()
    assert watch.page.get_by_label("round_s", exact=True).is_disabled()
    assert watch.page.get_by_role("button", name="Prepare").count() == 0
    watch.assert_clean()


def test_corrections_are_those_of_the_sampler_and_name_their_zero(site, watched):
    site.command("MOVED", "subreflector", "1.5", "mm", "anna")
    wait_for(lambda: site.get("samplers/BEAM")["mjd"])
    watch = watched(f"{site.url}/#/corrections")
    page = watch.page
    page.get_by_text("given to the telescope").first.wait_for()
    page.locator("main tr", has_text="subreflector").first.wait_for()

    def agrees():
        columns = site.get("samplers/CORRECTIONS?limit=1")["columns"]
        text = page.inner_text("main").replace("\u00a0", " ")
        epoch, zero = columns["epoch"][0], columns["reference"][0]
        return epoch > (zero or epoch) and f"of epoch\n{epoch:g}" in text and f"reference epoch\n{zero:g}" in text

    wait_for(agrees, 60.0)
    watch.picture("corrections")
    text = page.inner_text("main").replace("\u00a0", " ")
    assert re.search(r"azimuth × cos E\n\(.?[\d.]+ ± [\d.]+\)″", text)
    assert re.search(r"dish\s+\d+\s.?[\d.]+ ± [\d.]+ mm", text)
    assert page.locator("main canvas").count() >= 2
    watch.assert_clean()


def test_zero_is_set_from_the_page_of_corrections(site, watched):
    watch = watched(f"{site.url}/#token={TOKEN}")
    watch.page.wait_for_selector("main:not(.silent) h1")
    watch.page.goto(f"{site.url}/#/corrections")
    before = site.get("samplers/CORRECTIONS?limit=1")["columns"]["reference"][0]
    watch.page.get_by_role("button", name="Set the zero").click()
    dialog = watch.page.locator("dialog[open]")
    dialog.get_by_label("Your name").fill("anna")
    dialog.get_by_role("button", name="Send REFERENCE").click()
    dialog.get_by_text("done").wait_for(timeout=10_000)
    wait_for(lambda: site.get("samplers/CORRECTIONS?limit=1")["columns"]["reference"][0] > before, 60.0)
    watch.assert_clean()


def test_health_has_a_row_for_each_ranger(site, watched):
    wait_for(lambda: len(set(site.get("samplers/HEALTH?limit=400")["columns"]["ranger"])) == 18)
    watch = watched(f"{site.url}/#/health")
    wait_for(lambda: watch.page.locator("main tbody tr", has_text=re.compile("ZY1")).count() == 18, 20.0)
    columns = site.get("samplers/HEALTH?limit=400")["columns"]
    reported = {f"{ranger} {clock}" for ranger, clock in zip(columns["ranger"], columns["clock"], strict=True)}
    for row in watch.page.locator("main tbody tr").all_inner_texts():
        words = row.split()
        assert any(f"{words[0]} {clock}" in reported for clock in ("locked", "free") if clock in words), row
    watch.assert_clean()
