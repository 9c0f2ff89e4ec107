"""Documents in and out: problem files, archives of results, VTU."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "archive": ("FORMAT_VERSION", "OWN", "Archive", "digest", "json_ready", "load_result", "write_archive"),
        "export": ("element_of", "summary", "write_collapse_vtu", "write_contacts_vtu", "write_npz", "write_vtu"),
        "keys": ("file_keys", "listed"),
        "problem_file": ("ELEMENT_OPTIONS", "FileReader", "problem_from_toml"),
        "problem_writer": ("problem_to_toml",),
    },
)
