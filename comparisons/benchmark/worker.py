"""A process that measures: a task as JSON on standard input, records as lines of JSON on standard output.

    python -m comparisons.benchmark.worker

Started by `process`, not by hand. What libraries print goes to standard error.
"""

import json
import os
import sys
from typing import Any

from comparisons.benchmark.measure import TASKS


def main() -> None:
    """Do the task; each record is written as soon as it is known."""
    channel = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def emit(**record: Any) -> None:
        channel.write(json.dumps(record) + "\n")
        channel.flush()

    task = json.load(sys.stdin)
    TASKS[task.pop("task")](emit, **task)
    emit(kind="done")


if __name__ == "__main__":
    main()
