"""The command `qvi-contact`: options, reports, outlines of problems."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "cli": ("group",),
        "page.numbers": ("contact_rows", "resultant_rows", "step_tables"),
        "page.page": ("Request", "result_page"),
        "report": ("history_lines", "result_lines"),
        "progress_line": ("solving",),
    },
)
