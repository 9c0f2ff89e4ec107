"""What the README shows works; its links and commands are looked at in `test_docs`."""

import re
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"


def test_code_runs_and_is_certified(capsys, monkeypatch):
    monkeypatch.chdir(README.parent)
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)
    for code, start in zip(blocks, ["solved", "reached"], strict=True):
        exec(compile(code, "README.md", "exec"), {})
        assert capsys.readouterr().out.startswith(start)
