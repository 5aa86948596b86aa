"""Workers of a Dask cluster, by the address of its scheduler; needs the extra ``dask``."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from selfmodel.errors import InputError
from selfmodel.experiments.grid.workers import Workers

CONNECT_SECONDS = 30
"""Longest wait for the scheduler."""

AT_ONCE = 1000
"""Cells that are submitted at a time: more than a cluster has workers, some of which come later."""


@contextmanager
def dask(address: str) -> Iterator[Workers]:
    """Yields the workers of a running Dask cluster.

    Args:
        address: ``HOST:PORT`` of the scheduler.

    Raises:
        InputError: Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client, KilledWorker  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise InputError(
            "a Dask cluster needs the package distributed: pip install 'selfmodel[dask]'"
        ) from error
    # A lost scheduler is one sentence of the command, not the client's tracebacks.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(f"tcp://{address}", timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address}: start one with `dask scheduler`, and workers "
            f"with `dask worker`, or correct the address"
        ) from error
    with client:
        # A pure call of the same arguments would be answered with the error of the last one.
        executor = client.get_executor(pure=False)
        # Dask itself tries a cell on four workers (distributed.scheduler.allowed-failures).
        yield Workers(executor, AT_ONCE, exits=(KilledWorker,), attempts=2, last_alone=True)
