import http.client
import json
import socket
import struct
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from time import monotonic, sleep
from urllib.parse import urlsplit

import pytest

from selfmodel.report.live.server import Shown, serving


@pytest.fixture
def shown() -> Shown:
    found = Shown(line="it begins.")
    found.show(b"<html><body>first</body></html>")
    return found


@pytest.fixture
def address(shown: Shown) -> Iterator[str]:
    with serving(shown) as url:
        yield url


def status_of(address: str, path: str, host: str | None = None) -> int:
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=10)
    connection.request("GET", path, headers={} if host is None else {"Host": host})
    return connection.getresponse().status


def read(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=10) as answer:  # noqa: S310  # this computer
        return answer.read()


def reset(address: str, request: str, read_bytes: int) -> None:
    """Sends a request, reads the beginning of the answer, and resets the connection.

    Returns when the server has ended the request.
    """
    before = set(threading.enumerate())
    url = urlsplit(address)
    with socket.create_connection((url.hostname, url.port), timeout=10) as client:
        client.sendall(request.format(path=url.path, host=url.netloc).encode())
        if read_bytes:
            assert client.recv(read_bytes)
        end, requests = monotonic() + 10, set[threading.Thread]()
        while not requests and monotonic() < end:
            sleep(0.01)
            # A thread that has yet to start is listed, and cannot be joined.
            requests = {own for own in threading.enumerate() if own.is_alive()} - before
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    for thread in requests:
        thread.join(10)
    assert requests
    assert not any(thread.is_alive() for thread in requests)


def test_the_page_is_served_with_its_number(address: str):
    assert read(address) == b'<html><body data-version="1">first</body></html>'


def test_the_status_follows_the_page(address: str, shown: Shown):
    shown.show(b"<body>")
    shown.line = "generation 1."

    status = json.loads(read(f"{address}status.json"))

    assert status == {"version": 2, "line": "generation 1.", "running": True}


@pytest.mark.parametrize("path", ["/", "/report.html", "/wrong/", "/wrong/status.json"])
def test_without_the_token_there_is_nothing(address: str, path: str):
    assert status_of(address, path) == 404


def test_beside_the_page_there_is_nothing(address: str):
    token = urlsplit(address).path

    assert status_of(address, f"{token}../../etc/passwd") == 404
    assert status_of(address, f"{token}other") == 404


def test_another_host_name_is_refused(address: str):
    token = urlsplit(address).path

    assert status_of(address, token, "evil.example") == 404
    assert status_of(address, token, "localhost:1") == 200


def test_two_servers_have_different_tokens_on_this_computer_alone(shown: Shown):
    with serving(shown) as first, serving(shown) as second:
        assert urlsplit(first).path != urlsplit(second).path
        assert {urlsplit(one).hostname for one in (first, second)} == {"127.0.0.1"}
        assert len(urlsplit(first).path) > 30


def test_the_server_ends_with_its_context(shown: Shown):
    with serving(shown) as address:
        pass

    with pytest.raises(urllib.error.URLError):
        read(address)


def test_a_page_that_was_never_asked_for_is_not_read(shown: Shown):
    assert not shown.is_read(3600)
    with serving(shown) as address:
        read(address)
        end = monotonic() + 10
        while shown.read_version < 1 and monotonic() < end:
            sleep(0.01)
    assert shown.is_read(3600)
    assert shown.read_version == 1


def test_a_page_is_read_only_once_all_of_it_was_sent(shown: Shown):
    answer = shown.answer("")

    assert answer is not None
    assert shown.read_version == -1
    shown.sent(answer[2])
    assert shown.read_version == shown.version


@pytest.mark.parametrize(
    ("request_text", "read_bytes"),
    [("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n", 100), ("GET {path}", 0)],
    ids=["in the answer", "in the request"],
)
def test_a_connection_that_the_browser_resets_prints_nothing(
    address: str,
    shown: Shown,
    request_text: str,
    read_bytes: int,
    capsys: pytest.CaptureFixture[str],
):
    shown.show(b"<body>" + bytes(50_000_000))  # more than the buffers of a connection hold

    reset(address, request_text, read_bytes)

    assert capsys.readouterr() == ("", "")
    assert shown.read_version == -1
    shown.show(b"<body>")
    assert read(address) == b'<body data-version="3">'


def test_another_error_of_a_request_is_printed(
    address: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def failing(_shown: Shown, _name: str) -> None:
        raise ValueError("no page")

    monkeypatch.setattr(Shown, "answer", failing)

    with pytest.raises(http.client.RemoteDisconnected):
        read(address)

    end = monotonic() + 10
    printed = ""
    while "ValueError: no page" not in printed and monotonic() < end:
        sleep(0.01)
        printed += capsys.readouterr().err
    assert "ValueError: no page" in printed
