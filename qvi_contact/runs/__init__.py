"""Long runs of sweeps and studies: work in processes with limits, on this machine or a cluster, and rows in files.

`processes` distributes work to processes of this machine or of a Dask cluster, `worker` is the program of such a
process, and `database` keeps rows in SQLite files.
"""

from solvers.basics.front import front

__getattr__ = front(__name__)
