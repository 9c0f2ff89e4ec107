"""Print the lowest versions that `pyproject.toml` allows, as constraints for pip.

``python .ci/lowest.py EXTRA`` prints one line ``name==version`` for each requirement of the package and of the extra,
including those of the package's own extras that it names.
"""

import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement

PROJECT = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def _requirements(extra: str) -> Iterator[Requirement]:
    """All that an extra asks for, where another extra of the package stands for what that one asks for."""
    for requirement in map(Requirement, PROJECT["optional-dependencies"][extra]):
        if requirement.name == PROJECT["name"]:
            for other in requirement.extras:
                yield from _requirements(other)
        else:
            yield requirement


def _lowest(requirement: Requirement) -> str:
    """The constraint; ValueError for a requirement that does not have exactly one lower bound."""
    (bound,) = (each.version for each in requirement.specifier if each.operator == ">=")
    marker = f"; {requirement.marker}" if requirement.marker else ""
    return f"{requirement.name}=={bound}{marker}"


if __name__ == "__main__":
    wanted = [*map(Requirement, PROJECT["dependencies"]), *_requirements(sys.argv[1])]
    print(*sorted(set(map(_lowest, wanted))), sep="\n")
