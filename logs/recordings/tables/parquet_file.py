"""Reader of Parquet files, with pyarrow."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from selfmodel.errors import InputError
from selfmodel.logs.recordings.tables.content import (
    NO_TIME,
    Content,
    Numbers,
    Request,
    as_numbers,
    reason_of,
)


def read_parquet(request: Request) -> Content:
    """Returns the wanted columns of a Parquet file; a missing value is NaN.

    Columns of lists, texts and other types than numbers, booleans and times are left out.

    Raises:
        InputError: The file is no Parquet file.
        OSError: The file cannot be read.
    """
    try:
        with pa.OSFile(str(request.path)) as data:
            return _content(request, data)
    except (pa.ArrowException, ValueError, OSError) as failure:
        if isinstance(failure, InputError):
            raise
        raise InputError(
            f"{request.path}: expected a Parquet file, got: {reason_of(failure)}: write it again, "
            f"for example with DataFrame.to_parquet"
        ) from failure


def _content(request: Request, data: pa.OSFile) -> Content:
    # The memory of other allocators is reserved in large blocks, which exceed the limit.
    file = pq.ParquetFile(data, memory_map=False, pre_buffer=False, page_checksum_verification=True)
    names = [field.name for field in file.schema_arrow if _is_numeric(field.type)]
    request.check_names(names)
    wanted = [name for name in names if name in request.wanted]
    table = file.read(columns=wanted, use_threads=False)
    return Content(
        names, {name: _numbers(table[name], exact=name == request.exact) for name in wanted}
    )


def _is_numeric(kind: pa.DataType) -> bool:
    types = pa.types
    checks = (types.is_integer, types.is_floating, types.is_boolean)
    times = (types.is_timestamp, types.is_duration)
    return any(check(kind) for check in (*checks, *times))


def _numbers(column: pa.ChunkedArray, *, exact: bool) -> Numbers:
    if pa.types.is_timestamp(column.type):
        column = _integers(column.cast(pa.timestamp("ns", column.type.tz)), exact=exact)
    elif pa.types.is_duration(column.type):
        column = _integers(column.cast(pa.duration("ns")), exact=exact)
    elif pa.types.is_boolean(column.type):
        column = column.cast(pa.int8())
    return as_numbers(np.asarray(column.to_numpy()), exact=exact)


def _integers(times: pa.ChunkedArray, *, exact: bool) -> pa.ChunkedArray:
    """Times in ns as integers; a missing one remains null, or is ``NO_TIME``."""
    whole = times.cast(pa.int64())
    return whole.fill_null(NO_TIME) if exact else whole


pa.set_memory_pool(pa.system_memory_pool())
