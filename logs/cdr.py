"""ROS 2's binary message format (CDR, little-endian), as templates that are patched.

All messages of one topic of a trial are the same but for their time stamps and their numbers. So a
message is laid out once, with zeros for both, and whole series of messages are made from it, and
read back, by copying columns of bytes. The tests hold this layout to rosbags' serialiser, byte by
byte; rosbags itself is not needed at run time.
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
    """A message with holes for its time stamps and its numbers.

    Attributes:
        payload: The message with zeros in the holes.
        stamps: Where each time stamp stands (int32 seconds, uint32 nanoseconds).
        blocks: Offset and length of each run of float64, in order.
    """

    payload: bytes
    stamps: tuple[int, ...]
    blocks: tuple[tuple[int, int], ...]

    @property
    def width(self) -> int:
        """How many float64 a message has holes for."""
        return sum(count for _, count in self.blocks)

    def encode(self, nanoseconds: IntArray, values: FloatArray) -> list[bytes]:
        """Returns one message a row.

        Args:
            nanoseconds: ``(steps,)``, at least 0: each goes into every stamp of its message.
            values: ``(steps, width)``.
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
        """Returns what ``encode`` was given.

        Returns:
            ``(steps,)`` nanoseconds and ``(steps, width)`` values.

        Raises:
            ValueError: A message differs from the template outside of its holes, or its stamps
                differ from each other; the sentence says which message.
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
        none: FloatArray = np.empty((len(messages), 0))  # for a robot that feels nothing
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
    """Lays out a message field by field, in the order of its definition."""

    def __init__(self) -> None:
        self._bytes = bytearray(_ENCAPSULATION)
        self._stamps: list[int] = []
        self._blocks: list[tuple[int, int]] = []

    def header(self, frame: str) -> None:
        """Adds a ``std_msgs/Header``: a hole for the stamp, and the frame's name."""
        self._align(4)
        self._stamps.append(len(self._bytes))
        self._bytes += bytes(8)
        self.string(frame)

    def length(self, count: int) -> None:
        """Adds the length of a sequence whose elements follow."""
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
        """Adds a hole for so many float64."""
        self._align(8)
        self._blocks.append((len(self._bytes), count))
        self._bytes += bytes(8 * count)

    def zeros(self, count: int) -> None:
        """Adds so many float64 that are always zero."""
        self._align(8)
        self._bytes += bytes(8 * count)

    def sequence(self, count: int) -> None:
        """Adds a sequence of float64: its length, and a hole; an empty one has no hole."""
        self.length(count)
        if count:
            self.floats(count)

    def template(self) -> Template:
        """Returns what has been laid out."""
        return Template(bytes(self._bytes), tuple(self._stamps), tuple(self._blocks))

    def _align(self, size: int) -> None:
        self._bytes += bytes(-(len(self._bytes) - len(_ENCAPSULATION)) % size)


def names_of(payload: bytes) -> tuple[str, ...]:
    """Returns the names in a message that begins with a header and a ``string[] name``.

    Raises:
        ValueError: The bytes do not begin so.
    """
    if payload[:4] != _ENCAPSULATION:
        raise ValueError(f"expected little-endian CDR (00 01 00 00), got {payload[:4].hex(' ')!r}")
    _, at = _text(payload, len(_ENCAPSULATION) + 8)
    count, at = _uint32(payload, at)
    names = []
    for _ in range(count):  # each takes bytes, so a wrong count ends at the payload's end
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
