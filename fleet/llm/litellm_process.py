"""A process that carries out LiteLLM calls: one JSON request a line in, one JSON answer a line out.

LiteLLM takes seconds to import, reads the network and the environment while it does, and waits as
long as a server trickles. Here it can be ended at any moment, and what it holds goes with it.
Run by `fleet.llm.client`; it ends when its standard input does.
"""

from __future__ import annotations

import gc
import json
import math
import os
import re
import resource
import signal
import sys
from typing import Any

MEMORY_BYTES = 1 << 30
"""What this process may allocate; an endless answer ends it, not the machine."""
MAX_MESSAGE = 300
"""Characters of an error message that are passed on."""
_WRAPPED = re.compile(
    r"^(litellm\.\w+: |\w+Error: |\w+Exception - )+|"
    r"\bTraceback .*|, Received response .*",
    re.DOTALL,
)
"""What LiteLLM puts around the message of a server."""


def main() -> None:
    """Answer requests until standard input ends."""
    # Ctrl-C is for the planner, which ends this process by closing its input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Libraries print; the answers have a way out of their own.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
    os.environ["LITELLM_LOCAL_MODEL_COST_MAP"] = "True"  # else importing it asks the internet
    os.environ["LITELLM_MODE"] = "PRODUCTION"  # else a stray .env file is read
    # Importing makes millions of objects that all stay: to look for garbage among them takes a
    # fifth of the time.
    gc.disable()
    try:
        import litellm
    except Exception as error:
        _write(answers, {"kind": "failed", "error": f"LiteLLM cannot be imported: {error}"})
        return
    gc.freeze()
    gc.enable()
    litellm.telemetry = False
    litellm.suppress_debug_info = True
    _write(answers, {"kind": "ready"})
    for line in sys.stdin:
        _write(answers, _answer(litellm, json.loads(line)))


def _write(answers: Any, row: dict[str, Any]) -> None:
    # What a server sends may hold half a character, which no JSON can pass on.
    plain = {
        name: value.encode(errors="replace").decode() if isinstance(value, str) else value
        for name, value in row.items()
    }
    answers.write(json.dumps(plain, allow_nan=False) + "\n")
    answers.flush()


def _answer(litellm: Any, request: dict[str, Any]) -> dict[str, Any]:
    key_env = request.pop("api_key_env")
    max_chars = request.pop("max_chars")
    key = os.environ.get(key_env) if key_env else None
    if key_env and not key:
        return {"kind": "key", "error": f"the environment variable {key_env} is not set"}
    if key is None and request.get("api_base"):
        # The key of another provider, which LiteLLM would take from the environment, is not for
        # this server; and the client insists on some key.
        key = "none"
    try:
        reply = litellm.completion(**request, api_key=key, max_retries=0, num_retries=0)
        return _read(litellm, reply, request["model"], max_chars)
    except MemoryError:
        return {"kind": "oversized", "error": "the answer does not fit into memory"}
    except Exception as error:
        return _failure(litellm, error, key)


def _read(litellm: Any, reply: Any, model: str, max_chars: int) -> dict[str, Any]:
    usage = getattr(reply, "usage", None)
    tokens_in = max(int(getattr(usage, "prompt_tokens", 0) or 0), 0)
    tokens_out = max(int(getattr(usage, "completion_tokens", 0) or 0), 0)
    row: dict[str, Any] = {"kind": "answer", "tokens_in": tokens_in, "tokens_out": tokens_out}
    try:
        prices = litellm.cost_per_token(
            model=model, prompt_tokens=tokens_in, completion_tokens=tokens_out
        )
        row["usd"] = float(sum(prices))
    except Exception:
        # LiteLLM has many ways to say that it does not know a model's price.
        row["usd"] = None
    if not reply.choices:
        return {**row, "text": "", "finish": "stop"}
    choice = reply.choices[0]
    refusal = (choice.message.provider_specific_fields or {}).get("refusal")
    text = choice.message.content or ""
    if len(text) > max_chars:
        return {**row, "kind": "oversized", "error": f"the answer has {len(text)} characters"}
    return {
        **row,
        "text": text,
        "finish": str(choice.finish_reason),
        "refusal": str(refusal)[:MAX_MESSAGE] if refusal else None,
    }


def _failure(litellm: Any, error: Exception, key: str | None) -> dict[str, Any]:
    kinds = (
        (litellm.Timeout, "timeout"),
        (litellm.RateLimitError, "rate-limit"),
        (litellm.AuthenticationError, "key"),
        (litellm.PermissionDeniedError, "key"),
        (litellm.ContextWindowExceededError, "too-long"),
        (litellm.ContentPolicyViolationError, "refused"),
        (litellm.UnsupportedParamsError, "form"),
        (litellm.BadRequestError, "form"),
        (litellm.UnprocessableEntityError, "form"),
        (litellm.NotFoundError, "unknown-model"),
        (litellm.InternalServerError, "unavailable"),
        (litellm.ServiceUnavailableError, "unavailable"),
        (litellm.BadGatewayError, "unavailable"),
        (litellm.APIConnectionError, "unavailable"),
    )
    kind = next((name for cls, name in kinds if isinstance(error, cls)), "failed")
    message = " ".join(_WRAPPED.sub("", str(error)).split()) or type(error).__name__
    if key and key != "none":
        message = message.replace(key, "***")
    headers: Any = getattr(error, "litellm_response_headers", None) or {}
    try:
        asked_s = float(headers["retry-after"])
        wait_s = asked_s if math.isfinite(asked_s) else None
    except (KeyError, ValueError):
        wait_s = None
    return {"kind": kind, "error": message[:MAX_MESSAGE], "retry_after_s": wait_s}


if __name__ == "__main__":
    main()
