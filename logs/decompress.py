"""Bounded decompression, against bombs that would fill the memory."""

import lz4.frame
import zstandard


class BombError(ValueError):
    """Decompressed data exceed their limit."""


def unzstd(data: bytes, limit: int) -> bytes:
    """Returns the content of a zstd frame.

    Args:
        data: The frame.
        limit: Maximum decompressed size, bytes.

    Raises:
        BombError: The content exceeds the limit.
        zstandard.ZstdError: The data are damaged.
    """
    # Not decompress(), which allocates the size that the frame claims.
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        unpacked = reader.read(limit + 1)
    return _within(unpacked, limit)


def unlz4(data: bytes, limit: int) -> bytes:
    """Returns the content of an lz4 frame.

    Args:
        data: The frame.
        limit: Maximum decompressed size, bytes.

    Raises:
        BombError: The content exceeds the limit.
        RuntimeError: The data are damaged.
    """
    unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=limit + 1)
    return _within(unpacked, limit)


def _within(unpacked: bytes, limit: int) -> bytes:
    if len(unpacked) > limit:
        raise BombError(f"it unpacks to more than {limit} bytes")
    return unpacked
