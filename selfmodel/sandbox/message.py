"""Message between a process and its isolated child: JSON and named bytes, without pickle."""

import json
import socket
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

_LENGTH = struct.Struct("<Q")
MAX_HEADER_BYTES = 64 * 2**20
"""Largest JSON part of a message, bytes."""

OUT_OF_MEMORY = 71
"""Exit status of a child process without the memory to send its answer."""


class MessageError(ValueError):
    """The bytes are no complete message."""


@dataclass(frozen=True)
class Message:
    """Values that pass from one process to another.

    Attributes:
        facts: JSON object.
        blobs: Bytes by name.
    """

    facts: Mapping[str, Any]
    blobs: Mapping[str, bytes] = field(default_factory=dict)


def send(channel: socket.socket, message: Message) -> None:
    """Sends a message.

    Raises:
        OSError: The other process has closed the channel.
    """
    sizes = {name: len(data) for name, data in message.blobs.items()}
    header = json.dumps({"facts": dict(message.facts), "sizes": sizes}).encode()
    channel.sendall(_LENGTH.pack(len(header)) + header)
    # The other process may be gone after the last byte: a call for no bytes would fail.
    for data in filter(None, message.blobs.values()):
        channel.sendall(data)


def receive(channel: socket.socket, limit: int) -> Message:
    """Returns the next message.

    Args:
        channel: Channel to read.
        limit: Largest total size of the blobs, bytes.

    Raises:
        MessageError: The channel ended before the end of the message, or the message is invalid.
    """
    (length,) = _LENGTH.unpack(_exactly(channel, _LENGTH.size))
    if length > MAX_HEADER_BYTES:
        raise MessageError(f"a header of {length} bytes")
    try:
        header = json.loads(_exactly(channel, length))
        facts, sizes = header["facts"], header["sizes"]
        if not isinstance(facts, dict):
            raise MessageError(f"facts that are a {type(facts).__name__}")
        if sum(sizes.values()) > limit or min(sizes.values(), default=0) < 0:
            raise MessageError(f"blobs of {sum(sizes.values())} bytes, more than {limit}")
        blobs = {name: _exactly(channel, size) for name, size in sizes.items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise MessageError(str(error)) from error
    return Message(facts, blobs)


def _exactly(channel: socket.socket, size: int) -> bytes:
    data = bytearray(size)
    view = memoryview(data)
    done = 0
    while done < size:
        count = channel.recv_into(view[done:])
        if not count:
            raise MessageError(f"{done} of {size} bytes")
        done += count
    return bytes(data)
