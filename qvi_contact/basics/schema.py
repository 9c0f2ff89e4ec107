"""The schema of problem files: each datum is declared once, as a field of a dataclass.

Type, default and metadata of the field give the key in problem files, its check, its messages and its written form:

    cohesion: Field = field(default=0.0, metadata=key(kind=Varying(0.0), tied=False, symbol="c", unit="stress"))

The text below the field has the form "meaning: `cohesion = 0.1`.", with an example in TOML at the end. The page of all
keys and the help of commands are made from these texts.

Errors of `Kind.read` have a path relative to the value that is read. Each table or list around it adds its part.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager, suppress
from dataclasses import MISSING, dataclass, fields
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from qvi_contact.errors import InputError
from solvers.errors import closest

LARGEST: Final = 1e60
"""Largest number; products of squares of larger numbers overflow."""

ADD: Final = "add this key, it is needed"
MOST: Final = 2000  # entries of a table with free names, and tables of one kind
_MAX_NAME: Final = 100


_Value = TypeVar("_Value")


def _cached(function: Callable[[type], _Value]) -> Callable[[type], _Value]:
    """The function with cached results; `functools.cache` alone has no type for a class as argument."""
    return cache(function)


class Missing:
    """Value in messages of a required key that is missing; TOML has no None."""

    def __repr__(self) -> str:
        return "missing"


Reader: TypeAlias = Any
"""A `FileReader`: reads numbers and functions in a file by its `field`; `whole` is the class of the whole file."""

Writer: TypeAlias = Callable[[str, object], object]
"""Function of a path and a field that returns a number, text or table; it collects constants and time for the file."""


class Kind:
    """The values of a key: read from a file, given in Python, written to a file."""

    values = ""
    """The values in words, for the list of all keys."""

    def read(self, value: Any, reader: Reader) -> Any:  # noqa: ARG002
        """The Python value of a value in a file; `InputError` if it is not of this kind."""
        return self.check("", value)

    def check(self, name: str, value: Any) -> Any:  # noqa: ARG002
        """The value given in Python, with numbers as floats and lists as tuples; `InputError` for another kind."""
        return value

    def written(self, path: str, value: Any, writer: Writer) -> object:  # noqa: ARG002
        """The value as a problem file holds it."""
        return value


def _check_range(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        limit = f"most {most:g}" if value > most else f"least {least:g}"
        raise InputError(name, value, f"give at {limit}")


@dataclass(frozen=True, eq=False, repr=False)
class Number(Kind):
    """A finite number, from `least` to `most`; above zero if `positive`."""

    values = "number"
    least: float = -LARGEST
    most: float = LARGEST
    positive: bool = False

    def check(self, name: str, value: Any) -> float:
        from qvi_contact.basics.checks import finite_number, positive_number

        number = (positive_number if self.positive else finite_number)(name, value)
        _check_range(name, number, self.least, self.most)
        return number


@dataclass(frozen=True, eq=False, repr=False)
class Whole(Kind):
    """A whole number from `least` to `most`."""

    values = "whole number"
    least: int = -(2**63)
    most: int = 2**63 - 1

    def read(self, value: Any, reader: Reader) -> int:  # noqa: ARG002
        if isinstance(value, bool) or not isinstance(value, int):
            raise InputError("", value, "give a whole number")
        _check_range("", value, self.least, self.most)
        return value


class Truth(Kind):
    """True or false; Python's 1 and 0 are no values in a file."""

    values = "true or false"

    def read(self, value: Any, reader: Reader) -> bool:  # noqa: ARG002
        if not isinstance(value, bool):
            raise InputError("", value, "give true or false")
        return value

    def check(self, name: str, value: Any) -> bool:
        from qvi_contact.basics.checks import true_or_false

        return true_or_false(name, value)


@dataclass(frozen=True, eq=False, repr=False)
class Text(Kind):
    """A text; if `name`, one line of at most 100 characters."""

    values = "text"
    name: bool = False

    def check(self, name: str, value: Any) -> str:
        if not isinstance(value, str):
            several = ": each name needs a table or condition of its own" if isinstance(value, list | tuple) else ""
            raise InputError(name, value, f"give a text in quotes{several}")
        if self.name and (not value.strip() or not value.isprintable() or len(value) > _MAX_NAME):
            raise InputError(name, value, f"give a text of one line and at most {_MAX_NAME} characters")
        return value


