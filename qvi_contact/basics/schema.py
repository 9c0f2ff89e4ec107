"""One declaration of a datum for all who deal with it: a field of a dataclass.

From type, default and metadata follow the key of problem files, its check and message, and what is written:

    cohesion: Field = field(default=0.0, metadata=key(kind=Varying(0.0), tied=False, symbol="c", unit="stress"))

What it means says the text below the field: "meaning: `cohesion = 0.1`.", the last part an example in TOML. The page of
all keys is made of these, and the help of commands.

Errors of `Kind.read` have a path relative to the value that is read; each table or list on the way adds its own part.
"""

from __future__ import annotations

import ast
import inspect
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
"""Numbers beyond it overflow when they are squared and multiplied."""

ADD: Final = "add this key, it is needed"
MOST: Final = 2000  # names, and tables of one kind
_LONGEST_NAME: Final = 100
_IN_TOML: Final = (
    ("with_edges() or with_joint()", "[[edges]] or [[joints]]"),
    ("with_edges()", "[[edges]]"),
    ("with_joint()", "[[joints]]"),
    ("with_region()", "[[regions]]"),
    (
        "add a Traction (0 if it is free), Displacement, Symmetry or Contact",
        "add [[tractions]] (0 if it is free), [[displacements]], [[symmetry]] or [[contacts]]",
    ),
    ("is not a Traction;", "is not one of [[tractions]];"),
    ("by a Displacement or Contact", "by [[displacements]] or [[contacts]]"),
)  # remedies written for Python


_Value = TypeVar("_Value")


def _cached(function: Callable[[type], _Value]) -> Callable[[type], _Value]:
    """What a function of classes returns, computed once for each; to type checkers a class has no hash of its own."""
    return cache(function)


class Missing:
    """The value of a key that is needed and not there, for messages: TOML knows no None."""

    def __repr__(self) -> str:
        return "missing"


Reader: TypeAlias = Any
"""A `FileReader`: reads numbers and functions in a file by its `field`; `whole` is the class of the whole file."""

Writer: TypeAlias = Callable[[str, object], object]
"""What makes of a path and a field a number, text or table, and collects the constants and the time that all share."""


class Kind:
    """The values of a key: read from a file, given in Python, written to a file."""

    def read(self, value: Any, reader: Reader) -> Any:  # noqa: ARG002
        """What Python makes of the value in a file; `InputError` if it is none of these."""
        return self.check("", value)

    def check(self, name: str, value: Any) -> Any:  # noqa: ARG002
        """What Python was given, numbers as floats, lists as tuples; `InputError` if it is something else."""
        return value

    def written(self, path: str, value: Any, writer: Writer) -> object:  # noqa: ARG002
        """What stands in the file."""
        return value


