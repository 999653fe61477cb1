"""The authors' cloud products as records: read from small files of the same formats, and from the real ones."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from erag.cli.main import run
from erag.compare.reference import cloud_caption, references
from erag.core.errors import InputError
from erag.core.types import Observation, Pose
from erag.lm.callfile import read_calls
from erag.lm.replay import NotRecorded, Replay, ReplayConfig
from erag.lm.roles import Caption, SelectTask
from erag.study.decisions import Part, Read, chats_of, read_all

CARD = "{n}. Location Details:\n   ID: area_{n}\n   Name: quiet_lounge{n}\n   Summary: {text}\n   ---\n"
END = "Instruction: From the provided context, please choose exactly one option and respond with the name exactly."


def decision(question: str, context: str, answer: str) -> str:
    asked = f"Query: {question}\nContext: Available Locations for Selection:\n\n{context}\n{END}"
    return json.dumps({"messages": [{"role": "user", "content": asked}, {"role": "assistant", "content": answer}]})


AREAS = "\n".join(CARD.format(n=n, text=f"Has {n} sofas.\n7. is a number.") for n in (1, 2))
PLAIN = "1. woodenBlock2\n\n2. bench_woodenSlats_30\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "retrieval_qa"
    made.mkdir()
    train = [decision("Where to rest?", AREAS, "area_2"), decision("Where to sit?", PLAIN, "bench_woodenSlats_30")]
    test = [train[0], decision("Where to rest?", AREAS, "area_1"), train[0], decision("Nowhere?", PLAIN, "the moon")]
    (made / "train.jsonl").write_text("\n".join(train))
    (made / "test.jsonl").write_text("\n".join(test))
    return made


def decisions(folder: Path) -> Read:
    chats = chats_of(folder)
    assert chats is not None
    return read_all([chats])


def test_decisions_are_read_once_each_and_counted(folder: Path) -> None:
    found = decisions(folder)
    assert [(d.query, d.chosen) for d in found.decisions] == [("Where to rest?", 1), ("Where to sit?", 1)]
    assert found.decisions[0].cards[1].startswith("quiet lounge. Has 2 sofas.")
    assert found.decisions[1].cards == ("wooden block", "bench wooden slats")
    assert set(found.notes) >= {
        "decisions read: 6", "distinct: 2", "with a choice: 2", "left out: the choice is none of the cards: 1",
        "decided differently another time: 1",
    }  # fmt: skip


def test_decisions_become_records_a_replay_answers_from(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "calls.jsonl.gz"
    assert run(["records", "reference", str(folder), "--out", str(out), "--teacher", "gpt-4"]) == 0
    replay = Replay(ReplayConfig(records=out))
    tasks = [d.task for d in decisions(folder).decisions]
    assert replay.select(tasks, 1) == [[1], [1]]
    assert '"teacher": "gpt-4"' in replay.fingerprint("select")
    with pytest.raises(NotRecorded, match="1 of 1 select"):
        replay.select([SelectTask("Where to rest?", ("another card",))], 1)


def test_folds_keep_questions_and_card_sets_whole(folder: Path) -> None:
    found = decisions(folder).decisions
    parts = [Part(number=number, folds=3) for number in range(3)]
    assert all(sum(part.holds(d) for part in parts) == 1 for d in found)
    loud = [replace(d, query=f"{d.query.upper()}  ") for d in found]
    assert all(part.holds(a) == part.holds(b) for part in parts for a, b in zip(found, loud, strict=True))
    turned = [replace(d, query="another", cards=d.cards[::-1]) for d in found]
    by_cards = [Part(number=number, folds=3, by="cards") for number in range(3)]
    assert all(part.holds(a) == part.holds(b) for part in by_cards for a, b in zip(found, turned, strict=True))


@pytest.mark.parametrize("line", ["{", "[]", '{"messages": []}', decision("q", "1. a", "a").replace("Query", "Quest")])
def test_what_is_no_decision_is_named_with_its_line(folder: Path, line: str) -> None:
    (folder / "test.jsonl").write_text("\n" + line)
    with pytest.raises(InputError, match=r"test\.jsonl:2"):
        decisions(folder)


GML = """graph [
  node [ id 0 label "0" type "base" position [ x 8.0 y 47.0 z 0 ] name "Bench" caption "A bench by a pond." level 0 ]
  node [ id 1 label "1" type "base" position [ x 8.0 y 47.1 z 0 ] name "Bin" caption "A red bin." level 0 ]
  node [ id 2 label "c" type "cluster" position [ x 8.0 y 47.0 z 0 ] name "Park" summary "A park." level 1
    members "0" members "1" relationships "bench by pond" ]
]"""


def test_a_forest_gives_the_summaries_it_states(tmp_path: Path) -> None:
    (tmp_path / "forest.gml").write_text(GML)
    found = references(tmp_path / "forest.gml", "gpt-4")
    assert dict(found.counts) == {"summarise": 1}
    assert json.loads(found.records[0].request) == {"facts": [], "texts": ["A bench by a pond.", "A red bin."]}
    assert json.loads(found.records[0].result)["text"] == "A park."
    assert found.notes == ("captions without an image, which are data but no records: 2",)


def coex(folder: Path) -> Path:
    folder.mkdir()
    said = json.dumps({"Description": "A lobby.", "Objects": "escalator, marble floor, escalator"})
    nodes = [
        {"node_id": i, "timestamp": 1571636004579869 + i, "position": [i, 0, 0], "quaternion": [0, 0, 0, 1],
         "image": f"frames/{i}.jpg", "caption": said}
        for i in range(2)
    ]  # fmt: skip
    (folder / "nodes_with_captions.json").write_text(json.dumps(nodes))
    (folder / "edges.json").write_text(json.dumps({"edges": []}))
    (folder / "frames").mkdir()
    return folder


def test_captions_become_records_where_their_image_is(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    source = coex(tmp_path / "coex")
    pillow.new("RGB", (8, 8)).save(source / "frames" / "0.jpg")
    run(["records", "reference", str(source), "--out", str(tmp_path / "c.jsonl.gz")])
    assert [s.role for s in read_calls(tmp_path / "c.jsonl.gz").sources] == ["caption"]
    (caption,) = Replay(ReplayConfig(records=tmp_path / "c.jsonl.gz")).caption([source / "frames" / "0.jpg"])
    assert caption == Caption("A lobby.", ("escalator", "marble floor"))


def test_a_caption_without_a_list_is_a_text() -> None:
    node = Observation("1", "place", Pose(0, 0, 0), caption="Objects are few here.")
    assert cloud_caption(node) == Caption("Objects are few here.")


@pytest.mark.shared
def test_the_authors_products(shared: Path) -> None:
    data = shared / "data"
    found = decisions(data / "retrieval_qa")
    assert {"decisions read: 2,926", "with a choice: 1,860"} <= set(found.notes)
    choices = [d for d in found.decisions if len(d.cards) > 1]
    assert sum(d.agrees(0) for d in choices) / len(choices) == pytest.approx(0.38, abs=0.01)
    assert dict(references(data / "coex_1f", "gpt-4o-mini").counts) == {"caption": 50, "summarise": 5}
    assert references(data / "cmu_500" / "semantic_forest_gpt4.gml", "gpt-4").counts["summarise"] == 214
    assert references(data / "building99" / "semantic_forest_gpt.gml", "gpt-4").counts["summarise"] == 31