@dataclass(frozen=True, eq=False, repr=False)
class Choice(Kind):
    """One of several words or numbers."""

    words: tuple[Any, ...]

    def check(self, name: str, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, str | int) or value not in self.words:
            suggestion = closest(value, [word for word in self.words if isinstance(word, str)])
            listed = " or ".join(filter(None, [", ".join(map(repr, self.words[:-1])), repr(self.words[-1])]))
            raise InputError(name, value, f"give {listed}" + (f"; did you mean {suggestion!r}?" if suggestion else ""))
        return value


@dataclass(frozen=True, eq=False, repr=False)
class Varying(Kind):
    """A field: a number of at least `least`, or a function of (x, y); `instead` is the remedy if zero is refused."""

    values = "number, expression or polynomial"
    least: float | None = None
    instead: str = ""

    def read(self, value: Any, reader: Reader) -> Any:
        return reader.field(value)

    def check(self, name: str, value: Any) -> Any:
        """The field, checked as far as possible before it is evaluated."""
        from qvi_contact.basics.checks import acts, check_field

        field = check_field(name, value, minimum=self.least)
        if self.instead and not acts(field):
            raise InputError(name, value, f"give a positive number: {self.instead}")
        return field

    def written(self, path: str, value: Any, writer: Writer) -> object:
        return writer(path, value)


class Scalar(Number):
    """A number; in a file also an expression of constants and t."""

    values = "number or expression"

    def read(self, value: Any, reader: Reader) -> float:
        """The number at the time t of the reader."""
        number = reader.field(value) if isinstance(value, str) else super().read(value, reader)
        if callable(number):
            raise InputError("", value, "this is one number: it cannot depend on x and y")
        return float(number)


@dataclass(frozen=True, eq=False, repr=False)
class Listed(Kind):
    """A list of values of one kind, as a tuple."""

    kind: Kind
    least: int = 0
    most: int | None = None

    def read(self, value: Any, reader: Reader) -> tuple[Any, ...]:
        """The entries; the path of an error is the entry's index."""
        if not isinstance(value, list):
            raise InputError("", value, "give a list, in [ ]")
        if len(value) < self.least:
            raise InputError("", value, f"give a list of at least {self.least} entries")
        if self.most is not None and len(value) > self.most:
            raise InputError("", value, f"give a list of at most {self.most} entries")
        index = 0
        try:
            entries = []
            for index, item in enumerate(value):  # noqa: B007  # one `try` for all: meshes have many
                entries.append(self.kind.read(item, reader))
        except InputError as error:
            raise _with_path(f"[{index}]", error) from error
        return tuple(entries)

    def check(self, name: str, value: Any) -> tuple[Any, ...]:
        entries: tuple[Any, ...] | None = None
        if not isinstance(value, str | bytes | bytearray | Mapping | Set):
            with suppress(TypeError):  # if it is not iterable
                entries = tuple(value)
        if entries is None or (self.most is not None and len(entries) != self.most):
            words = {None: "give a list", 2: "give a pair (x, y)"}
            raise InputError(name, value, words.get(self.most, f"give a list of {self.most}"))
        return tuple(self.kind.check(name, item) for item in entries)

    def written(self, path: str, value: Any, writer: Writer) -> object:
        return [self.kind.written(f"{path}[{index}]", item, writer) for index, item in enumerate(value)]


@dataclass(frozen=True, eq=False, repr=False)
class Named(Kind):
    """A table of values of one kind by names that the user chooses."""

    kind: Kind

    def read(self, value: Any, reader: Reader) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise InputError("", value, "give a table: keys and values")
        if len(value) > MOST:
            raise InputError("", value, f"give a table of at most {MOST} entries")
        values = {}
        for name, item in value.items():
            with located(quoted(name)):
                values[Text(name=True).read(name, reader)] = self.kind.read(item, reader)
        return values


@dataclass(frozen=True, eq=False, repr=False)
class Table(Kind):
    """The fields of a dataclass as a table."""

    values = "table"
    of: type

    def read(self, value: Any, reader: Reader) -> Any:
        return read_table(self.of, value, reader)

    def check(self, name: str, value: Any) -> Any:
        if not isinstance(value, self.of):
            raise InputError(name, value, f"give a {self.of.__name__}")
        return value

    def written(self, path: str, value: Any, writer: Writer) -> object:
        return write_table(path, value, writer)


class Options(Table):
    """The fields of a dataclass as a table, read as a mapping of the given values only."""

    def read(self, value: Any, reader: Reader) -> Any:
        return read_values(self.of, value, reader)


