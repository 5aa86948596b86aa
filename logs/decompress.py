"""Bounded decompression, against bombs that would fill memory or disk."""

from pathlib import Path

import lz4.frame
import zstandard

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame. A CDR message begins with 0."""

MAX_DECOMPRESSED_BYTES = 256 * 2**20
"""Maximum decompressed size of a chunk or a message, bytes."""

RATIO = 100
"""Maximum compression ratio of a file: recordings have ratios of 2 to 30."""


class BombError(ValueError):
    """Decompressed data exceed their limit."""


def unzstd(data: bytes, limit: int = MAX_DECOMPRESSED_BYTES) -> bytes:
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


def unlz4(data: bytes, limit: int = MAX_DECOMPRESSED_BYTES) -> bytes:
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


def unzstd_file(packed: Path, unpacked: Path) -> None:
    """Decompresses a zstd file into another file.

    Raises:
        BombError: The content exceeds ``RATIO`` times the file's size, and
            ``MAX_DECOMPRESSED_BYTES``.
        zstandard.ZstdError: The data are damaged.
        OSError: Reading or writing failed.
    """
    limit = max(MAX_DECOMPRESSED_BYTES, RATIO * packed.stat().st_size)
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
