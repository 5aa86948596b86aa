import json
import socket
import struct

import pytest

from selfmodel.sandbox.message import Message, MessageError, receive, send

LIMIT = 1000


def sent(data: bytes) -> Message:
    """Message in bytes, after which the channel ends."""
    left, right = socket.socketpair()
    with right:
        with left:
            left.sendall(data)
        return receive(right, LIMIT)


def framed(header: object) -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text


def test_a_message_arrives_as_it_was_sent():
    message = Message({"a": [1, None]}, {"b": b"bytes", "empty": b""})
    left, right = socket.socketpair()
    with left, right:
        send(left, message)

        assert receive(right, LIMIT) == message


def test_an_empty_blob_needs_no_receiver_any_more():
    calls = []

    class Channel:
        def sendall(self, data: bytes) -> None:
            calls.append(data)

    send(Channel(), Message({}, {"empty": b""}))

    assert len(calls) == 1


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x01",
        struct.pack("<Q", 10) + b"{}",
        struct.pack("<Q", 2**60),
        struct.pack("<Q", 2) + b"{x",
        framed([]),
        framed({"facts": {}}),
        framed({"facts": [], "sizes": {}}),
        framed({"facts": {}, "sizes": {"a": LIMIT + 1}}),
        framed({"facts": {}, "sizes": {"a": -1}}),
        framed({"facts": {}, "sizes": {"a": "1"}}),
        framed({"facts": {}, "sizes": {"a": 5}}) + b"1234",
        struct.pack("<Q", 100_000) + b"[" * 100_000,
    ],
)
def test_other_bytes_are_refused(data: bytes):
    with pytest.raises(MessageError):
        sent(data)
