"""Trips to the first hit of every question of a data set, over noise of the position and blocked edges.

python scripts/trips.py cmu_500 --root FOLDER --queries Q.jsonl
"""

from __future__ import annotations

import argparse
from pathlib import Path

from erag.data.contract import parse_query
from erag.evaluate.dataset import Environment
from erag.evaluate.datasets.catalogue import load_dataset
from erag.evaluate.navigation.planner import FollowerConfig, WaypointFollower
from erag.evaluate.navigation.trips import Course, Trip, navigation_score, random_blockages
from erag.pipeline.query import Asker
from erag.pipeline.session import open_memory

CONDITIONS = ((0.0, 0.0), (0.2, 0.0), (1.0, 0.0), (3.0, 0.0), (0.2, 0.02), (0.2, 0.1))  # metres, share of edges


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("--root", type=Path)
    parser.add_argument("--queries", type=Path)
    parser.add_argument("--retriever", default="fusion")
    parser.add_argument("--memories", type=Path, default=Path("experiments/trips"))
    options = parser.parse_args()
    options.memories.mkdir(parents=True, exist_ok=True)
    for environment in load_dataset(options.dataset, options.root, options.queries).environments:
        overrides = [f"retrieve.retriever={{kind: {options.retriever}}}"]
        memory = open_memory(options.memories / f"{environment.name}.erag", overrides=overrides)
        memory.ingest(environment.source, environment.reader)
        memory.build()
        for noise, share in CONDITIONS:
            found = navigation_score(driven(environment, memory.asker, noise, share))
            ended = ", ".join(f"{n} {status}" for status, n in found.statuses.items())
            print(
                f"{environment.name}, noise {noise} m, {share:.0%} of the edges blocked: "
                f"{found.trips} trips ({ended}), success {found.success}, SPL {found.spl}, "
                f"{found.replans:.1f} replans a trip"
            )


def driven(environment: Environment, asker: Asker, noise: float, share: float) -> list[Trip]:
    """A trip for every question that states labels and a position; one that was not answered has no route."""
    topomap = asker.corpus.topomap
    course = Course(topomap, WaypointFollower(FollowerConfig(noise=noise)), random_blockages(topomap, share, seed=1))
    asked = [parse_query(q.line, 1, asker.ground) for q in environment.questions if q.relevant is not None]
    trips = []
    for number, query in enumerate(q for q in asked if q.at is not None):
        hits = asker.ask(query).hits
        trips.append(course.trip(query.at, hits[0].node, number) if hits else Trip("no_route"))
    return trips


if __name__ == "__main__":
    main()
