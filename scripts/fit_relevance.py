"""Fit the weights of the relevance model on queries of training worlds, and say how well they do on worlds left out.

erag sim build --captions truth --no-objects --out worlds
python scripts/fit_relevance.py worlds --memories memories [--preset standard] [--write]

Each world is ingested and built once (embeddings alone). With a preset that expands queries the model for named things
is fitted as well. `--write` replaces erag/retrieve/relevance.yaml.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml

import erag.retrieve
from erag.core.errors import EragError
from erag.lm.config import build_backend
from erag.lm.journal import Journal
from erag.lm.roles import LMBackend
from erag.lm.weights import default_store
from erag.memory.file import MemoryFile
from erag.pipeline.build import build
from erag.pipeline.config import load_config
from erag.pipeline.ingest import ingest
from erag.pipeline.load import load
from erag.retrieve.expand import Expander
from erag.retrieve.relevance import SHIPPED, Evidence, EvidenceTable
from erag.retrieve.scoring import Batch, best_first
from erag.retrieve.uses import shipped_lexicon

PENALTY = 1e-2
EMBED_ONLY = ("backend.roles={embed: minilm}", "retrieve.retriever={kind: fusion}", "answer.explain=quotes")


@dataclass(frozen=True)
class Asked:
    """A query of a world with the evidence for each node (n, f) and which are right (n,)."""

    world: str
    kind: str
    text: str
    evidence: Evidence
    right: np.ndarray


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", type=Path, nargs="+", help="data sets of `erag sim build`, with captions")
    parser.add_argument("--memories", type=Path, required=True, help="where memories are kept")
    parser.add_argument("--preset", default="tiny")
    parser.add_argument("--split", default="train")
    parser.add_argument("--evaluate", default=None, help="another split to judge the weights on")
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    args.memories.mkdir(parents=True, exist_ok=True)
    with MemoryFile.writing(args.memories / "calls.erag", "fit_relevance", create=True) as calls:  # what was generated
        _study(args, calls)


def _study(args: argparse.Namespace, calls: MemoryFile) -> None:
    config = load_config(args.preset)
    backend = build_backend(config.backend, default_store())
    expand = config.retrieve.expand
    expander = Expander(Journal(backend, calls.calls), expand) if expand else None
    asked = [a for folder in args.worlds for a in _asked(folder, args.split, args.memories, backend, expander)]
    print(f"{len(asked)} queries of {len({a.world for a in asked})} worlds ({args.split})")
    held = _held_out(asked)
    _report("left-out worlds", asked, held)
    scale, shift = _calibrated(held, asked)
    weights, bias = _fit(asked)
    print(f"calibration: logit = {scale:.3f} x score {shift:+.3f}")
    if args.evaluate:
        others = [a for folder in args.worlds for a in _asked(folder, args.evaluate, args.memories, backend, expander)]
        _report(args.evaluate, others, [a.evidence.rows @ weights + bias for a in others])
    model = {
        "bias": round(float(bias * scale + shift), 4),
        "weights": {n: round(float(w * scale), 4) for n, w in zip(asked[0].evidence.names, weights, strict=True)},
    }
    print(json.dumps(model))
    if args.write:
        _write(
            "named" if expander else "plain", model, f"{len(asked)} queries of {len({a.world for a in asked})} worlds"
        )


def _asked(folder: Path, split: str, memories: Path, backend: LMBackend, expander: Expander | None) -> list[Asked]:
    found: list[Asked] = []
    lines = [json.loads(line) for line in (folder / "queries.jsonl").read_text("utf-8").splitlines()]
    wanted = [q for q in lines if q["split"] == split and q["task"] == "find" and not q.get("sensor")]
    for world in dict.fromkeys(q["environment"] for q in wanted):
        corpus = load(_memory(folder, world, memories)).corpus
        table = EvidenceTable(corpus, shipped_lexicon(backend))
        queries = [q for q in wanted if q["environment"] == world]
        texts = tuple(q["query"] for q in queries)
        batch = Batch(texts, backend.embed(texts, "query"))
        if expander is not None:
            batch, _ = expander.expanded(batch)
        ids = [node.id for node in corpus.topomap.nodes]
        for query, evidence in zip(queries, table.of(batch), strict=True):
            right = np.isin(ids, query["relevant"])
            if right.any():
                found.append(Asked(f"{folder.name}/{world}", query["kind"], query["query"], evidence, right))
    return found


def _memory(folder: Path, world: str, memories: Path) -> Path:
    path = memories / f"{folder.name}-{world}.erag"
    if not path.is_file():
        ingest(folder / "worlds" / world, path)
        with MemoryFile.writing(path, "fit_relevance") as memory:
            build(memory, load_config("tiny", None, EMBED_ONLY), default_store())
    return path


def _held_out(asked: list[Asked]) -> list[np.ndarray]:
    """The scores of each query by weights fitted on the other worlds."""
    scores: dict[int, np.ndarray] = {}
    for world in sorted({a.world for a in asked}):
        name = world.split("/")[-1]
        weights, bias = _fit([a for a in asked if a.world.split("/")[-1] != name])
        scores |= {i: a.evidence.rows @ weights + bias for i, a in enumerate(asked) if a.world == world}
    return [scores[i] for i in range(len(asked))]


def _fit(asked: list[Asked]) -> tuple[np.ndarray, float]:
    """Weights that give the right nodes of each query the largest share of a softmax over its nodes."""
    rows = torch.tensor(np.concatenate([a.evidence.rows for a in asked]), dtype=torch.float64)
    right = torch.tensor(np.concatenate([a.right for a in asked]), dtype=torch.float64)
    owner = torch.tensor(np.repeat(np.arange(len(asked)), [len(a.right) for a in asked]))
    mean, spread = rows.mean(0), rows.std(0) + 1e-9
    weights = torch.zeros(rows.shape[1], dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.LBFGS([weights], max_iter=500, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        scores = (rows - mean) / spread @ weights
        share = torch.exp(scores - scores.max().detach())
        zeros = torch.zeros(len(asked), dtype=torch.float64)
        won, all_ = zeros.index_add(0, owner, share * right), zeros.index_add(0, owner, share)
        total = (all_.clamp_min(1e-300).log() - won.clamp_min(1e-300).log()).mean() + PENALTY * weights.square().sum()
        total.backward()
        return total

    optimiser.step(loss)
    fitted = (weights / spread).detach()
    return fitted.numpy(), -float(fitted @ mean)


def _calibrated(scores: list[np.ndarray], asked: list[Asked]) -> tuple[float, float]:
    """Scale and shift that make scores of left-out worlds log odds; each query counts the same."""
    flat = torch.tensor(np.concatenate(scores))
    right = torch.tensor(np.concatenate([a.right for a in asked]), dtype=torch.float64)
    weight = torch.tensor(np.concatenate([np.full(len(s), 1 / len(s)) for s in scores]))
    line = torch.tensor([1.0, 0.0], dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.LBFGS([line], max_iter=200, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        logits = line[0] * flat + line[1]
        each = torch.nn.functional.binary_cross_entropy_with_logits(logits, right, reduction="none")
        total = (each * weight).sum() / len(scores)
        total.backward()
        return total

    optimiser.step(loss)
    return float(line[0]), float(line[1])


def _report(title: str, asked: list[Asked], scores: list[np.ndarray]) -> None:
    for kind in dict.fromkeys(a.kind for a in asked):
        tops = [
            a.right[best_first(s, np.arange(len(s)))[:5]] for a, s in zip(asked, scores, strict=True) if a.kind == kind
        ]
        first, five = np.mean([t[0] for t in tops]), np.mean([t.mean() for t in tops])
        print(f"  {title}, {kind}: {len(tops)} queries, P@1 {first:.3f}, P@5 {five:.3f}")


def _write(name: str, model: dict[str, Any], said: str) -> None:
    path = Path(erag.retrieve.__file__).parent / SHIPPED
    raw = yaml.safe_load(path.read_text("utf-8")) if path.is_file() else {}
    raw = {"plain": model, "named": model, **raw, "fitted": said, name: model}
    ordered = {key: raw[key] for key in ("fitted", "plain", "named")}
    path.write_text(
        "# Written by scripts/fit_relevance.py\n" + yaml.safe_dump(ordered, sort_keys=False, width=118), "utf-8"
    )


if __name__ == "__main__":
    try:
        main()
    except EragError as error:
        raise SystemExit(error.line()) from error
