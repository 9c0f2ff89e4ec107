"""The gallery: problem files of `examples`, checked, solved and drawn by the command line, and scripts beside them.

Made when the site is built. The page holds a line ``% gallery``, which is replaced by a section for each file.
Everything shown comes from the file and from what the programs printed and drew. The setting ``gallery_examples`` (-D
gallery_examples=punch,bracket) keeps only those named.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

EXAMPLES = Path(__file__).parents[2] / "examples"
MARK = "% gallery"
_SECONDS = 90.0  # after which a command is given up, and the page says so
_AT_ONCE = 2


@dataclass(frozen=True)
class Shown:
    """What is shown of a problem file: title, words, commands in it, output and exit status, pictures drawn.

    A script of the same name has its output in ``script``, "" if there is none.
    """

    name: str
    title: str
    words: tuple[str, ...]
    command: str
    output: str
    status: int | None
    pictures: tuple[Path, ...]
    script: str


def comments(text: str) -> tuple[str, list[str]]:
    """Paragraphs of the comment at the top of a problem file, and the commands among them."""
    top = text.split("\n\n")[0].splitlines()
    lines = [line.removeprefix("#").removeprefix(" ") for line in top if line.startswith("#")]
    paragraphs = "\n".join(line for line in lines if not line.startswith("    ")).split("\n\n")
    commands = [line.split("  #")[0].strip() for line in lines if line.startswith("    ")]
    return "\n\n".join(part.strip() for part in paragraphs if part.strip()), commands


def shown(path: Path, folder: Path) -> Shown:
    """Check, solve and draw a problem file, pictures into the folder."""
    import tomllib

    text = path.read_text(encoding="utf-8")
    words, commands = comments(text)
    problem, answer = folder / f"{path.stem}_problem.png", folder / f"{path.stem}.png"
    _run(path, "-m", "qvi_contact", "check", str(path), "--plot", str(problem))
    status, output = _run(path, "-m", "qvi_contact", "solve", str(path), "--plot", str(answer))
    script = path.with_suffix(".py")
    printed = _run(script, str(script))[1] if script.exists() else ""
    pictures = tuple(picture for picture in (problem, answer) if picture.exists())
    title = tomllib.loads(text)["title"]
    return Shown(
        path.stem,
        title,
        (words, *commands),
        f"qvi-contact solve examples/{path.name}",
        output,
        status,
        pictures,
        printed,
    )


def _run(path: Path, *words: str) -> tuple[int | None, str]:
    """Exit status and output of Python with these words, for a file; no status if it took too long."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    environment = {**os.environ, **threads, "PYTHONIOENCODING": "utf-8"}
    try:
        done = subprocess.run(
            [sys.executable, *words], capture_output=True, timeout=_SECONDS, env=environment, check=False
        )
    except subprocess.TimeoutExpired:
        return None, f"given up after {_SECONDS:.0f} s"
    output = done.stdout.decode() + done.stderr.decode()
    if done.returncode == 2 or (path.suffix == ".py" and done.returncode):
        raise ExtensionError(f"{path.name}: {output}")
    return done.returncode, output.rstrip()


def section(example: Shown, folder: str) -> str:
    """The Markdown of a problem file's section, pictures in the folder as seen from the page."""
    words, *commands = example.words
    alternatives = ("mesh, conditions and loads", "the result")
    pictures = [
        f"![{example.title}: {what}]({folder}/{picture.name})"
        for picture, what in zip(example.pictures, alternatives, strict=False)
    ]
    ended = "was given up" if example.status is None else f"ends with exit status {example.status}"
    script = f"examples/{example.name}.py"
    beside = [f"`python {script}` prints", f"```text\n{example.script}\n```", f"The script: [{script}](../{script})"]
    return "\n\n".join([
        f"## {example.title}", words.replace("<", "\\<").replace("_", "\\_"), *pictures,
        "```console\n" + "\n".join(f"$ {command}" for command in commands or [example.command]) + "\n```",
        f"`{example.command}` {ended} and prints", f"```text\n{example.output}\n```",
        f"The file: [examples/{example.name}.toml](../examples/{example.name}.toml)",
        *(beside if example.script else ()),
    ])  # fmt: skip


def _replace(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the sections in the place of the mark."""
    if MARK not in source[0]:
        return
    only = [name for name in app.config.gallery_examples.split(",") if name]
    files = [path for path in sorted(EXAMPLES.glob("*.toml")) if not only or path.stem in only]
    if len(files) < len(only):
        raise ExtensionError(f"gallery_examples: not all of {', '.join(only)} are in {EXAMPLES.name}")
    folder = Path(app.doctreedir).parent / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        examples = list(pool.map(lambda path: shown(path, folder), files))
    for path in files:
        app.env.note_dependency(str(path))
    seen = os.path.relpath(folder, Path(app.env.doc2path(docname)).parent)
    source[0] = source[0].replace(MARK, "\n\n".join(section(example, seen) for example in examples))


def setup(app: Sphinx) -> dict[str, Any]:
    """Sphinx's entry."""
    app.add_config_value("gallery_examples", "", "env", str)
    app.connect("source-read", _replace)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
