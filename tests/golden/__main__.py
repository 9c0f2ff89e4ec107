"""Compare the golden numbers, or write them anew; see the package."""

import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.golden.problems import PROBLEMS, Numbers

STORE: Final = Path(__file__).with_name("numbers.json")
KERNELS: Final = ("Haswell", "Sandybridge", "Nehalem")
LEAST: Final = 1e-9  # least tolerance of a number, over the largest number of its kind
SPREADS: Final = 30.0
ITERATIONS: Final = 2


def main(words: list[str]) -> int:
    """Compare or write; 1 if a number is off."""
    if words[:1] == ["--compute"]:
        print(json.dumps(computed(float(words[1]), words[2:])))
        return 0
    if words[:1] == ["--write"]:
        write(words[1:])
        return 0
    stored, names = json.loads(STORE.read_text(encoding="utf-8")), chosen(words)
    differences = [line for name in names for line in compare(name, stored.get(name), PROBLEMS[name](1.0))]
    print(*(differences or [f"all golden numbers of {len(names)} problems as they were"]), sep="\n")
    return bool(differences)


def chosen(words: list[str]) -> list[str]:
    """Problems whose names contain one of the words; all without words. A word that is in no name ends the command."""
    for word in words:
        if not any(word in name for name in PROBLEMS):
            sys.exit(f"no problem has {word!r} in its name; there are: {', '.join(PROBLEMS)}")
    return [name for name in PROBLEMS if not words or any(word in name for word in words)]


def computed(share: float, words: list[str]) -> dict[str, Numbers]:
    """All numbers with this share of the solver's tolerance."""
    return {name: PROBLEMS[name](share) for name in chosen(words)}


def compare(name: str, stored: dict[str, Any] | None, now: Numbers) -> Iterable[str]:
    """One line for every number that differs: problem, quantity, old, new, tolerance."""
    if stored is None:
        yield f"{name}: no golden numbers; run python -m tests.golden --write {name!r}"
        return
    quantities = {(kind, quantity) for numbers in (stored, now) for kind in numbers for quantity in numbers[kind]}
    for kind, quantity in sorted(quantities):
        where = f"{name}, {kind} {quantity}".strip()
        old, new = stored.get(kind, {}).get(quantity), now.get(kind, {}).get(quantity)
        if old is None or new is None:
            yield f"{where}: was {old}, is {new}"
        elif kind == "status":
            if old != new:
                yield f"{where}: was {old}, is {new}"
        elif kind == "iterations":
            if not old[0] - ITERATIONS <= new <= old[1] + ITERATIONS:
                yield f"{where}: were {old[0]} to {old[1]}, are {new}"
        elif not (abs(new - old[0]) <= old[1] or new == old[0]):
            yield f"{where}: was {old[0]!r}, is {new!r}, may move by {old[1]:.0e}"


def write(words: list[str]) -> None:
    """Run with three kernels and with a tenth of the tolerance, and keep numbers with their accuracy."""
    runs = [_run(kernel, 1.0, words) for kernel in KERNELS] + [_run(KERNELS[0], 0.1, words)]
    stored = json.loads(STORE.read_text(encoding="utf-8")) if words and STORE.exists() else {}
    stored |= {name: _with_accuracy([run[name] for run in runs]) for name in chosen(words)}
    lines = (f" {json.dumps(name)}: {json.dumps(stored[name], ensure_ascii=False)}" for name in PROBLEMS)
    STORE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _run(kernel: str, share: float, words: list[str]) -> dict[str, Numbers]:
    command = [sys.executable, "-m", "tests.golden", "--compute", str(share), *words]
    environment = os.environ | {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def _with_accuracy(runs: list[Numbers]) -> dict[str, Any]:
    """The first run's numbers as [number, distance that it may move], iterations as [fewest, most].

    Rounding decides in which iteration a point that neither presses nor slides is found at rest, so kernels differ.
    """
    kept: dict[str, Any] = {}
    for kind, numbers in runs[0].items():
        if kind == "status":
            kept[kind] = numbers
            continue
        if kind == "iterations":
            kept[kind] = {name: _range([run[kind][name] for run in runs]) for name in numbers}
            continue
        values = {name: np.array([run[kind][name] for run in runs], dtype=float) for name in numbers}
        largest = _largest(numbers)
        if kind == "length":  # gaps and slips may all be noise: beside the displacement that the loads do work on
            largest = max(largest, _largest(runs[0]["energy"]) / _largest(runs[0]["force"]))
        kept[kind] = {name: [numbers[name], _within(value, largest)] for name, value in values.items()}
    return kept


def _range(counts: list[int]) -> list[int]:
    return [min(counts), max(counts)]


def _largest(numbers: dict[str, Any]) -> float:
    return max([abs(value) for value in numbers.values() if np.isfinite(value)], default=1.0)


def _within(values: np.ndarray, largest: float) -> float:
    spread = np.ptp(values) if np.isfinite(values).all() else 0.0
    return float(f"{max(SPREADS * spread, LEAST * largest):.1g}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
