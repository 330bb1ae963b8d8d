"""Independent calls on a Dask cluster.

The only module that imports Dask. Calls are handed to Dask itself and not through
joblib, which waits for ever for a call that Dask has given up: one that ended every
worker that tried it.
"""

from collections.abc import Generator, Iterable
from ipaddress import ip_address
from itertools import islice
from typing import Any
from urllib.parse import urlsplit

from acquisition.errors import MissingLibraryError, SettingsError
from analysis.study.worker_processes import Call, WorkerLostError

_PATIENCE = 10.0  # s to reach a scheduler


def run_on_cluster(calls: Iterable[Call], address: str) -> Generator[Any]:
    """Yield what calls return, as soon as each is done.

    Args:
        calls: functions that workers can import by name, and their arguments.
        address: of the scheduler.

    Raises:
        SettingsError: the scheduler does not answer, or is reached without TLS.
        WorkerLostError: workers ended, one after the other, in the middle of a call.
        MissingLibraryError: Dask is not installed.
    """
    try:
        from distributed import KilledWorker, as_completed
    except ImportError as error:
        raise MissingLibraryError("distributed", "cluster") from error

    left = iter(calls)
    with _client(address) as client:

        def submitted(running: int) -> list[Any]:
            """Return calls that keep all workers busy, those that have come since."""
            ahead = 2 * max(1, sum(client.nthreads().values()))
            further = islice(left, max(0, ahead - running))
            return [client.submit(*call, pure=False) for call in further]

        running = as_completed(submitted(0), loop=client.loop, with_results=True)
        try:
            for _, result in running:
                running.update(submitted(running.count()))
                yield result
        except KilledWorker as error:
            raise WorkerLostError from error


def is_guarded(address: str) -> bool:
    """Return whether nobody can answer in the place of the scheduler at `address`.

    Dask carries pickled objects: who can write into the connection can execute
    anything here. It has to be authenticated by TLS, or stay on this machine.
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


def _client(address: str) -> Any:  # noqa: ANN401
    """Return a connection to the Dask scheduler at `address`."""
    from distributed import Client

    if not is_guarded(address):
        raise SettingsError(
            f"The Dask scheduler {address} is neither on this machine nor reached by "
            "TLS.",
            hint="What comes back from it is executed here. Name tls://HOST:PORT with "
            "certificates in Dask's configuration, or leave --scheduler out.",
        )
    try:
        return Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SettingsError(
            f"No Dask scheduler answers at {address} within {_PATIENCE:.0f} s.",
            hint="Start one with `dask scheduler` and workers with `dask worker`, or "
            "leave --scheduler out.",
        ) from error
