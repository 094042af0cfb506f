"""Generated requests against the OpenAPI document: no fault, and each answer as the document says."""

import json

import pytest
from hypothesis import HealthCheck, settings

from web.page_scene import DOCUMENT, TOKEN, served_page

schemathesis = pytest.importorskip("schemathesis", reason="the extra test-web is not installed")

CHECKED = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_schema_conformance",
)


@pytest.fixture(scope="module")
def page():
    with served_page() as page:
        yield page


schema = schemathesis.openapi.from_dict(json.loads(DOCUMENT.read_text(encoding="utf-8")))
QUIET = [HealthCheck.filter_too_much, HealthCheck.too_slow]  # of names that a pattern allows


def checks():
    return [check for check in schemathesis.checks.CHECKS.get_all() if check.__name__ in CHECKED]


@schema.parametrize()
@settings(max_examples=25, derandomize=True, deadline=None, suppress_health_check=QUIET)
def test_an_answer_is_as_the_document_says(page, case):
    assert len(checks()) == len(CHECKED)
    case.call_and_validate(base_url=page.base, headers={"Authorization": f"Bearer {TOKEN}"}, checks=checks())


@pytest.mark.slow
@schema.parametrize()
@settings(max_examples=250, deadline=None, suppress_health_check=QUIET)
def test_many_answers_are_as_the_document_says(page, case):
    case.call_and_validate(base_url=page.base, headers={"Authorization": f"Bearer {TOKEN}"}, checks=checks())
