"""Documents in and out: problem files, archives of results, VTU."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "archive": (
            "FORMAT_VERSION",
            "OWN",
            "Archive",
            "answer_from_archive",
            "digest",
            "load_result",
            "write_archive",
        ),
        "export": ("field_arrays", "summary", "write_json", "write_npz"),
        "options": ("RefineOptions", "SolveOptions"),
        "problem_file": ("ELEMENT_OPTIONS", "FileReader", "load_problem", "problem_from_toml"),
        "problem_writer": ("problem_to_toml",),
        "vtu": ("write_companion_vtu", "write_contacts_vtu", "write_vtu"),
    },
)
