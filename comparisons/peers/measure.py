"""What a worker process does: one case, by one code, in this Python or another one."""

import json
import os
import subprocess
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from comparisons.peers.repeated import repeated

TASK: Final = f"{__name__}:run"
"""As `comparisons.study` names it."""

_FOREIGN: Final = Path(__file__).with_name("foreign.py")
_LAST_WORDS: Final = 200


class ForeignError(RuntimeError):
    """The other Python ended without an answer."""


def run(order: dict[str, Any]) -> dict[str, Any]:
    """Solve a case, see `repeated`.

    Parameters
    ----------
    order : dict
        "module": a module beside this one; "interpreter": the Python to take, None for this one; the other arguments
        of `repeated`.

    Raises
    ------
    ForeignError
        If the other Python fails; the message has its last words.

    """
    interpreter, module = order.pop("interpreter"), order.pop("module")
    if interpreter is None:
        return repeated(import_module(f"comparisons.peers.{module}"), **order)
    return _foreign(interpreter, {"module": module, **order})


def _foreign(interpreter: str, order: dict[str, Any]) -> dict[str, Any]:
    """The same in another Python, which must not find the packages of this one."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command, task = [interpreter, str(_FOREIGN)], json.dumps(order).encode()
    done = subprocess.run(command, input=task, capture_output=True, env=environment, check=False)
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        raise ForeignError(f"{Path(interpreter).name} ended with status {done.returncode}: {words[-1][-_LAST_WORDS:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer
