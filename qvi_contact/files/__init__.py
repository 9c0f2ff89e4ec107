"""Documents in and out: problem files, archives of results, VTU."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "archive": ("Archive", "FORMAT_VERSION", "OWN", "digest", "write_archive"),
        "export": ("field_arrays", "summary", "write_json", "write_npz"),
        "options": ("RefineOptions", "SolveOptions"),
        "problem_file": ("ELEMENT_OPTIONS", "FileReader", "load_problem", "problem_from_toml"),
        "problem_writer": ("problem_to_toml",),
        "stored": ("answer_from_archive", "load_result"),
        "vtu": ("write_companion_vtu", "write_contacts_vtu", "write_vtu"),
    },
)
