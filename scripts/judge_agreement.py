"""How far the judges that need no language model agree with the labels of a data set, alone and as a panel.

python scripts/judge_agreement.py sample
python scripts/judge_agreement.py cmu_500 --root FOLDER --queries Q.jsonl --kind explicit
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from erag.evaluate.dataset import Environment
from erag.evaluate.datasets.catalogue import load_dataset
from erag.evaluate.judges.agreement import TOP, Agreement, panel_agreement
from erag.evaluate.judges.calibration import cross_calibrated
from erag.evaluate.judges.embedding import EmbeddingJudge
from erag.evaluate.judges.expanded import ExpandedJudge
from erag.evaluate.judges.labels import LabelJudge
from erag.evaluate.judges.lexical import LexicalJudge
from erag.evaluate.judges.pairs import LabelledPairs, labelled_pairs
from erag.evaluate.judges.protocol import Judge, Panel, Votes
from erag.lm.config import BackendConfig, build_backend
from erag.lm.roles import LMBackend
from erag.lm.weights import default_store
from erag.pipeline.query import Asker
from erag.pipeline.session import open_memory


def asker_of(environment: Environment, folder: Path, retriever: str) -> Asker:
    """A memory of the environment, made in `folder` or found there."""
    overrides = [f"retrieve.retriever={{kind: {retriever}}}"]
    memory = open_memory(folder / f"{environment.name}.erag", overrides=overrides)
    memory.ingest(environment.source, environment.reader)
    memory.build()
    return memory.asker


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("--root", type=Path)
    parser.add_argument("--queries", type=Path)
    parser.add_argument("--kind", help="only questions of this kind")
    parser.add_argument("--expand", action="store_true", help="ask judges by the questions' targets, too")
    parser.add_argument("--retriever", default="fusion", help="whose ranking has the top 50")
    parser.add_argument("--memories", type=Path, default=Path("experiments/judges"))
    options = parser.parse_args()
    options.memories.mkdir(parents=True, exist_ok=True)
    backend = build_backend(BackendConfig(), default_store())
    for environment in load_dataset(options.dataset, options.root, options.queries).environments:
        wanted = tuple(q for q in environment.questions if q.relevant and options.kind in (None, q.kind))
        kept = replace(environment, questions=wanted)
        asker = asker_of(kept, options.memories, options.retriever)
        tried = tried_pairs(kept, asker)
        votes = voted(kept, tried, backend, options.expand)
        print(f"{kept.name}: {len(wanted)} questions, {len(asker.corpus.topomap)} nodes")
        for found in panel_agreement(votes, tried.labels, tried.queries, tried.places, TOP):
            print(f"    {found.line()}")
        print(f"  calibrated on the top {TOP} of other questions")
        for found in calibrated(votes, tried):
            print(f"    {found.line()}")


def tried_pairs(environment: Environment, asker: Asker) -> LabelledPairs:
    """Every question with every node that can be found; the ranking is by the text alone."""
    lines = (replace(q.line, raw={"id": q.id, "query": q.text}) for q in environment.questions)
    rankings = {r.id: [h.node for h in r.hits] for r in asker.ask_lines(lines, TOP)}
    rows = asker.corpus.topomap.row
    return labelled_pairs(environment, [n for n in rows if asker.corpus.searchable[rows[n]]], rankings)


def voted(environment: Environment, tried: LabelledPairs, backend: LMBackend, expand: bool) -> Votes:
    """The votes of the judges that have anything to say about these pairs."""
    truths = list(environment.truths.by_node.values())
    embedding = EmbeddingJudge("minilm-l6", backend, frozenset({backend.identity("embed")}))
    labels = LabelJudge.over(o for t in truths for o in t.objects or ())
    readers: list[Judge] = [LexicalJudge.over(truths), embedding]
    readers = [ExpandedJudge(judge) for judge in readers] if expand else readers
    votes = Panel((*readers, labels)).vote(tried.pairs)
    cast = [i for i in range(len(votes.judges)) if not np.isnan(votes.values[:, i]).all()]
    return Votes(tuple(votes.judges[i] for i in cast), tuple(votes.models[i] for i in cast), votes.values[:, cast])


def calibrated(votes: Votes, tried: LabelledPairs) -> list[Agreement]:
    """Agreement over the head of the rankings, scaled on the heads of other questions: pairs as they are judged."""
    head = np.flatnonzero(tried.places <= TOP)
    queries, labels = [tried.queries[i] for i in head], tried.labels[head]
    columns = [cross_calibrated(votes.values[head, i], labels, queries) for i in range(len(votes.judges))]
    scaled = replace(votes, values=np.stack(columns, axis=1))
    found = panel_agreement(scaled, labels, queries, tried.places[head], TOP)
    return [one for one in found if one.over != "all"]


if __name__ == "__main__":
    main()
