"""Rows of results, or columns of numbers, as a pandas data frame; pandas is optional."""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError


def data_frame(
    content: Sequence[Mapping[str, Any]] | Mapping[str, FloatArray],
) -> Any:  # noqa: ANN401  # pandas is optional
    """Returns a ``pandas.DataFrame`` of rows, with one column per key, or of columns by name.

    Raises:
        InputError: pandas is not installed.
    """
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise InputError(
            "to_pandas() needs pandas, which is not installed: pip install 'selfmodel[tables]'"
        ) from error
    return pandas.DataFrame(content)
