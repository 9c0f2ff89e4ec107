"""The command `qvi-contact`: options and help. Functions of `work` do the work; they are imported when it runs."""

import sys
from collections.abc import Callable, Iterable
from functools import wraps
from importlib import import_module
from importlib.util import LazyLoader, find_spec, module_from_spec
from itertools import chain
from typing import Any, Final, NamedTuple

import click

from qvi_contact import __version__
from qvi_contact.basics.schema import Choice, Number, Whole, defaults_of, described, keys_of
from qvi_contact.basics.terminal import Group, run
from qvi_contact.solution.settings import RefineOptions, Settings

_Command = Callable[..., Any]
_Decorator = Callable[[_Command], _Command]


class Target(NamedTuple):
    """A file that commands write: its name in the help, the help text, its suffixes, and the library that it needs."""

    metavar: str
    text: str
    suffixes: str = ""
    library: str = ""


TARGETS: Final = {
    "plot": Target("PICTURE", "Draw the result: .png, .svg or .pdf.", ".png .svg .pdf", "matplotlib"),
    "vtk": Target("VTU", "Write the fields for ParaView (.vtu), and the contacts to …_contacts.vtu.", ".vtu", "meshio"),
    "npz": Target("NPZ", "Write problem and result as NumPy arrays (.npz), for qvi-contact verify.", ".npz"),
    "save_json": Target("JSON", "Write the document of --json to a file."),
    "report": Target("HTML", "Write a report on one page (.html): pictures, forces, bounds.", ".html", "matplotlib"),
    "proof": Target("FILE", "Write a proof of both numbers (.json), for qvi-contact check-proof.", ".json"),
}
"""Files that commands write, by option."""

_METAVARS: Final = {"time_limit": "SECONDS", "quantity": "NAME", "max_unknowns": "N", "max_rounds": "N"}


def _words(_context: object, option: click.Parameter, prefix: str) -> list[str]:
    """Completions of an option for the shell: names of methods, inner solvers or factorisations that work here."""
    from solvers import available
    from solvers.factorisation.choice import OTHERS, available_backends
    from solvers.settings import METHODS

    words_of: dict[str | None, Iterable[str]] = {"method": METHODS, "inner": available()}
    return [word for word in words_of.get(option.name, (*OTHERS, *available_backends())) if word.startswith(prefix)]


_SHARED: Final[dict[str, _Decorator]] = {
    "FILE": click.argument("file", metavar="FILE", type=click.Path()),  # shells complete file names
    "verbose": click.option("-v", "--verbose", is_flag=True, help="Print what the solver does, on standard error."),
    "json": click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else."),
}


def _option(name: str, text: str = "") -> _Decorator:
    """A shared option: a file to write, or a field of `Settings` or `RefineOptions`. `text` is its help."""
    if name in _SHARED:
        return _SHARED[name]
    attributes: dict[str, Any] = {"metavar": _METAVARS.get(name)}
    if name in TARGETS:
        attributes["metavar"], help_text, *_ = TARGETS[name]
    else:
        declared = Settings if name in keys_of(Settings) else RefineOptions
        kind, default = keys_of(declared)[name].kind, defaults_of(declared)[name]
        help_text = described(declared).get(name, "").rpartition(": `")[0]  # empty without source code
        help_text += "." if help_text else ""
        if default is not None:
            help_text += f"  [default: {default}]"
        if isinstance(kind, Choice):
            attributes["type"] = click.Choice(kind.words)
        elif isinstance(kind, Number | Whole):
            attributes["type"] = float if isinstance(kind, Number) else int
        if name in ("method", "inner", "factorisation"):
            attributes["shell_complete"] = _words
    return click.option(f"--{name.replace('_', '-')}", help=text or help_text, **attributes)


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__)
def group() -> None:
    """Frictional contact computed from the stress side.

    The unknown is an Airy stress function, so every computed stress is in equilibrium. Contact with Coulomb friction
    is a complementarity problem on the contact. Every answer has a certificate, computed from the original data.

    \b
    Problems are TOML files; the folder examples has commented ones:
        qvi-contact check examples/punch.toml --plot punch.png
        qvi-contact solve examples/punch.toml --plot answer.png --npz answer.npz
        qvi-contact verify answer.npz

    \b
    Exit status: 0 the answer was found and passes its checks
                 1 no answer was found, or a check failed: the message says why
                 2 the input is wrong, or a file cannot be written

    \b
    Reproduce the paper that the method comes from:
        python -m comparisons paper
    """  # noqa: D301  # click needs the control character \b


