"""Every route of the API: its answer has the shape of the document, its refusals are one line."""

import gzip
import json

import pytest

from web.page_scene import DOCUMENT, TOKEN, MadeUpWatch, served_page

import httpx  # isort: skip - after the skip of the scene

ANSWERS = {
    "/api/service": "ServiceJson",
    "/api/site": "SiteJson",
    "/api/state": "StateJson",
    "/api/state?at=60635.1": "StateJson",
    "/api/epochs?since=60000&until=70000&limit=10": "EpochsJson",
    "/api/epochs/3": "EpochJson",
    "/api/epochs/3/residuals": "ResidualsJson",
    "/api/series/names": "SeriesNamesJson",
    "/api/series?names=azimuth&most=10": "SeriesJson",
    "/api/dropped": "DroppedJson",
    "/api/shots?ranger=ZY101&status=good": "ShotsJson",
    "/api/shots/41": "ShotJson",
    "/api/shots/41/samples": "SamplesJson",
    "/api/points/A": "PointJson",
    "/api/rangers/ZY101": "RangerJson",
    "/api/calibrations": "CalibrationsJson",
    "/api/air?epoch=3": "AirJson",
    "/api/comparison?first=3&second=3": "ComparisonJson",
    "/api/surface": "SurfaceJson",
    "/api/events?severity=warning": "EventsJson",
    "/api/parameters": "ParametersJson",
    "/api/samplers": "SamplersJson",
    "/api/samplers/FOCUS?limit=10": "SamplerValuesJson",
}
BEARER = {"Authorization": f"Bearer {TOKEN}"}


@pytest.fixture(scope="module")
def page():
    with served_page() as page:
        yield page


@pytest.fixture(scope="module")
def client(page):
    with httpx.Client(base_url=page.base, timeout=20.0) as client:
        yield client


@pytest.mark.parametrize("path", ANSWERS)
def test_an_answer_has_the_shape_of_the_document(client, path):
    from catseye.web import models

    answer = client.get(path)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/json"), answer.text
    getattr(models, ANSWERS[path]).model_validate_json(answer.content, strict=True)
    assert answer.headers["cache-control"] == "no-store"


def test_each_route_of_the_document_is_tested(client):
    paths = set(client.get("/api/openapi.json").json()["paths"])
    templates = {"3": "{number}", "41": "{number}", "A": "{name}", "ZY101": "{name}", "FOCUS": "{name}"}
    tested = {"/".join(templates.get(part, part) for part in path.split("?")[0].split("/")) for path in ANSWERS}
    posts = {path for path in paths if path.startswith(("/api/commands", "/api/console", "/api/alarms"))}
    assert paths == tested | posts | {"/metrics", "/api/report"}


@pytest.mark.parametrize(
    ("path", "status", "text"),
    [
        ("/api/epochs/99", 404, "epoch 99 is unknown (expected 1 to 3)"),
        ("/api/shots/0", 404, "shot 0 is unknown"),
        ("/api/points/%2e%2e", 404, "point '..' is unknown"),
        ("/api/rangers/nobody", 404, "is no ranger"),
        ("/api/state?at=59999", 422, "before the history"),
        ("/api/state?at=nan", 422, "query at"),
        ("/api/state?at=-1", 422, "query at"),
        ("/api/epochs/three", 422, "path number"),
        ("/api/epochs?limit=0", 422, "query limit"),
        ("/api/series?names=bogus", 404, "'bogus' is not a series"),
        ("/api/series?names=,%20,", 422, "0 names (expected 1 to 64)"),
        ("/api/shots?since=60002&until=60001", 422, "expected an earlier and a later MJD"),
        ("/api/air?epoch=-1", 422, "query epoch"),
        ("/api/series", 422, "query names"),
        ("/api/events?severity=loud", 422, "query severity"),
        ("/api/nothing", 404, "/api/nothing is not a path"),
        ("/api/report", 404, "shows a site"),
        ("/api/samplers/GOSSIP", 404, "'GOSSIP' is not a sampler"),
        ("/api/samplers/FOCUS?limit=4097", 422, "query limit"),
    ],
)
def test_a_refusal_is_one_line(client, path, status, text):
    answer = client.get(path)
    assert answer.status_code == status
    assert list(answer.json()) == ["error"]
    assert text in answer.json()["error"]
    assert "\n" not in answer.json()["error"]


