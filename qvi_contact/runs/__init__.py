"""Long runs of sweeps and studies: work in processes with limits, on this machine or a cluster, and rows in files.

`processes` does work in processes of this machine or of a Dask cluster, `worker` is what such a process runs, and
`database` keeps rows in SQLite files.
"""

from solvers.basics.front import front

__getattr__ = front(__name__)