def _command(*options: str | _Decorator) -> Callable[[_Command], click.Command]:
    """Make a command with options, or names of shared options. Its function has the help, that in `work` the work."""

    def decorated(function: _Command) -> click.Command:
        @wraps(function)
        def run_work(**given: Any) -> Any:
            _put_off("f2py", "testing")
            return getattr(import_module("qvi_contact.command.work"), function.__name__)(**given)

        command: _Command = run_work
        decorators = [[given] if callable(given) else map(_option, given.split()) for given in options]
        for option in reversed([*chain.from_iterable(decorators)]):
            command = option(command)
        return group.command(command)

    return decorated


def _put_off(*names: str) -> None:
    """Import parts of NumPy on first use: SciPy names all parts, and importing these takes a tenth of a small solve."""
    import numpy as np

    for spec in (find_spec(f"numpy.{name}") for name in names):
        if spec is not None and spec.loader is not None and spec.name not in sys.modules:
            spec.loader = LazyLoader(spec.loader)
            sys.modules[spec.name] = module = module_from_spec(spec)
            spec.loader.exec_module(module)
            setattr(np, spec.name.rpartition(".")[2], module)


@_command(
    "FILE degree law_on method inner factorisation threads tolerance time_limit verbose json",
    "plot vtk npz save_json report",
    click.option(
        "--panels",
        metavar="NAMES",
        help="Contacts whose pressure and friction are drawn as charts, such as base,wall; none for no charts.  "
        "[default: at most two]",
    ),
    click.option(
        "--set",
        "swept",
        multiple=True,
        metavar="NAME=V1,V2,…",
        help="Solve for several values, V1,V2,… or START:STOP:COUNT. NAME is a constant of the file, friction, load (a "
        "factor), gap or offset (a length to add), or one of a single contact or load: CONTACT.friction, load.NAME.",
    ),
    click.option(
        "--store",
        metavar="PLACE",
        help="Folder for the steps of a history, or SQLite file for the rows of a sweep. Repeat an interrupted command "
        "to continue it.",
    ),
    click.option("--workers", type=int, help="Processes that share a sweep with --store.  [default: 1]"),
    click.option(
        "--dask", metavar="ADDRESS", help="Share a sweep with --store on a Dask cluster: its scheduler's address."
    ),
)
def solve() -> None:
    """Solve the problem in FILE: forces, states, certificate.

    The peak of a contact is the largest pressure at its points; at sharp corners it grows on finer meshes.

    Options override [solve] in the file. After --time-limit seconds the best state found has the status time_limit.

    A file with a [history] is solved step by step. The picture shows the forces of all steps, the other files have the
    last step. With --store each step is written to a folder as soon as it is solved.

    --set, or a [sweep] in the file, solves for several values; the files written have the last one. A single value of a
    constant replaces the constant in the file, also together with a history or another --set. For thousands of values
    give --store: each value becomes a row of forces and states as soon as it is solved. With --workers or --dask
    several processes share the values.

    --report writes one page. The energy bounds on it, and the displacements in the file of --vtk, need a second solve
    by displacement elements, which takes at most --time-limit seconds. The bounds of a load step hold for that step
    alone, after the slip computed before it.

    \b
    Examples:
        qvi-contact solve examples/punch.toml
        qvi-contact solve examples/punch.toml --degree 5 --plot punch.png
        qvi-contact solve examples/punch.toml --report punch.html
        qvi-contact solve examples/cyclic_shear.toml --json > cycle.json
        qvi-contact solve examples/cyclic_shear.toml --store cycle
        qvi-contact solve examples/punch.toml --set P=50 --set friction=0.1,0.2
        qvi-contact solve examples/punch.toml --set friction=0.1:0.5:41 --store punch.sqlite
    """  # noqa: D301


