"""What every reader returns: observations, given edges and clusters, and the issues it met on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from erag.core.types import EdgeKind, Frame, Observation, Range


@dataclass(frozen=True, slots=True)
class Issue:
    """Something in a source that could not be used as it is: where it stands (file:row), what it is, what was done."""

    where: str
    what: str
    action: str


@dataclass(frozen=True, slots=True)
class GivenEdge:
    """An edge the source states, between node ids; `metres` None means that the map measures it."""

    a: str
    b: str
    kind: EdgeKind
    metres: float | None = None


@dataclass(frozen=True, slots=True)
class GivenCluster:
    """A cluster the source states (`erag build --forest given`); `members` are ids of nodes or of other clusters."""

    id: str
    level: int
    members: tuple[str, ...]
    name: str = ""
    summary: str = ""
    relationships: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reading:
    """One source, read: everything usable in the order of the file, and every issue.

    `root` is the folder image paths are relative to; `sensors` the declared range of each channel; `notes` are facts
    about the frame that a user should know (for example that z points down).
    """

    source: str
    root: Path
    frame: Frame
    observations: tuple[Observation, ...]
    edges: tuple[GivenEdge, ...] = ()
    clusters: tuple[GivenCluster, ...] = ()
    sensors: Mapping[str, Range] = field(default_factory=dict)
    issues: tuple[Issue, ...] = ()
    notes: tuple[str, ...] = ()


class Reader(Protocol):
    """A file format. Readers never evaluate what they read, and keep all that is usable of a damaged source."""

    kind: str

    def sniff(self, path: Path) -> bool:
        """Whether `path` looks like this format; reads at most a few kilobytes."""
        ...

    def read(self, path: Path) -> Reading:
        """Read the whole source. Raises InputError only when nothing of it can be used."""
        ...
