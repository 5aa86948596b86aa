"""Export of a trial as a table: a CSV, NPZ or Parquet file, which ``logs import`` reads again."""

import csv
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import IO

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.logs.files import create_file
from selfmodel.trials.behaviour import Behaviour, columns_of

Columns = Mapping[str, FloatArray]


def export(path: Path, behaviour: Behaviour) -> tuple[str, ...]:
    """Writes the observed signals of a trial as a table.

    Args:
        path: Name of the file, which must not exist, with a suffix of ``WRITERS``.
        behaviour: Behaviour of the trial.

    Returns:
        Names of the columns.

    Raises:
        InputError: The file exists, has another suffix, or needs a package that is missing.
        LogWriteError: The disk is full, or failed.
    """
    write = writer_of(path)
    columns = columns_of(behaviour)
    with create_file(path) as file:
        write(file, columns)
    return tuple(columns)


def writer_of(path: Path) -> Callable[[IO[bytes], Columns], None]:
    """Returns the writer of a table's format, by the suffix of its file.

    Raises:
        InputError: The suffix is unknown, or the format needs a package that is missing.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise InputError(
            f"{path}: expected a file that ends in {', '.join(WRITERS)}, got {suffix or 'no end'}"
        )
    if suffix == ".parquet":
        try:
            import pyarrow.parquet  # noqa: F401, PLC0415  # an extra
        except ImportError:
            raise InputError(
                f"{path}: a Parquet file needs pyarrow: pip install 'selfmodel[tables]'"
            ) from None
    return WRITERS[suffix]


def _write_csv(file: IO[bytes], columns: Columns) -> None:
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    rows = csv.writer(text)
    rows.writerow(columns)
    # The shortest text of each number that is read as the same number.
    lists = [values.tolist() for values in columns.values()]
    rows.writerows(
        ["" if number != number else repr(number) for number in row]  # noqa: PLR0124  # NaN
        for row in zip(*lists, strict=True)
    )
    text.flush()
    text.detach()


def _write_npz(file: IO[bytes], columns: Columns) -> None:
    np.savez_compressed(file, allow_pickle=False, **columns)


def _write_parquet(file: IO[bytes], columns: Columns) -> None:
    import pyarrow as pa  # noqa: PLC0415  # an extra
    import pyarrow.parquet as pq  # noqa: PLC0415

    table = pa.table({name: np.array(values) for name, values in columns.items()})
    pq.write_table(table, file, write_page_checksum=True)


WRITERS: Mapping[str, Callable[[IO[bytes], Columns], None]] = MappingProxyType(
    {".csv": _write_csv, ".npz": _write_npz, ".parquet": _write_parquet}
)
"""Writers by the suffix of a file."""