@dataclass(frozen=True, eq=False, repr=False)
class Tables(Kind):
    """A list of tables, [[name]]."""

    values = "tables"
    of: type
    most: int | None = MOST

    def read(self, value: Any, reader: Reader) -> tuple[Any, ...]:
        if isinstance(value, dict):
            raise InputError("", value, "write its heading in double brackets, [[ ]]: there may be several")
        return Listed(Table(self.of), 0, self.most).read(value, reader)


@dataclass(frozen=True, eq=False, repr=False)
class Inline(Table):
    """The fields of another dataclass, as keys of the same table."""

    without: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Tagged(Kind):
    """One of several dataclasses; the key `law` is the `kind` of the class."""

    values = "table with a law"
    classes: tuple[type, ...]

    def read(self, value: Any, reader: Reader) -> Any:
        """The object of the class that `law` names."""
        if not isinstance(value, dict):
            raise InputError("", value, "give a table: keys and values")
        class_of_law = {getattr(each, "kind", ""): each for each in self.classes}
        if "law" not in value:
            raise InputError("law", Missing(), ADD)
        with located("law"):
            law = Choice(tuple(class_of_law)).read(value["law"], reader)
        return read_table(class_of_law[law], value, reader, also=("law",))

    def check(self, name: str, value: Any) -> Any:
        if not isinstance(value, self.classes):
            names = [each.__name__ for each in self.classes]
            raise InputError(name, value, f"give a {', '.join(names[:-1])} or {names[-1]}, or leave it out")
        return value

    def written(self, path: str, value: Any, writer: Writer) -> object:
        return {"law": value.kind, **write_table(path, value, writer)}


@dataclass(frozen=True)
class Key:
    """The metadata of a datum, in addition to its name, default and meaning."""

    kind: Kind
    """Kind of its values."""
    needed: bool | None = None
    """Whether a file must have the key; by default if the field has no default."""
    like: str = ""
    """Name of the key whose value is the default."""
    tied: bool = True
    """Whether a tied contact can have the datum."""
    symbol: str = ""
    """Symbol in pictures."""
    unit: str = ""
    """Quantity of the unit: "stress", "length", "force", "moment", "rotation", …; empty without a unit."""


def key(**metadata: Any) -> dict[str, Any]:
    """The metadata of a field: entries of its `Key`; `kind` only if the type does not determine it."""
    return {"key": metadata}


