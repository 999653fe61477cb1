"""A cross-encoder of a tiny BERT, taught by made-up decisions: it learns, resumes, plays its roles."""

import json
import os
import signal
import subprocess
import sys
import time
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lightning", reason="needs erag[train]")

import torch

sys.path.insert(0, str(Path(__file__).parents[1] / "lm"))
from chats import told
from tiny_bert import NAME, POSITIONS, tiny_store

from erag.compare.sizes import model_mb
from erag.core.errors import ModelError
from erag.lm.checkpoints import load_tensors, save
from erag.lm.config import BackendConfig, build_backend
from erag.lm.cross import CUT, HEADER, MOST_BYTES, CrossEncoder, CrossEncoderConfig, header_of
from erag.lm.cross_header import CrossHeader
from erag.lm.cross_network import build
from erag.lm.cross_tokens import Frame, PairTokens
from erag.lm.fake import FakeConfig
from erag.lm.ledger import Ledger
from erag.lm.roles import SelectTask
from erag.lm.weights import ModelStore
from erag.study.calibration import area
from erag.study.cross import BESIDE, BOTH, STUDENT, distil
from erag.study.decisions import ChatDecisions
from erag.study.kinds import AnyDistil
from erag.study.standing import QUESTIONS, SETS, STRICT, Report
from erag.study.textconfig import AdapterShape, CrossDistil, CrossTraining, TextTraining

# What nobody can know without having been taught: a need is met by a thing that shares no word with it.
MET = {"thirsty": "fountain", "tired": "sofa", "hungry": "cafeteria", "lost": "signpost", "cold": "radiator"}
SAYING = ("I am {}", "we are {} today", "they look {}", "somebody is {} now", "I am so {}", "they are {} now")
SETS_OF = [things[i % 3 :] + things[: i % 3] for i, things in enumerate(combinations(MET.values(), 3))]
WORDS = sorted({word.lower() for text in (*MET, *MET.values(), *SAYING, "zone") for word in text.split()} - {"{}"})


