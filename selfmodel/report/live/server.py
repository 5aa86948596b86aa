"""Server of one page on this computer, for the user who has its address.

The server is bound to 127.0.0.1, so no other computer reaches it. Its address has a random token,
so no other user of the computer can guess it, and requests under another host name are refused, so
no page of the web can read it by a name that resolves to this computer (DNS rebinding).
"""

import json
import secrets
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from time import monotonic
from typing import Any

from selfmodel.errors import WorkError

HOST = "127.0.0.1"

STATUS = "status.json"
"""Name of the state of the page, beside the page."""


@dataclass
class Shown:
    """What the server sends; replaced as a whole by ``show``.

    Attributes:
        page: The page.
        version: Number of the page.
        line: What happens at the moment, as a line of text.
        is_running: Whether there will be other pages.
        read_version: Number of the last page that was sent.
        read_at: Time of the last request, s by the monotonic clock; -inf before the first.
    """

    page: bytes = b""
    version: int = 0
    line: str = ""
    is_running: bool = True
    read_version: int = -1
    read_at: float = float("-inf")
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def show(self, page: bytes) -> None:
        """Replaces the page."""
        with self.lock:
            self.page = page
            self.version += 1

    def answer(self, name: str) -> tuple[bytes, str, int] | None:
        """Returns content, media type and number of a file; None for an unknown name.

        The number is that of the page, for ``sent``, or -1 for a file that is no page.
        """
        with self.lock:
            self.read_at = monotonic()
            if name == "":
                numbered = f'<body data-version="{self.version}">'.encode()
                page = self.page.replace(b"<body>", numbered, 1)
                return page, "text/html; charset=utf-8", self.version
            if name == STATUS:
                return json.dumps(self.status()).encode(), "application/json", -1
            return None

    def sent(self, version: int) -> None:
        """Notes that a whole page was sent: until then, the server must not end."""
        with self.lock:
            self.read_version = max(self.read_version, version)

    def status(self) -> dict[str, Any]:
        """Returns the state of the page as JSON values."""
        return {"version": self.version, "line": self.line, "running": self.is_running}

    def is_read(self, since: float) -> bool:
        """Returns whether a browser has shown the page in the last seconds.

        Args:
            since: Number of the seconds.
        """
        return monotonic() - self.read_at < since


@contextmanager
def serving(shown: Shown) -> Iterator[str]:
    """Serves a page in the background, and yields its address.

    Args:
        shown: What the server sends.

    Raises:
        WorkError: This computer has no free port.
    """
    token = secrets.token_urlsafe(24)
    try:
        server = _Server((HOST, 0), _handler(shown, token))
    except OSError as error:
        raise WorkError(f"no report can be served on {HOST}: {error.strerror}") from error
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1})
    thread.daemon = True
    thread.start()
    try:
        yield f"http://{HOST}:{server.server_port}/{token}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ANN401  # as in the base
        """Prints the error of a request, unless the browser has closed the connection.

        A tab that is closed or reloaded during a transfer is no error, and the terminal shows the
        recovery.
        """
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


def _handler(shown: Shown, token: str) -> type[BaseHTTPRequestHandler]:
    """Returns the class that the server makes an object of for each request."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:  # the name is of the base class
            answer = shown.answer(self.path.removeprefix(f"/{token}/")) if self._is_ours() else None
            if answer is None:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            data, media_type, version = answer
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", media_type)
            self.send_header("Content-Length", str(len(data)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            self.wfile.write(data)
            shown.sent(version)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002  # as in the base
            """Logs nothing: the terminal shows the recovery."""

        def _is_ours(self) -> bool:
            host = self.headers.get("Host", "").partition(":")[0]
            given = self.path[1:].partition("/")[0]
            return host in (HOST, "localhost") and secrets.compare_digest(
                given.encode(), token.encode()
            )

    return Handler
