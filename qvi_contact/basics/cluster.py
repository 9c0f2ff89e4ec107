"""The client of a Dask cluster, by the address of its scheduler."""

import logging
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from typing import TYPE_CHECKING, Final

from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

_CONNECTING: Final = 10.0  # seconds
_JOINING: Final = 10.0  # seconds until a cluster has a worker
_WITHOUT_PORT: Final = ("inproc", "ucx")  # schemes whose addresses `distributed` itself does not take apart
_REMEDY: Final = "give the address that dask scheduler prints, as tcp://host:8786"


@contextmanager
def connected(address: str) -> Iterator["Client"]:
    """A client of the cluster of this scheduler, closed in the end. The address has passed `check`.

    What Dask would log on standard error is told by exceptions.

    Raises
    ------
    InputError
        If the cluster cannot be reached, or has no workers.

    """
    with _quiet(), closing(_client(address)) as client:
        yield client


def check(address: str) -> None:
    """Refuse an address that cannot be a scheduler's, as `distributed` reads it, before anything is done.

    Raises
    ------
    InputError
        If `distributed` is missing, or the address is not scheme://host:port with a scheme it knows.

    """
    if not isinstance(address, str):
        raise InputError("dask", address, _REMEDY)
    _check_installed(address)
    from distributed.comm.addressing import get_address_host_port, parse_address
    from distributed.comm.registry import get_backend

    try:
        scheme, _ = parse_address(address, strict=True)
        get_backend(scheme)
        if scheme not in _WITHOUT_PORT:
            get_address_host_port(address, strict=True)
    except (ValueError, ImportError) as error:
        raise InputError("dask", address, f"is not scheme://host:port with a known scheme: {_REMEDY}") from error


def _check_installed(address: str) -> None:
    try:
        import distributed  # noqa: F401 - logging is set up when it is loaded
    except ImportError as error:
        remedy = "needs the package distributed: python -m pip install distributed"
        raise InputError("dask", address, remedy) from error


@contextmanager
def _quiet() -> Iterator[None]:
    """What Dask's client would log on standard error is told by an exception.

    Its event loop would log a fault of its own besides where an interrupt finds the client about to wait.
    """
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client", "tornado.application")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


async def _greet(address: str) -> None:
    """Exchange the first words with whoever listens there; Dask's client alone would wait for them without end."""
    from asyncio import timeout

    from distributed import Security
    from distributed.comm import connect

    security = Security().get_connection_args("client")
    async with timeout(_CONNECTING):
        comm = await connect(address, timeout=_CONNECTING, **security)
    await comm.close()


def _client(address: str) -> "Client":
    from asyncio import run  # which worker processes need not load

    try:
        run(_greet(address))
        client = _quiet_client()(address, timeout=_CONNECTING, set_as_default=False)
    except Exception as error:  # of many kinds, for whatever answers there
        raise InputError("dask", address, f"no scheduler answers there: {_REMEDY}") from error
    try:
        client.wait_for_workers(1, timeout=_JOINING)
    except Exception as error:
        client.close()
        raise InputError("dask", address, "the cluster has no workers: start some") from error
    return client


def _quiet_client() -> "type[Client]":
    """Dask's client; one that was only half built, for want of a scheduler, cannot always be closed, and goes so."""
    from distributed import Client

    class QuietClient(Client):  # type: ignore[misc]
        def __del__(self) -> None:
            with suppress(Exception):
                super().__del__()

    return QuietClient
