"""Edges by name, alike for every kind of mesh."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from qvi_contact.basics.checks import IntArray
from qvi_contact.mesh.edges import Edges
from solvers.basics.names import known_name

_Edges = TypeVar("_Edges", bound=Edges)


class NamedEdges(ABC, Generic[_Edges]):
    """A mesh that knows the indices of its named edges."""

    @property
    @abstractmethod
    def boundary(self) -> _Edges:
        """All edges of the boundary."""

    @property
    @abstractmethod
    def interior(self) -> _Edges:
        """All edges between two cells of the body."""

    @property
    @abstractmethod
    def edge_names(self) -> tuple[str, ...]:
        """Names of parts of the boundary, those that `edge_set` knows."""

    @property
    @abstractmethod
    def joint_names(self) -> tuple[str, ...]:
        """Names of joints, those that `joint_set` knows."""

    @property
    @abstractmethod
    def _sets(self) -> Mapping[str, IntArray]:
        """Indices into `boundary`, of a joint into `interior`, by name."""

    def edge_set(self, name: str) -> IntArray:
        """Indices into `boundary` of the edges called `name`."""
        return self._sets[known_name("edges", name, {"edge sets": self.edge_names}, "add it by with_edges()")]

    def joint_set(self, name: str) -> IntArray:
        """Indices into `interior` of the joint called `name`."""
        return self._sets[known_name("joint", name, {"joints": self.joint_names}, "add it by with_joint()")]

    def edges(self, name: str) -> _Edges:
        """The edges called `name`, on the boundary or in a joint."""
        if isinstance(name, str) and name in self._taken:
            return self._taken[name]
        known = {"edge sets": self.edge_names, "joints": self.joint_names}
        if known_name("edges", name, known, "add it by with_edges() or with_joint()") in self.joint_names:
            found = self.interior.take(self.joint_set(name))
        else:
            found = self.boundary.take(self.edge_set(name))
        for part in vars(found).values():
            if isinstance(part, np.ndarray):
                part.setflags(write=False)  # all who ask share it
        return self._taken.setdefault(name, found)

    @cached_property
    def _taken(self) -> dict[str, _Edges]:
        """Those asked for so far: a problem asks for the same ones tens of times."""
        return {}
