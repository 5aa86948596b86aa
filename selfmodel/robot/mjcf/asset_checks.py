"""Checks the files that a model in a log names, before MuJoCo unpacks them."""

import struct
import zlib

KINDS = (".stl", ".obj", ".msh", ".png", ".ktx", ".skn", ".bin")
"""How the names of such files may end. MuJoCo would take an archive for a mesh, with a model of its
own in it, and that model's files from anywhere."""

_PNG = b"\x89PNG\r\n\x1a\n"
_PACKED_TEXTS = (b"iCCP", b"zTXt", b"iTXt")
_MOST_PACKED_TEXTS = 4  # MuJoCo unpacks 16 MB of each, and no camera writes more


def cells_of(name: str, data: bytes) -> int:
    """Returns how many pixels a file unpacks to, 0 for what is not packed.

    Raises:
        ValueError: It is of a kind that a model in a log may not name, or unpacks to more than it
            says.
    """
    if not name.lower().endswith(KINDS):
        raise ValueError(
            f"the model names the file {name!r}: a model in a log may name {', '.join(KINDS)}"
        )
    if data.startswith(_PNG):
        return _pixels(name, data)
    if name.lower().endswith(".png"):
        raise ValueError(f"the file {name!r} is no PNG")
    return 0


def _pixels(name: str, data: bytes) -> int:
    chunks = _chunks(data)
    if not chunks or chunks[0][0] != b"IHDR" or len(chunks[0][1]) != 13:
        raise ValueError(f"the file {name!r} is no PNG: its header is missing")
    if sum(kind in _PACKED_TEXTS for kind, _ in chunks) > _MOST_PACKED_TEXTS:
        raise ValueError(f"the file {name!r} has more than {_MOST_PACKED_TEXTS} packed texts")
    width, height = struct.unpack_from(">II", chunks[0][1])
    most = 8 * width * height + 16 * height + 64  # four colours of 16 bits; a byte before each row
    if most < len(data) * 2000:  # more cannot come out of so many bytes
        _check_unpacked(name, b"".join(body for kind, body in chunks if kind == b"IDAT"), most)
    return int(width * height)


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    chunks = []
    at = len(_PNG)
    while at + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        chunks.append((kind, data[at + 8 : at + 8 + length]))
        at += 12 + length
    return chunks


def _check_unpacked(name: str, packed: bytes, most: int) -> None:
    try:
        unpacked = zlib.decompressobj().decompress(packed, most + 1)
    except zlib.error as error:
        raise ValueError(f"the file {name!r} is a damaged PNG: {error}") from error
    if len(unpacked) > most:
        raise ValueError(f"the file {name!r} unpacks to more than its size in pixels")
