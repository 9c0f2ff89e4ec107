"""The command, see the package."""

import csv
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate
from pathlib import Path
from queue import SimpleQueue
from typing import Final
from xml.etree import ElementTree

ROOT: Final = Path(__file__).resolve().parents[2]
SAMPLE: Final = Path(__file__).with_name("sample.csv")
CACHE: Final = ROOT / ".mutations"
PACKAGES: Final = ("qvi_contact", "solvers", "comparisons")
SEED: Final = 1992
COUNT: Final = 320
SECONDS: Final = 10.0  # of tests that are run for a mutation
NUMERICAL: Final = (
    "qvi_contact/bracket", "qvi_contact/companion", "qvi_contact/discretization", "qvi_contact/element",
    "qvi_contact/limit", "qvi_contact/mechanism", "qvi_contact/mesh", "qvi_contact/problem", "qvi_contact/refinement",
    "qvi_contact/solution", "solvers",
)  # fmt: skip
"""Rooms whose mutations are drawn three times as often."""
OPERATORS: Final = (
    "ReplaceBinaryOperator_Add_Sub", "ReplaceBinaryOperator_Sub_Add", "ReplaceBinaryOperator_Mul_Div",
    "ReplaceBinaryOperator_Div_Mul", "ReplaceBinaryOperator_Pow_Mul", "ReplaceBinaryOperator_FloorDiv_Mul",
    "ReplaceBinaryOperator_BitAnd_BitOr", "ReplaceComparisonOperator_Lt_LtE", "ReplaceComparisonOperator_LtE_Lt",
    "ReplaceComparisonOperator_Gt_GtE", "ReplaceComparisonOperator_GtE_Gt", "ReplaceComparisonOperator_Lt_Gt",
    "ReplaceComparisonOperator_Gt_Lt", "ReplaceComparisonOperator_Eq_NotEq", "ReplaceComparisonOperator_NotEq_Eq",
    "ReplaceComparisonOperator_Is_IsNot", "ReplaceComparisonOperator_IsNot_Is", "ReplaceUnaryOperator_Delete_USub",
    "ReplaceUnaryOperator_Delete_Not", "ReplaceUnaryOperator_Delete_Invert", "AddNot", "ReplaceTrueWithFalse",
    "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd", "ReplaceBreakWithContinue", "NumberReplacer",
    "ZeroIterationForLoop",
)  # fmt: skip

Mutation = dict[str, str]
"""file, operator, line (its text), nth (among the file's places for it with that text), mutated (the line after it)."""
Lines = Mapping[tuple[str, int], list[str]]


def main(words: list[str]) -> int:
    """Run the command that is named."""
    match words:
        case ["sample"]:
            write(sample())
        case ["renew"]:
            write(renewed())
        case ["cover"]:
            cover()
        case ["run", name]:
            run(name)
        case _:
            print("usage: python -m tests.mutations sample | renew | cover | run NAME", file=sys.stderr)
            return 2
    return 0