@_command(
    click.argument("result", metavar="RESULT", type=click.Path()),
    _option("tolerance", "Tolerance of the certificate.  [default: that of the result]"),
    click.option("-v", "--verbose", is_flag=True, help="Print every check, not only those that failed."),
    "json",
)
def verify() -> None:
    """Check the stored result RESULT, from its file alone.

    RESULT is an archive written by "qvi-contact solve --npz" or qvi_contact.export.write_npz. It holds the problem,
    which is discretised again. The certificate is computed again from unknowns and multipliers. Tractions, gaps, slips,
    states, forces, energies and stresses are computed again and compared with those in the file. The output lists the
    checks that failed, each with its value, limit and meaning. The last line is the verdict.

    A result that was not solved fails. If its accuracy is good enough for you, give that accuracy as --tolerance. A
    problem with Python functions for loads or gaps cannot be stored, so its result cannot be checked.

    \b
    Examples:
        qvi-contact verify answer.npz -v
        qvi-contact verify answer.npz --tolerance 1e-6 --json
    """  # noqa: D301


@_command("FILE degree law_on", _option("plot", "Draw mesh, boundary parts and loads: .png, .svg or .pdf."), "json")
def check() -> None:
    """Read FILE and print the problem, without solving it.

    The mesh is built, every part of the boundary gets its condition, loads are added up, and unknowns are counted.

    \b
    Example:
        qvi-contact check examples/bracket.toml --plot bracket.png
    """  # noqa: D301


@_command(
    "FILE",
    _option("degree", "Degree of the displacements, 1 to 5; that of the stress function by default, at most 5."),
    click.option(
        "--tolerance", type=float, default=1e-8, show_default=True, help="Tolerance of both solves, at most 1e-6."
    ),
    "time_limit verbose json",
    _option("vtk", "Write the fields for ParaView (.vtu), with the part of each cell in the gap of the bounds."),
)
def bracket() -> None:
    """Bound energy and forces from both sides.

    The problem in FILE is solved by stresses, for a lower bound of the energy, and by displacements on the same mesh,
    for an upper bound. Both together bound the error of the stresses and the forces of contacts. The bounds are
    guaranteed for straight contacts without Coulomb friction. With Coulomb friction they are guaranteed or estimated,
    whatever sticks, slips or opens. The output gives every reason why bounds are not guaranteed.

    \b
    Examples:
        qvi-contact bracket examples/punch.toml --vtk apart.vtu
        qvi-contact bracket examples/compressed_plate.toml --degree 3 --json
    """  # noqa: D301


@_command(
    "FILE target quantity max_unknowns max_rounds",
    click.option(
        "--guaranteed/--estimated",
        default=None,
        help="For the force of a contact: refine until guaranteed bounds, or an estimate, are within the target.  "
        "[default: estimated]",
    ),
    _option("degree", "Degree of the element, 3 to 11; 5 by default."),
    "law_on method inner tolerance time_limit verbose json plot vtk npz save_json report",
)
def refine() -> None:
    """Refine the mesh until a number is as accurate as you ask.

    The first mesh is the one in the file: make it coarse. Each round solves the problem, prints unknowns, value and
    relative error of the quantity, and divides the cells that contribute most to the error. The error is an estimate.
    Without Coulomb friction it is a guaranteed bound for the energy, and for the force of the only prescribed
    displacement. With --guaranteed it is a bound for the force of any contact, also with Coulomb friction, where one is
    proved; this takes more unknowns. The files written are those of "qvi-contact solve", for the last mesh.

    Options override [refine] and [solve] in the file. After --time-limit seconds the answer is that of the last round
    done in time. The energy bounds on the page of --report take one more solve.

    \b
    Examples:
        qvi-contact refine examples/trapezoid.toml --target 1e-4 --quantity base.normal_force
        qvi-contact refine examples/cylinder_on_block.toml --quantity contact.largest_pressure
        qvi-contact refine examples/compressed_plate.toml --quantity plate.normal_force --guaranteed
        qvi-contact refine examples/trapezoid.toml --npz answer.npz && qvi-contact verify answer.npz
        qvi-contact refine examples/trapezoid.toml --json --report trapezoid.html > trapezoid.json
    """  # noqa: D301


