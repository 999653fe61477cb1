"""Who wins in words, from answers made by hand."""

from __future__ import annotations

from itertools import pairwise

import pytest

from erag.experiment.config import ColumnConfig, TableConfig
from erag.experiment.figures import _apart
from erag.experiment.findings import findings, findings_sheet, order_sheet, told, told_of_parts
from erag.experiment.predictions import Prediction
from erag.experiment.questions import QuestionRecord
from erag.experiment.scoring import Scored
from erag.experiment.tables import Choices, table

PRINTED = {"Embodied-RAG": 0.55, "Naive-RAG": 0.08, "GraphRAG": 0.06}
HIT = ColumnConfig(title="hit", set="s", metric="p_q_a@1", printed=PRINTED)
TIME = ColumnConfig(title="time", set="s", metric="seconds")
NEAR = ColumnConfig(title="near", set="s", metric="metres@1")
COUNTERPARTS = {"graph": "GraphRAG", "naive": "Naive-RAG"}


def scores(**systems: dict[str, list[float]]) -> list[Scored]:
    """Values of metrics by system, question by question."""
    made = []
    for system, metrics in systems.items():
        for i in range(len(next(iter(metrics.values())))):
            prediction = Prediction(system=system, data="d", environment="w", id=str(i), mode="Q")
            question = QuestionRecord(data="d", environment="w", id=str(i), kind="explicit", sets=("s",))
            values = {name.replace("__", "@"): known[i] for name, known in metrics.items()}
            made.append(Scored(prediction, question, values))
    return made


ASKED = scores(
    tiny={"p_q_a__1": [1.0] * 10, "seconds": [2.0] * 10, "metres__1": [1.0] * 10},
    flat={"p_q_a__1": [1.0] * 2 + [0.0] * 8, "seconds": [1.0] * 10, "metres__1": [2.0] * 10},
    graph={"p_q_a__1": [0.0] * 10, "seconds": [3.0] * 10, "metres__1": [2.0] * 10},
    naive={"p_q_a__1": [1.0] * 2, "seconds": [1.0] * 2, "metres__1": [0.0] * 2},
)
CHOICES = Choices(("tiny", "flat", "graph", "naive"), frozenset({"flat"}), ("tiny",), COUNTERPARTS)
CONFIG = TableConfig(title="T", columns=(HIT, TIME, NEAR))


def test_the_default_against_the_best_that_was_asked_enough() -> None:
    hit, time = findings(CONFIG, "d", ASKED, CHOICES)  # metres need an answer and are not compared
    assert (hit.test.system, hit.test.baseline, hit.n) == ("tiny", "flat", 10)  # naive has the better mean of 2
    assert (hit.ours, hit.other) == (1.0, 0.2)
    assert hit.test.p == pytest.approx(2 / 256)
    assert (hit.test.adjusted, hit.verdict) == (pytest.approx(2 / 256), "tiny is better")
    assert (time.test.baseline, time.verdict) == ("flat", "flat is better")  # of seconds less is better
    words = "\n".join(told([hit, time], "d, T"))
    assert "better in 1 of 2 columns, worse in 1" in words
    assert "* **better**: hit 1.00 to the 0.20 of flat (+0.80 [+0.50, +1.00], n 10, p = .008)." in words
    assert "* **worse**: time" in words
    (sheet,) = findings_sheet([hit, time], "T", "d")
    assert [row[-1] for row in sheet.rows] == ["tiny is better", "flat is better"]


def test_no_difference_is_said_to_be_none() -> None:
    alike = scores(tiny={"p_q_a__1": [0.5] * 5}, flat={"p_q_a__1": [0.5] * 5})
    (found,) = findings(TableConfig(title="T", columns=(HIT,)), "d", alike, CHOICES)
    assert (found.test.p, found.verdict) == (1.0, "no difference shown")
    assert "* no difference shown: hit" in "\n".join(told([found], "d"))
    nobody = Choices(("tiny", "flat"), frozenset({"flat"}))
    assert findings(CONFIG, "d", alike, nobody) == []
    assert told([], "d") == []
    assert findings_sheet([], "T", "d") == []


def test_a_column_says_which_way_is_better() -> None:
    refused = scores(tiny={"refused": [1.0] * 10}, flat={"refused": [0.0] * 10})
    column = ColumnConfig(title="c", set="s", metric="refused")
    for better, verdict in ((None, "flat is better"), ("more", "tiny is better")):
        config = TableConfig(title="T", columns=(column.model_copy(update={"better": better}),))
        (found,) = findings(config, "d", refused, CHOICES)
        assert found.verdict == verdict
    control = TableConfig(title="T", columns=(ColumnConfig(title="c", set="s", metric="ss_generic"),))
    assert findings(control, "d", scores(tiny={"ss_generic": [1.0]}, flat={"ss_generic": [0.0]}), CHOICES) == []


def test_the_order_of_the_paper_and_ours() -> None:
    made = table(CONFIG, "d", ASKED, CHOICES)
    (sheet,) = order_sheet(made, CHOICES)
    (row,) = sheet.rows
    assert row[1] == "Embodied-RAG 0.55 > Naive-RAG 0.08 > GraphRAG 0.06"
    assert row[2] == "tiny 1.00 > naive (for Naive-RAG) 1.00 > graph (for GraphRAG) 0.00"


def test_parts_against_the_whole() -> None:
    config = TableConfig(title="Parts", columns=(HIT,), against="tiny")
    made = table(config, "d", ASKED, CHOICES)
    assert {test.baseline for test in made.tests["hit"]} == {"tiny"}
    said = "\n".join(told_of_parts(made, "tiny"))
    assert "**hit** (1.00 [1.00, 1.00]): worse: flat -0.80" in said
    assert "no difference shown for the other 1" in said


def test_labels_are_moved_apart_and_stay_inside() -> None:
    assert _apart([0.1, 0.5]) == [0.1, 0.5]
    close = _apart([0.98, 0.99, 1.0])
    assert close[-1] == 1.0
    assert all(b - a >= 0.045 - 1e-9 for a, b in pairwise(close))
    assert _apart([]) == []
