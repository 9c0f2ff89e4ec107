"""The gallery: problem files of `examples`, checked, solved and drawn by the command line, beside what is known.

``python docs/_ext/gallery.py`` writes a section for each file, and the pictures into ``docs/gallery``; with names, such
as ``punch bracket``, it renews these sections only. Everything shown comes from the file and from what the programs
printed and drew.
"""

import os
import re
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from made import DOCS, made, make

EXAMPLES = DOCS.parent / "examples"
PAGE, PICTURES = DOCS / "gallery.md", DOCS / "gallery"
_SECONDS = 90.0  # after which a command is given up, and the page says so
_AT_ONCE = 2
_WIDTH = 1000  # of a picture at most, in pixels
_COLOURS = 256  # in a picture, which makes its file small; with fewer, rare blue lines became green


@dataclass(frozen=True)
class Shown:
    """What is shown of a problem file: title, words, commands in it, output and exit status, pictures drawn.

    `known` is a table in Markdown of what is known of it, beside what was computed.
    """

    name: str
    title: str
    words: tuple[str, ...]
    command: str
    output: str
    status: int | None
    pictures: tuple[Path, ...]
    known: str


def comments(text: str) -> tuple[str, list[str]]:
    """Paragraphs of the comment at the top of a problem file, and the commands among them."""
    top = text.split("\n\n")[0].splitlines()
    lines = [line.removeprefix("#").removeprefix(" ") for line in top if line.startswith("#")]
    paragraphs = "\n".join(line for line in lines if not line.startswith("    ")).split("\n\n")
    commands = [line.split("  #")[0].strip() for line in lines if line.startswith("    ")]
    return "\n\n".join(part.strip() for part in paragraphs if part.strip()), commands


def shown(path: Path, folder: Path) -> Shown:
    """Check, solve and draw a problem file, pictures into the folder."""
    problem, answer = folder / f"{path.stem}_problem.png", folder / f"{path.stem}.png"
    _run(path, "-m", "qvi_contact", "check", str(path), "--plot", str(problem))
    status, output = _run(path, "-m", "qvi_contact", "solve", str(path), "--plot", str(answer))
    pictures = tuple(picture for picture in (problem, answer) if picture.exists())
    for picture in pictures:
        _made_small(picture)
    return example_of(path, output, status, pictures, known_table(path.stem))


def example_of(path: Path, output: str, status: int | None, pictures: tuple[Path, ...], known: str) -> Shown:
    """What a problem file says of itself, with what the programs said and drew."""
    text = path.read_text(encoding="utf-8")
    words, commands = comments(text)
    title, command = tomllib.loads(text)["title"], f"qvi-contact solve examples/{path.name}"
    return Shown(path.stem, title, (words, *commands), command, output, status, pictures, known)


def known_table(name: str) -> str:
    """What `comparisons.verification.known` has of a problem file, beside what it computes, in Markdown."""
    from comparisons.verification.known import KNOWN, Answer

    answer = Answer(name, KNOWN[name].degree)
    lines = ["| quantity | computed | known | tolerance | source |", "|---|---|---|---|---|"]
    for line in KNOWN[name].lines:
        row = line.row(answer)
        if not row.passed:
            raise RuntimeError(f"{name}: {row.quantity} is {row.ours}, not {row.reference}")
        ours, reference = (value if isinstance(value, str) else f"{value:.7g}" for value in (row.ours, row.reference))
        if reference == "0" and abs(row.ours) <= row.tolerance:
            ours = "0"  # rounding is no number to read
        sign = {"excess": "at most ", "shortfall": "at least "}.get(row.measure, "")
        cells = (row.quantity, ours, sign + reference, f"{row.tolerance:g}", row.source)
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines)


def _made_small(path: Path) -> None:
    """Make a picture one that a page can have many of."""
    from PIL import Image

    with Image.open(path) as picture:
        width = min(_WIDTH, picture.width)
        height = round(picture.height * width / picture.width)
        small = picture.convert("RGB").resize((width, height), Image.Resampling.LANCZOS)
    small.quantize(_COLOURS, kmeans=1).save(path, optimize=True)


def _run(path: Path, *words: str) -> tuple[int | None, str]:
    """Exit status and output of Python with these words, for a file; no status if it took too long.

    Lines of progress and errors, on the other stream, are not shown.
    """
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    environment = {**os.environ, **threads, "PYTHONIOENCODING": "utf-8"}
    try:
        done = subprocess.run(
            [sys.executable, *words], capture_output=True, timeout=_SECONDS, env=environment, check=False
        )
    except subprocess.TimeoutExpired:
        return None, f"given up after {_SECONDS:.0f} s"
    errors = done.stderr.decode()
    if done.returncode == 2 or "Traceback" in errors:
        raise RuntimeError(f"{path.name}: {errors}")
    return done.returncode, done.stdout.decode().rstrip()


def section(example: Shown, folder: str) -> str:
    """The Markdown of a problem file's section, pictures in the folder as seen from the page."""
    words, *commands = example.words
    alternatives = ("mesh, conditions and loads", "the result")
    pictures = [
        f"![{example.title}: {what}]({folder}/{picture.name})"
        for picture, what in zip(example.pictures, alternatives, strict=False)
    ]
    ended = "was given up" if example.status is None else f"ends with exit status {example.status}"
    return "\n\n".join([
        f"## {example.title}", words.replace("<", "\\<").replace("_", "\\_"), *pictures,
        "```console\n" + "\n".join(f"$ {command}" for command in commands or [example.command]) + "\n```",
        f"`{example.command}` {ended} and prints", f"```text\n{example.output}\n```",
        "Beside what is known without this program:", example.known,
        f"The file: [examples/{example.name}.toml](../examples/{example.name}.toml)",
    ])  # fmt: skip


def sections(markdown: str) -> dict[str, str]:
    """Name of the problem file → its section, of those in a page."""
    found = [part.strip() for part in re.split(r"^(?=## )", markdown, flags=re.M) if part.strip()]
    return {re.findall(r"\[examples/(\w+)\.toml\]", part)[-1]: part for part in found}


def main(names: list[str]) -> None:
    """Renew the sections of these problem files, of all without names."""
    files = sorted(EXAMPLES.glob("*.toml"))
    unknown = set(names) - {path.stem for path in files}
    if unknown:
        raise SystemExit(f"not in {EXAMPLES.name}: {', '.join(sorted(unknown))}")
    PICTURES.mkdir(exist_ok=True)
    known = sections(made(PAGE, "gallery"))
    wanted = [path for path in files if not names or path.stem in names]
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        for example in pool.map(lambda path: shown(path, PICTURES), wanted):
            known[example.name] = section(example, PICTURES.name)
            make(PAGE, "gallery", "\n\n".join(known[path.stem] for path in files if path.stem in known))


if __name__ == "__main__":
    main(sys.argv[1:])
