"""Settings of a solve: every option of every method, with its check and its text, stated once.

    Settings(method="condensed", tolerance=1e-9, options={"gap": 1e-12})

The text below an option ends with an example in the syntax of problem files. The keys of problem files and the options
of the command line are made from these classes. The command line's help does without NumPy, so this module imports it
only in the checks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Self, TypeVar

from solvers.errors import InputError, SolverUnavailableError, nearest_first

DEFAULT_INNER: Final = "qp:clarabel"
"""The default inner solver of the fixed point."""

STARTED: Final = ("condensed", "fixed-point")
"""Methods that take `initial`: both take a state, the fixed point a pressure too."""


@dataclass(frozen=True, kw_only=True)
class CondensedOptions:
    """Options of the condensed method; `initial` is a `Start` near which it begins.

    By default at most 600 factorisations of Newton's matrix. On graded meshes the gap is reduced further: by
    (r / 2e-3)², with r the least weight of a bound over the sum of the weights in its contact, if r < 2e-3. In sparse
    systems 5e-4 takes the place of 2e-3.
    """

    gap: float = 1e-14
    """Condensed: complementarity at the end, relative to stress × displacement × length: `gap = 1e-12`."""
    max_iterations: int = 600
    initial: Any = None
    system: str = "auto"
    """Condensed: Newton's matrices, "dense" on the unknowns of the contact, "sparse" in all unknowns, or "auto", the
    one with fewer operations: `system = "sparse"`."""

    def __post_init__(self) -> None:
        from solvers.basics.checks import fraction, one_of, whole_number

        fraction("gap", self.gap)
        whole_number("max_iterations", self.max_iterations)
        if self.initial is not None:
            from solvers.solution import Start

            if not isinstance(self.initial, Start):
                remedy = "the condensed method starts from a result on the same mesh, not from a pressure: give that"
                raise InputError("initial", type(self.initial).__name__, remedy)
        one_of("system", self.system, ("auto", "dense", "sparse"))


@dataclass(frozen=True, kw_only=True)
class FixedPointOptions:
    """Options of the fixed point; `initial` is a `Start`, or the pressure s (m,) ≥ 0; by default the bonded one.

    By default at most 100 outer iterations.
    """

    variant: str = "anderson"
    """Fixed point: "anderson", "damped" s + θ (g − s), or "plain" s ← g: `variant = "damped"`."""
    damping: float = 0.5
    """Fixed point: θ of "damped" and mixing β of "anderson", above 0, at most 1: `damping = 0.2`."""
    memory: int = 5
    """Fixed point: earlier iterations that "anderson" uses: `memory = 10`."""
    max_iterations: int = 100
    initial: Any = None
    inner_tolerance: float | None = None
    """Fixed point: tolerance of the inner solver; 1e-4 × tolerance by default, between 1e-12 and 1e-6: `inner_tolerance
    = 1e-12`."""
    patience: int = 15
    """Fixed point: iterations without progress before it counts as stalled: `patience = 30`."""
    form: str = "auto"
    """Fixed point: unknowns of the inner problems, "auto", "full" or "condensed": `form = "full"`."""
    inner_options: Mapping[str, Any] | None = None
    """Settings of the inner solver by its own names, in place of `inner_tolerance`. Some back ends ignore names that
    they do not know."""

    def __post_init__(self) -> None:
        from solvers.basics.checks import finite_number, fraction, mapping, one_of, whole_number

        one_of("variant", self.variant, ("plain", "damped", "anderson"))
        one_of("form", self.form, ("auto", "full", "condensed"))
        if not 0 < finite_number("damping", self.damping) <= 1:
            raise InputError("damping", self.damping, "give a number in (0, 1]")
        for name in ("memory", "max_iterations", "patience"):
            whole_number(name, getattr(self, name))
        mapping("inner_options", self.inner_options, "settings by name", optional=True)
        if self.inner_tolerance is not None:
            fraction("inner_tolerance", self.inner_tolerance)


@dataclass(frozen=True, kw_only=True)
class UzawaOptions:
    """Options of the Uzawa procedure; by default at most 100 000 iterations."""

    rule: str = "accumulating"
    """Uzawa: "accumulating", or "printed" as in the paper, see `solvers.uzawa`: `rule = "printed"`."""
    omega_T: float = 0.01  # noqa: N815  # the letter of the paper
    """Uzawa: step of the tangential multiplier, a displacement (dimensionless): `omega_T = 0.001`."""
    omega_N: float | None = None  # noqa: N815
    """Uzawa: step of the normal multiplier, displacement per stress; 1 / the spectral radius of N K⁻¹ Nᵀ W by default:
    `omega_N = 0.5`."""
    step_decay: float | None = None
    """Uzawa: iterations k₀ in which the step halves, ω_T 2^(−i / k₀); constant by default: `step_decay = 200.0`."""
    max_iterations: int = 100_000
    iterations: int | None = None
    """Uzawa: exact number of iterations, without any test (30 in the paper): `iterations = 30`."""

    def __post_init__(self) -> None:
        from solvers.basics.checks import one_of, positive_number, whole_number

        one_of("rule", self.rule, ("printed", "accumulating"))
        positive_number("omega_T", self.omega_T)
        whole_number("max_iterations", self.max_iterations)
        for name in ("omega_N", "step_decay", "iterations"):
            if getattr(self, name) is not None:
                (whole_number if name == "iterations" else positive_number)(name, getattr(self, name))


@dataclass(frozen=True, kw_only=True)
class PivotingOptions:
    """Options of pivoting: `max_iterations` limits the vertices along a direction, one for each guess of the signs."""

    max_iterations: int = 1000

    def __post_init__(self) -> None:
        from solvers.basics.checks import whole_number

        whole_number("max_iterations", self.max_iterations)


OPTIONS: Final[Mapping[str, Any]] = {
    "condensed": CondensedOptions, "fixed-point": FixedPointOptions, "pivoting": PivotingOptions, "uzawa": UzawaOptions,
}  # fmt: skip
METHODS: Final = tuple(OPTIONS)

Options = TypeVar("Options", CondensedOptions, FixedPointOptions, UzawaOptions, PivotingOptions)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a solve.

    Raises
    ------
    InputError
        If a field or an option is wrong.
    SolverUnavailableError
        If method, inner solver or factorisation is unknown or not installed.

    Notes
    -----
    "condensed" solves the inequality directly, by an interior point method on the unknowns of the contact.
    "fixed-point" iterates on the friction bound, with convex inner problems. "pivoting" goes from vertex to vertex, for
    small contacts. "uzawa" is the paper's iteration (4.1)-(4.4). By default contacts of up to 200 points are solved by
    "pivoting", larger ones, and those where it fails, by "condensed". If that fails too, "pivoting" follows on 201 to
    800 points, and "fixed-point" on up to 250. Each may take as long as the condensed method, or 15 seconds if that is
    more. An inner solver, or options that only one method has, choose that method.

    Inner solvers are "qp:" and a name of qpsolvers, "direct:clarabel", or "socp:" and a name of cvxpy;
    `solvers.available()` lists the installed ones. Factorisations are "pardiso", "multifrontal" and "dense"; "auto"
    takes "dense" for up to 400 unknowns, else the first of the others that is installed.

    After `time_limit` the best state so far is returned, with the status "time_limit" unless its certificate passes.
    Methods check the time in every iteration, and pass it on to inner solvers that accept a limit. A factorisation, or
    an inner solver without a limit, is not interrupted. A large factorisation is not begun after the limit.

    """

    method: str | None = None
    """condensed, fixed-point, pivoting or uzawa; by default pivoting on small contacts, else condensed: `method =
    "fixed-point"`."""
    inner: str | None = None
    """Inner solver of the fixed point, see `qvi-contact methods`; qp:clarabel by default: `inner =
    "direct:clarabel"`."""
    tolerance: float = 1e-8
    """Accuracy that the certificate must confirm, dimensionless: `tolerance = 1e-9`."""
    factorisation: str = "auto"
    """Factorisation, see `qvi-contact methods`: `factorisation = "multifrontal"`."""
    threads: int | None = None
    """Threads of factorisations and dense linear algebra; one for small problems by default, else all cores: `threads =
    2`."""
    time_limit: float | None = None
    """Seconds for the whole computation: all steps or values, methods, retries and inner problems; no limit by default:
    `time_limit = 60.0`."""
    verbose: bool = False
    """Print a header, a line for each iteration, step or value, and a footer with status and times."""
    throw: bool = False
    """Raise `SolveError` if a solve does not end with the status "solved"."""
    callback: Callable[[Any], object] | None = None
    """Called with every `solvers.Iteration` of any method. Histories, sweeps and refinement have another one."""
    initial: Any = field(default=None, hash=False)
    """Start of pivoting, the condensed method and the fixed point; it chooses no method. `solve_qvi` takes the
    `QVISolution` of a problem with the same unknowns and rows, or a pressure (m,) for the fixed point. The condensed
    method decides after two iterations whether the state is near enough; if not, it takes the usual start."""
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Options of the method, by name: fields of `CondensedOptions`, `FixedPointOptions`, `PivotingOptions` or
    `UzawaOptions`. If no method is chosen, `max_iterations` limits the sum over condensed method and fixed point."""

    def __post_init__(self) -> None:
        from solvers.basics.checks import fraction, function_or_none, mapping, true_or_false
        from solvers.basics.progress import checked_limit
        from solvers.factorisation.choice import Request
        from solvers.inner.registry import check_name

        mapping("options", self.options, "options by name")
        if self.method is not None and not (isinstance(self.method, str) and self.method in METHODS):
            raise SolverUnavailableError("method", self.method, f"choose one of {', '.join(METHODS)}")
        if self.inner is not None:
            check_name(self.inner)
        fraction("tolerance", self.tolerance)
        function_or_none("callback", self.callback)
        for name in ("throw", "verbose"):
            true_or_false(name, getattr(self, name))
        checked_limit(self.time_limit)
        Request.checked(self.factorisation, self.threads)
        kind, given = OPTIONS[self.chosen], dict(self.options)
        if self.initial is not None and not self.takes_state:
            given["initial"] = self.initial  # is refused below; methods that take it check it with the problem
        if self.inner is not None and self.chosen != "fixed-point":
            given["inner"] = self.inner
        names = list(kind.__dataclass_fields__)
        for name, value in given.items():
            if name not in names:
                listed = f"method {self.chosen!r} has the options {', '.join(names)}"
                known = [*names, *self.__dataclass_fields__.keys() - {name}]
                raise InputError(name, value, nearest_first(name, known, listed))
        kind(**given)

    @classmethod
    def of(cls, settings: Self | None, changes: Mapping[str, Any]) -> Self:
        """The given settings, or the default ones, with changes of fields and of options of the method; checked."""
        if settings is not None and not isinstance(settings, cls):
            raise InputError("settings", settings, "give Settings, or their fields by name, such as method='uzawa'")
        if settings is not None and not changes:
            return settings
        from solvers.basics.checks import mapping

        fields, options = dict[str, Any](), dict[str, Any]({} if settings is None else settings.options)
        for name, value in changes.items():
            (fields if name in cls.__dataclass_fields__ else options)[name] = value
        options.update(mapping("options", fields.pop("options", {}), "options by name"))
        return cls(**fields, options=options) if settings is None else replace(settings, **fields, options=options)

    @cached_property
    def chosen(self) -> str:
        """The method: the one asked for, else the first of those that have the most of the given options."""
        if self.method is not None:
            return self.method
        if self.inner is not None:
            return "fixed-point"
        if not self.options:
            return METHODS[0]
        given = set(self.options)
        return max(OPTIONS, key=lambda method: len(given & OPTIONS[method].__dataclass_fields__.keys()))

    @property
    def by_default(self) -> bool:
        """Whether no method was asked for, so that other methods may follow."""
        return self.method is None and self.chosen == METHODS[0]

    @property
    def takes_state(self) -> bool:
        """Whether the method takes `initial`."""
        return self.chosen in STARTED
