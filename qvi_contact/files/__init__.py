"""Documents in and out: problem files, archives of results, VTU."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "archive": ("FORMAT_VERSION", "OWN", "Archive", "digest", "load_result", "write_archive"),
        "export": ("summary", "write_npz"),
        "keys": ("file_keys",),
        "problem_file": ("ELEMENT_OPTIONS", "FileReader", "problem_from_toml"),
        "problem_writer": ("problem_to_toml",),
    },
)
