"""What the README shows works."""

import re
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"


def test_code_runs_and_is_certified(capsys):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)
    assert len(blocks) == 4
    for code, start in zip(blocks, ["solved", "solved", "solved", "Guaranteed"], strict=True):
        exec(compile(code, "README.md", "exec"), {})
        assert capsys.readouterr().out.startswith(start)


def test_links_and_pictures_exist():
    for target in re.findall(r"\]\(([^)#:]+)\)", README.read_text(encoding="utf-8")):
        assert (README.parent / target).exists(), target