def _check_range(value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InputError("", value, f"give at {'most' if value > most else 'least'} {most if value > most else least}")


@dataclass(frozen=True, eq=False, repr=False)
class Number(Kind):
    """A finite number, from `least` to `most`; `positive` ones are above zero."""

    least: float = -LARGEST
    most: float = LARGEST
    positive: bool = False

    def read(self, value: Any, reader: Reader) -> float:  # noqa: ARG002
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError("", value, "give a number")
        if self.positive and 0.0 < value < 1.0 / LARGEST:
            raise InputError("", value, f"give at least {1.0 / LARGEST:g}: take other units if you need less")
        _check_range(value, self.least, self.most)
        return float(value)

    def check(self, name: str, value: Any) -> float:
        from qvi_contact.basics.checks import finite_number, positive_number

        return (positive_number if self.positive else finite_number)(name, value)


@dataclass(frozen=True, eq=False, repr=False)
class Whole(Kind):
    """A whole number from `least` to `most`."""

    least: int = -(2**63)
    most: int = 2**63 - 1

    def read(self, value: Any, reader: Reader) -> int:  # noqa: ARG002
        if isinstance(value, bool) or not isinstance(value, int):
            raise InputError("", value, "give a whole number")
        _check_range(value, self.least, self.most)
        return value


class Truth(Kind):
    """True or false."""

    def read(self, value: Any, reader: Reader) -> bool:  # noqa: ARG002
        if not isinstance(value, bool):
            raise InputError("", value, "give true or false")
        return value

    def check(self, name: str, value: Any) -> bool:
        from qvi_contact.basics.checks import true_or_false

        return true_or_false(name, value)


@dataclass(frozen=True, eq=False, repr=False)
class Text(Kind):
    """A text; a name is one of one line that is not too long."""

    name: bool = False

    def read(self, value: Any, reader: Reader) -> str:  # noqa: ARG002
        if not isinstance(value, str):
            raise InputError("", value, "give a text in quotes")
        if self.name and (not value.strip() or not value.isprintable() or len(value) > _LONGEST_NAME):
            raise InputError("", value, f"give a text of one line and at most {_LONGEST_NAME} characters")
        return value

    def check(self, name: str, value: Any) -> str:
        if not isinstance(value, str):
            raise InputError(name, value, "give a string")
        return value


@dataclass(frozen=True, eq=False, repr=False)
class Choice(Kind):
    """One of some words, or numbers."""

    words: tuple[Any, ...]

    def check(self, name: str, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, str | int) or value not in self.words:
            near = closest(value, [word for word in self.words if isinstance(word, str)])
            listed = " or ".join(filter(None, [", ".join(map(repr, self.words[:-1])), repr(self.words[-1])]))
            raise InputError(name, value, f"give {listed}" + (f"; did you mean {near!r}?" if near else ""))
        return value


@dataclass(frozen=True, eq=False, repr=False)
class Varying(Kind):
    """A field: a number of at least `least`, or a function of (x, y); what to do instead of zero says `instead`."""

    least: float | None = None
    instead: str = ""

    def read(self, value: Any, reader: Reader) -> Any:
        return reader.field(value)

    def check(self, name: str, value: Any) -> Any:
        """What can be checked before it is evaluated."""
        from qvi_contact.basics.checks import acts, check_field

        found = check_field(name, value, minimum=self.least)
        if self.instead and not acts(found):
            raise InputError(name, value, f"give a positive number: {self.instead}")
        return found

    def written(self, path: str, value: Any, writer: Writer) -> object:
        return writer(path, value)


class Scalar(Number):
    """A number, which a file may write as an expression of constants and t."""

    def read(self, value: Any, reader: Reader) -> float:
        """The number at the time that is read."""
        found = reader.field(value) if isinstance(value, str) else super().read(value, reader)
        if callable(found):
            raise InputError("", value, "this is one number: it cannot depend on x and y")
        return float(found)


@dataclass(frozen=True, eq=False, repr=False)
class Listed(Kind):
    """A list of values of one kind, as a tuple."""

    kind: Kind
    least: int = 0
    most: int | None = None

    def read(self, value: Any, reader: Reader) -> tuple[Any, ...]:
        """Entry by entry; the index of a bad one is its path."""
        if not isinstance(value, list):
            raise InputError("", value, "give a list, in [ ]")
        if len(value) < self.least:
            raise InputError("", value, f"give a list of at least {self.least} entries")
        if self.most is not None and len(value) > self.most:
            raise InputError("", value, f"give a list of at most {self.most} entries")
        index = 0
        try:
            found = []
            for index, item in enumerate(value):  # noqa: B007  # one `try` for all: meshes have many
                found.append(self.kind.read(item, reader))
        except InputError as error:
            raise _further(f"[{index}]", error) from error
        return tuple(found)

    def check(self, name: str, value: Any) -> tuple[Any, ...]:
        given: tuple[Any, ...] | None = None
        if not isinstance(value, str | bytes | bytearray | Mapping | Set):
            with suppress(TypeError):  # of what is no list, such as a number, be it an array
                given = tuple(value)
        if given is None or (self.most is not None and len(given) != self.most):
            raise InputError(name, value, "give a pair (x, y)" if self.most == 2 else f"give a list of {self.most}")
        return tuple(self.kind.check(name, item) for item in given)

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
        found = {}
        for name, item in value.items():
            with located(quoted(name)):
                found[Text(name=True).read(name, reader)] = self.kind.read(item, reader)
        return found


@dataclass(frozen=True, eq=False, repr=False)
class Table(Kind):
    """The fields of a dataclass as a table."""

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
    """The same, of which only what is given counts: a mapping."""

    def read(self, value: Any, reader: Reader) -> Any:
        given = getattr(self.of, "given", None)
        return read_values(self.of, value if given is None else given(value), reader)


@dataclass(frozen=True, eq=False, repr=False)
class Tables(Kind):
    """A list of tables, [[name]]."""

    of: type
    most: int | None = MOST

    def read(self, value: Any, reader: Reader) -> tuple[Any, ...]:
        if isinstance(value, dict):
            raise InputError("", value, "write its heading in double brackets, [[ ]]: there may be several")
        return Listed(Table(self.of), 0, self.most).read(value, reader)


@dataclass(frozen=True, eq=False, repr=False)
class Inline(Table):
    """The fields of another dataclass beside those of this one."""

    without: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Tagged(Kind):
    """One of several dataclasses, told apart by the key `law`, which is the `kind` of the class."""

    classes: tuple[type, ...]

    def read(self, value: Any, reader: Reader) -> Any:
        """The object of the class that `law` names."""
        if not isinstance(value, dict):
            raise InputError("", value, "give a table: keys and values")
        known = {getattr(each, "kind", ""): each for each in self.classes}
        if "law" not in value:
            raise InputError("law", Missing(), ADD)
        with located("law"):
            law = Choice(tuple(known)).read(value["law"], reader)
        return read_table(known[law], value, reader, also=("law",))

    def check(self, name: str, value: Any) -> Any:
        if not isinstance(value, self.classes):
            names = [each.__name__ for each in self.classes]
            raise InputError(name, value, f"give a {', '.join(names[:-1])} or {names[-1]}, or leave it out")
        return value

    def written(self, path: str, value: Any, writer: Writer) -> object:
        return {"law": value.kind, **write_table(path, value, writer)}


@dataclass(frozen=True)
class Key:
    """What there is to say of a datum beside its name, default and meaning."""

    kind: Kind
    """Its values."""
    needed: bool | None = None
    """Whether a file must have it; by default where the field has no default."""
    like: str = ""
    """Name of the key whose value it has by default."""
    tied: bool = True
    """Whether a tied contact can have it."""
    symbol: str = ""
    """What pictures call it."""
    unit: str = ""
    """The quantity whose unit it has: "stress", "length", "force", "moment", "rotation"; or none."""


def key(**said: Any) -> dict[str, Any]:
    """The metadata of a field: entries of its `Key`, where the type does not say all of its kind that too."""
    return {"key": said}


def kind_of(hint: Any) -> Kind:
    """The kind of values that a type means; what it leaves open says a `Kind` in `Annotated`."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return next(each for each in arguments if isinstance(each, Kind))
    if origin in (Union, UnionType):
        given = [each for each in arguments if each is not NoneType]
        tables = tuple(each for each in given if hasattr(each, "__dataclass_fields__"))
        if len(given) == 1:
            return kind_of(given[0])
        return Tagged(tables) if tables else Varying()  # a number, or a function of (x, y)
    if origin is Literal:
        return Choice(arguments)
    if origin is dict:
        return Named(kind_of(arguments[1]))
    if origin is tuple:
        if arguments[-1] is not ...:
            return Listed(kind_of(arguments[0]), len(arguments), len(arguments))
        return Tables(arguments[0]) if hasattr(arguments[0], "__dataclass_fields__") else Listed(kind_of(arguments[0]))
    simple = {float: FINITE, int: Whole(), bool: Truth(), str: TEXT}
    return simple[hint] if hint in simple else Table(hint)


@_cached
def keys_of(kind: type) -> dict[str, Key]:
    """The keys of a dataclass, in the order of its fields."""
    hints = get_type_hints(kind, include_extras=True)
    said = {each.name: each.metadata.get("key", {}) for each in fields(kind)}
    return {name: Key(**{"kind": kind_of(hints[name])} | more) for name, more in said.items() if more is not None}


@_cached
def defaults_of(kind: type) -> dict[str, Any]:
    """What fields are by default, of those that have a default."""
    made = {each.name: each.default_factory() for each in fields(kind) if each.default_factory is not MISSING}
    return made | {each.name: each.default for each in fields(kind) if each.default is not MISSING}


@_cached
def file_keys(kind: type) -> dict[str, Key]:
    """The keys of a table: those of the class, of what is inlined, and those that files only have (`in_files`)."""
    found: dict[str, Key] = {}
    for name, each in keys_of(kind).items():
        if isinstance(each.kind, Inline):
            found |= {inner: own for inner, own in file_keys(each.kind.of).items() if inner not in each.kind.without}
        else:
            found[name] = each
    return found | getattr(kind, "in_files", {})


def inlined(kind: type) -> list[type]:
    """The classes whose fields stand beside those of this one."""
    return [each.kind.of for each in keys_of(kind).values() if isinstance(each.kind, Inline)]


def is_needed(kind: type, name: str) -> bool:
    """Whether a table must have this key."""
    own = file_keys(kind)[name].needed
    return not any(name in defaults_of(each) for each in (kind, *inlined(kind))) if own is None else own


def read_values(kind: type, data: Any, reader: Reader, also: tuple[str, ...] = (), partly: bool = False) -> Any:
    """The values of a table by name; keys in `also` have been read, and `partly` needs none.

    `InputError` if it is no table, has a key that is not known or a bad value, or lacks a key.
    """
    known = file_keys(kind)
    if not isinstance(data, dict):
        raise InputError("", data, "give a table: keys and values")
    for name in data:
        if name not in known and name not in also:
            raise InputError(quoted(name), data[name], _instead(name, (*also, *known), reader))
    found = {}
    for name, each in known.items():
        if name in data:
            with located(name):
                found[name] = each.kind.read(data[name], reader)
        elif not partly and is_needed(kind, name):
            raise InputError(name, Missing(), ADD)
    return found


def read_table(kind: type, data: Any, reader: Reader, also: tuple[str, ...] = (), partly: bool = False) -> Any:
    """The object that a table states, made by the class or by its `from_file`."""
    values = read_values(kind, data, reader, also, partly)
    with located("", file_keys(kind)):
        for name, each in keys_of(kind).items():
            if isinstance(each.kind, Inline):
                own = [inner for inner in file_keys(each.kind.of) if inner in values and inner not in each.kind.without]
                values[name] = each.kind.of(**{inner: values.pop(inner) for inner in own})
        return getattr(kind, "from_file", kind)(**values)


def write_table(path: str, stated: Any, writer: Writer) -> dict[str, Any]:
    """The table that states an object, without what goes without saying."""
    found: dict[str, Any] = {}
    kind = type(stated)
    defaults = defaults_of(kind)
    for name, each in keys_of(kind).items():
        value = getattr(stated, name)
        if isinstance(each.kind, Inline):
            own = write_table(path, value, writer)
            found |= {inner: own[inner] for inner in own if inner not in each.kind.without}
        elif value is not None and not (each.like and value == getattr(stated, each.like)):
            written = each.kind.written(f"{path}.{name}", value, writer)
            if name not in defaults or value != defaults[name]:
                found[name] = written
    return found


class Checked:
    """Dataclasses whose fields are checked by their keys; numbers become floats, some are like others by default."""

    def __post_init__(self) -> None:
        kind = type(self)
        defaults = defaults_of(kind)
        for name, each in keys_of(kind).items():
            value = getattr(self, name)
            if value is not None or defaults.get(name, MISSING) is not None:
                object.__setattr__(self, name, each.kind.check(f"{kind.__name__}.{name}", value))
            if each.like and not value:
                object.__setattr__(self, name, getattr(self, each.like))


@_cached
def described(kind: type) -> dict[str, str]:
    """The texts below fields of a class, and of those above it; below `in_files` that of the key it names.

    Fields right above one another share the text below them. Nothing where there is no source.
    """
    texts: dict[str, str] = {}
    for each in reversed(kind.__mro__[:-1]):
        above = list[str]()
        for line in _classes(each.__module__).get(each.__name__, ()):
            if isinstance(line, ast.AnnAssign):
                above.append(ast.unparse(line.target))
            elif isinstance(line, ast.Expr) and above:
                text = " ".join(ast.literal_eval(line.value).split())
                names = [text.rpartition(": `")[2].partition(" ")[0]] if above[-1] == "in_files" else above
                texts, above = texts | dict.fromkeys(names, text), []
    return texts


@cache
def _classes(module: str) -> dict[str, list[ast.stmt]]:
    """What stands in the classes of a module."""
    with suppress(OSError, TypeError):  # it has no source
        return {each.name: each.body for each in ast.parse(inspect.getsource(sys.modules[module])).body
                if isinstance(each, ast.ClassDef)}  # fmt: skip
    return {}


def quoted(name: object) -> str:
    """A key as TOML writes it: bare if it can be."""
    text = str(name)
    return text if text.replace("_", "").replace("-", "").isalnum() and text.isascii() else repr(text)


def joined(path: str, further: str) -> str:
    """A path and what follows it: ``contacts`` and ``[2].friction``."""
    return f"{path}.{further}" if path and further and not further.startswith("[") else path + further


def in_toml(remedy: str) -> str:
    """The remedy in words of a problem file."""
    for python, toml in _IN_TOML:
        remedy = remedy.replace(python, toml)
    return remedy


@contextmanager
def located(path: str, known: Iterable[str] | None = None) -> Iterator[None]:
    """Errors raised in the block get this path before theirs, or before its last part if that is one of those known."""
    try:
        yield
    except InputError as error:
        name = error.field if known is None else error.field.split(".")[-1]
        kept = name if known is None or name in known else ""
        raise _further(path, type(error)(kept, error.value, error.remedy)) from error


def _further(path: str, error: InputError) -> InputError:
    """The same error seen from one table or list further out."""
    value = Missing() if error.value is None else error.value
    return type(error)(joined(path, error.field), value, in_toml(error.remedy))


def _instead(name: str, known: Iterable[str], reader: Reader) -> str:
    """What to write in place of an unknown key: one of those known, or where in the file a key like it belongs."""
    places = dict.fromkeys(file_keys(reader.whole), "the top of the file, before the first [table]")
    for table, headings in tables_of(reader.whole).items():
        places = dict.fromkeys(file_keys(table), headings[0]) | places
    near, listed = closest(name, {**dict.fromkeys(known), **places}), f"the keys here are {', '.join(known)}"
    if near is None:
        return f"there is no such key; {listed}"
    if near == name:
        return f"this belongs to {places[near]}; {listed}"
    where = "" if near in known else f", of {places[near]}"
    return f"there is no such key; did you mean {near}{where}? ({listed})"


@_cached
def tables_of(whole: type) -> dict[type, list[str]]:
    """The classes that state the tables of a file, and the headings of each."""
    found: dict[type, list[str]] = {}

    def walk(kind: type, path: str) -> None:
        for name, each in file_keys(kind).items():
            classes = (each.kind.of,) if hasattr(each.kind, "of") else getattr(each.kind, "classes", ())
            for table in classes:
                heading = f"[[{path}{name}]]" if isinstance(each.kind, Tables) else f"[{path}{name}]"
                found.setdefault(table, []).append(heading)
                walk(table, f"{path}{name}.")

    walk(whole, "")
    return found


FINITE: Final = Number()
TEXT: Final = Text()
Name: TypeAlias = Annotated[str, Text(name=True)]
Positive: TypeAlias = Annotated[float, Number(positive=True)]
