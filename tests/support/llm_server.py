"""A scripted OpenAI-compatible HTTP server on the loopback, to stand at the end of real calls."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass(frozen=True)
class Reply:
    """One answer. `content` that is no text is sent as its JSON.

    `silent` never answers, `trickle` sends one byte after the other without an end; both stop when
    the server does. `raw` replaces the whole body.
    """

    content: Any = ""
    status: int = 200
    finish_reason: str = "stop"
    refusal: str | None = None
    tokens: tuple[int, int] = (100, 50)
    headers: dict[str, str] = field(default_factory=dict)
    silent: bool = False
    trickle: bool = False
    raw: bytes | None = None

    def body(self, model: str) -> bytes:
        """What goes over the wire."""
        if self.raw is not None:
            return self.raw
        if self.status != 200:
            error = {"message": f"scripted {self.status}", "type": "scripted", "code": self.status}
            return json.dumps({"error": error}).encode()
        text = (
            self.content
            if isinstance(self.content, str | None)
            else json.dumps(self.content, indent=1)
        )
        message = {"role": "assistant", "content": text, "refusal": self.refusal}
        tokens_in, tokens_out = self.tokens
        return json.dumps(
            {
                "id": "scripted",
                "object": "chat.completion",
                "created": 0,
                "model": model,
                "choices": [{"index": 0, "message": message, "finish_reason": self.finish_reason}],
                "usage": {
                    "prompt_tokens": tokens_in,
                    "completion_tokens": tokens_out,
                    "total_tokens": tokens_in + tokens_out,
                },
            }
        ).encode()


class LlmServer:
    """Gives its replies in order, the last one again and again, and keeps the requests.

    A reply may be made from the request when that comes.
    """

    def __init__(self, *replies: Reply | Callable[[dict[str, Any]], Reply]) -> None:
        self.replies = replies
        self.requests: list[dict[str, Any]] = []
        self.keys: list[str | None] = []
        self.asked = threading.Event()
        """Set once there was a request."""
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                outer.serve(self)

            def log_message(self, *args: object) -> None:
                """Requests are kept, not printed."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        # A client that was ended in mid-answer is what some tests want, and no news.
        self._server.handle_error = lambda *_: None  # type: ignore[method-assign]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,))

    @property
    def api_base(self) -> str:
        """The URL to configure."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/v1"

    def prompt(self, request: int) -> str:
        """Everything that the client said in one of its requests."""
        return "\n".join(message["content"] for message in self.requests[request]["messages"])

    def serve(self, handler: BaseHTTPRequestHandler) -> None:
        """Answer one request."""
        length = int(handler.headers.get("Content-Length", 0))
        request = json.loads(handler.rfile.read(length))
        with self._lock:
            self.requests.append(request)
            self.keys.append(handler.headers.get("Authorization"))
            scripted = self.replies[min(len(self.requests), len(self.replies)) - 1]
        self.asked.set()
        reply = scripted if isinstance(scripted, Reply) else scripted(request)
        if reply.silent:
            self._stopped.wait()
            return
        body = reply.body(request["model"])
        handler.send_response(reply.status)
        handler.send_header("Content-Type", "application/json")
        handler.send_header("Content-Length", str(len(body) + (1 << 30) * reply.trickle))
        for name, value in reply.headers.items():
            handler.send_header(name, value)
        handler.end_headers()
        while reply.trickle and not self._stopped.wait(0.1):
            handler.wfile.write(b" ")
            handler.wfile.flush()
        handler.wfile.write(body)

    def __enter__(self) -> LlmServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()
