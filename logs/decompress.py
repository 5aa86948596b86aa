"""Unpacking that stops: what a few packed bytes claim to hold must not fill memory or disk."""

from pathlib import Path

import lz4.frame
import zstandard

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""How a zstd frame begins. No CDR message does: the first byte of one is 0."""

LARGEST = 256 * 2**20
"""Bytes that one chunk or message may have once it is unpacked."""

RATIO = 100
"""How many times its size a packed file may unpack to: recordings shrink by 2 to 30 times."""


class BombError(ValueError):
    """Something unpacks to more than it may."""


def unzstd(data: bytes, limit: int = LARGEST) -> bytes:
    """Returns what a zstd frame holds.

    Args:
        data: The frame.
        limit: Bytes that it may unpack to.

    Raises:
        BombError: It unpacks to more.
        zstandard.ZstdError: It is damaged.
    """
    # Not decompress(): that allocates what the frame claims before it looks.
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        unpacked = reader.read(limit + 1)
    return _within(unpacked, limit)


def unlz4(data: bytes, limit: int = LARGEST) -> bytes:
    """Returns what an lz4 frame holds.

    Args:
        data: The frame.
        limit: Bytes that it may unpack to.

    Raises:
        BombError: It unpacks to more.
        RuntimeError: It is damaged.
    """
    unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=limit + 1)
    return _within(unpacked, limit)


def _within(unpacked: bytes, limit: int) -> bytes:
    if len(unpacked) > limit:
        raise BombError(f"it unpacks to more than {limit} bytes")
    return unpacked


def unzstd_file(packed: Path, unpacked: Path) -> None:
    """Unpacks a zstd file into another.

    Raises:
        BombError: It unpacks to more than ``RATIO`` times its size, and more than ``LARGEST``.
        zstandard.ZstdError: It is damaged.
        OSError: A file could not be read or written.
    """
    limit = max(LARGEST, RATIO * packed.stat().st_size)
    with packed.open("rb") as source, unpacked.open("wb") as target:
        decompressor = zstandard.ZstdDecompressor()
        with decompressor.stream_reader(source, read_across_frames=True) as reader:
            while block := reader.read(_BLOCK):
                limit -= len(block)
                if limit < 0:
                    raise BombError(
                        f"it unpacks to more than {RATIO} times its size, as no recording does"
                    )
                target.write(block)


_BLOCK = 2**20
