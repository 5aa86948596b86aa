"""Workers of a Dask cluster, by the address of its scheduler; needs the extra ``dask``."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from typing import Any

from selfmodel.errors import InputError
from selfmodel.experiments.grid.checks import refused_versions
from selfmodel.experiments.grid.workers import Workers
from selfmodel.logs import result_files

CONNECT_SECONDS = 30
"""Longest wait for the scheduler."""

AT_ONCE = 1000
"""Cells that are submitted at a time: more than a cluster has workers, some of which come later."""


@contextmanager
def dask(address: str) -> Iterator[Workers]:
    """Yields the workers of a running Dask cluster.

    The connection is encrypted by TLS where Dask's configuration requires encryption or has a
    certificate of the client.

    Args:
        address: ``HOST:PORT`` of the scheduler.

    Raises:
        InputError: Dask is not installed, its configuration of TLS is invalid, no scheduler
            answers, or a worker has other versions than the command, or none.
    """
    try:
        from distributed import Client, KilledWorker  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise InputError(
            "a Dask cluster needs the package distributed: pip install 'selfmodel[dask]'"
        ) from error
    # A lost scheduler is one sentence of the command, not the client's tracebacks.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    protocol = _protocol()
    try:
        client = Client(f"{protocol}://{address}", timeout=CONNECT_SECONDS)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address}: start one with `dask scheduler`, and workers "
            f"with `dask worker`, correct the address, or configure Dask here as the scheduler is, "
            f"by TLS or not: this was {protocol}"
        ) from error
    with client:
        check = partial(_check_versions, client)
        check()
        # A pure call of the same arguments would be answered with the error of the last one.
        executor = client.get_executor(pure=False)
        # Dask itself tries a cell on four workers (distributed.scheduler.allowed-failures).
        yield Workers(
            executor, AT_ONCE, exits=(KilledWorker,), attempts=2, last_alone=True, check=check
        )


def _protocol() -> str:
    """Returns the protocol that Dask's configuration asks for.

    Raises:
        InputError: It asks for TLS, and lacks a file or has an invalid one.
    """
    from distributed.security import Security  # noqa: PLC0415  # an extra

    expected = (
        "expected distributed.comm.tls.ca-file, tls.client.cert and tls.client.key in Dask's "
        "configuration, which asks for TLS"
    )
    try:
        security = Security()
        encrypted = security.get_connection_args("client")["ssl_context"] is not None
    except (OSError, ValueError) as error:
        raise InputError(f"{expected}, got {error}: correct them") from error
    given = security.get_tls_config_for_role("client")
    if not encrypted and (security.require_encryption or given["cert"]):
        got = f"ca-file {given['ca_file']}, cert {given['cert']}"
        raise InputError(
            f"{expected}, got {got}: add them, or remove distributed.comm.require-encryption and "
            f"tls.client.cert"
        )
    return "tls" if encrypted else "tcp"


def _check_versions(client: Any) -> None:  # noqa: ANN401  # of an extra
    """Checks the versions of all workers by a function that needs no selfmodel there.

    Raises:
        InputError: A worker has other versions than the command, or none.
    """
    versions = result_files.versions()
    found: dict[str, dict[str, str]] = {}
    for package in versions:
        try:
            answers = client.run(version, package, on_error="return")
        except OSError:  # the scheduler has ended, and so all calls
            return
        for worker, answer in answers.items():
            if isinstance(answer, str):
                found.setdefault(worker, {})[package] = answer
            elif isinstance(answer, ImportError):  # any other error is of a worker that ended
                found.setdefault(worker, {})[package] = "(not installed)"
    for worker, own in found.items():
        if any(versions[package] != there for package, there in own.items()):
            raise InputError(refused_versions(f"the Dask worker at {worker}", own, versions))
