"""First hits of the find queries of the simulated worlds, asked with all that they state, and what is refused rightly.

python scripts/held_out.py [--preset tiny] [--worlds worlds] [--split test] [--leave sensor] [--set path=value]

Memories hold the captions of the truth, positions and readings, and a forest without summaries; they are kept in
experiments/bench-memories. Prints P@1 with 95 % bootstrap intervals, by kind of query and whether it wishes for a
reading; and the share that is refused of the queries that nothing answers, asked by text alone.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from erag.bench.config import WorldsConfig
from erag.bench.worlds import LabelledWorld, labelled_worlds
from erag.core.errors import EragError
from erag.core.types import Query
from erag.data.contract import parse_query
from erag.evaluate.dataset import Question
from erag.evaluate.statistics import bootstrap
from erag.lm.weights import default_store
from erag.pipeline.config import PipelineConfig, load_config
from erag.pipeline.query import Asker, metered

EMBEDDED = PipelineConfig.model_validate(
    {"backend": {"models": {"minilm": {"kind": "sentence"}}, "roles": {"embed": "minilm"}}}
)
TEXT = {"id", "query"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="tiny")
    parser.add_argument("--worlds", type=Path, default=Path("worlds"))
    parser.add_argument("--split", choices=("train", "dev", "test"), default="test")
    parser.add_argument("--leave", action="append", default=[], choices=("sensor", "at"), help="do not say this")
    parser.add_argument("--set", dest="overrides", action="append", default=[])
    args = parser.parse_args()
    config, store = load_config(args.preset, None, args.overrides), default_store()
    models, found = metered(config, store), defaultdict[str, list[float]](list)
    for world in labelled_worlds(WorldsConfig(root=args.worlds, split=args.split), EMBEDDED, store):
        for what, value in _asked(world, Asker(world.memory, config, store, models), args.leave):
            found[what].append(value)
        print(world.name, flush=True)
    for what, values in sorted(found.items()):
        print(f"{what}: {bootstrap(values)} of {len(values)}")


def _asked(world: LabelledWorld, asker: Asker, leave: Collection[str]) -> Iterator[tuple[str, float]]:
    for question in world.of("find"):
        result = asker.ask(_query(question, asker, without=leave))
        right = bool(result.hits) and result.hits[0].node in (question.relevant or ())
        yield f"{question.kind}, P@1", float(right)
        if (question.line.raw or {}).get("sensor"):
            yield f"{question.kind} with a wish for a reading, P@1", float(right)
    for question in world.of("unanswerable"):
        answer = asker.ask(_query(question, asker, only=TEXT)).answer
        yield "unanswerable, refused", float(answer is None or answer.waypoint is None)


def _query(
    question: Question, asker: Asker, *, without: Collection[str] = (), only: Collection[str] | None = None
) -> Query:
    raw = question.line.raw or {}
    kept = {key: value for key, value in raw.items() if key not in without and (only is None or key in only)}
    return parse_query(replace(question.line, raw=kept), 5, asker.ground)


if __name__ == "__main__":
    try:
        main()
    except EragError as error:
        raise SystemExit(error.line()) from None
