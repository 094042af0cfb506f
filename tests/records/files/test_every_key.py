"""An error of a file names every key that is invalid, whatever their number."""

from datetime import date
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from catseye.records.files.record import Record, Within
from catseye.records.files.refusal import explained


class Small(Record):
    """Three keys that must be there, of three types."""

    length_mm: Annotated[float, Within(0, 100)]
    name: str
    when: date


KEYS = st.text("abcdefgh_", min_size=1, max_size=6).filter(lambda key: key not in ("length_mm", "name", "when"))


@given(st.sets(KEYS, min_size=1, max_size=15), st.booleans())
def test_every_unknown_key_and_every_wrong_value_is_named(keys, wrong):
    document = {"length_mm": 1e6 if wrong else 1.0, "name": "A", "when": date(2026, 1, 1), **dict.fromkeys(keys, 1)}
    with pytest.raises(ValidationError) as problem:
        Small.model_validate(document)
    text = explained(problem.value, document, Small)
    named = set(text.replace(",", " ").replace(";", " ").replace(":", " ").split())
    assert keys <= named
    assert ("length_mm" in named) or not wrong
    assert "more)" not in text
