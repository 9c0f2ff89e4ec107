"""The command `qvi-contact`: options, reports, outlines of problems."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "cli": ("group",),
        "page": ("Request", "number", "result_page", "result_tables"),
        "report": ("history_lines", "result_lines", "series_tables"),
        "progress_line": ("solving",),
    },
)
