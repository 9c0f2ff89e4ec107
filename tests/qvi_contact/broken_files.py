"""Problem files that hypothesis breaks."""

import copy
import tomllib
from pathlib import Path

import tomli_w
from hypothesis import strategies as st

PROBLEMS = Path(__file__).parent / "problems"
RICH = (PROBLEMS / "rich.toml").read_text(encoding="utf-8")
TRIANGLES = (PROBLEMS / "triangles.toml").read_text(encoding="utf-8")

PRINTED = "aZ09_-.,:;!?#$%&*+/\\|~^<>=()[]{}'\"`@§½²₂Ⅷµμßéåπσ→∞≤€中あ한אع☃😀𝒙"
"""Letters, numbers, punctuation and symbols of one to four bytes, with all that TOML gives a meaning."""
LETTERS = PRINTED + " \t\n\r\0\x1b\x7f\x85\xa0\xad\u0301\u200b\u200f\u2028\u3000\ue000\ufeff\uffff"
"""With spaces, ends of lines, control characters, and what is not seen. Few: hypothesis takes seconds to list all."""

numbers = st.floats(allow_nan=True) | st.integers() | st.sampled_from([0, -1, 1e-320, 1e308, 2**70, -0.0, 1e59])
words = st.text(LETTERS, max_size=12) | st.sampled_from(
    ["t", "x /", "1/0", "x**99999", "().__class__", "open('f')", "top", "joint", "roof", "lambda: 1", "9" * 300]
)
lists = st.lists(numbers | words, max_size=3)
junk = numbers | words | st.booleans() | lists | st.dictionaries(words, numbers, max_size=2)


def places(value, path=()):
    """Paths of all values in nested tables and lists."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from places(item, (*path, key))


@st.composite
def mutated(draw, whole=RICH):
    """A rich file with one to three things wrong, as bytes."""
    data = copy.deepcopy(tomllib.loads(whole))
    for _ in range(draw(st.integers(1, 3))):
        _break(draw, data)
    text = _as_toml(data).encode("utf-8", "replace")
    how = draw(st.sampled_from(["whole"] * 8 + ["cut", "bytes"]))
    at = draw(st.integers(0, len(text)))
    return {"whole": text, "cut": text[:at], "bytes": text[:at] + draw(st.binary(max_size=8)) + text[at:]}[how]


def _as_toml(data):
    try:
        return tomli_w.dumps(data)
    except (TypeError, ValueError):
        return "version = 1"


def _break(draw, data):
    """Delete, replace or rename one value, double a table, or add a key."""
    path = draw(st.sampled_from(list(places(data)) or [()]))
    if not path:
        return
    parent = data
    for key in path[:-1]:
        parent = parent[key]
    kind = draw(st.sampled_from(["delete", "replace", "replace", "scale", "rename", "double", "add"]))
    value = parent[path[-1]]
    if kind == "delete":
        del parent[path[-1]]
    elif kind == "scale" and isinstance(value, (int, float)) and not isinstance(value, bool):
        parent[path[-1]] = value * draw(st.sampled_from([-1, 2, 0.5, 1e12, 1e-12, 0]))
    elif kind == "rename" and isinstance(parent, dict):
        parent[str(path[-1])[:-1] + draw(st.sampled_from("abz "))] = parent.pop(path[-1])
    elif kind == "double" and isinstance(parent, list):
        parent.append(copy.deepcopy(value))
    elif kind == "add" and isinstance(value, dict):
        value[draw(words)] = draw(junk)
    else:
        parent[path[-1]] = draw(junk)
