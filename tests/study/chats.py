"""Made-up decisions in the form of the authors' fine-tuning data: a need and the thing that meets it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping


def chat(query: str, things: Iterable[str], answer: str, summary: str = "") -> str:
    """A line: a question, the cards of `things`, each with a `summary` of its `{}`, and the ID of the card chosen."""
    said = f"\n   Summary: {summary}" if summary else ""
    cards = (
        f"{number}. Location Details:\n   ID: {thing}_{number}\n   Name: {thing}_zone{said.format(thing)}\n   ---"
        for number, thing in enumerate(things, 1)
    )
    shown = "\n\n".join(cards)
    asked = f"Query: {query}\nContext: Available Locations for Selection:\n\n{shown}\nInstruction: Choose."
    return json.dumps({"messages": [{"role": "user", "content": asked}, {"role": "assistant", "content": answer}]})


def told(
    met: Mapping[str, str], sets: Iterable[tuple[str, ...]], saying: Iterable[str], summary: str = ""
) -> Iterator[str]:
    """A line for each set of things that holds what meets a need, each need, and each way of saying it."""
    ways = list(saying)
    for things in sets:
        for need, thing in met.items():
            if thing in things:
                answer = f"{thing}_{things.index(thing) + 1}"
                yield from (chat(say.format(need), things, answer, summary) for say in ways)
