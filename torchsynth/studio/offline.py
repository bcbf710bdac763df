"""Nothing of the page comes from another machine, and nothing goes there.

Gradio's own page is nearly so already. What is left, the preview pictures named in its head and anything that a
component might load, is taken out or forbidden here, so that the browser itself keeps the promise.
"""

from __future__ import annotations

import re
from typing import Any

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY = "; ".join(
    (
        "default-src 'self'",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:",  # gradio's page has scripts inside
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "connect-src 'self' data: blob:",
        "worker-src 'self' blob:",
        "object-src 'none'",
        "base-uri 'self'",
        "form-action 'self'",
        "frame-ancestors 'self'",
    )
)
"""What the browser may load: only what this server sends."""

_FOREIGN_TAGS = re.compile(
    rb"<(?:meta|link)\b[^>]*\bhttps?://[^>]*>|<script\b[^>]*\bsrc=\"https?://[^>]*></script>"
)


def without_foreign_tags(page: bytes) -> bytes:
    """A page without the tags that name another machine.

    Example:
        >>> without_foreign_tags(b'<p><link href="https://fonts.example/a.css">')
        b'<p>'
    """
    return _FOREIGN_TAGS.sub(b"", page)


class Offline:
    """Sends the policy with everything, and takes foreign tags out of pages.

    Args:
        app: What answers.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        await self._app(scope, receive, _Answer(send))


class _Answer:
    """One answer on its way out; a page is held back until all of it is there."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._start: Message | None = None
        self._body = b""

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers["Content-Security-Policy"] = POLICY
            headers["Referrer-Policy"] = "no-referrer"
            if headers.get("content-type", "").startswith("text/html"):
                self._start = message
                return
        elif message["type"] == "http.response.body" and self._start is not None:
            await self._hold(message)
            return
        await self._send(message)

    async def _hold(self, message: Any) -> None:  # noqa: ANN401 (a message holds values of any kind)
        self._body += message.get("body", b"")
        if message.get("more_body", False):
            return
        assert self._start is not None, "pages only"  # noqa: S101 (for the type checker)
        body = without_foreign_tags(self._body)
        MutableHeaders(scope=self._start)["content-length"] = str(len(body))
        start, self._start = self._start, None
        await self._send(start)
        await self._send({"type": "http.response.body", "body": body})
