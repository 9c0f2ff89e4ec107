"""How far a run is: a bar on standard error with rate and time left, silent when that is not a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from qvi_contact.basics.terminal import Advance, error_console

if TYPE_CHECKING:
    from rich.progress import ProgressColumn

_WINDOW = 3600.0  # seconds that the rate is taken over; cases may be long


@contextmanager
def progress(title: str, total: int, finished: int = 0, *, shown: bool = True) -> Iterator[Advance]:
    """A progress bar that begins with what an earlier run has finished, which does not count for the rate."""
    console = error_console()
    if not (shown and console.is_terminal):  # before release 14.3 of rich even a disabled bar writes an empty line
        yield lambda *_: None
        return
    from rich import progress as rich

    columns = (
        rich.TextColumn("{task.description}"), rich.BarColumn(), rich.MofNCompleteColumn(), _rate_column(),
        rich.TimeElapsedColumn(), rich.TextColumn("left"), rich.TimeRemainingColumn(),
    )  # fmt: skip
    with rich.Progress(*columns, console=console, transient=True, speed_estimate_period=_WINDOW) as bar:
        task = bar.add_task(title, total=total, completed=finished)

        def advance(description: str = "") -> None:
            bar.update(task, advance=1, description=f"{title}: {description}" if description else title)

        yield advance


def _rate_column() -> "ProgressColumn":
    from rich.progress import ProgressColumn, Task
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(rate(task.speed))

    return Rate()


def rate(speed: float | None) -> str:
    """Rows per second in the unit that reads best."""
    if not speed:
        return ""
    unit, factor = next((pair for pair in (("s", 1), ("min", 60)) if speed * pair[1] >= 1.0), ("h", 3600))
    return f"{speed * factor:.3g}/{unit}"
