"""The loaded pin of NAFEMS by displacement codes beside this package: same mesh, same law, numbers side by side."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "report": ("document_of",),
        "study": ("MODELS", "OWN", "pin_study", "plain_pin", "run"),
    },
)
