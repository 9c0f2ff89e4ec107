"""Scheduler and workers of a Dask cluster for tests; apart, as they must load nothing of this package by themselves."""

import asyncio
import os
import sys
from multiprocessing import parent_process
from os import _exit as end_at_once
from pathlib import Path

QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.interval": "60s",
    "distributed.admin.tick.interval": "10s",
}
"""What Dask would measure of itself all the time."""


def scheduler(folder, environment, path, tells):
    """Be a scheduler, and tell its address."""
    from distributed import Scheduler

    _serve(Scheduler, folder, environment, path, tells.send, port=0)


def worker(folder, environment, path, address):
    """Be a worker of one thread."""
    from distributed import Worker

    _serve(Worker, folder, environment, path, lambda _: None, address, nthreads=1, local_directory=folder)


def _serve(kind, folder, environment, path, tell, *arguments, **options):
    """Packages are looked for in `path` first."""
    import dask

    sys.path.insert(0, path)
    os.environ.update(environment)
    with open(Path(folder) / "log", "ab") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)

    async def served():
        asyncio.get_running_loop().add_reader(parent_process().sentinel, end_at_once, 1)  # nothing outlives the tests
        async with kind(*arguments, host="127.0.0.1", dashboard=False, **options) as server:
            tell(server.address)
            await server.finished()

    with dask.config.set(QUIET):
        asyncio.run(served())
