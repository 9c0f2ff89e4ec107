"""The docstrings of the packages as reStructuredText.

They are plain text: an indented block is a formula or an example, a word between backticks a name, a section underlined
by hyphens a list of entries. None of the characters of mathematics has another meaning in them (|σ_T|, J*, u_N).
"""

import ast
import inspect
import re
from collections.abc import Iterator, Sequence
from importlib import import_module
from itertools import pairwise
from typing import Any

from docutils import nodes
from sphinx.addnodes import desc_annotation, pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.pycode import ModuleAnalyzer

_PACKAGES = ("qvi_contact", "solvers", "comparisons")
_SECTION = re.compile(r"^[A-Z][A-Za-z ]+$")
_PUBLIC = re.compile(r"```\{public\} (\S+)\n(.*?)```", re.DOTALL)
_LISTS = ("Attributes", "Parameters", "Raises", "Returns", "Yields")
_CODE = re.compile(r"(``.+?``|`[^`]+`|\*\*[^*\s][^*]*\*\*)")
_ENTRY = re.compile(r"^(?P<name>\**[\w., ]+?) : (?P<kind>.+)$")
_SHOWN_ARRAY = re.compile(r"ndarray\[tuple\[[^\]]*\], dtype\[[^\]]*\]\]")
_CLASS = re.compile(r"(?<![\w`.])((?:[A-Z]+[a-z]+){2,}\d*)(?![\w`.(])")
_WORD = re.compile(r"^(\S+) {2,}(.+)$")
_STATUS = re.compile(r"^(Exit status:) (\d .+)$")
_BULLET = re.compile(r"^([*-] +)(.*)$")
_ALIAS = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")  # what Sphinx makes of a name in a union
_ARRAY = re.compile(r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[[^\]]*\]\]")
_MATRIX = re.compile(r"~?numpy\.ndarray\[tuple\[[^\]]*\], ~?numpy\.dtype\[[^\]]*\]\]")


def restructured(lines: Sequence[str]) -> list[str]:
    """The lines of a docstring as reStructuredText, section by section."""
    text: list[str] = []
    for title, body in _sections(inspect.cleandoc("\n".join(lines)).splitlines()):
        if title:
            text += [f".. rubric:: {title}", ""]
        text += _entries(body) if title in _LISTS else list(_paragraphs(body))
        text.append("")
    return text


