"""First hits of queries with conditions (near, away from, not), with the reader of conditions and without.

python scripts/conditions.py [--half look | measure] [--preset tiny] [--memory M.erag] [--set path=value] [--each]

The queries are those of the sample, erag/data/sample/conditions.jsonl: one half was looked at while the reader was
written, the other is for measuring. Prints P@1 with 95 % bootstrap intervals, and that of the paired difference.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from erag.core.errors import EragError
from erag.data.contract import parse_query, read_queries
from erag.data.sample import sample_conditions, sample_dir
from erag.evaluate.statistics import bootstrap, paired_bootstrap
from erag.lm.weights import default_store
from erag.memory.file import MemoryFile
from erag.pipeline.build import build
from erag.pipeline.config import load_config
from erag.pipeline.ingest import ingest
from erag.pipeline.query import Asker

RETRIEVER = "retrieve.retriever={kind: relevance}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--half", choices=("look", "measure"), default="look")
    parser.add_argument("--preset", default="tiny")
    parser.add_argument("--memory", type=Path, default=Path("experiments/conditions.erag"))
    parser.add_argument("--set", dest="overrides", action="append", default=[RETRIEVER])
    parser.add_argument("--each", action="store_true", help="print the first hits of every query")
    args = parser.parse_args()
    config = load_config(args.preset, None, (*args.overrides, "answer.explain=quotes"))
    _built(args.memory, args.preset)
    lines = list(read_queries(sample_conditions(), {"half": args.half}))
    right: dict[bool, list[float]] = {}
    for read in (False, True):
        retrieve = config.retrieve.model_copy(update={"conditions": read})
        asker = Asker(args.memory, config.model_copy(update={"retrieve": retrieve}), default_store())
        right[read] = []
        for line in lines:
            raw, result = line.raw or {}, asker.ask(parse_query(line, 5, asker.ground))
            right[read].append(float(bool(result.hits) and result.hits[0].node in raw["relevant"]))
            if args.each:
                hits = [[hit.node, round(hit.score, 3)] for hit in result.hits[:3]]
                print(json.dumps([line.id, read, right[read][-1], raw["query"], hits, result.notes]))
        print(
            f"{args.half}, {len(lines)} queries, conditions {'read' if read else 'not read'}: {bootstrap(right[read])}"
        )
    print(f"difference: {paired_bootstrap(right[True], right[False])}")


def _built(path: Path, preset: str) -> None:
    """Make the memory of the sample where there is none: embeddings alone."""
    if path.is_file():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    only = load_config(
        preset,
        None,
        (
            "backend.roles={embed: minilm}",
            "retrieve.retriever={kind: fusion}",
            "answer.explain=quotes",
            "retrieve.expand=null",
        ),
    )
    ingest(sample_dir(), path)
    with MemoryFile.writing(path, "conditions") as memory:
        build(memory, only, default_store())


if __name__ == "__main__":
    try:
        main()
    except EragError as error:
        raise SystemExit(error.line()) from error
