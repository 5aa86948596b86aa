"""Rows of results as a pandas data frame; pandas is optional."""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any

from selfmodel.errors import InputError


def data_frame(rows: Sequence[Mapping[str, Any]]) -> Any:  # noqa: ANN401  # pandas is optional
    """Returns rows as a ``pandas.DataFrame``, with one column per key.

    Raises:
        InputError: pandas is not installed.
    """
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise InputError(
            "to_pandas() needs pandas, which is not installed: pip install pandas, or use to_dict()"
        ) from error
    return pandas.DataFrame(list(rows))