def _sections(lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Title, empty for the first, and lines of each section."""
    title, body = "", list[str]()
    for number, line in enumerate(lines):
        under = lines[number + 1] if number + 1 < len(lines) else ""
        if _SECTION.match(line) and set(under) == {"-"} and len(under) == len(line):
            yield title, body
            title, body = line, []
        elif not (set(line) == {"-"} and not body and title):
            body.append(line)
    yield title, body


def _entries(lines: Sequence[str]) -> list[str]:
    """A list of entries "name : type" with an indented description each; what is no entry stays a paragraph."""
    text: list[str] = []
    for head, body in _blocks(lines):
        found = _ENTRY.match(head)
        if found is None:
            entry = [f"* {_linked(head)}" if body else _linked(head)]
        else:
            entry = [f"* ``{found['name']}``: {_linked(found['kind'])}"]
        text += [*entry, ""]
        text += [f"  {line}".rstrip() for line in _paragraphs(body)]
        text.append("")
    return text


def _blocks(lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Lines at the left edge, each with what is indented below it; text that goes on at the edge is one of them."""
    head, body = "", list[str]()
    for line in [*lines, ""]:
        if line.startswith(" ") or not line.strip():
            body.append(line)
        elif head and not any(body) and not _ENTRY.match(line) and not _ENTRY.match(head):
            head = f"{head} {line}"
        else:
            if head:
                yield head, inspect.cleandoc("\n".join(["", *body])).splitlines()
            head, body = line, []
    if head:
        yield head, inspect.cleandoc("\n".join(["", *body])).splitlines()


def _paragraphs(lines: Sequence[str]) -> Iterator[str]:
    """Text with its indented blocks as they are."""
    block, listed, blank = list[str](), False, True
    for line in [*lines, ""]:
        inside = line.startswith("    ") and (bool(block) or (blank and not listed))
        if inside or (block and not line.strip()):
            block.append(line)
            continue
        if block:
            yield from _literal(block)
            block = []
        listed = bool(_BULLET.match(line)) or (listed and (line.startswith(" ") or not line.strip()))
        blank = not line.strip()
        yield from _line(line)
    if block:
        yield from _literal(block)


def _line(line: str) -> Iterator[str]:
    bullet = _BULLET.match(line)
    if bullet:
        yield ""
        yield bullet[1] + _inline(bullet[2])
    elif line.startswith(">>> "):
        yield line
    else:
        indent = len(line) - len(line.lstrip())
        yield " " * indent + _inline(line.strip())


def _literal(block: Sequence[str]) -> Iterator[str]:
    """An indented block, in colours if it is Python."""
    code = inspect.cleandoc("\n".join(["", *block]))
    yield ""
    yield f".. code-block:: {'python' if _is_python(code) else 'text'}"
    yield ""
    yield from (f"    {line}".rstrip() for line in code.splitlines())
    yield ""


def _is_python(code: str) -> bool:
    if code.startswith(">>> "):
        return True
    try:
        return any(isinstance(node, ast.Import | ast.ImportFrom | ast.Assign) for node in ast.parse(code).body)
    except SyntaxError:
        return False


def _inline(text: str) -> str:
    """Names between backticks as such, everything else as it is."""
    return "".join(_marked(part) if number % 2 else _escaped(part) for number, part in enumerate(_CODE.split(text)))


def _linked(text: str) -> str:
    """The same, and names of classes as names, which need no backticks in a list of entries."""
    return _inline(_CLASS.sub(r"`\1`", text))


def _marked(part: str) -> str:
    if part.startswith("``"):
        return f"\\ {part}\\ "
    if part.startswith("`"):
        return f"\\ :named:{part}\\ "
    return f"\\ **{_escaped(part[2:-2])}**\\ "


def _escaped(text: str) -> str:
    return re.sub(r"([\\*|_`])", r"\\\1", text)


def _named(_role: str, raw: str, text: str, line: int, inliner: Any, *_: Any) -> tuple[list[Any], list[Any]]:
    """Role of a name: a link where it is documented, else just code."""
    env = inliner.document.settings.env
    literal = nodes.literal(raw, text, classes=["xref", "py"])
    link = pending_xref(raw, literal, refdomain="py", reftype="obj", reftarget=text.split("(")[0], named=True)
    link["refdoc"] = env.current_document.docname
    link.source, link.line = inliner.document.current_source, line
    return [link], []


def _missing(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Node) -> nodes.Node | None:
    """Names and types without their module, if only one thing is called so; other names are just code."""
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"].lstrip("~.")
    found = {
        (entry.docname, entry.node_id)
        for name, entry in env.domains.python_domain.objects.items()
        if not entry.aliased and (name == target or name.endswith(f".{target}") or _same_class(name, target))
    }
    if len(found) == 1:
        docname, anchor = found.pop()
        uri = app.builder.get_relative_uri(node["refdoc"], docname) + f"#{anchor}"
        return nodes.reference("", "", content, internal=True, refuri=uri)
    return content if node.get("named") else None


def _same_class(name: str, target: str) -> bool:
    """Whether both are the same class, the one as `package.Class`, the other where it is defined."""
    package, _, last = name.rpartition(".")
    return "." in target and last == target.rpartition(".")[2] and target.startswith(f"{package}.")


def _listed(_app: Sphinx, _docname: str, source: list[str]) -> None:
    """Blocks ``{public} package`` of names in it, documented with their members, and behind a + with inherited ones."""
    source[0] = _PUBLIC.sub(_documented, source[0])


def _documented(block: re.Match[str]) -> str:
    """A block of names as directives of autodoc."""
    lines = ["```{eval-rst}"]
    for name, inherited in re.findall(r"([\w.]+)(\+?)", block[2]):
        home, _, last = f"{block[1]}.{name}".rpartition(".")
        found = getattr(import_module(home), last)
        if isinstance(found, type):
            _share_texts(found)
        kind = "class" if isinstance(found, type) else "function" if callable(found) else "data"
        lines += [f".. auto{kind}:: {block[1]}.{name}"]
        lines += ["   :members:"] * (kind == "class") + ["   :inherited-members:"] * bool(inherited)
    return "\n".join([*lines, "```"])


def _share_texts(documented: type) -> None:
    """Give the fields of a class the text below the next one of their type: one text may stand for several fields."""
    for module in {each.__module__ for each in documented.__mro__ if each.__module__.split(".")[0] in _PACKAGES}:
        analyzer = ModuleAnalyzer.for_module(module)
        analyzer.analyze()
        types, texts = analyzer.annotations, analyzer.attr_docs
        for following, field in pairwise(reversed(types)):
            if field[0] == following[0] != "" and types[field] == types[following] and following in texts:
                texts.setdefault(field, texts[following])


def _process(_app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]) -> None:
    end = lines.index("Fields") if "Fields" in lines else len(lines)  # for `help`: members have their own texts here
    lines[:] = restructured(lines[:end])


