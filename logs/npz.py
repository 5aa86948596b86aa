"""Exceptions of malformed NPZ files, which are archives of numpy arrays."""

import struct
import tokenize
import zipfile
import zlib

NPZ_FAILURES = (
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
"""Exceptions of zipfile and numpy for malformed bytes."""