@_command(
    "FILE",
    click.option(
        "--load", "loads", metavar="NAME", multiple=True, help="Name of a load to multiply; may be given several times."
    ),
    _option("target", "Refine the mesh until the two bounds agree to this relative difference, such as 1e-4."),
    _option("max_unknowns", "Largest number of unknowns, 20000 by default; given alone, the target is 1e-3."),
    "degree time_limit verbose json",
    _option("plot", "Draw how the body gives way beyond the limit: .png, .svg or .pdf."),
    _option("vtk", "Write the plastic flow of a body that yields for ParaView (.vtu)."),
    _option("report", "Write a report on one page (.html): both numbers, and the motion beyond the limit."),
    "proof",
)
def limit() -> None:
    """Bound the largest multiple of loads that can be carried.

    The loads NAME are multiplied, the other loads are fixed. The first number is a multiple that stresses of this mesh
    carry within the contact laws, and within the strength of materials that have one. The second number is a multiple
    that no stress of the body exceeds, proved by a mechanism of rigid blocks, or by the plastic flow of bodies that
    yield. With --target the mesh is refined until the difference is within this share of the second number. Under
    Coulomb friction the body may slide at smaller loads; check a load by "qvi-contact solve".

    NAME is the name of a traction (its edge set if it has none), of a contact whose plate is driven by force, or "body"
    for the body force. Loads of one name are multiplied together. With a [history] the problem at its first time is
    used. With --proof but no --load the file proves, by a mechanism of rigid blocks, that the given loads cannot be
    carried. The exit status is 1 if the mesh carries no multiple, or if the target was not reached.

    \b
    Examples:
        qvi-contact limit examples/dragged_block_holds.toml --load drag --target 1e-4
        qvi-contact limit examples/dragged_block_holds.toml --load drag --plot drag.png
        qvi-contact limit examples/dragged_block_holds.toml --load drag --proof drag.json
    """  # noqa: D301


@_command(
    "FILE",
    click.option(
        "--of", metavar="NAME", multiple=True, help='Contact, region or "body" to weaken; may be given several times.'
    ),
    click.option("--accuracy", type=float, default=1e-3, show_default=True, help="Relative width where searches end."),
    "degree time_limit verbose json",
)
def safety() -> None:
    """Bound the factor of safety on strength and friction.

    It is the number by which friction, cohesion and strengths can be divided until the loads are just carried. At the
    first number printed, stresses of this mesh carry all loads; at the second, no stress does. All contacts and
    materials are weakened together, or those given by --of, where "body" is the material of the body. Under Coulomb
    friction the body may slide at factors below the first number; check a factor by "qvi-contact solve". With a
    [history] the problem at its first time is used. The exit status is 1 if the first number is below 1.

    \b
    Examples:
        qvi-contact safety examples/gravity_dam.toml
        qvi-contact safety examples/gravity_dam.toml --of base
    """  # noqa: D301


@_command("FILE")
def check_proof() -> None:
    """Check a proof file in exact arithmetic.

    "qvi-contact limit --proof" writes such a file, with proofs of both bounds of a limit load. The check is the script
    qvi_contact/limit/check_proof.py, which needs only Python's standard library. The exit status is 1 if a proof does
    not hold.

    \b
    Example:
        qvi-contact check-proof drag.json
    """  # noqa: D301


@_command(click.argument("name", metavar="[NAME]", default=""))
def keys() -> None:
    """List the keys of problem files.

    Without NAME, all tables are listed with their keys. NAME is a table or a key: then each key is explained, with the
    values that it takes, its default, its meaning with the unit, and an example.

    \b
    Examples:
        qvi-contact keys contacts
        qvi-contact keys contacts.friction
        qvi-contact keys mesh.outline
    """  # noqa: D301


@_command("json")
def methods() -> None:
    """List methods and solvers that can be used here.

    Inner solvers are names for --inner and the argument `inner` of qvi_contact.solve: "qp:…" solve quadratic programs
    through qpsolvers, "direct:…" keep their set-up between outer iterations, "socp:…" solve second-order cone programs
    through cvxpy. In a copy of the repository "python -m pip install '.[solvers]'" installs more of them. The list also
    names factorisations that are not installed, and how to install them.
    """


def main() -> None:
    """Entry point."""
    run(group, "qvi-contact")
