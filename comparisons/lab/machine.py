"""What a run was measured on, without names of hosts, users or folders."""

import os
import platform
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

PACKAGES: Final = (
    "qvi-contact",
    "numpy",
    "scipy",
    "mkl",
    "cvxopt",
    "cvxpy",
    "clarabel",
    "qpsolvers",
    "scikit-fem",
    "threadpoolctl",
)


def machine() -> dict[str, Any]:
    """Processor, cores this process may use, memory [bytes], system, Python."""
    return {
        "processor": _processor(),
        "cores": _cores(),
        "memory_bytes": _memory(),
        "system": _system(),
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }


def versions(packages: Sequence[str] = PACKAGES) -> dict[str, str | None]:
    """Package → version, None of those that are not installed; by default what may matter for a time."""
    from importlib.metadata import PackageNotFoundError, version  # as long to load as all else of a worker process

    found: dict[str, str | None] = dict.fromkeys(packages)
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def load_average() -> float | None:
    """Processes that wanted to run in the last minute."""
    with suppress(AttributeError, OSError):
        return round(os.getloadavg()[0], 2)
    return None


def _processor() -> str:
    """Name of the processor's model."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _memory() -> int | None:
    with suppress(AttributeError, ValueError, OSError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return None


def _system() -> str:
    """Distribution or system, and the architecture."""
    name = f"{platform.system()} {platform.release()}"
    with suppress(OSError):
        name = platform.freedesktop_os_release().get("PRETTY_NAME", name)
    return f"{name}, {platform.machine()}"
