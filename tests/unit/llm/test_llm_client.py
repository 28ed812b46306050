"""The processes that ask language models, with real LiteLLM calls to a scripted server."""

from __future__ import annotations

import asyncio
import queue
import sys
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from fleet.llm.client import ModelClient
from tests.support.llm_server import LlmServer, Reply
from tests.support.polling import DEADLINE_S, until
from tests.support.process_ids import children

KEY = "sk-very-secret"


@pytest.fixture(scope="module")
def client() -> Iterator[ModelClient]:
    """Its processes have a key in their environment, and are started once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROBOTFLEET_TEST_KEY", KEY)
        client = ModelClient()
        yield client
        client.close()


def request(server: LlmServer, key_env: str | None = None) -> dict[str, Any]:
    return {
        "model": "openai/scripted",
        "messages": [{"role": "user", "content": "hello"}],
        "api_base": server.api_base,
        "api_key_env": key_env,
    }


async def test_a_call_waits_for_the_process_that_is_being_started(client: ModelClient) -> None:
    before = children()
    warming = asyncio.create_task(asyncio.to_thread(client.warm))
    await until(lambda: children() - before)
    with LlmServer(Reply("hello")) as server:
        answer = await asyncio.to_thread(client.call, request(server), DEADLINE_S)
    await warming
    assert answer.kind == "answer"
    assert len(children() - before) == 1


def test_calls_go_on_side_by_side_and_litellm_stays_outside(client: ModelClient) -> None:
    kinds: queue.Queue[str] = queue.Queue()
    with LlmServer(Reply(silent=True), Reply("hello")) as server:
        threads = [
            threading.Thread(target=lambda: kinds.put(client.call(request(server), 600).kind))
            for _ in range(2)
        ]
        for thread in threads:
            thread.start()
        assert kinds.get(timeout=DEADLINE_S) == "answer", "though the other one waits"
        assert kinds.empty()
    for thread in threads:
        thread.join()
    assert "litellm" not in sys.modules


def test_keys_go_to_the_server_and_not_into_messages(client: ModelClient) -> None:
    echo = f'{{"error": {{"message": "bad key {KEY}"}}}}'.encode()
    with LlmServer(Reply(status=401, raw=echo)) as server:
        answer = client.call(request(server, "ROBOTFLEET_TEST_KEY"), DEADLINE_S)
        assert server.keys == [f"Bearer {KEY}"]
    assert answer.kind == "key"
    assert "bad key ***" in answer.error


def test_close_ends_a_call_that_is_under_way(client: ModelClient) -> None:
    """The last one here, since no call follows a close."""
    kinds: list[str] = []
    with LlmServer(Reply(silent=True)) as server:
        thread = threading.Thread(
            target=lambda: kinds.append(client.call(request(server), 600).kind)
        )
        thread.start()
        assert server.asked.wait(DEADLINE_S)
        client.close()
        thread.join(DEADLINE_S)
        assert kinds == ["failed"]
        assert client.call(request(server), 600).kind == "closed"
        assert len(server.requests) == 1