def sample() -> list[Mutation]:
    """Mutations by chance, those of numerical rooms weighted."""
    paths = (path.relative_to(ROOT).as_posix() for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py")))
    everything = [mutation for file in paths for mutation, _, _ in places(file)]
    chance = random.Random(SEED)
    keys = [chance.random() ** (1.0 / (3 if each["file"].startswith(NUMERICAL) else 1)) for each in everything]
    drawn = [everything[index] for index in sorted(range(len(keys)), key=keys.__getitem__, reverse=True)[:COUNT]]
    return sorted(map(with_its_line, drawn), key=lambda each: tuple(each.values()))


def with_its_line(mutation: Mutation) -> Mutation:
    """With the line as it is after the mutation."""
    lines = zip(text_of(mutation["file"]).split("\n"), mutated(mutation).split("\n"), strict=True)
    return mutation | {"mutated": next(b for a, b in lines if a != b).strip()}


def renewed() -> list[Mutation]:
    """The sample on the code as it is: a line that moved keeps its answers, for one that is gone another is drawn.

    It is drawn from the same file, from the same folder if the file is gone, or else from the package, and has no
    answers yet.
    """
    with SAMPLE.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    names = ("file", "operator", "line", "nth")
    paths = (path.relative_to(ROOT).as_posix() for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py")))
    everything = {tuple(each[name] for name in names): each for file in paths for each, _, _ in places(file)}
    left = everything.keys() - {tuple(row[name] for name in names) for row in rows}
    chance = random.Random(SEED)
    for number, row in enumerate(rows):
        if tuple(row[name] for name in names) in everything:
            continue
        package = [place for place in left if place[0].split("/")[0] == row["file"].split("/")[0]]
        near = [place for place in package if Path(place[0]).parent == Path(row["file"]).parent] or package
        same = [place for place in package if place[1:] == tuple(row[name] for name in names[1:])]
        same = [place for place in same if place in near] or same
        if len(same) == 1:
            place = same[0]
            rows[number] = row | everything[place]
        else:
            place = chance.choice(sorted([each for each in near if each[0] == row["file"]] or near))
            rows[number] = dict.fromkeys(row, "") | with_its_line(everything[place])
        left -= {place}
    return sorted(rows, key=lambda each: tuple(each[name] for name in names))


def text_of(file: str) -> str:
    return (ROOT / file).read_text(encoding="utf-8")


def places(file: str) -> Iterator[tuple[Mutation, int, int]]:
    """All mutations of a file, the number of the line of each, and which occurrence it is for Cosmic Ray."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    code = text_of(file)
    lines, nodes = code.split("\n"), list(ast_nodes(get_ast(code)))
    for name in OPERATORS:
        operator = get_operator(f"core/{name}")()
        seen: Counter[str] = Counter()
        found = (start for node in nodes for start, _ in operator.mutation_positions(node))
        for occurrence, (number, _) in enumerate(found):
            text = lines[number - 1].strip()
            yield {"file": file, "operator": name, "line": text, "nth": str(seen[text])}, number, occurrence
            seen[text] += 1


def mutated(mutation: Mutation) -> str:
    """The text of the file with the mutation; empty if there is no such place."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    names = ("operator", "line", "nth")
    for each, _, occurrence in places(mutation["file"]):
        if all(each[name] == mutation[name] for name in names):
            operator = get_operator(f"core/{mutation['operator']}")()
            return mutate_code(text_of(mutation["file"]), operator, occurrence) or ""
    return ""


def write(rows: list[Mutation]) -> None:
    """Write the sample, with what is known of it: whole, or not at all."""
    new = SAMPLE.with_suffix(".new")
    with new.open("w", encoding="utf-8", newline="") as stream:
        table = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    new.replace(SAMPLE)


def cover() -> None:
    """Run the suite, and keep which test passes which line, and how long it takes."""
    shutil.rmtree(CACHE, ignore_errors=True)
    CACHE.mkdir()
    settings = CACHE / "settings.ini"  # not coverage.…: these files are erased
    settings.write_text(f"[run]\nsource = {','.join(PACKAGES)}\nrelative_files = True\n", encoding="utf-8")
    command = [
        sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--cov", "--cov-report=",
        f"--cov-config={settings}", "--cov-context=test", f"--junit-xml={CACHE / 'junit.xml'}",
    ]  # fmt: skip
    subprocess.run(command, cwd=ROOT, env=os.environ | {"COVERAGE_FILE": str(CACHE / "coverage")}, check=False)


def covered(files: Iterable[str]) -> tuple[Lines, dict[str, float]]:
    """Tests that pass each line (file, number) of these files, the quickest first, and the seconds of each test."""
    from coverage import CoverageData

    seconds: dict[str, float] = {}
    of_file = defaultdict(list)
    for case in ElementTree.parse(CACHE / "junit.xml").iter("testcase"):
        parts = case.attrib["classname"].split(".")
        size = next((number for number, part in enumerate(parts, 1) if part.startswith("test_")), 0)
        if not size:
            sys.exit(f"{case.attrib['name']} could not be loaded, so that its tests notice nothing")
        test = "::".join(["/".join(parts[:size]) + ".py", *parts[size:], case.attrib["name"]])
        if case.find("failure") is None and case.find("error") is None and case.find("skipped") is None:
            seconds[test] = float(case.attrib["time"])
            of_file[test.partition("::")[0]].append(test)
    data = CoverageData(str(CACHE / "coverage"))
    data.read()
    lines: dict[tuple[str, int], list[str]] = {}
    for file in files:
        for number, contexts in data.contexts_by_lineno(file).items():
            tests: set[str] = set()
            for context in contexts:
                test, _, phase = context.rpartition("|")
                # what a fixture passes is passed for all tests of its file, the first of which made it
                tests.update(of_file[test.partition("::")[0]] if phase == "setup" else {test} & seconds.keys())
            lines[file, number] = sorted(tests, key=lambda test: (seconds[test], test))
    return lines, seconds


def run(name: str) -> None:
    """Try each mutation of the sample: "noticed", "not noticed", or "gone" if its line is not there.

    Each answer is written at once, and a row that has one is not tried again: a run that was ended goes on.
    """
    with SAMPLE.open(encoding="utf-8") as stream:
        rows = [row | {name: row.get(name) or ""} for row in csv.DictReader(stream)]
    left = [row for row in rows if not row[name]]
    lines, seconds = covered({row["file"] for row in left})
    workers = os.cpu_count() or 1
    copies: SimpleQueue[Path] = SimpleQueue()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        for number in range(workers):
            others = shutil.ignore_patterns(".git", ".mutations", "__pycache__", "*.egg-info")
            copies.put(shutil.copytree(ROOT, Path(folder) / str(number), ignore=others))

        def answer(row: Mutation) -> str:
            copy = copies.get()
            try:
                return tried(row, copy, lines, seconds)
            finally:
                copies.put(copy)

        for number, (row, found) in enumerate(zip(left, pool.map(answer, left), strict=True), 1):
            row[name] = found
            write(rows)
            print(f"{number}/{len(left)} {found}: {row['file']}: {row['line']} -> {row['mutated']}", flush=True)
    print(json.dumps(Counter(row[name] for row in rows)))


def tried(row: Mutation, copy: Path, lines: Lines, seconds: Mapping[str, float]) -> str:
    """Whether the tests of a copy of the repository notice a mutation."""
    file = row["file"]
    code = mutated(row) if (ROOT / file).exists() else ""
    if not code:
        return "gone"
    before = text_of(file)
    number = next(n for n, (a, b) in enumerate(zip(before.split("\n"), code.split("\n"), strict=True), 1) if a != b)
    tests = lines.get((file, number))
    if not tests:  # a line that is passed on import
        passing = {test for (name, _), some in lines.items() if name == file for test in some}
        tests = sorted(passing, key=seconds.__getitem__)
    total = accumulate(seconds[test] for test in tests)
    chosen = [test for test, until in zip(tests, total, strict=True) if until <= SECONDS] or tests[:1]
    if not chosen:
        return "not noticed"
    target = copy / file
    target.write_text(code, encoding="utf-8")
    (copy / "chosen.txt").write_text("\n".join(chosen), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", "@chosen.txt"]
    limit = round(3.0 * sum(seconds[test] for test in chosen) + 30.0)  # of processor time: the machine may be busy
    command = ["sh", "-c", f'ulimit -t {limit}; exec "$@"', "sh", *command]
    try:
        environment = os.environ | {"PYTHONPATH": str(copy)}
        done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=10 * limit, check=False)
    except subprocess.TimeoutExpired:
        return "noticed"
    finally:
        target.write_text(before, encoding="utf-8")
    return "noticed" if done.returncode else "not noticed"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
