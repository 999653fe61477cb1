"""Whole experiments without weights: what is asked once, resumed, set aside, judged, and computed from files alone."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from experiment_worlds import BM25, FAKE, NEVER, config, ran, raw

from erag.core.errors import ConfigError, InputError
from erag.evaluate.judges.agreement import auc
from erag.experiment.agreement import AgreementRow, TriedPair
from erag.experiment.config import ExperimentConfig, TripsConfig
from erag.experiment.driving import Driven
from erag.experiment.join import join
from erag.experiment.predictions import read_predictions, read_records
from erag.experiment.questions import QuestionRecord
from erag.experiment.run import Experiment
from erag.lm.weights import default_store

VARYING = {"seconds"}  # of a prediction: all else is the same in every run


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Memories that all experiments of this module share."""
    return tmp_path_factory.mktemp("work")


@pytest.fixture(scope="module")
def done(work: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run. Read only."""
    out = tmp_path_factory.mktemp("runs") / "small"
    assert ran(config(work), out).asked_now == len(read_predictions(out / "predictions.jsonl")) > 20
    return out


def answers(out: Path) -> list[dict[str, Any]]:
    """What was answered, without clock times."""
    return sorted(
        (p.model_dump(mode="json", exclude=VARYING) for p in read_predictions(out / "predictions.jsonl")),
        key=lambda p: (p["system"], p["id"], p["mode"]),
    )


def figures(out: Path) -> list[dict[str, Any]]:
    return json.loads((out / "metrics.json").read_text())


def test_a_run_leaves_answers_tables_and_where_they_come_from(done: Path) -> None:
    predictions = read_predictions(done / "predictions.jsonl")
    assert {p.system for p in predictions} == {"tree", "words", "naive"}
    assert {p.mode for p in predictions} == {"Q", "Q,L"}
    assert all(p.error is None for p in predictions)
    assert all(h.metres is not None for p in predictions for h in p.hits)
    page = (done / "README.md").read_text()
    for section in (
        "## Table: campus",
        "### Tests",
        "## The panel against labels",
        "### What answers cost",
        "revision",
    ):
        assert section in page
    assert "| Embodied-RAG (paper) | – | 0.55 | – | – |" in page
    facts = json.loads((done / "run.json").read_text())
    assert {"revision", "models", "cpu", "seed", "systems", "memories", "data"} <= set(facts)
    loaded = ExperimentConfig.model_validate(yaml.safe_load((done / "config.yaml").read_text()))
    assert list(loaded.systems) == ["tree", "words", "naive"]


def test_nothing_is_asked_twice(work: Path, done: Path) -> None:
    before, numbers = answers(done), figures(done)
    assert ran(config(work), done).asked_now == 0
    assert (answers(done), figures(done)) == (before, numbers)


def test_the_same_configuration_gives_the_same_numbers(work: Path, done: Path, tmp_path: Path) -> None:
    assert ran(config(tmp_path / "work"), tmp_path / "again").taken_over == 0
    assert answers(tmp_path / "again") == answers(done)
    assert figures(tmp_path / "again") == figures(done)


DOOMED = """
import os, signal, sys, yaml
from pathlib import Path
from erag.experiment import predictions
from erag.experiment.config import ExperimentConfig, TripsConfig
from erag.experiment.driving import Driven
from erag.experiment.run import Experiment
from erag.lm.weights import default_store

config, out, left, cut = sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4] == "cut"
whole = predictions.Appender.add

def add(self, record):
    global left
    if Path(self._file.name).name == "predictions.jsonl":
        left -= 1
        if left < 0:
            if cut:
                self._file.write(predictions.line_of(record)[:40])
                self._file.flush()
            os.kill(os.getpid(), signal.SIGKILL)
    whole(self, record)

