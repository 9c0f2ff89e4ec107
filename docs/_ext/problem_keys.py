"""The tables of keys of a problem file, made from the schema: ``python docs/_ext/problem_keys.py`` writes the page."""

from made import DOCS, make

from qvi_contact.files.problem_text import HEADINGS, keys

PAGE = DOCS / "problem_files.md"


def tables() -> str:
    """The Markdown of all tables."""
    found = []
    for heading, table in HEADINGS.items():
        rows = ["| key | default | meaning | example |", "|---|---|---|---|"]
        for key in keys(table):
            default = f"`{key.default}`" if key.default not in ("", "needed") else key.default
            rows.append(f"| `{key.name}` | {default} | {key.meaning} | `{key.example}` |")
        found.append("\n".join([f"### {heading}", "", *rows]))
    return "\n\n".join(found)


if __name__ == "__main__":
    make(PAGE, "problem_keys", tables())
