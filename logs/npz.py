"""Reading of NPZ files, which are archives of numpy arrays, from untrusted bytes."""

import io
import struct
import tokenize
import zipfile
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


def read_array(data: bytes) -> NDArray[Any]:
    """Returns the array of an ``.npy`` file, of version 1.0 and without objects.

    The header is checked against the size before memory is allocated.

    Raises:
        ValueError: The bytes are no such file; other malformed bytes raise ``NPZ_FAILURES``.
    """
    file = io.BytesIO(data)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("it has arrays of another version than 1.0")
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    count = 1
    for length in shape:
        count *= length
    if dtype.hasobject or dtype.itemsize * count != len(data) - file.tell():
        raise ValueError(f"an array of shape {shape} and type {dtype} does not fit its size")
    file.seek(0)
    array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    return array
