"""The card of a student: what it is, how it was made, how good it is, where it fails."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from erag.study.config import DistilConfig
from erag.study.examples import Words
from erag.study.judging import Judged


def write_card(config: DistilConfig, words: Words, trained_on: int, size: int, figures: Mapping[str, Judged]) -> Path:
    """Write the card beside the checkpoint; where it is."""
    path = config.out.with_suffix(".md")
    parts = [_head(config, words, trained_on, size), *(_figures(name, judged) for name, judged in figures.items())]
    path.write_text("\n".join(parts), encoding="utf-8")
    return path


def _head(config: DistilConfig, words: Words, trained_on: int, size: int) -> str:
    return f"""# {config.out.stem}

The `student` captioner: a small network over frozen features of {config.backbone}, which says the objects in view and
where, their looks, the place and the light, and gives a vector that text can find.

Made by `erag distil --config configs/distil/captioner.yaml` from {trained_on} rendered images of simulated worlds
({config.training.epochs} epochs, seed {config.training.seed}). {size:,} bytes, 8-bit weights. It knows
{len(words.objects)} classes, {len(words.colours)} colours, {len(words.shapes)} shapes and {len(words.places)} places,
listed in the file's header. Licence as the project's (MIT); the backbone is Apache-2.0.

It has seen rendered worlds only: on photographs its words are guesses. An object counts as visible from
{config.least_share:.0%} of the image on.
"""


def _figures(name: str, judged: Judged) -> str:
    q = judged.quality
    lines = [
        f"## {name.capitalize()}: {q.images} images",
        "",
        "| figure | value [95 % over images] |",
        "|---|---|",
        f"| object precision | {q.precision.shown(3)} |",
        f"| object recall | {q.recall.shown(3)} |",
        f"| object F1, micro | {q.f1.shown(3)} |",
        f"| object F1, mean of classes | {q.macro_f1:.3f} |",
        f"| place named rightly | {q.place.shown(3)} |",
        *(f"| F1 in {world} | {measured.shown(3)} |" for world, measured in judged.worlds.items()),
    ]
    if judged.learnt is not None:
        share, right = judged.learnt
        lines.append(f"| place named rightly, of the kinds it has learnt ({share:.0%} of the images) | {right:.3f} |")
    if judged.offset is not None:
        lines.append(f"| median distance from the true centre, as a share of the image | {judged.offset:.3f} |")
    if judged.colours is not None:
        lines.append(
            f"| colour right, where one is said ({judged.said or 0:.2f} of those with one) | {judged.colours:.3f} |"
        )
    if judged.search:
        lines.append(f"| image found by its caption: first, in five | {judged.search[0]:.3f}, {judged.search[1]:.3f} |")
    rows = sorted(q.classes, key=lambda c: (-c.images, c.name))
    table = [f"| {c.name} | {c.images} | {c.precision:.2f} | {c.recall:.2f} | {c.f1:.2f} |" for c in rows]
    return "\n".join([*lines, "", "| class | images | precision | recall | F1 |", "|---|---|---|---|---|", *table, ""])
