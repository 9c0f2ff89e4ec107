"""Polynomials and expressions: they say what numpy says, and nothing dangerous is let in."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qvi_contact import InputError, TriangleMesh, solve
from qvi_contact.basics import evaluate
from qvi_contact.problem import Contact, ContactProblem, Expression, Material, Polynomial, Symmetry, Traction
from tests.cases import refusal

POINTS = np.random.default_rng(0).uniform(0.1, 2.0, (2, 3, 4))


class TestPolynomial:
    """Sums of powers."""

    @settings(max_examples=30, deadline=None, derandomize=True)
    @given(st.lists(st.lists(st.integers(-9, 9), min_size=0, max_size=4), min_size=1, max_size=4).filter(any))
    def test_values(self, coefficients):
        """Σ c_ij xⁱ yʲ, term by term."""
        x, y = POINTS
        expected = sum(c * x**i * y**j for i, row in enumerate(coefficients) for j, c in enumerate(row))
        found = Polynomial(coefficients)(*POINTS)
        assert found.shape == x.shape
        assert found == pytest.approx(np.broadcast_to(expected, found.shape), rel=1e-12, abs=1e-10)

    def test_bad_coefficients(self):
        for bad in ([], [[]], [[], []], [[float("nan")]], [[float("inf")]], [["a"]], 3, [1, 2], None, [[None]]):
            with pytest.raises(InputError, match="Polynomial"):
                Polynomial(bad)


NAMES = {"x": POINTS[0], "y": POINTS[1], "t": 0.7, "pi": np.pi, "a": 2.5}
FUNCTIONS = {
    "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "exp": np.exp, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "arctan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "log": np.log, "hypot": np.hypot,
    "min": np.minimum, "max": np.maximum, "where": np.where, "arcsin": np.arcsin, "arccos": np.arccos,
}  # fmt: skip


def trusted(text):
    """What Python and numpy make of it."""
    with np.errstate(all="ignore"):
        return eval(text, {"__builtins__": {}}, {**FUNCTIONS, **NAMES})


EXPRESSIONS = [
    "1e6 * where(x < 0.5, x, 0.5) * sin(pi * t)", "-x**2 + 3*x*y - y/2", "2**-x", "-x**-y**0.5",
    "min(x, y) + max(x, a) - hypot(x, y)", "where(x >= y, where(y > 1, 1, 2), (x <= 1) * -1.0)",
    "arcsin(x/4) + arccos(y/4) + arctan(x) - log(x) * exp(-y)", "where(0 < t <= 0.7, x, y) + (a > t > 1)", "+x - -y",
    "(((x)))", "7", "1_000 * .5e-2", "abs(-x) + sign(y - 1) + sqrt(x) + tan(x/3) + sinh(x) + cosh(y) + tanh(a*t)",
    " \n x \n ",
]  # fmt: skip


class TestExpression:
    """Values are those of numpy, and nothing but arithmetic is let in."""

    @pytest.mark.parametrize("text", EXPRESSIONS)
    def test_values(self, text):
        points = POINTS.copy()
        found = Expression(text, {"a": 2.5}, 0.7)(*points)
        assert found.shape == POINTS[0].shape
        assert found == pytest.approx(np.broadcast_to(trusted(text.strip()), found.shape), rel=1e-14)
        found[...] = 0.0
        assert (points == POINTS).all()  # they are left alone

    def test_truths_are_numbers(self):
        """Of which numpy would make a truth again by +, and numbers of few digits by functions."""
        x, y = POINTS
        less, more = (x < 1.0).astype(float), (x + y < 2.0).astype(float)
        assert (Expression("(x < 1) + (x + y < 2) - (0 < 1)")(x, y) == less + more - 1.0).all()
        assert (Expression("exp(x < 1) + hypot(x < 1, x + y < 2)")(x, y) == np.exp(less) + np.hypot(less, more)).all()

    def test_constants_are_those_of_before(self):
        constants = {"a": np.int8(2)}
        expression = Expression("a * x", constants)
        constants["a"] = 3.0
        assert (expression(*POINTS) == 2.0 * POINTS[0]).all()
        same = Contact("top", 0.1, gap=Expression("a * x", {"a": 2.0}))
        assert {Contact("top", 0.1, gap=expression): 1}[same] == 1

    def test_time(self):
        load = Expression("x * t")
        assert load.names == {"x", "t"}
        assert Expression("sin(pi * x)").names == {"sin", "pi", "x"}
        assert Expression("x * t", t=3.0)(np.array([2.0]), np.array([0.0])) == [6.0]
        assert load(np.array([2.0]), np.array([0.0])) == [0.0]

    @pytest.mark.parametrize("text", ["0.3 - 0.1 * x", "0.3 - 0.1 * t", "-0.1 * x + 0.3", "0.1 + 0.2 - 0.1 * x"])
    def test_a_sum_that_is_rounding_is_zero(self, text):
        """Alone, its size shows nothing: −5.6e-17 was refused as friction below 0."""
        assert Expression(text, t=3.0)(np.array([3.0]), np.array([0.0])) == [0.0]
        assert Expression(text, t=2.0)(np.array([2.0]), np.array([0.0])) == pytest.approx([0.1])

    def test_below_zero_by_the_rounding_of_a_place_is_zero(self):
        """On a line at y = −1e-17 all values of y are below 0. −1e-3 is refused, also at the end of a domain."""
        x, y = np.arange(2.0), np.full(2, -1e-17)
        assert not evaluate("friction", lambda _, y: 0.3 * y, x, y, minimum=0.0).any()
        for field in (lambda _, y: 0.3 * y, lambda x, y: 0.3 * y + np.log(x <= 1.0)):
            assert "at least 0" in refusal(lambda at=field: evaluate("friction", at, x, y - 1e-3, minimum=0.0)).remedy

    def test_integers_are_numbers(self):
        """No exact arithmetic of whole numbers, which has no limit; overflow is infinity."""
        assert (Expression("2**53 + 1 - 2**53")(*POINTS) == 0.0).all()
        assert np.isinf(Expression("9**9**9")(np.array([1.0]), np.array([1.0]))).all()
        assert np.isinf(Expression("(9**9**9)**9**9 * x")(np.array([1.0]), np.array([1.0]))).all()

    @pytest.mark.parametrize("text", ["1/(x-x)", "1/(x-x) + 1", "log(-x)", "exp(1e4)", "0/0*x", "9**9**9"])
    def test_what_is_not_finite_is_refused_where_it_is_used(self, text):
        conditions = [Contact("bottom", 0.1), Symmetry("left"), Traction("right", 0.0, 0.0)]
        conditions.append(Traction("top", 0.0, Expression(text)))
        problem = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(1.0, 0.3), conditions)
        with pytest.raises(InputError, match=r"Traction\.y.*finite"):
            solve(problem)


DANGEROUS = [
    "__import__('os').system('true')", "().__class__", "x.__class__", "x.shape", "x.tofile('f')", "sin.__self__",
    "x[0]", "(1, 2)", "[1]", "{1: 2}", "{1}", "lambda: 1", "(lambda: 1)()", "[i for i in (1,)]", "sum(x for x in y)",
    "'a'", "b'a'", "f'{x}'", "True", "None", "...", "1j", "x if x else y", "x and y", "not x", "x == y", "x != y",
    "x is y", "x in y", "x // 2", "x % 2", "x @ y", "x << 1", "~1", "x & y", "x | y", "x ^ y", "x := 1", "(x := 1)",
    "open('f')", "eval('1')", "exec('1')", "print(x)", "getattr(x, 'y')", "np.sin(x)", "math.sin(x)", "rand()",
    "randint(3)", "int(x)", "float(x)", "str(x)", "globals()", "x; y", "import os", "x = 1", "sin(x=1)",
    "sin(x, out=y)", "hypot(x, y, out=x)", "sin(*y)", "sin(**y)", "sin()(x)", "(sin)(x)(y)", "where(x)(y)", "z", "X",
    "__builtins__", "__doc__", "_", "await x", "yield x", "", "   ", "x +", "1 2", "\x00", "x\ny", "#", "sin",
    "x + sin", "sin * 2", "sin < 1", "min", "where(sin, 1, 2)",
    "q" * 1000, f"{'q' * 1000}(x)", f"({'+'.join(['x'] * 500)})[0]",
]  # fmt: skip


class TestRefused:
    """Texts that are no formulas, in one line."""

    @pytest.mark.parametrize("text", DANGEROUS)
    def test_dangerous_or_meaningless(self, text):
        with warnings.catch_warnings(action="error"):
            message = str(refusal(Expression, text))
        assert len(message) < 400
        assert {"x == y": "by < <=", "x and y": "write min(", "x ^ y": "**"}.get(text, "") in message

    def test_number_of_arguments(self):
        """One more would be taken by numpy for the array to write the result to: into x itself."""
        x = np.array([0.5, 0.25])
        for function in FUNCTIONS:
            wanted = {"hypot": 2, "min": 2, "max": 2, "where": 3}.get(function, 1)
            for count in range(5):
                text = f"{function}({', '.join(['x'] * count)})"
                if count == wanted:
                    assert np.isfinite(Expression(text)(x, x)).all()
                    text = f"{text[:-1]}, out=y)"
                with pytest.raises(InputError, match=f"{function} takes {wanted} argument"):
                    Expression(text)
        assert (x == [0.5, 0.25]).all()

    def test_bad_constants(self):
        for bad in ({"x": 1.0}, {"pi": 3.0}, {"sin": 1.0}, {"a": float("nan")}, {"a": "1"}, {"t": 0.0}):
            with pytest.raises(InputError, match="constants"):
                Expression("x", bad)

    @pytest.mark.parametrize(
        "text", [3, None, b"x", "x" * 2001, "(" * 500 + "x" + ")" * 500, "-" * 1999 + "x", "+".join("x" * 1000)]
    )
    def test_no_text_or_too_long(self, text):
        """Deep nesting does not break the parser either; what is merely long is computed."""
        try:
            found = Expression(text)(np.array([1.0]), np.array([1.0]))
        except InputError:
            return
        assert np.isfinite(found).all()

    @settings(max_examples=150, deadline=None, derandomize=True)
    @given(st.text(alphabet="xyt()+-*/.,0159eE_[]{}<>= '\"\\:sinwhere%@&|~\n", max_size=40))
    def test_noise(self, text):
        """An expression, or one line of complaint: never another exception, nor a warning."""
        complaint = ""
        with warnings.catch_warnings(action="error"):
            try:
                Expression(text)(*POINTS)
            except InputError as error:
                complaint = str(error)
        assert "\n" not in complaint
