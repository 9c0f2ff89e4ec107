"""A case solved by another Python than the project's, in which the project need not be installed.

    python comparisons/peers/foreign.py < order.json

Started by `measure`, not by hand. The code and `repeated` are found beside this file and import nothing of the project.
What libraries print goes to standard error; the answer is one line of JSON on standard output.
"""

import json
import os
import sys
from importlib import import_module


def main() -> None:
    """Do what is asked and answer."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    order = json.load(sys.stdin)
    code, repeated = import_module(order.pop("module")), import_module("repeated")
    answers.write(json.dumps(repeated.repeated(code, **order)) + "\n")
    answers.close()


if __name__ == "__main__":
    main()
