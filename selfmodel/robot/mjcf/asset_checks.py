"""Checks of the files that a model in a log names, before MuJoCo decodes them."""

import struct
import zlib

ASSET_ENDINGS = (".stl", ".obj", ".msh", ".png", ".ktx", ".skn", ".bin")
"""Endings of the names of the files that a model in a log may name. Archives are excluded: MuJoCo
would read an archive in place of a mesh, and with the archive another model and the files of that
model from any folder."""

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COMPRESSED_TEXTS = (b"iCCP", b"zTXt", b"iTXt")
_MAX_COMPRESSED_TEXTS = 4  # MuJoCo decompresses 16 MB of each; cameras write no more


def pixel_count(name: str, data: bytes) -> int:
    """Returns the number of pixels of a file: width times height of a PNG, 0 for other files.

    Raises:
        ValueError: The file has an ending that a model in a log may not name, or decompresses to
            more bytes than its header declares.
    """
    if not name.lower().endswith(ASSET_ENDINGS):
        raise ValueError(
            f"the model names the file {name!r}: a model in a log may name "
            f"{', '.join(ASSET_ENDINGS)}"
        )
    if data.startswith(_PNG_SIGNATURE):
        return _checked_pixels(name, data)
    if name.lower().endswith(".png"):
        raise ValueError(f"the file {name!r} is no PNG")
    return 0


def _checked_pixels(name: str, data: bytes) -> int:
    chunks = _chunks(data)
    if not chunks or chunks[0][0] != b"IHDR" or len(chunks[0][1]) != 13:
        raise ValueError(f"the file {name!r} is no PNG: its header is missing")
    if sum(kind in _COMPRESSED_TEXTS for kind, _ in chunks) > _MAX_COMPRESSED_TEXTS:
        raise ValueError(f"the file {name!r} has more than {_MAX_COMPRESSED_TEXTS} packed texts")
    width, height = struct.unpack_from(">II", chunks[0][1])
    limit = 8 * width * height + 16 * height + 64  # four channels of 16 bits, one byte per row
    if limit < len(data) * 2000:  # zlib compresses by a factor of at most 1,032
        _check_decompressed(name, b"".join(body for kind, body in chunks if kind == b"IDAT"), limit)
    return int(width * height)


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """Returns type and content of the chunks of a PNG."""
    chunks = []
    offset = len(_PNG_SIGNATURE)
    while offset + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, offset)
        chunks.append((kind, data[offset + 8 : offset + 8 + length]))
        offset += 12 + length
    return chunks


def _check_decompressed(name: str, compressed: bytes, limit: int) -> None:
    try:
        content = zlib.decompressobj().decompress(compressed, limit + 1)
    except zlib.error as error:
        raise ValueError(f"the file {name!r} is a damaged PNG: {error}") from error
    if len(content) > limit:
        raise ValueError(f"the file {name!r} unpacks to more than its size in pixels")