@pytest.fixture(scope="module")
def chats(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("chats") / "decisions.jsonl"
    path.write_text("\n".join(told(MET, SETS_OF, SAYING)))
    return path


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    return tiny_store(tmp_path_factory.mktemp("store"), WORDS)


def _config(chats: Path, out: Path, epochs: int, **more: object) -> CrossDistil:
    training = CrossTraining(
        epochs=epochs, batch_size=8, rate=3e-3, dropout=0.0, dtype="float32", wandb=False, threads=1
    )
    return CrossDistil(
        kind="cross_encoder", decisions=(ChatDecisions(kind="chats", paths=(chats,)),), taught_by="Taught by a rule.",
        embedder=FakeConfig(dim=96), base=NAME, layers=2, max_tokens=16, work=out / "work",
        out=out / "cross-encoder.safetensors", training=training, resamples=20, **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def taught(chats: Path, store: ModelStore, tmp_path_factory: pytest.TempPathFactory) -> tuple[CrossDistil, Report]:
    beside = AdapterShape(rank=4, members=1, training=TextTraining(epochs=1, batch_size=16, wandb=False))
    config = _config(chats, tmp_path_factory.mktemp("taught"), 12, folds=3, beside=beside)
    return config, distil(config, store)


def _student(config: CrossDistil, store: ModelStore, ledger: Ledger | None = None) -> CrossEncoder:
    return CrossEncoder(CrossEncoderConfig(checkpoint=config.out, dtype="float32"), store, ledger)


def test_it_learns_what_no_word_gives_away(taught: tuple[CrossDistil, Report]) -> None:
    _, report = taught
    for split in (QUESTIONS, SETS):
        assert list(report.agreement[split]) == ["always first", "cosine", BESIDE, BOTH, STUDENT, STRICT]
        assert report.agreement[split][STUDENT].mean > 0.9
        assert report.agreement[split]["cosine"].mean < 0.6
        assert list(report.area[split]) == ["cosine", BESIDE, BOTH, STUDENT]
        assert report.area[split][STUDENT].mean > 0.9 > report.area[split]["cosine"].mean
    assert list(report.seconds) == ["embed", "adapter", "folds", "train", "judge"]


def test_the_card_says_what_was_measured_and_whose_choices_it_learnt(taught: tuple[CrossDistil, Report]) -> None:
    config, report = taught
    card = config.out.with_suffix(".md").read_text()
    assert "Taught by a rule." in card
    assert f"its upper 2 layers were taught, and one score of the mean of all tokens.\n{report.bytes:,} bytes" in card
    for who in (BESIDE, BOTH, STUDENT):
        assert f"| {who} | {report.agreement[QUESTIONS][who].mean:.3f} [" in card
    assert "ms a decision, query and cards read anew" in card
    figures = json.loads((config.work / "figures.json").read_text())
    assert figures["agreement"][SETS][STUDENT]["mean"] == report.agreement[SETS][STUDENT].mean


def test_it_selects_whatever_the_order_of_the_cards(taught: tuple[CrossDistil, Report], store: ModelStore) -> None:
    student = _student(taught[0], store)
    cards = tuple(f"{thing} zone" for thing in MET.values())
    tasks = [SelectTask(f"I am {need}", cards) for need in MET]
    picks = student.select(tasks, 3)
    assert [own[0] for own in picks] == list(range(len(MET)))
    turned = student.select([SelectTask(task.query, task.cards[::-1]) for task in tasks[::-1]], 3)
    assert [[len(MET) - 1 - i for i in own] for own in turned[::-1]] == picks
    assert student.select([SelectTask("I am tired", ("one",))], 3) == [[0]]
    assert student.select([SelectTask("I am tired", ("sofa zone", "lost", "sofa zone"))], 2) == [[0, 2]]
    assert student.select([], 3) == []


def test_scores_are_chances_of_single_pairs(taught: tuple[CrossDistil, Report], store: ModelStore) -> None:
    student = _student(taught[0], store)
    pairs = [(f"I am {need}", f"{thing} zone") for need in MET for thing in MET.values()]
    scores = student.score(pairs)
    right = np.array([MET[q.split()[-1]] == c.split()[0] for q, c in pairs], float)
    assert area(scores.astype(float), right) > 0.9
    assert scores.dtype == np.float32
    assert ((scores >= 0) & (scores <= 1)).all()
    assert student.score(pairs[5:6])[0] == pytest.approx(scores[5], abs=1e-5)
    assert student.score([]).shape == (0,)


def test_empty_and_huge_texts_are_read_and_what_is_cut_is_counted(
    taught: tuple[CrossDistil, Report], store: ModelStore
) -> None:
    ledger = Ledger()
    student = _student(taught[0], store, ledger)
    texts = ("", " \n", "\x00\ud7ff", "sofa " * 100_000, "x" * 1_000_000)
    scores = student.score([(query, card) for query in texts for card in texts])
    assert np.isfinite(scores).all()
    assert ledger.events[CUT] == 9  # five with the long query, four more with the long card; one long word is one token
    assert sorted(student.select([SelectTask("", texts)], 9)[0]) == list(range(len(texts)))


def test_what_stands_in_a_text_is_no_special_token(store: ModelStore) -> None:
    tokens = PairTokens(store.path(NAME), 16)
    (said,) = tokens.encode(["sofa [SEP] [CLS] [PAD]"])
    assert not {0, tokens.frame.begin, tokens.frame.end} & set(said)


def test_a_row_has_room_for_both() -> None:
    frame = Frame(begin=2, end=3, longest=9)
    assert frame.row((5, 6), (7,)) == ((2, 5, 6, 3), (7, 3))
    long = frame.row(tuple(range(10, 30)), tuple(range(40, 60)))
    assert long == ((2, 10, 11, 12, 3), (40, 41, 42, 3))
    assert frame.row((), tuple(range(40, 60))) == ((2, 3), (40, 41, 42, 43, 44, 45, 3))
    assert [frame.cuts((1,) * q, (1,) * c) for q, c in ((3, 3), (4, 0), (3, 4), (0, 6), (0, 7))] == [
        False, True, True, False, True,
    ]  # fmt: skip


def test_it_is_a_backend(taught: tuple[CrossDistil, Report], store: ModelStore) -> None:
    model = {"kind": "cross_encoder", "checkpoint": taught[0].out, "dtype": "float32"}
    config = BackendConfig.model_validate({"models": {"a": model}, "roles": {"select": "a", "score": "a"}})
    backend = build_backend(config, store)
    tasks = [SelectTask("I am cold", ("sofa zone", "radiator zone")), SelectTask("I am lost", ("x", "signpost zone"))]
    assert backend.select(tasks, 1) == [[1], [1]]
    stated = json.loads(backend.identity("select"))
    assert (stated["kind"], stated["base"]) == ("cross_encoder", store.fingerprint(NAME))
    assert json.loads(backend.fingerprint("score"))["dtype"] == "float32"
    sizes = taught[0].out.stat().st_size, sum(f.stat().st_size for f in store.path(NAME).rglob("*.safetensors"))
    assert (model_mb(config.models.values(), store) or 0) * 1e6 >= sizes[0]
    assert taught[0].out.stat().st_size < sizes[1]


def test_hostile_checkpoints_are_refused(taught: tuple[CrossDistil, Report], store: ModelStore, tmp_path: Path) -> None:
    good, weights = header_of(taught[0].out), load_tensors(taught[0].out, "")
    state = {name: torch.from_numpy(values) for name, values in weights.items()}
    (tmp_path / "text").write_text("not a checkpoint")
    with (tmp_path / "large").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    written: dict[str, tuple[CrossHeader, dict[str, torch.Tensor]]] = {
        "trained by rules 99": (good.model_copy(update={"rules": 99}), state),
        "trained on tiny-bert with": (good.model_copy(update={"weights": "0" * 64}), state),
        "no model": (good.model_copy(update={"base": "other"}), state),
        "40 layers": (good.model_copy(update={"layers": 40}), state),
        "500 tokens": (good.model_copy(update={"max_tokens": 500}), state),
        "not finite": (good, {**state, "head.bias": torch.full((1,), torch.nan)}),
        "do not fit": (good, {**state, "head.weight": torch.zeros(1, 3)}),
        "do not fit its": (good, {name: tensor for name, tensor in state.items() if name != "head.bias"}),
        "head.weight.int8": (good, {**state, "head.weight.int8": torch.zeros(1), "head.weight.scale": torch.ones(9)}),
    }
    for number, (header, tensors) in enumerate(written.values()):
        save(tmp_path / str(number), HEADER, header, tensors)
    files = ["none", "text", "large", *map(str, range(len(written)))]
    said = ["no such checkpoint", "no checkpoint of kind cross_encoder", "too large", *written]
    for name, what in zip(files, said, strict=True):
        with pytest.raises(ModelError, match=what):
            CrossEncoder(CrossEncoderConfig(checkpoint=tmp_path / name), store).score([("a", "b")])


def test_the_network_is_that_of_transformers(store: ModelStore) -> None:
    transformers = pytest.importorskip("transformers", reason="needs erag[sentence]")
    folder = store.path(NAME)
    library = transformers.BertModel.from_pretrained(folder, local_files_only=True, add_pooling_layer=False).eval()
    tokens = PairTokens(folder, POSITIONS)
    pairs = [("i am tired", "sofa zone"), ("lost", "fountain zone today sofa now"), ("", "")]
    ids = [tuple(tokens.encode(pair)) for pair in pairs]
    for layers, pooling in ((1, "mean"), (2, "first")):
        header = CrossHeader(
            base=NAME, weights=store.fingerprint(NAME), layers=layers, max_tokens=POSITIONS, pooling=pooling
        )
        network = build(folder, header, tokens.frame, "float32").at_work("float32")
        with torch.no_grad():
            found = network.logits(ids, 2)
            for (query, card), logit in zip(ids, found, strict=True):
                first, second = tokens.frame.row(query, card)
                types = torch.tensor([[0] * len(first) + [1] * len(second)])
                hidden = library(torch.tensor([[*first, *second]]), token_type_ids=types).last_hidden_state[0]
                seen = hidden.mean(0) if pooling == "mean" else hidden[0]
                assert logit.item() == pytest.approx(network.upper.head(seen).item(), abs=1e-5)


def test_the_same_bytes_after_kill_9(chats: Path, store: ModelStore, tmp_path: Path) -> None:
    """A process of its own is killed in the middle of the second fold; what goes on ends as if nothing had happened."""
    whole, killed = (_config(chats, tmp_path / name, 2, folds=2, beside=None) for name in ("whole", "killed"))
    written, marker = tmp_path / "config.json", tmp_path / "marker"
    written.write_text(killed.model_dump_json())
    code = (
        "import sys, time\nfrom pathlib import Path\nfrom erag.lm.weights import ModelStore\n"
        "from erag.study.cross import distil\nfrom erag.study.textconfig import CrossDistil\n"
        "def told(stage, done, total):\n"
        "    if stage == 'unseen questions 1: epochs' and done == 1:\n"
        "        Path(sys.argv[2]).touch()\n        time.sleep(600)\n"
        "config = CrossDistil.model_validate_json(Path(sys.argv[1]).read_text())\n"
        "distil(config, ModelStore(Path(sys.argv[3]), Path(sys.argv[4])), told)\n"
    )
    command = [sys.executable, "-c", code, str(written), str(marker), str(store.manifests), str(store.files)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not marker.exists() and process.poll() is None:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    kept = sorted(f"{path.parent.name}/{path.name}" for path in killed.work.glob("run-*/*/*") if path.is_file())
    assert kept == ["unseen-questions-0/logits.npy", "unseen-questions-1/last.ckpt"]
    reports = [distil(config, store) for config in (whole, killed)]
    assert killed.out.read_bytes() == whole.out.read_bytes()
    assert reports[0].agreement == reports[1].agreement
    assert reports[0].area == reports[1].area


def test_the_configuration_that_is_shipped_is_one() -> None:
    from erag.pipeline.config import read_yaml, validate

    path = Path(__file__).parents[2] / "configs" / "distil" / "cross-encoder.yaml"
    chosen = validate(AnyDistil, read_yaml(path), str(path)).root
    assert isinstance(chosen, CrossDistil)
    assert chosen.beside is not None
    assert chosen.out.stem == path.stem
