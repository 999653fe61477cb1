"""Summaries of a whole forest: every cluster described, nothing kept that no member says, everything counted."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from erag.core.errors import BadModelOutput, ModelError
from erag.core.types import Cluster, Edges, Forest, Frame, Observation, Pose, TopoMap
from erag.forest.evidence import EvidenceConfig, counted
from erag.forest.facts import cluster_facts
from erag.forest.quality import base_nodes, forest_quality
from erag.forest.summaries import Summaries, SummaryConfig, summarise_forest, whole_sentences, without_repeats
from erag.forest.support import Evidence, check
from erag.forest.vocabulary import map_vocabulary
from erag.lm.compose import compose
from erag.lm.fake import Fake, FakeConfig
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.roles import Group, Roles, Summary
from erag.memory.database import Database
from erag.memory.file import MemoryFile

PARK = "A pond lies in the park, with benches along the path. It is autumn."
STREET = 'Parked cars along the street. A sign reads "No Parking". Tall trees.'
PLAIN = SummaryConfig(counts=False, again=None)
ONCE = SummaryConfig(again=None)
TRUE = Summary("Street with cars", "Cars are parked along the street. There are trees.", ("Cars along street",))
TEXTS = (*[PARK] * 4, *[STREET] * 4, None)


class Speaker:
    """Says `answer` of every group, and remembers what it was asked."""

    def __init__(self, answer: Summary = TRUE) -> None:
        self.answer = answer
        self.calls: list[list[Group]] = []

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        self.calls.append(list(groups))
        return [self._of(group) for group in groups]

    def _of(self, group: Group) -> Summary:
        return self.answer


@pytest.fixture
def topomap() -> TopoMap:
    nodes = [Observation(f"n{i}", "place", Pose(i * 10.0, 0), caption=text) for i, text in enumerate(TEXTS)]
    return TopoMap(Frame.METRIC, tuple(nodes), Edges.empty())


@pytest.fixture
def forest(topomap: TopoMap) -> Forest:
    """Park and street on level 1, a cluster without text, all of it under one root; one row skips a level."""
    ids = [node.id for node in topomap.nodes]
    members = (("park", 1, ids[:4]), ("street", 1, ids[4:7]), ("void", 1, ids[8:]), ("both", 2, ["park", "street"]),
               ("root", 3, ["both", "void", ids[7]]))  # fmt: skip
    clusters = tuple(Cluster(name, level, tuple(m), (0.0, 0.0, 0.0), 10.0) for name, level, m in members)
    parent = np.array([9] * 4 + [10] * 3 + [13, 11, 12, 12, 13, 13, -1], np.int64)
    level = np.array([0] * 9 + [1, 1, 1, 2, 3], np.int64)
    return Forest(tuple(ids), clusters, parent, level, np.zeros((14, 2), np.float32))


def by_id(forest: Forest) -> dict[str, Cluster]:
    return {cluster.id: cluster for cluster in forest.clusters}


def test_every_cluster_is_described_level_by_level(topomap: TopoMap, forest: Forest) -> None:
    speaker, seen = Speaker(), []
    done = summarise_forest(topomap, forest, speaker, ONCE, progress=lambda *p: seen.append(p))
    assert all(c.name and c.summary and c.relationships for c in done.clusters)
    assert [len(call) for call in speaker.calls] == [2, 1, 1]  # one call a level; nothing is asked of the void
    assert seen == [("summaries", n, 5) for n in (0, 3, 4, 5)]
    assert (done.parent == forest.parent).all()
    assert [c.id for c in done.clusters] == [c.id for c in forest.clusters]
    assert not forest.clusters[0].summary


def test_upper_levels_speak_of_all_base_nodes_below(topomap: TopoMap, forest: Forest) -> None:
    speaker = Speaker()
    config = SummaryConfig(evidence=EvidenceConfig(parts=6, counts=True), again=None)
    summarise_forest(topomap, forest, speaker, config)
    (both,), (root,) = speaker.calls[1:]
    assert "of 7 views" in both.facts[0]
    assert "of 8 views" in root.facts[0]
    assert any(line.startswith("parts: ") and "Street with cars" in line for line in both.facts)


def test_numbers_are_told_by_code(topomap: TopoMap, forest: Forest) -> None:
    words = map_vocabulary(topomap)
    street = cluster_facts(words, np.arange(4, 7))
    done, plain = (by_id(summarise_forest(topomap, forest, Speaker(), c)) for c in (ONCE, PLAIN))
    assert done["street"].summary == f"{TRUE.text} {counted(street)}"
    assert plain["street"].summary == TRUE.text
    assert "in 3 of 3 views" in done["street"].summary


def test_unsupported_statements_are_removed_and_counted(topomap: TopoMap, forest: Forest) -> None:
    answer = Summary(
        "City of Dreams", "Cars are parked. A beach lies by the sea.", ("Cars along street", "Boats on sea")
    )
    ledger = Ledger()
    done = by_id(summarise_forest(topomap, forest, Speaker(answer), PLAIN, ledger))
    assert done["street"].summary == "Cars are parked."
    assert done["street"].relationships == ("Cars along street",)
    assert "Dreams" not in done["street"].name
    assert ledger.events["statements written"] == 4 * 5
    # name, beach and boats of four clusters; in the park there are neither cars nor a street
    assert ledger.events["unsupported statements removed"] == 4 * 3 + 2
    assert ledger.events["names composed from facts"] == 4
    assert ledger.events["summaries composed from facts"] == 1
    assert ledger.events["relationships composed from facts"] == 1
    assert ledger.events["clusters without any text"] == 1


def test_what_is_missing_is_asked_once_more_with_another_view(topomap: TopoMap, forest: Forest) -> None:
    class Second(Speaker):
        def _of(self, group: Group) -> Summary:
            return TRUE if group.texts else Summary("A beach", "Cars are parked.", ())

    speaker, ledger = Second(), Ledger()
    done = by_id(summarise_forest(topomap, forest, speaker, SummaryConfig(counts=False), ledger))
    street = done["street"]
    assert (street.name, street.summary, street.relationships) == (TRUE.name, "Cars are parked.", TRUE.relationships)
    assert ledger.events["clusters asked again"] == 4
    assert [bool(group.texts) for call in speaker.calls for group in call] == [False, False, True, True] + [
        False,
        True,
    ] * 2
    assert ledger.events["names composed from facts"] == 1  # the park has neither cars nor a street


def test_the_papers_summaries_rest_on_member_texts_and_are_not_checked(topomap: TopoMap, forest: Forest) -> None:
    speaker = Speaker(Summary("City of Dreams", "A beach lies by the sea.", ()))
    config = SummaryConfig(source="members", check=False, counts=False, again=None)
    done = by_id(summarise_forest(topomap, forest, speaker, config))
    (park, _), (both,), _ = speaker.calls
    assert park.texts == (PARK,) * 4
    assert not park.facts
    assert both.texts == ("City of Dreams: A beach lies by the sea.",) * 2
    assert done["street"].summary == "A beach lies by the sea."
    assert done["street"].relationships  # composed from facts: every cluster has some


def test_what_one_view_shows_is_not_said_of_the_whole(topomap: TopoMap, forest: Forest) -> None:
    ledger = Ledger()
    config = SummaryConfig(counts=False, again=None, name_share=0.6)
    done = by_id(summarise_forest(topomap, forest, Speaker(), config, ledger))
    assert done["street"].name == TRUE.name
    assert done["both"].name != TRUE.name  # three of its seven views show a street
    assert ledger.events["statements on too few members removed"] == 2


@pytest.mark.parametrize("bad", [0, 1, 2])
def test_a_bad_answer_costs_one_summary_not_the_batch(topomap: TopoMap, forest: Forest, bad: int) -> None:
    class Failing(Speaker):
        def summarise(self, groups: Sequence[Group]) -> list[Summary]:
            if any(self.is_bad(g) for g in groups):
                raise BadModelOutput("cut by the token cap")
            return super().summarise(groups)

        def is_bad(self, group: Group) -> bool:
            return ("pond" in str(group), "street" in str(group), True)[bad]

    ledger = Ledger()
    done = by_id(summarise_forest(topomap, forest, Failing(), PLAIN, ledger))
    assert all(c.name and c.summary and c.relationships for c in done.values())
    assert ledger.events["summaries refused: not of the schema"] == (2, 3, 4)[bad]
    assert (done["street"].summary == TRUE.text) == (bad == 0)


def test_marks_without_words_are_no_summary(topomap: TopoMap, forest: Forest) -> None:
    ledger = Ledger()
    done = by_id(summarise_forest(topomap, forest, Speaker(Summary("((((", "(((( ???", ("))", "."))), PLAIN, ledger))
    assert ledger.events["summaries composed from facts"] == 4
    assert all(
        c.summary[0].isalnum() and c.name[0].isalnum() and c.relationships[0][0].isalnum() for c in done.values()
    )


def test_other_errors_are_not_swallowed(topomap: TopoMap, forest: Forest) -> None:
    class Missing(Speaker):
        def summarise(self, groups: Sequence[Group]) -> list[Summary]:
            raise ModelError("no such model")

    with pytest.raises(ModelError):
        summarise_forest(topomap, forest, Missing())


def test_given_summaries_can_be_kept(topomap: TopoMap, forest: Forest) -> None:
    first = summarise_forest(topomap, forest, Speaker(), PLAIN)
    emptied = by_id(first) | {"both": by_id(forest)["both"]}
    half = Forest(forest.leaves, tuple(emptied.values()), forest.parent, forest.level, forest.embeddings)
    speaker = Speaker(Summary("Trees", "Trees.", ("Cars along street",)))
    again = by_id(summarise_forest(topomap, half, speaker, PLAIN))
    assert [len(call) for call in speaker.calls] == [1]
    assert again["both"].summary == "Trees."
    assert all(again[i] == c for i, c in by_id(first).items() if i != "both")


def test_levels_can_be_asked_for_while_the_forest_grows(topomap: TopoMap, forest: Forest) -> None:
    growing = Summaries(topomap, Speaker())
    levels = [[c for c in forest.clusters if c.level == level] for level in (1, 2, 3)]
    found = [c for level in levels for c in growing.level(level)]
    assert tuple(found) == summarise_forest(topomap, forest, Speaker()).clusters


def test_what_code_composes_is_supported(topomap: TopoMap, forest: Forest) -> None:
    class Mute(Speaker):
        def summarise(self, groups: Sequence[Group]) -> list[Summary]:
            return [Summary("", "") for _ in groups]

    done = summarise_forest(topomap, forest, Mute())
    words = map_vocabulary(topomap)
    for cluster, rows in zip(done.clusters, base_nodes(forest), strict=True):
        if cluster.id != "void":
            said = Summary(cluster.name, cluster.summary, cluster.relationships)
            assert check(said, Evidence(words, rows, cluster_facts(words, rows), measured=True)).removed == ()


def test_quality_is_counted_by_level(topomap: TopoMap, forest: Forest) -> None:
    before = forest_quality(topomap, forest)
    assert [q.clusters for q in before.values()] == [2, 1, 1]
    assert before[1].described == before[1].statements == before[1].coverage == 0
    liar = Speaker(Summary("Street", "A beach. Cars.", ("Boats on sea",)))
    clusters = tuple(
        Cluster(c.id, c.level, c.members, c.position, 1.0, *_said(liar.answer)) for c in forest.clusters
    )  # fmt: skip
    lying = Forest(forest.leaves, clusters, forest.parent, forest.level, forest.embeddings)
    assert forest_quality(topomap, lying)[2].unsupported == 2
    assert forest_quality(topomap, lying)[2].unsupported_rate == 0.5
    honest = forest_quality(topomap, summarise_forest(topomap, forest, Speaker()))
    assert honest[1].unsupported == 0
    assert honest[1].coverage > 0.5
    assert "2 of 2 clusters described" in honest[1].line()


def _said(summary: Summary) -> tuple[str, str, tuple[str, ...]]:
    return summary.name, summary.text, summary.relationships


def test_base_nodes_are_found_through_skipped_levels(forest: Forest) -> None:
    found = dict(zip([c.id for c in forest.clusters], base_nodes(forest), strict=True))
    assert found["both"].tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert found["root"].tolist() == list(range(9))


def test_objects_by_name_alone_are_described() -> None:
    names = ("chair_office_1", "chair_office_2", "desk_3", "droneWithoutText")
    nodes = tuple(
        Observation(f"o{i}", "object", Pose(float(i), 0), name=name) for i, name in enumerate(names)
    )  # fmt: skip
    topomap = TopoMap(Frame.METRIC, nodes, Edges.empty())
    cluster = Cluster("c", 1, tuple(n.id for n in nodes[:3]), (0.0, 0.0, 0.0), 1.3)
    (done,) = Summaries(topomap, Speaker(Summary("Office chairs", "Office chairs and a desk.", ()))).level([cluster])
    assert done.name == "Office chairs"
    assert done.summary.startswith("Office chairs and a desk. Chair")
    assert "2 of 3 objects" in done.summary
    assert done.relationships[0].endswith("m from desk")


@pytest.fixture
def memory(tmp_path: Path) -> Iterator[MemoryFile]:
    Database.create(tmp_path / "m.erag")
    file = MemoryFile(tmp_path / "m.erag", "write")
    yield file
    file.close()


def test_a_second_run_asks_nothing_again(topomap: TopoMap, forest: Forest, memory: MemoryFile) -> None:
    class Once(Fake):
        asked = 0

        def summarise(self, groups: Sequence[Group]) -> list[Summary]:
            Once.asked += len(groups)
            if Once.asked > 3:
                raise ModelError("killed")
            return super().summarise(groups)

    def journal() -> Journal:
        return Journal(compose({"m": Once(FakeConfig(call_size=1))}, Roles({"summarise": "m"})), memory.calls)

    with pytest.raises(ModelError):
        summarise_forest(topomap, forest, journal(), ONCE)
    Once.asked = 1  # room for what is still missing, and for nothing else
    done = summarise_forest(topomap, forest, journal(), ONCE)
    Once.asked = 9
    assert summarise_forest(topomap, forest, journal(), ONCE).clusters == done.clusters


@pytest.mark.parametrize(
    ("text", "limit", "whole", "cut"),
    [
        ("A street. A park.", 99, "A street. A park.", False),
        ("A street. A park and a", 99, "A street.", True),
        ("A street with trees", 99, "A street with trees.", False),
        ("A street. A park. A pond.", 18, "A street. A park.", True),
        ("A street with trees, benches, lamps and ca", 30, "A street with trees, benches.", True),
        ('It reads "Open."', 99, 'It reads "Open."', False),
        ("", 99, "", False),
    ],
)
def test_texts_end_with_whole_sentences(text: str, limit: int, whole: str, cut: bool) -> None:
    assert whole_sentences(text, limit) == (whole, cut)


def test_loops_are_told_once() -> None:
    looping = "A street lined with trees, a park, a street lined with trees, a street lined with trees. A park."
    assert without_repeats(looping) == ("A street lined with trees, a park.", 3)
    assert without_repeats("A street. It also has a park.") == ("A street. It also has a park.", 0)
