"""What is known of the world at a node, apart from any system: objects in view, reference captions, the image."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

VISIBLE = 0.01  # share of the image from which on an object counts as seen


@dataclass(frozen=True, slots=True)
class SeenObject:
    """An object in view: its class as words, and the share of the image it fills (1 where the node is the object).

    `look` says how it looks (`brown metal`), `sign` what is written on it.
    """

    name: str
    area: float = 1.0
    look: str = ""
    sign: str = ""

    def __post_init__(self) -> None:
        if not 0 <= self.area <= 1:
            raise ValueError(f"the area of {self.name!r} must lie in [0, 1], got {self.area}")

    @property
    def words(self) -> str:
        """The object in words."""
        return " ".join(part for part in (self.look, self.name, f'reading "{self.sign}"' if self.sign else "") if part)


@dataclass(frozen=True, slots=True)
class NodeTruth:
    """The ground truth of one node. `objects` is None where nobody listed them, empty where nothing is seen.

    `captions` are reference captions (by people, the simulator or a captioner apart from the run), `place` the kind of
    place and `attributes` what else holds of the view (weather, light, state), `image` a file.
    """

    node: str
    objects: tuple[SeenObject, ...] | None = None
    captions: tuple[str, ...] = ()
    place: str = ""
    attributes: tuple[str, ...] = ()
    image: Path | None = None

    @property
    def caption(self) -> str:
        """The reference captions in one text."""
        return " ".join(self.captions)

    @property
    def texts(self) -> tuple[str, ...]:
        """The truth as texts: the captions, then the listed objects, place and attributes as one sentence."""
        said = ", ".join(self.parts)
        return (*self.captions, *((f"{said}.",) if said else ()))

    @property
    def parts(self) -> tuple[str, ...]:
        """What is listed besides captions: the place, every kind of object seen, the attributes."""
        listed = [self.place, *dict.fromkeys(seen.words for seen in self.seen), *self.attributes]
        return tuple(part for part in listed if part)

    @property
    def seen(self) -> tuple[SeenObject, ...]:
        """The listed objects that count as seen."""
        return tuple(o for o in self.objects or () if o.area >= VISIBLE)

    @property
    def listed(self) -> NodeTruth:
        """The same without its captions where objects are listed: what nobody put into words before."""
        return self if self.objects is None else replace(self, captions=())


@dataclass(frozen=True, slots=True)
class Asked:
    """A question as judges see it; `targets` are the object classes that satisfy it, None where nobody stated them."""

    id: str
    text: str
    targets: frozenset[str] | None = None


@dataclass(frozen=True, slots=True)
class Pair:
    """A question and the world at one answer: what a judge is asked about. It never holds a system's own caption."""

    asked: Asked
    truth: NodeTruth


@dataclass(frozen=True)
class Truths:
    """The ground truth of an environment by node id; `independent` is False where it is what the memory was given."""

    by_node: Mapping[str, NodeTruth] = field(default_factory=dict)
    independent: bool = True

    def of(self, node: str) -> NodeTruth:
        """The truth of a node; an empty one, on which judges abstain, where nothing is known."""
        return self.by_node.get(node) or NodeTruth(node)

    def over(self, nodes: Iterable[str], listed: bool = False) -> Truths:
        """Those of some nodes; with `listed` without captions wherever objects are listed."""
        kept = {node: self.by_node[node] for node in nodes if node in self.by_node}
        return replace(self, by_node={n: t.listed for n, t in kept.items()} if listed else kept)
