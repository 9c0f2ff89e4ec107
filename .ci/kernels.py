"""Print kernels of OpenBLAS that this processor can run besides its own, the newest first, at most so many.

``OPENBLAS_CORETYPE=$kernel`` makes NumPy and SciPy compute like an older processor: their sums are rounded in another
order. What cannot be had here is told on standard error.
"""

import os
import subprocess
import sys
from pathlib import Path

NEEDS = {
    "SkylakeX": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "Haswell": {"avx2", "fma"},
    "Sandybridge": {"avx"},
    "Nehalem": {"sse4_2"},
}
"""Kernel → instructions, as /proc/cpuinfo names them."""

TWINS = {"Zen": "Haswell", "Cooperlake": "SkylakeX", "SapphireRapids": "SkylakeX"}
"""Kernel → the older one whose arithmetic it shares for the most part."""

ASK = """
import numpy, scipy.linalg, threadpoolctl
print(*{library["architecture"] for library in threadpoolctl.threadpool_info() if "architecture" in library})
"""


def _instructions() -> set[str]:
    """What the processor can run; nothing where the system does not tell."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return next((set(line.partition(":")[2].split()) for line in lines if line.startswith("flags")), set())


def _used(kernel: str | None) -> set[str]:
    """Kernels of all libraries in a process that is asked for one, or for none."""
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    if kernel is not None:
        environment["OPENBLAS_CORETYPE"] = kernel
    done = subprocess.run([sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def _other_kernels() -> list[str]:
    own, found = _used(None), []
    known = own | {TWINS[name] for name in own & set(TWINS)}
    instructions = _instructions()
    for kernel, needed in NEEDS.items():
        if kernel in known:
            continue
        if not needed <= instructions:
            print(f"kernel {kernel} is skipped: this processor does not have its instructions", file=sys.stderr)
        elif _used(kernel) != {kernel}:
            print(f"kernel {kernel} is skipped: NumPy or SciPy does not have it", file=sys.stderr)
        else:
            found.append(kernel)
    return found


if __name__ == "__main__":
    print(*_other_kernels()[: int(sys.argv[1])])