def _signature(
    _app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Arrays by one word, defaults that are made by a function as dots."""
    return _short(signature), _short(returns)


def _short(text: str | None) -> str | None:
    if text is None:
        return None
    for pattern in (_ARRAY, _MATRIX):
        text = pattern.sub("Array", text)
    text = _rewritten(_rewritten(text, "Annotated["), "float | Callable[")
    return _ALIAS.sub(r"\1", text).replace("<factory>", "...")


def _rewritten(text: str, head: str) -> str:
    """Types in `Annotated` without what problem files read there; `Field` for a number or a function of x and y."""
    pattern = r"[\w.~]*" + re.escape(head).replace("Callable", r"[\w.~]*Callable")
    while (found := re.search(pattern, text)) is not None:
        depth, end, comma = 1, found.end(), 0
        while depth:
            depth += {"[": 1, "(": 1, "]": -1, ")": -1}.get(text[end], 0)
            comma = comma or (end if text[end] == "," and depth == 1 else 0)
            end += 1
        kept = text[found.end() : comma] if head == "Annotated[" else "Field"
        text = text[: found.start()] + kept + text[end:]
    return text


def _short_types(_app: Sphinx, document: nodes.document) -> None:
    """The same for the types of attributes and properties."""
    for annotation in document.findall(desc_annotation):
        words = annotation.findall(nodes.Text)  # a name comes twice, as it is shown and as it would be without a link
        text = "".join(word for word in words if word.parent.get("condition") != "*")
        short = _SHOWN_ARRAY.sub("Array", _ALIAS.sub(r"\1", text))
        short = _rewritten(_rewritten(short, "Annotated["), "float | Callable[")
        if short != text:
            annotation.children = [nodes.Text(short)]


def _process_command(_app: Sphinx, _context: Any, lines: list[str]) -> None:
    """Mark up the lines of a command's help that are kept as they are: sphinx-click makes line blocks of them."""
    text: list[str] = []
    kept: list[str] = []
    for line in [*lines, ""]:
        if line.startswith("|"):
            kept.append(line[1:].removeprefix(" "))
            continue
        text += [*kept_lines(kept), line] if kept else [line]
        kept = []
    lines[:] = text


def kept_lines(lines: Sequence[str]) -> Iterator[str]:
    """Code under a line that ends in a colon, lists of exit statuses, lists of words and what they mean."""
    for head, body in _indented(lines):
        word, status = _WORD.match(head), _STATUS.match(head)
        if head.endswith(":") and body:
            yield from (_escaped(head), *_literal(body))
        elif status:
            yield from (_escaped(status[1]), "", *(_item(*line.strip().split(" ", 1)) for line in (status[2], *body)))
        elif word:
            yield _item(word[1], " ".join([word[2], *(line.strip() for line in body)]))
        else:
            yield from _literal([head, *body])
    yield ""


def _indented(lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Each line at the left edge with those that are indented below it."""
    starts = [number for number, line in enumerate(lines) if not line.startswith(" ")]
    for start, end in pairwise([*starts, len(lines)]):
        yield lines[start], list(lines[start + 1 : end])


def _item(word: str, meaning: str) -> str:
    return f"* ``{word}`` {_escaped(meaning.strip())}"


def setup(app: Sphinx) -> dict[str, Any]:
    """Sphinx's entry."""
    app.add_role("named", _named)
    app.connect("source-read", _listed)
    app.connect("autodoc-process-docstring", _process)
    app.connect("autodoc-process-signature", _signature)
    app.connect("doctree-read", _short_types)
    app.connect("missing-reference", _missing)
    app.connect("sphinx-click-process-description", _process_command)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
