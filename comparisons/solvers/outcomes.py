"""What an answer was worth: what the solver said of it, beside what the certificate says.

| outcome       | said              | problem with a solution               | problem without          |
|---------------|-------------------|---------------------------------------|--------------------------|
| right         | solved            | certificate passes                    | -                        |
| right         | infeasible        | -                                     | always                   |
| untrue        | solved            | certificate fails                     | always                   |
| false alarm   | infeasible        | always                                | -                        |
| modest        | anything else     | certificate passes                    | -                        |
| gave up       | anything else     | certificate fails                     | always                   |

"Untrue" is a lie told in good faith: the solver's own test passed. Unbounded counts as infeasible where there is a
solution, and as giving up where there is none.
"""

from typing import Final

from solvers.basics.status import Status

RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP = "right", "untrue", "false alarm", "modest", "gave up"

NO_ANSWER: Final = "no answer"
"""Of a run that ended without a result: out of time or memory, or the process died."""


def outcome(said: Status, passed: bool, feasible: bool) -> str:
    """The outcome of an answer, see the module."""
    if said is Status.SOLVED:
        return RIGHT if passed and feasible else UNTRUE
    if said is Status.INFEASIBLE and not feasible:
        return RIGHT
    if said in (Status.INFEASIBLE, Status.UNBOUNDED) and feasible:
        return FALSE_ALARM
    return MODEST if passed and feasible else GAVE_UP
