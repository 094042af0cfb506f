"""Queue of a client: batches, an end to its length, and counts of what went."""

import asyncio
import json

import pytest

from web import page_scene  # isort: skip - skips where the extra is absent
from catseye.web import feed as feed_module
from catseye.web.feed import KINDS, MOST_BATCHES, LiveClient, LiveFeed, encoded

assert page_scene.TOKEN


def batch(*kinds):
    return tuple(encoded(kind, {"n": k}) for k, kind in enumerate(kinds))


def test_a_client_gets_its_kinds_in_order():
    async def story():
        client = LiveClient(["shot", "event"])
        assert not client.put(batch("shot", "posture", "event"))
        assert not client.put(batch("posture"))
        return await client.take()

    assert [json.loads(text)["kind"] for text in asyncio.run(story())] == ["shot", "event"]


def test_a_full_queue_loses_the_oldest_and_says_how_many():
    async def story():
        client = LiveClient(KINDS)
        lost = [client.put(batch("shot", "shot", "posture")) for _ in range(MOST_BATCHES + 3)]
        return lost, [await client.take() for _ in range(MOST_BATCHES)]

    lost, taken = asyncio.run(story())
    assert [dict(counts) for counts in lost[-4:]] == [{}] + 3 * [{"shot": 2, "posture": 1}]
    assert json.loads(taken[0][0]) == {"kind": "lag", "data": {"dropped": {"shot": 6, "posture": 3}}}
    assert [len(texts) for texts in taken] == [4] + [3] * (MOST_BATCHES - 1)


def test_an_event_is_encoded_once_for_all_clients(monkeypatch):
    calls = []

    def counted(kind, data):
        calls.append(kind)
        return encoded(kind, data)

    monkeypatch.setattr(feed_module, "encoded", counted)

    async def story():
        feed = LiveFeed()
        feed.publish("shot", {"number": 0})  # nobody listens: it is not even encoded
        feed.clients |= {LiveClient(KINDS) for _ in range(50)}
        for number in range(7):
            feed.publish("shot", {"number": number})
        return feed, [await client.take() for client in feed.clients]

    feed, taken = asyncio.run(story())
    assert calls == ["shot"] * 7
    assert all(texts is not taken[0] and texts == taken[0] for texts in taken[1:])
    assert len({id(texts[0]) for texts in taken}) == 1
    assert feed.events == {"shot": 8}


def test_a_number_that_is_none_in_json_is_refused():
    with pytest.raises(ValueError, match="not JSON compliant"):
        encoded("shot", {"range": float("nan")})
