"""A committee of students: the mean of what its members say, as a backend of its own."""

import json
from pathlib import Path

import numpy as np
import pytest

from erag.compare.sizes import model_mb
from erag.core.errors import ConfigError
from erag.lm.adapter import Adapter, AdapterConfig
from erag.lm.checkpoints import shipped
from erag.lm.committee import Committee, CommitteeConfig
from erag.lm.config import BackendConfig, build_backend
from erag.lm.cross import CrossEncoder, CrossEncoderConfig
from erag.lm.roles import SelectTask
from erag.lm.weights import ModelStore
from erag.pipeline.config import validate

CARDS = ("Sofa corner. Soft chairs to rest on.", "Copy room. A printer and paper.", "Kitchen. A sink and a fridge.")
QUERIES = ("Where can I print my report on paper?", "Where is water?", "I need to lie down.")
PAIRS = [(query, card) for query in QUERIES for card in CARDS]
OWNERS = [number for number, _ in enumerate(QUERIES) for _ in CARDS]


@pytest.fixture
def committee(weights: ModelStore) -> Committee:
    return Committee(CommitteeConfig(), weights)


def test_its_odds_are_the_mean_of_the_members(committee: Committee, weights: ModelStore) -> None:
    members = Adapter(AdapterConfig(), weights), CrossEncoder(CrossEncoderConfig(), weights)
    for owners in (None, OWNERS):
        own = [member.log_odds(PAIRS, owners) for member in members]
        assert np.abs(own[0] - own[1]).max() > 0.1
        np.testing.assert_allclose(committee.log_odds(PAIRS, owners), np.mean(own, axis=0), atol=1e-6)
    assert committee.score([]).shape == (0,)
    assert committee.select([], 1) == []


def test_it_selects_by_its_odds_whatever_the_order(committee: Committee) -> None:
    odds = committee.log_odds(PAIRS, OWNERS).reshape(len(QUERIES), -1)
    tasks = [SelectTask(query, CARDS) for query in QUERIES]
    assert committee.select(tasks, 3) == (-odds).argsort(axis=1).tolist()
    turned = committee.select([SelectTask(query, CARDS[::-1]) for query in QUERIES], 3)
    assert [[len(CARDS) - 1 - i for i in own] for own in turned] == committee.select(tasks, 3)
    assert committee.select(tasks, 1)[0] == [1]


def test_scores_rise_with_the_odds_and_are_chances(committee: Committee) -> None:
    odds, scores = committee.log_odds(PAIRS), committee.score(PAIRS)
    assert scores.dtype == np.float32
    np.testing.assert_allclose(scores, 1 / (1 + np.exp(-odds)), atol=1e-6)


def test_it_is_a_backend_known_by_its_members(weights: ModelStore) -> None:
    plain = {"models": {"both": {"kind": "committee"}}, "roles": {"select": "both", "score": "both"}}
    backend = build_backend(BackendConfig.model_validate(plain), weights)
    assert backend.select([SelectTask(QUERIES[0], CARDS)], 1) == [[1]]
    said = json.loads(backend.identity("select"))
    assert [member["kind"] for member in said["members"]] == ["adapter", "cross_encoder"]
    other = Committee(
        CommitteeConfig(members=(AdapterConfig(checkpoint=shipped("scorer.safetensors")), CrossEncoderConfig())),
        weights,
    )
    assert other.identity("select") != backend.identity("select")
    assert other.fingerprint("score") != other.identity("score")


def test_its_files_are_those_of_its_members_each_once(weights: ModelStore) -> None:
    alone = [model_mb([member], weights) for member in CommitteeConfig().members]
    both = model_mb([CommitteeConfig()], weights)
    assert None not in alone
    assert both == pytest.approx(sum(alone) - (weights.manifest("minilm-l6").bytes or 0) / 1e6)  # type: ignore[arg-type]


def test_one_member_and_models_that_do_not_judge_pairs_are_refused(tmp_path: Path) -> None:
    def read(members: list[dict[str, str]]) -> object:
        return validate(CommitteeConfig, {"kind": "committee", "members": members}, str(tmp_path))

    with pytest.raises(ConfigError, match="members"):
        read([{"kind": "adapter"}])
    with pytest.raises(ConfigError, match="members"):
        read([{"kind": "adapter"}, {"kind": "sentence"}])
    assert read([{"kind": "adapter"}, {"kind": "adapter"}])