def kind_of(hint: Any) -> Kind:
    """The kind of values of a type hint, or the `Kind` in `Annotated`."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return next(each for each in arguments if isinstance(each, Kind))
    if origin in (Union, UnionType):
        alternatives = [each for each in arguments if each is not NoneType]
        tables = tuple(each for each in alternatives if hasattr(each, "__dataclass_fields__"))
        if len(alternatives) == 1:
            return kind_of(alternatives[0])
        return Tagged(tables) if tables else Varying()  # a number, or a function of (x, y)
    if origin is Literal:
        return Choice(arguments)
    if origin is dict:
        return Named(kind_of(arguments[1]))
    if origin is tuple:
        if arguments[-1] is not ...:
            return Listed(kind_of(arguments[0]), len(arguments), len(arguments))
        return Tables(arguments[0]) if hasattr(arguments[0], "__dataclass_fields__") else Listed(kind_of(arguments[0]))
    simple_kinds = {float: FINITE, int: Whole(), bool: Truth(), str: TEXT}
    return simple_kinds[hint] if hint in simple_kinds else Table(hint)


@_cached
def keys_of(kind: type) -> dict[str, Key]:
    """The keys of a dataclass, in the order of its fields."""
    hints = get_type_hints(kind, include_extras=True)
    metadata = {each.name: each.metadata.get("key", {}) for each in fields(kind)}
    return {name: Key(**{"kind": kind_of(hints[name])} | data) for name, data in metadata.items() if data is not None}


@_cached
def defaults_of(kind: type) -> dict[str, Any]:
    """The defaults of the fields that have one."""
    defaults = {each.name: each.default_factory() for each in fields(kind) if each.default_factory is not MISSING}
    return defaults | {each.name: each.default for each in fields(kind) if each.default is not MISSING}


@_cached
def file_keys(kind: type) -> dict[str, Key]:
    """The keys of a table: of the class, of inlined classes, and of files only (`in_files`)."""
    keys: dict[str, Key] = {}
    for name, own_key in keys_of(kind).items():
        if isinstance(own_key.kind, Inline):
            without = own_key.kind.without
            keys |= {inner: its for inner, its in file_keys(own_key.kind.of).items() if inner not in without}
        else:
            keys[name] = own_key
    return keys | getattr(kind, "in_files", {})


def inlined(kind: type) -> list[type]:
    """The classes whose fields are keys of the same table."""
    return [each.kind.of for each in keys_of(kind).values() if isinstance(each.kind, Inline)]


def is_needed(kind: type, name: str) -> bool:
    """Whether a table must have this key."""
    needed = file_keys(kind)[name].needed
    return not any(name in defaults_of(each) for each in (kind, *inlined(kind))) if needed is None else needed


def read_values(kind: type, data: Any, reader: Reader, also: tuple[str, ...] = (), partly: bool = False) -> Any:
    """The values of a table by name; keys in `also` have been read already, with `partly` no key is required.

    `InputError` if `data` is not a table, has an unknown key or a bad value, or lacks a key.
    """
    known = file_keys(kind)
    if not isinstance(data, dict):
        raise InputError("", data, "give a table: keys and values")
    for name in data:
        if name not in known and name not in also:
            raise InputError(quoted(name), data[name], _suggestion(kind, name, (*also, *known), reader))
    values = {}
    for name, each in known.items():
        if name in data:
            with located(name):
                values[name] = each.kind.read(data[name], reader)
        elif not partly and is_needed(kind, name):
            raise InputError(name, Missing(), ADD)
    return values


def read_table(kind: type, data: Any, reader: Reader, also: tuple[str, ...] = (), partly: bool = False) -> Any:
    """The object of a table, made by the class or by its `from_file`."""
    values = read_values(kind, data, reader, also, partly)
    with located("", file_keys(kind)):
        for name, each in keys_of(kind).items():
            if isinstance(each.kind, Inline):
                own = [inner for inner in file_keys(each.kind.of) if inner in values and inner not in each.kind.without]
                values[name] = each.kind.of(**{inner: values.pop(inner) for inner in own})
        return getattr(kind, "from_file", kind)(**values)


def write_table(path: str, stated: Any, writer: Writer) -> dict[str, Any]:
    """The table of an object, without values equal to their defaults."""
    table: dict[str, Any] = {}
    kind = type(stated)
    defaults = defaults_of(kind)
    for name, table_key in keys_of(kind).items():
        value = getattr(stated, name)
        if isinstance(table_key.kind, Inline):
            inner_table = write_table(path, value, writer)
            table |= {inner: inner_table[inner] for inner in inner_table if inner not in table_key.kind.without}
        elif value is not None and not (table_key.like and value == getattr(stated, table_key.like)):
            written = table_key.kind.written(f"{path}.{name}", value, writer)
            if name not in defaults or value != defaults[name]:
                table[name] = written
    return table


class WithFields:
    """Base of dataclasses whose docstrings, as `help` shows them, end with the texts of their fields."""

    def __init_subclass__(cls) -> None:
        cls.__doc__ = _WithFields(cls)  # type: ignore[assignment]


class _WithFields:
    """The docstring of a class: its own text, and the texts of the fields."""

    def __init__(self, kind: type) -> None:
        self.text = inspect.cleandoc(kind.__dict__.get("__doc__") or "")

    def __get__(self, _instance: object, kind: type) -> str:
        if "__match_args__" not in vars(kind):  # no dataclass yet: the decorator asks whether there is a text
            return self.text
        return "\n\n".join([self.text, "Fields\n------", *map(": ".join, described(kind).items())])


class Checked(WithFields):
    """Base of dataclasses whose fields are checked by their keys; numbers become floats, `like` gives defaults."""

    def __post_init__(self) -> None:
        kind = type(self)
        defaults = defaults_of(kind)
        for name, each in keys_of(kind).items():
            value, like = getattr(self, name), getattr(self, each.like) if each.like else None
            if isinstance(value, str) and value in (defaults.get(name), like):
                object.__setattr__(self, name, like or value)
            elif value is not None or defaults.get(name, MISSING) is not None:
                object.__setattr__(self, name, each.kind.check(f"{kind.__name__}.{name}", value))


@_cached
def described(kind: type) -> dict[str, str]:
    """The texts below the fields of a class and of its base classes; the text below `in_files` is that of its key.

    Consecutive fields share the text below the last one. Without source code the result is empty.
    """
    texts: dict[str, str] = {}
    for each in reversed(kind.__mro__[:-1]):
        names_above = list[str]()
        for statement in _classes(each.__module__).get(each.__name__, ()):
            if isinstance(statement, ast.AnnAssign):
                names_above.append(ast.unparse(statement.target))
            elif isinstance(statement, ast.Expr) and names_above:
                text = " ".join(ast.literal_eval(statement.value).split())
                names = [text.rpartition(": `")[2].partition(" ")[0]] if names_above[-1] == "in_files" else names_above
                texts, names_above = texts | dict.fromkeys(names, text), []
    return texts


@cache
def _classes(module: str) -> dict[str, list[ast.stmt]]:
    """The statements of the classes of a module, by class; empty without source code."""
    with suppress(OSError, TypeError):
        return {each.name: each.body for each in ast.parse(inspect.getsource(sys.modules[module])).body
                if isinstance(each, ast.ClassDef)}  # fmt: skip
    return {}


def quoted(name: object) -> str:
    """A key as TOML writes it, in quotes if necessary."""
    text = str(name)
    return text if text.replace("_", "").replace("-", "").isalnum() and text.isascii() else repr(text)


def joined(path: str, further: str) -> str:
    """A path and the rest of it, such as ``contacts`` and ``[2].friction``."""
    return f"{path}.{further}" if path and further and not further.startswith("[") else path + further


@contextmanager
def located(path: str, known: Iterable[str] | None = None) -> Iterator[None]:
    """Put `path` before the field of errors in the block; with `known`, only the field's last part stays, if known."""
    try:
        yield
    except InputError as error:
        name = error.field if known is None else error.field.split(".")[-1]
        known_name = name if known is None or name in known else ""
        raise _with_path(path, type(error)(known_name, error.value, error.remedy)) from error