predictions.Appender.add = add
Experiment(ExperimentConfig.model_validate(yaml.safe_load(open(config))), Path(out), default_store()).run()
"""


@pytest.mark.parametrize(("after", "how"), [(3, "whole"), (9, "cut")])
def test_a_killed_run_goes_on_where_it_was(done: Path, tmp_path: Path, after: int, how: str) -> None:
    written, work = tmp_path / "small.yaml", tmp_path / "work"
    written.write_text(yaml.safe_dump(raw(work)))
    out = tmp_path / "killed"
    killed = subprocess.run([sys.executable, "-c", DOOMED, str(written), str(out), str(after), how], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert len(read_predictions(out / "predictions.jsonl")) == after
    experiment = ran(config(work), out)
    assert experiment.asked_now == len(answers(done)) - after - 1  # one answer was kept in the work folder alone
    assert experiment.taken_over == 1
    assert answers(out) == answers(done)
    assert figures(out) == figures(done)


def test_another_configuration_is_asked_anew_and_the_old_answers_are_kept_aside(tmp_path: Path) -> None:
    work = tmp_path / "work"
    systems = {"a": {"overrides": [FAKE, NEVER]}, "b": {"overrides": [FAKE, NEVER, BM25]}}
    first = ran(config(work, systems=systems), tmp_path / "run")
    changed = {**systems, "b": {"overrides": [FAKE, NEVER, BM25, "retrieve.retriever.k1=1.2"]}}
    asked = ran(config(work, systems=changed), tmp_path / "run").asked_now
    assert 0 < asked < first.asked_now
    assert len(read_predictions(work / "stale" / "run.jsonl")) == asked
    assert ran(config(work, systems=changed), tmp_path / "run", again=("a",)).asked_now == first.asked_now - asked
    with pytest.raises(ConfigError, match="no system 'c'"):
        ran(config(work, systems=changed), tmp_path / "run", again=("c",))


def test_what_another_experiment_asked_is_taken_over(work: Path, done: Path, tmp_path: Path) -> None:
    systems = raw(work)["systems"]
    renamed = {"the same tree": systems["tree"], "another": {"overrides": [FAKE, NEVER, BM25, "answer.facts=1"]}}
    experiment = ran(config(work, systems=renamed, seed=1), tmp_path / "run")
    found = read_predictions(tmp_path / "run" / "predictions.jsonl")
    drawn = {q.id for q in read_records(done / "questions.jsonl", QuestionRecord) if q.drawn}
    before = {(p.id, p.mode): p for p in read_predictions(done / "predictions.jsonl") if p.system == "tree"}
    same = [p for p in found if p.system == "the same tree" and (p.id, p.mode) in before]
    taken = [p for p in same if p.mode == "Q" or p.id not in drawn]  # another seed draws other places
    assert taken
    assert experiment.taken_over >= len(taken)
    for one in taken:
        known = before[one.id, one.mode]
        assert one.seconds == known.seconds  # it was not asked again
        assert [h.node for h in one.hits] == [h.node for h in known.hits]
    assert any(one.hits[0].metres != before[one.id, "Q"].hits[0].metres for one in taken if one.id in drawn)
    asked = ran(config(work, systems=renamed, seed=1), tmp_path / "run", again=("the same tree",)).asked_now
    assert asked == sum(p.system == "the same tree" for p in found)


def test_how_long_a_run_takes_is_told_before_it_starts(work: Path, tmp_path: Path) -> None:
    systems = {"new": {"overrides": [FAKE, NEVER, BM25, "answer.facts=2"]}}
    before = Experiment(config(work, systems=systems), tmp_path / "run", default_store()).estimate()
    assert [(one.what, one.seconds) for one in before] == [("new", None), ("answers to judge", None)]
    ran(config(work, systems=systems), tmp_path / "run")
    assert Experiment(config(work, systems=systems), tmp_path / "run", default_store()).estimate() == []
    fresh = Experiment(config(tmp_path / "work", systems=systems), tmp_path / "other", default_store()).estimate()
    assert [one.what for one in fresh] == ["new", "memories to build", "answers to judge"]
    assert all(one.seconds is not None and one.seconds > 0 for one in fresh)


def test_tables_come_from_the_files_of_the_run_alone(work: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    ran(config(work), out)
    numbers = figures(out)
    for path in (out / "metrics.json", out / "README.md", *out.glob("*.csv")):
        path.unlink()
    elsewhere = config(tmp_path / "nowhere", data={"campus": {"dataset": "cmu_500", "root": "/nowhere"}})
    Experiment(elsewhere, out, default_store()).tables()
    assert figures(out) == numbers
    with pytest.raises(InputError, match="nothing was asked yet"):
        Experiment(elsewhere, tmp_path / "empty", default_store()).tables()


def test_what_was_answered_and_not_judged_is_no_zero(work: Path, done: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    ran(config(work), out)
    (out / "votes.jsonl").write_text("")
    with pytest.raises(InputError, match="was answered and not judged"):
        Experiment(config(work), out, default_store()).tables()


def test_two_runs_cannot_write_one_folder(work: Path, tmp_path: Path) -> None:
    from erag.core.lockfile import exclusive

    with (
        exclusive(tmp_path / ".lock", "test", lambda holder: InputError(holder)),
        pytest.raises(InputError, match="another run is at work"),
    ):
        ran(config(work), tmp_path)


def test_captions_of_the_truth_and_memories_without_readings(work: Path, tmp_path: Path) -> None:
    data = {"campus": {"dataset": "sample", "captions": "truth", "readings": False, "questions_per_set": 2}}
    sets = {"explicit": {"where": {"kind": "explicit"}, "modes": ["Q", "Q,S"], "sensor": {"ndvi": "low"}}}
    tables = [{"title": "T", "columns": [{"title": "P", "set": "explicit", "metric": "p_q_a@1"}]}]
    ran(config(work, data=data, sets=sets, tables=tables), tmp_path / "run")
    assert {p.mode for p in read_predictions(tmp_path / "run" / "predictions.jsonl")} == {"Q"}  # nobody can answer S
    data["campus"]["readings"] = True
    ran(config(work, data=data, sets=sets, tables=tables), tmp_path / "run")
    asked = read_predictions(tmp_path / "run" / "predictions.jsonl")
    assert {p.mode for p in asked} == {"Q", "Q,S"}
    assert any(h.sensor is not None for p in asked if p.mode == "Q,S" for h in p.hits)
    assert all(h.sensor is None for p in asked if p.mode == "Q" for h in p.hits)


def test_capabilities_are_read_off_a_run(work: Path, tmp_path: Path) -> None:
    modes = ["Q", "L", "Q,L", "Q,S", "Q,L,S"]
    sets = {
        "explicit": {"where": {"kind": "explicit"}, "modes": modes, "sensor": {"ndvi": "low"}},
        "global": {"where": {"kind": "global"}},
    }
    systems = {"tree": {"overrides": [FAKE, NEVER]}}
    made = config(work, sets=sets, systems=systems, capabilities=True, tables=[])
    ran(made, tmp_path / "run")
    (table,) = [p for p in (tmp_path / "run").glob("*.csv") if p.stem == "capabilities"]
    rows = {line.split(",")[0].strip('"') for line in table.read_text().splitlines()[1:]}
    assert {"P(A|Q)", "P(A|L)", "text", "waypoint", "path"} <= rows
    page = (tmp_path / "run" / "README.md").read_text()
    nearest = next(line for line in page.splitlines() if line.startswith("| P(A\\|L) |"))
    assert "3 of 3" in nearest  # the fourth asks for a time


def test_a_robot_drives_to_what_was_answered(work: Path, tmp_path: Path) -> None:
    columns = [{"title": "there", "set": "explicit", "metric": "arrived", "mode": "Q,L"},
               {"title": "both", "set": "explicit", "metric": "arrived_right", "mode": "Q,L"}]  # fmt: skip
    systems = {"words": {"overrides": [FAKE, NEVER, BM25]}}
    made = config(work, systems=systems, tables=[{"title": "Trips", "columns": columns}], trips={"blocked": 0})
    ran(made, tmp_path / "run")
    trips = read_records(tmp_path / "run" / "trips.jsonl", Driven)
    assert {t.mode for t in trips} == {"Q,L"}
    there, both = (next(c["mean"] for c in figures(tmp_path / "run") if c["column"] == n) for n in ("there", "both"))
    assert there == pytest.approx(sum(t.status == "arrived" for t in trips) / len(trips))
    assert 0 < both <= there
    ran(made.model_copy(update={"trips": TripsConfig(blocked=1.0)}), tmp_path / "run")
    stuck = read_records(tmp_path / "run" / "trips.jsonl", Driven)
    assert sum(t.status == "arrived" for t in stuck) < sum(t.status == "arrived" for t in trips)


def test_a_sweep_is_a_system_a_value_and_has_curves(work: Path, tmp_path: Path) -> None:
    sweep = {
        "base": {"overrides": [FAKE, NEVER]},
        "axes": {
            "k": {"path": "retrieve.retriever.branches", "values": [1, 3]},
            "alpha": {"path": "retrieve.alpha_rank", "values": [0.0, 0.5]},
        },
        "grid": [["alpha", "k"]],
    }
    experiment = ran(config(work, systems={}, sweep=sweep, pictures=True), tmp_path / "run")
    assert list(experiment.config.systems) == [
        "k = 1", "k = 3", "alpha = 0.0", "alpha = 0.5",
        "alpha = 0.0, k = 1", "alpha = 0.0, k = 3", "alpha = 0.5, k = 1", "alpha = 0.5, k = 3",
    ]  # fmt: skip
    pictures = {p.stem for p in (tmp_path / "run").glob("*.png")}
    assert {"sweep-k-table-campus", "sweep-alpha-table-campus", "grid-alpha-k-table-campus"} <= pictures


def test_a_stack_is_fitted_and_applied(work: Path, tmp_path: Path) -> None:
    panel = raw(work)["panel"] | {"fit": True}
    ran(config(work, panel=panel, systems={}, tables=[]), tmp_path / "fit")
    applied = raw(work)["panel"] | {"stack": str(tmp_path / "fit" / "stack.json"), "probability": "stack"}
    ran(config(work, panel=applied), tmp_path / "run")
    votes = [json.loads(line) for line in (tmp_path / "run" / "votes.jsonl").read_text().splitlines()]
    assert votes
    assert all(0 <= vote["stack"] <= 1 for vote in votes)
    assert "| stack |" in (tmp_path / "run" / "README.md").read_text()


def test_agreement_can_be_computed_again_from_the_pairs_that_were_tried(done: Path) -> None:
    rows = read_records(done / "agreement.jsonl", AgreementRow)
    pairs = read_records(done / "tried.jsonl", TriedPair)
    row = next(r for r in rows if (r.kind, r.over, r.judge) == ("all", "top 5", "words"))
    head = [p for p in pairs if p.place is not None and p.place <= 5 and "words" in p.votes]
    assert (row.pairs, row.positives) == (len(head), sum(p.relevant for p in head))
    again = auc(np.array([p.votes["words"] for p in head]), np.array([p.relevant for p in head]))
    assert again == pytest.approx(row.auc)
    assert any(p.place is None for p in pairs)


def test_what_was_answered_is_a_trial_of_the_panel(done: Path) -> None:
    rows = list(csv.DictReader((done / "agreement.csv").open()))
    row = next(r for r in rows if (r["over"], r["judge"]) == ("answered", "words"))
    judged = [json.loads(line) for line in (done / "votes.jsonl").read_text().splitlines()]
    records = read_records(done / "questions.jsonl", QuestionRecord)
    labelled = {q.id for q in records if q.relevant and not q.stated}
    cast = [v for v in judged if v["id"] in labelled and "words" in v["votes"]]
    assert (int(row["pairs"]), int(row["right"])) == (len(cast), sum(v["relevant"] for v in cast))


def test_other_judges_leave_out_what_a_system_shares_with_them(work: Path, tmp_path: Path) -> None:
    systems = {"words": {"overrides": [FAKE, NEVER, BM25]}}
    ran(config(work, systems=systems), tmp_path / "run")
    rows = list(csv.DictReader((tmp_path / "run" / "sensitivity-campus.csv").open()))
    assert {"all judges", "without its own", "without the run's (model, vectors)"} <= set(rows[0])
    for row in rows:
        assert row["without its own"] == row["without the run's (model, vectors)"]


def test_a_place_is_drawn_once_for_all_systems(done: Path) -> None:
    questions = read_records(done / "questions.jsonl", QuestionRecord)
    assert all(q.at is not None for q in questions)
    assert any(q.drawn for q in questions)
    assert all(q.shortest_m is not None and q.radius_m for q in questions if q.relevant)


def test_all_runs_are_joined_on_one_page(work: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no run in it"):
        join(tmp_path)
    for name in ("one", "two"):
        ran(config(work, systems={"words": {"overrides": [FAKE, NEVER, BM25]}}, title=name.title()), tmp_path / name)
    page = join(tmp_path).read_text()
    assert "* [one](one/README.md): One (revision" in page
    assert page.count("### Table: campus") == 2
    assert "](two/README.md#details)" in page
    assert "# What answers cost" not in page