def test_a_large_answer_is_compressed_where_asked(client):
    path = "/api/series?names=azimuth&most=5000"
    with client.stream("GET", path, headers={"Accept-Encoding": "gzip"}) as answer:
        small = b"".join(answer.iter_raw())
    plain = client.get(path, headers={"Accept-Encoding": "identity"})
    refused = client.get(path, headers={"Accept-Encoding": "gzip;q=0"})
    assert answer.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in plain.headers
    assert "content-encoding" not in refused.headers
    assert gzip.decompress(small) == plain.content
    assert len(small) < len(plain.content) / 10


def test_a_file_of_the_page_is_sent_again_only_when_it_changed(client):
    first = client.get("/")
    assert (first.status_code, first.headers["cache-control"]) == (200, "no-cache")
    assert "<html" in first.text
    again = client.get("/index.html", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert client.get("/", headers={"If-None-Match": '"other"'}).status_code == 200
    assert client.head("/").headers["etag"] == first.headers["etag"]


def test_a_nan_of_ours_is_no_answer_and_no_trace_leaves(page, client):
    class Broken(MadeUpWatch):
        def surface(self, epoch=None, run=None, at=None):
            return {"rms": float("nan")}

    with served_page(watch=Broken()) as broken:
        answer = httpx.get(f"{broken.base}/api/surface")
    assert (answer.status_code, answer.json()) == (
        500,
        {"error": "internal error of the service; its log has a line about it"},
    )
    assert broken.counts["fault"] == 1
    [line] = broken.log
    assert "GET /api/surface: ValueError" in line


def test_commands_reach_the_site_with_their_person(page, client):
    page.subject.watch.done.clear()
    command = {"command": "MODE", "parameters": ["hold"], "who": "anna"}
    answer = client.post("/api/commands", json=command, headers=BEARER)
    assert (answer.status_code, answer.json()["values"]) == (200, ["hold"])
    line = client.post("/api/console/ZY101", json={"line": "STATUS", "who": "anna"}, headers=BEARER)
    assert line.json() == {"replies": ["OK STATUS"]}
    for path, body in (("acknowledge", {}), ("shelve", {"minutes": 30}), ("unshelve", {})):
        answer = client.post(f"/api/alarms/clock/{path}", json={"who": "anna", **body}, headers=BEARER)
        assert answer.status_code == 200, answer.text
    assert page.subject.watch.done == [
        ("MODE", ("hold",), "anna"),
        ("ZY101", "STATUS", "anna"),
        ("ACK", ("clock",), "anna"),
        ("SHELVE", ("clock", "30.0"), "anna"),
        ("UNSHELVE", ("clock",), "anna"),
    ]


def test_a_site_that_refuses_or_is_not_connected_says_so(page, client):
    refused = client.post(
        "/api/commands", json={"command": "DROP", "parameters": ["ZY999"], "who": "anna"}, headers=BEARER
    )
    assert (refused.status_code, refused.json()) == (409, {"error": "ZY999 is no ranger of the site"})
    page.subject.watch.connected = False
    try:
        lost = client.post("/api/commands", json={"command": "MODE", "parameters": [], "who": "anna"}, headers=BEARER)
    finally:
        page.subject.watch.connected = True
    assert lost.status_code == 503
    assert "not connected" in lost.json()["error"]


def test_metrics_are_prometheus_text(client):
    client.get("/api/state")
    text = client.get("/metrics").text
    for line in (
        'catseye_page_requests_total{route="/api/state",status="200"}',
        "catseye_connected 1.0",
        "catseye_shots_acknowledged_total 41.0",
        'catseye_ranger_shots_total{ranger="ZY101"} 41.0',
        'catseye_weather_temperature_celsius{station="WX1"} 4.5',
        'catseye_alarms{severity="warning",shelved="no"} 1.0',
        "process_resident_memory_bytes",
    ):
        assert line in text


def test_a_result_has_its_report_and_nothing_of_a_site():
    report = {"format": "catseye-report-1", "title": "a night"}
    with served_page(report=report, token=None) as page, httpx.Client(base_url=page.base) as client:
        assert client.get("/api/report").json() == report
        assert client.get("/api/service").json()["kind"] == "result"
        assert client.get("/api/state").status_code == 404
        assert client.get("/metrics").status_code == 200


def test_the_document_is_the_committed_one(client):
    """`PYTHONPATH=src:tests python tests/web/page_scene.py` writes it."""
    assert client.get("/api/openapi.json").json() == json.loads(DOCUMENT.read_text(encoding="utf-8"))
