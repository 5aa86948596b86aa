"""ROS 2's binary message format (CDR, little-endian), as patched templates.

All messages of one topic of a trial differ only in their time stamps and their numbers. A message
is laid out once, with zeros for both, and series of messages are encoded and decoded by copying
columns of bytes. The tests compare this layout with rosbags' serialiser, byte by byte; rosbags
itself is not needed at run time.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selfmodel.arrays import FloatArray

IntArray = NDArray[np.int64]
ByteMatrix = NDArray[np.uint8]

_ENCAPSULATION = b"\x00\x01\x00\x00"
_BILLION = 1_000_000_000


@dataclass(frozen=True)
class Template:
    """Bytes of a message with gaps for its time stamps and its numbers.

    Attributes:
        payload: Message with zeros in the gaps.
        stamps: Offsets of the time stamps (int32 seconds, uint32 nanoseconds), bytes.
        blocks: Offset in bytes and number of values of each float64 block, in order.
    """

    payload: bytes
    stamps: tuple[int, ...]
    blocks: tuple[tuple[int, int], ...]

    @property
    def width(self) -> int:
        """Number of float64 values in a message."""
        return sum(count for _, count in self.blocks)

    def encode(self, nanoseconds: IntArray, values: FloatArray) -> list[bytes]:
        """Returns one message per row of values.

        Args:
            nanoseconds: Non-negative times, ``(steps,)`` ns, written into every stamp of a message.
            values: Numbers, ``(steps, width)``.
        """
        messages = np.tile(np.frombuffer(self.payload, np.uint8), (len(values), 1))
        seconds = np.column_stack([nanoseconds // _BILLION, nanoseconds % _BILLION])
        stamp_bytes = np.ascontiguousarray(seconds, dtype="<u4").view(np.uint8)
        for offset in self.stamps:
            messages[:, offset : offset + 8] = stamp_bytes
        value_bytes = np.ascontiguousarray(values, dtype="<f8").view(np.uint8)
        start = 0
        for offset, count in self.blocks:
            messages[:, offset : offset + 8 * count] = value_bytes[:, start : start + 8 * count]
            start += 8 * count
        return [row.tobytes() for row in messages]

    def decode(self, payloads: Sequence[bytes]) -> tuple[IntArray, FloatArray]:
        """Returns the times and numbers of messages; the inverse of ``encode``.

        Returns:
            Times, ``(steps,)`` ns, and numbers, ``(steps, width)``.

        Raises:
            ValueError: A message differs from the template outside its gaps, or its stamps differ
                from each other; the message names its index.
        """
        length = len(self.payload)
        for index, payload in enumerate(payloads):
            if len(payload) != length:
                raise ValueError(
                    f"message {index} has {len(payload)} bytes where the first has {length}"
                )
        messages = np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, length)
        fixed = self._fixed()
        wrong = np.any(messages[:, fixed] != np.frombuffer(self.payload, np.uint8)[fixed], axis=1)
        if np.any(wrong):
            raise ValueError(f"message {np.argmax(wrong)} has another layout than expected")
        stamps = [_view(messages, offset, 8, "<u4") for offset in self.stamps]
        if any(np.any(other != stamps[0]) for other in stamps[1:]):
            raise ValueError("the time stamps within a message differ")
        seconds = stamps[0].astype(np.int64)
        blocks = [_view(messages, offset, 8 * count, "<f8") for offset, count in self.blocks]
        none: FloatArray = np.empty((len(messages), 0))  # for a robot without sensors
        values = np.concatenate([none, *blocks], axis=1).astype(np.float64, copy=False)
        return seconds[:, 0] * _BILLION + seconds[:, 1], values

    def _fixed(self) -> NDArray[np.bool_]:
        fixed = np.ones(len(self.payload), dtype=np.bool_)
        for offset in self.stamps:
            fixed[offset : offset + 8] = False
        for offset, count in self.blocks:
            fixed[offset : offset + 8 * count] = False
        return fixed


class Layout:
    """Builder of a template, field by field in the order of the message definition."""

    def __init__(self) -> None:
        self._bytes = bytearray(_ENCAPSULATION)
        self._stamps: list[int] = []
        self._blocks: list[tuple[int, int]] = []

    def header(self, frame: str) -> None:
        """Adds a ``std_msgs/Header``: a gap for the stamp, and the name of the frame."""
        self._align(4)
        self._stamps.append(len(self._bytes))
        self._bytes += bytes(8)
        self.string(frame)

    def length(self, count: int) -> None:
        """Adds the length of a sequence; its elements must follow."""
        self._align(4)
        self._bytes += struct.pack("<I", count)

    def string(self, text: str) -> None:
        """Adds a string."""
        data = text.encode() + b"\x00"
        self.length(len(data))
        self._bytes += data

    def strings(self, texts: Sequence[str]) -> None:
        """Adds a sequence of strings."""
        self.length(len(texts))
        for text in texts:
            self.string(text)

    def floats(self, count: int) -> None:
        """Adds a gap for ``count`` float64 values."""
        self._align(8)
        self._blocks.append((len(self._bytes), count))
        self._bytes += bytes(8 * count)

    def zeros(self, count: int) -> None:
        """Adds ``count`` float64 values that are always zero."""
        self._align(8)
        self._bytes += bytes(8 * count)

    def sequence(self, count: int) -> None:
        """Adds a sequence of float64: its length, and a gap unless the sequence is empty."""
        self.length(count)
        if count:
            self.floats(count)

    def template(self) -> Template:
        """Returns the template of the fields added so far."""
        return Template(bytes(self._bytes), tuple(self._stamps), tuple(self._blocks))

    def _align(self, size: int) -> None:
        self._bytes += bytes(-(len(self._bytes) - len(_ENCAPSULATION)) % size)


def decode_names(payload: bytes) -> tuple[str, ...]:
    """Returns the names in a message that begins with a header and a ``string[] name``.

    Raises:
        ValueError: The message has another layout.
    """
    if payload[:4] != _ENCAPSULATION:
        raise ValueError(f"expected little-endian CDR (00 01 00 00), got {payload[:4].hex(' ')!r}")
    _, at = _text(payload, len(_ENCAPSULATION) + 8)
    count, at = _uint32(payload, at)
    names = []
    for _ in range(count):  # every name takes bytes, so a wrong count ends with the payload
        name, at = _text(payload, at)
        names.append(name)
    return tuple(names)


def _uint32(payload: bytes, at: int) -> tuple[int, int]:
    at += -(at - len(_ENCAPSULATION)) % 4
    if at + 4 > len(payload):
        raise ValueError(f"a message of {len(payload)} bytes ends within its names")
    return int.from_bytes(payload[at : at + 4], "little"), at + 4


def _text(payload: bytes, at: int) -> tuple[str, int]:
    size, at = _uint32(payload, at)
    if not 0 < size <= len(payload) - at:
        raise ValueError(f"a name of {size} bytes in a message of {len(payload)} bytes")
    return payload[at : at + size - 1].decode(), at + size


def _view(messages: ByteMatrix, offset: int, size: int, dtype: str) -> NDArray[np.generic]:
    return np.ascontiguousarray(messages[:, offset : offset + size]).view(dtype)