def _with_path(path: str, error: InputError) -> InputError:
    """The error with the path of the table or list around it."""
    value = Missing() if error.value is None else error.value
    return type(error)(joined(path, error.field), value, error.remedy)


def _suggestion(kind: type, name: str, known: tuple[str, ...], reader: Reader) -> str:
    """Remedy for an unknown key: the place where it belongs, or a known key of similar name, or with it in its text."""
    places = dict.fromkeys(file_keys(reader.whole), "the top of the file, before the first [table]")
    for table, headings in tables_of(reader.whole).items():
        places = dict.fromkeys(file_keys(table), headings[0]) | places
    listed = f"the keys here are {', '.join(known)}"
    texts = {key: text for each in (kind, *inlined(kind)) for key, text in described(each).items() if key in known}
    meanings = {key: text.rpartition(": `")[0].partition(". ")[0] for key, text in texts.items()}
    word = rf"(?<!')\b{re.escape(name)}\b"  # not the s of a possessive
    meant = [m for m, text in meanings.items() if m in name.split("_") or (name != "a" and re.search(word, text))]
    if name in places and not (meant and len(name) == 1):  # a symbol
        return f"this belongs to {places[name]}; {listed}"
    is_close = len(name) > 1 or name.lower() in known  # a letter is close to no key
    suggestion = None if not is_close else closest(name, {**dict.fromkeys(known), **places})
    if meant and suggestion not in known:
        return f"there is no such key; did you mean {meant[0]}? {meanings[meant[0]]}; {listed}"
    if suggestion is None:
        return f"there is no such key; {listed}"
    where = "" if suggestion in known else f", of {places[suggestion]}"
    return f"there is no such key; did you mean {suggestion}{where}? ({listed})"


@_cached
def tables_of(whole: type) -> dict[type, list[str]]:
    """The classes of the tables of a file, with the headings of each."""
    headings: dict[type, list[str]] = {}

    def walk(kind: type, path: str) -> None:
        for name, each in file_keys(kind).items():
            classes = (each.kind.of,) if hasattr(each.kind, "of") else getattr(each.kind, "classes", ())
            for table in classes:
                heading = f"[[{path}{name}]]" if isinstance(each.kind, Tables) else f"[{path}{name}]"
                headings.setdefault(table, []).append(heading)
                walk(table, f"{path}{name}.")

    walk(whole, "")
    return headings


FINITE: Final = Number()
TEXT: Final = Text()
Name: TypeAlias = Annotated[str, Text(name=True)]
Positive: TypeAlias = Annotated[float, Number(1e-60, positive=True)]
