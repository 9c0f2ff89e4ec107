"""Parts of pages that are made by a command and committed, so that a reader of the repository sees them too.

Such a part stands between two comments, the first of which names the command. A test compares the two.
"""

from pathlib import Path

DOCS = Path(__file__).parents[1]
_BEGIN, _END = "<!-- made by python docs/_ext/{}.py -->", "<!-- end of what is made -->"


def made(page: Path, command: str) -> str:
    """What stands in the part of a page that a command makes.

    Raises
    ------
    ValueError
        If the page has no such part.

    """
    return _cut(page, command)[1].strip()


def make(page: Path, command: str, content: str) -> None:
    """Write the part of a page that a command makes.

    Raises
    ------
    ValueError
        If the page has no such part.

    """
    before, _, after = _cut(page, command)
    page.write_text(f"{before}\n\n{content.strip()}\n\n{after}", encoding="utf-8")


def _cut(page: Path, command: str) -> tuple[str, str, str]:
    """The page up to the first comment, the part, and the rest from the second comment on."""
    begin, text = _BEGIN.format(command), page.read_text(encoding="utf-8")
    before, found, rest = text.partition(begin)
    part, ended, after = rest.partition(_END)
    if not (found and ended):
        raise ValueError(f"{page.name} needs the lines {begin} and {_END}")
    return before + begin, part, _END + after
