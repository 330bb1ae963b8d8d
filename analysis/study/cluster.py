"""Execution of independent calls on a Dask cluster.

The only module that imports Dask. Calls go to Dask directly and not through joblib,
which waits forever for a call that Dask has abandoned because it killed every worker
that ran it.
"""

from collections.abc import Generator, Iterable
from ipaddress import ip_address
from itertools import islice
from typing import Any
from urllib.parse import urlsplit

from acquisition.errors import SettingsError
from acquisition.extras import import_refusal
from analysis.study.worker_processes import Call, WorkerLostError

_PATIENCE = 10.0  # s, timeout for reaching a scheduler


def run_on_cluster(calls: Iterable[Call], address: str) -> Generator[Any]:
    """Yield the results of calls as they complete.

    Args:
        calls: functions that workers can import by name, and their arguments.
        address: address of the scheduler.

    Raises:
        SettingsError: the scheduler does not answer, or is reached without TLS.
        WorkerLostError: workers ended one after the other during the same call.
        MissingLibraryError: Dask is not installed.
    """
    try:
        from distributed import KilledWorker, as_completed
    except ImportError as error:
        raise import_refusal(error, "distributed", "cluster") from error

    pending = iter(calls)
    with _client(address) as client:

        def submitted(running: int) -> list[Any]:
            """Submit enough calls to keep all workers busy, including new workers."""
            ahead = 2 * max(1, sum(client.nthreads().values()))
            batch = islice(pending, max(0, ahead - running))
            return [client.submit(*call, pure=False) for call in batch]

        running = as_completed(submitted(0), loop=client.loop, with_results=True)
        try:
            for _, result in running:
                running.update(submitted(running.count()))
                yield result
        except KilledWorker as error:
            raise WorkerLostError from error


def is_guarded(address: str) -> bool:
    """Return whether the scheduler at `address` cannot be impersonated.

    Dask transfers pickled objects: whoever can write to the connection can execute code
    here. The connection must be authenticated by TLS or stay on this machine.
    """
    scheme, _, netloc = address.rpartition("://")
    if scheme not in {"", "tcp", "tls"}:
        return False
    try:
        host = urlsplit(f"//{netloc}").hostname or ""
        is_loopback = host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        is_loopback = False
    return scheme == "tls" or is_loopback


def require_guarded(address: str) -> None:
    """Refuse a scheduler that strangers could write to.

    Raises:
        SettingsError: it is neither on this machine nor reached by TLS.
    """
    if not is_guarded(address):
        raise SettingsError(
            f"The Dask scheduler {address} is neither on this machine nor reached by "
            "TLS.",
            hint="Its replies can execute code here. Name tls://HOST:PORT with "
            "certificates in Dask's configuration, or leave --scheduler out.",
        )


def _client(address: str) -> Any:  # noqa: ANN401
    """Connect to the Dask scheduler at `address`."""
    from distributed import Client

    require_guarded(address)
    try:
        return Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SettingsError(
            f"No Dask scheduler answers at {address} within {_PATIENCE:.0f} s.",
            hint="Start one with `dask scheduler` and workers with `dask worker`, or "
            "leave --scheduler out.",
        ) from error
