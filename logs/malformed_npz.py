"""Exceptions for the bytes of an NPZ file that is malformed."""

import struct
import tokenize
import zipfile
import zlib

FAILURES: tuple[type[Exception], ...] = (
    ValueError,  # numpy's headers
    TypeError,
    KeyError,
    EOFError,
    RuntimeError,  # an encrypted file, or an unknown compression
    OverflowError,
    SyntaxError,
    tokenize.TokenError,  # numpy's headers are Python literals
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions of zipfile and numpy."""
