"""A small world and a page taken apart: what the tests of the report share."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from erag.report.page import Page

HOSTILE = "<script>alert(1)</script><img src=http://evil.example/x.png onerror=alert(2)>\"'&amp;</script><!--"
Rows = Sequence[dict[str, Any]]
MakeMemory = Callable[..., Path]
MakePage = Callable[..., Page]


@dataclass
class Parsed(HTMLParser):
    """Elements with their attributes, and the texts that are shown, of a page."""

    elements: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    raw: dict[str, list[str]] = field(default_factory=lambda: {"script": [], "style": []})

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag in self.raw:
            self._inside = tag

    def handle_endtag(self, tag: str) -> None:
        if tag == self._inside:
            self._inside = ""

    def handle_data(self, data: str) -> None:
        (self.raw[self._inside] if self._inside else self.texts).append(data)

    def with_attribute(self, name: str, tag: str = "") -> Iterator[dict[str, str]]:
        return (a for t, a in self.elements if name in a and tag in ("", t))

    @property
    def shown(self) -> str:
        return " ".join(" ".join(self.texts).split())

    @property
    def data(self) -> dict[str, Any]:
        """What the page's script reads."""
        return json.loads(self.raw["script"][0])


def parse(html: str) -> Parsed:
    parsed = Parsed()
    parsed.feed(html)
    parsed.close()
    return parsed


def places(count: int = 12, **changes: Any) -> list[dict[str, Any]]:
    """Rows of places on a line, with captions that differ."""
    things = ("a bench under trees", "a fire hydrant", "a bicycle rack", "a glass door")
    return [
        {"id": f"p{i}", "pose": {"x": 3.0 * i, "y": float(i % 3)}, "caption": f"{things[i % 4]} number {i}", **changes}
        for i in range(count)
    ]
