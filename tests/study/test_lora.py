"""Adapters of a tiny language model: what is trained is merged, written, loaded and asked; it resumes."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("lightning", reason="needs erag[train]")
pytest.importorskip("gguf", reason="needs erag[torchlm]")

import torch
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).parents[1] / "lm" / "torchlm"))
from chats import chat
from torchlm_worlds import LLAMA, QWEN, Tiny, tiny_store

from erag.core.errors import InputError, ModelError
from erag.core.progress import quiet
from erag.lm.checkpoints import load_tensors, save, shipped
from erag.lm.fake import FakeConfig
from erag.lm.merging import merge, merged
from erag.lm.roles import Prompt
from erag.lm.textmodel import Continuation
from erag.lm.torchlm import TorchLM, TorchLMConfig
from erag.lm.torchlm.cache import Buffers
from erag.lm.torchlm.container import open_container
from erag.lm.torchlm.lora import HEADER, LoraHeader, factor_sizes, located, lora_file
from erag.lm.torchlm.prefill import extend
from erag.lm.torchlm.shape import shape_of
from erag.lm.torchlm.vocabulary import Vocabulary
from erag.lm.torchlm.weights import dequantised
from erag.lm.weights import ModelStore
from erag.retrieve.expand import asking
from erag.study.choosing import AGREES, Choosing
from erag.study.decisions import ChatDecisions
from erag.study.lessons import Lesson, drill
from erag.study.lora import Report, distil
from erag.study.loracard import lora_card
from erag.study.loraconfig import ChoosingTask, LoraDistil, LoraTraining, NamingTask
from erag.study.lowrank import LowRank
from erag.study.naming import EMBEDDING, Naming
from erag.study.tuning import padded
from erag.study.tutor import Tutor
from erag.study.understanding import FOUND

RANK, ALPHA = 4, 6.0
NAMED = {"where": ("shop", "market"), "find": ("viewpoint",), "take": ("bench", "sofa"), "need": ("lawn", "court")}


def network_of(store: ModelStore, model: str = "tiny") -> LowRank:
    file = open_container(store.path(model))
    shape = shape_of(file)
    return LowRank(shape, dequantised(file, shape, "float32"), RANK, ALPHA)


def logits_of(store: ModelStore, model: str, tokens: list[int], cache: Path, lora: Path | None = None) -> torch.Tensor:
    """(t, v) by the engine that answers prompts."""
    config = TorchLMConfig(model=model, dtype="float32", lora=lora)
    decoder = TorchLM(config, store, cache=cache).generator().decoder
    with torch.inference_mode():
        room = Buffers(decoder.shape, decoder.dtype).cache(1, len(tokens))
        return decoder.logits(extend(decoder, room, [tokens], [range(len(tokens))]))


def random_adapter(store: ModelStore, path: Path, **changes: object) -> Path:
    """An adapter of `tiny` that changes all it can."""
    shape = shape_of(open_container(store.path("tiny")))
    generator = torch.Generator().manual_seed(0)
    sizes = factor_sizes(shape, RANK)
    factors = {name: torch.randn(size, generator=generator) * size[1] ** -0.5 for name, size in sizes.items()}
    known = {"base": "tiny", "weights": store.fingerprint("tiny"), "taught": "nothing", "rank": RANK, "alpha": ALPHA}
    save(path, HEADER, LoraHeader.model_validate({**known, **changes}), factors)
    return path


@pytest.fixture(params=[LLAMA, QWEN], ids=lambda tiny: tiny.arch)
def tiny(request: pytest.FixtureRequest) -> Tiny:
    return request.param


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> ModelStore:
    return tiny_store(tmp_path_factory.mktemp("store"))


def test_an_untrained_adapter_changes_nothing(tiny: Tiny, tmp_path: Path) -> None:
    store = tiny_store(tmp_path, tiny)
    tokens = list(range(5, 65))
    network = network_of(store)
    with torch.no_grad():
        whole = network.logits(network(torch.tensor([], dtype=torch.long), torch.tensor([tokens, tokens[::-1]])))
        parted = network.logits(network(torch.tensor(tokens[:20]), torch.tensor([tokens[20:], tokens[20:][::-1]])))
    expected = logits_of(store, "tiny", tokens, tmp_path / "cache")
    assert (whole[0] - expected).abs().max() < 1e-4
    assert (parted[0] - expected[20:]).abs().max() < 1e-4


def test_a_merged_file_computes_what_was_trained(tiny: Tiny, tmp_path: Path) -> None:
    store, tokens = tiny_store(tmp_path, tiny), list(range(5, 65))
    adapter = random_adapter(store, tmp_path / "a.safetensors")
    network = network_of(store)
    network.factors.load_state_dict({name: torch.from_numpy(f) for name, f in load_tensors(adapter, "").items()})
    with torch.no_grad():
        expected = network.logits(network(torch.tensor(tokens[:20]), torch.tensor([tokens[20:]])))[0]
    source = merge(adapter, store, tmp_path / "out")
    made = ModelStore(tmp_path / "out" / "manifests", tmp_path / "out" / "files")
    found = logits_of(made, "tiny-nothing", tokens, tmp_path / "cache")[20:]
    before = logits_of(store, "tiny", tokens, tmp_path / "cache")[20:]
    assert source.whole
    assert (found - expected).abs().max() < 0.02 * (before - expected).abs().max()  # weights are rounded to F16


def test_llama_cpp_computes_the_same_of_a_merged_file(store: ModelStore, tmp_path: Path) -> None:
    pytest.importorskip("llama_cpp", reason="needs erag[llamacpp]")
    import numpy as np

    made = merged(random_adapter(store, tmp_path / "a.safetensors"), ("f16", "q8_0"), store, tmp_path / "out")
    files = ModelStore(tmp_path / "out" / "manifests", tmp_path / "out" / "files")
    tokens = list(range(5, 65))
    (tmp_path / "asked.json").write_text(json.dumps({"prompts": [tokens], "ends": [2], "most": 1}))
    child = Path(__file__).parents[1] / "lm" / "torchlm" / "llama_child.py"
    for form, most in (("f16", 0.02), ("q8_0", 0.2)):
        path = files.path(made[form].id)  # type: ignore[index]
        command = [sys.executable, str(child), str(path), str(tmp_path / "asked.json"), str(tmp_path / "found.npz")]
        assert subprocess.run(command, capture_output=True, check=False).returncode == 0
        with np.load(tmp_path / "found.npz") as found:
            theirs = torch.log_softmax(torch.from_numpy(found["logits0"]).float(), -1)
        ours = torch.log_softmax(logits_of(files, "tiny-nothing", tokens, tmp_path / "cache"), -1)
        assert (ours - theirs).abs().mean() < most
    assert made["q8_0"].id == "tiny-nothing-q8-0"


def test_an_adapter_of_other_weights_is_refused_and_a_file_is_made_once(store: ModelStore, tmp_path: Path) -> None:
    adapter = random_adapter(store, tmp_path / "a.safetensors")
    path = merge(adapter, store, tmp_path / "out").path
    before = path.stat().st_mtime_ns
    assert merge(adapter, store, tmp_path / "out").path.stat().st_mtime_ns == before
    path.unlink()
    assert merge(adapter, store, tmp_path / "out").path == path
    other = random_adapter(store, tmp_path / "b.safetensors", weights="0" * 64)
    with pytest.raises(ModelError, match="was trained on tiny with the sha256 000"):
        merge(other, store, tmp_path / "out")
    with pytest.raises(ModelError, match="do not fit tiny and rank 5"):
        merge(random_adapter(store, tmp_path / "c.safetensors", rank=5), store, tmp_path / "out")
    (tmp_path / "text").write_text("none")
    with pytest.raises(ModelError, match="no adapter of a language model"):
        merge(tmp_path / "text", store, tmp_path / "out")


def test_a_merged_model_is_taken_in_by_its_manifest(
    store: ModelStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from erag.cli import models
    from erag.lm.weights.intake import take_in

    monkeypatch.setattr(models, "_store", lambda files: store)
    adapter = random_adapter(store, tmp_path / "a.safetensors")
    done = CliRunner().invoke(models.app, ["merge", str(adapter), "--out", str(tmp_path / "out"), "--form", "f16"])
    assert done.exit_code == 0, done.output
    made = tmp_path / "out" / "files" / "tiny-nothing" / "tiny-nothing.f16.gguf"
    (tmp_path / "own").mkdir()
    shutil.copy(tmp_path / "out" / "manifests" / "tiny-nothing.yaml", tmp_path / "own")
    mine = ModelStore(store.manifests, tmp_path / "files", own=tmp_path / "own")
    assert take_in(mine, made).id == "tiny-nothing"
    assert mine.manifest("tiny-nothing").licence == "MIT"
    assert store.fingerprint("tiny") in mine.manifest("tiny-nothing").note


def test_lessons_are_the_tokens_that_the_role_reads(store: ModelStore, tmp_path: Path) -> None:
    file = open_container(store.path("tiny"))
    vocabulary, shape = Vocabulary(file), shape_of(file)
    lessons = [Lesson(asking(wish, 5).messages, '{"things": ["a cat"]}') for wish in ("I am cold.", "I am old, help!")]
    found = drill(lessons, vocabulary, shape)
    model = TorchLM(TorchLMConfig(model="tiny", dtype="float32"), store, cache=tmp_path)
    for lesson, asked, answer in zip(lessons, found.asked, found.answers, strict=True):
        (read,) = model.likelihoods([Continuation(lesson.messages, lesson.answer)])
        assert (read.prompt, read.tokens) == (len(found.prefix) + len(asked), len(answer))
        assert vocabulary.decode(answer) == lesson.answer
    rows, goals = padded(found, [0, 1])
    assert rows.shape == goals.shape
    for row, goal, asked, answer in zip(rows.tolist(), goals.tolist(), found.asked, found.answers, strict=True):
        assert tuple(g for g in goal if g >= 0) == answer
        assert row[goal.index(answer[0])] == asked[-1]
    with pytest.raises(InputError, match="a lesson of"):
        drill([Lesson((("user", "long " * 1000),), "no")], vocabulary, shape)


def test_decisions_become_questions_about_each_card(tmp_path: Path) -> None:
    from erag.lm.fake import Fake

    path = tmp_path / "d.jsonl"
    things = ("sofa", "clock", "sofa", "door")
    path.write_text("\n".join(chat(f"a {t} please", things, f"{things[i]}_{i + 1}") for i, t in enumerate("xyz")))
    source = ChatDecisions(kind="chats", paths=(path,))
    task = Choosing(ChoosingTask(kind="select", decisions=(source,)))
    assert [lesson.answer for lesson in task.lessons(1)] == ["No", "Yes", "No"]
    assert [lesson.answer for lesson in task.lessons(2)] == ["Yes", "No", "No"]  # the copy of the card counts as it
    assert not task.quotable
    assert "a y please" in task.lessons(1)[0].messages[0][1]
    answers = task.answers(Fake(), [0, 1, 2])  # type: ignore[arg-type]
    assert task.figures([0, 1, 2], task.taught, 20)[AGREES].mean == 1
    assert 0 <= task.figures([0, 1, 2], answers, 20)[AGREES].mean <= 1
    assert len(set(Choosing(ChoosingTask(kind="select", decisions=(source,), split="sets")).groups)) == 1


def _config(out: Path) -> LoraDistil:
    task = NamingTask(
        kind="understanding", teacher=FakeConfig(), embedder=FakeConfig(dim=96), limit=60, ways=2, work=out / "asked"
    )
    return LoraDistil(
        kind="lora", base="tiny", task=task, taught_by="Taught by a rule.", rank=RANK, folds=3, judged=1, most=24,
        work=out / "work", out=out / "lora.safetensors", resamples=20,
        training=LoraTraining(epochs=4, batch_size=8, rate=1e-2, wandb=False, dtype="float32", threads=1),
    )  # fmt: skip


def _teach(config: LoraDistil) -> None:
    """Keep what a rule names for the wishes, as if the teacher of the configuration had said it."""
    from erag.core.text import words
    from erag.lm.fake import Fake
    from erag.study.wishes import wishes

    task = config.task
    assert isinstance(task, NamingTask)
    stamp = {"teacher": Fake().identity("generate"), "things": task.things}
    rows = [
        {"need": n, "wish": w, "things": [t for word, named in NAMED.items() if word in words(w) for t in named]}
        for n, w in wishes(task.ways, task.seed)[: task.limit]
    ]
    task.work.mkdir(parents=True)
    (task.work / "teacher.jsonl").write_text("\n".join(json.dumps(r) for r in [stamp, *rows]) + "\n")


@pytest.fixture(scope="module")
def taught(store: ModelStore, tmp_path_factory: pytest.TempPathFactory) -> tuple[LoraDistil, Report]:
    config = _config(tmp_path_factory.mktemp("taught"))
    _teach(config)
    return config, distil(config, store)


def test_what_was_taught_is_likelier_than_before(
    taught: tuple[LoraDistil, Report], store: ModelStore, tmp_path: Path
) -> None:
    config, _ = taught
    task = config.task
    assert isinstance(task, NamingTask)
    lessons = [lesson for row in range(12) for lesson in Naming(task, store, quiet).lessons(row)]
    asked = [Continuation(lesson.messages, lesson.answer) for lesson in lessons]
    merge(config.out, store, tmp_path / "out")
    made = ModelStore(tmp_path / "out" / "manifests", tmp_path / "out" / "files")
    before, after = (
        TorchLM(TorchLMConfig(model=model, dtype="float32"), where, cache=tmp_path / "cache").likelihoods(asked)
        for model, where in (("tiny", store), ("tiny-understanding", made))
    )
    assert sum(x.mean for x in after) > sum(x.mean for x in before) + len(asked)  # a nat a token
    answer = TorchLM(TorchLMConfig(model="tiny-understanding", dtype="float32"), made, cache=tmp_path / "cache")
    prompt = asking("Where can I buy a hat?", 5)
    (said,) = answer.generate([Prompt(prompt.messages, prompt.schema, prompt.max_tokens)])
    assert json.loads(said.text)["things"]


def test_the_card_has_the_figures_of_items_left_out(taught: tuple[LoraDistil, Report]) -> None:
    config, report = taught
    assert list(report.figures)[-2:] == ["tiny, untaught", "this student, F16"]
    assert {"nearest things", EMBEDDING} <= set(report.figures)
    assert report.counted["this student, F16"] == report.judged < report.items
    assert report.taught == report.lessons == 24
    assert 1 < report.judged_groups < report.groups
    card = config.out.with_suffix(".md").read_text()
    assert "Taught by a rule." in card
    assert report.figures["this student, F16"][FOUND].shown(3) in card
    assert "3 folds of groups, of which 1 left out" in card
    assert not list(config.work.rglob("*.gguf"))
    asked = report.examples[0][0]
    assert asked in card
    silent = lora_card(config, replace(report, examples=()))  # of decisions that others published
    assert asked not in silent
    assert "| asked |" not in silent


def test_the_same_bytes_after_kill_9(taught: tuple[LoraDistil, Report], store: ModelStore, tmp_path: Path) -> None:
    """A process of its own is killed once the last training has done some epochs, and started again."""
    config = _config(tmp_path)
    _teach(config)
    (tmp_path / "config.json").write_text(config.model_dump_json())
    code = (
        "import sys\nfrom pathlib import Path\nfrom erag.lm.weights import ModelStore\n"
        "from erag.study.lora import distil\nfrom erag.study.loraconfig import LoraDistil\n"
        "config = LoraDistil.model_validate_json(Path(sys.argv[1]).read_text())\n"
        "distil(config, ModelStore(Path(sys.argv[2]), Path(sys.argv[3])))\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "config.json"), str(store.manifests), str(store.files)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 300
    while not list(config.work.glob("run-*/all/last.ckpt")) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not config.out.exists()
    assert subprocess.run(command, check=False, capture_output=True).returncode == 0
    assert config.out.read_bytes() == taught[0].out.read_bytes()
    figures = [json.loads((work / "figures.json").read_text())["figures"] for work in (config.work, taught[0].work)]
    assert figures[0] == figures[1]


def test_the_engine_merges_an_adapter_as_it_loads(tiny: Tiny, tmp_path: Path) -> None:
    store, tokens, cache = tiny_store(tmp_path, tiny), list(range(5, 65)), tmp_path / "cache"
    adapter = random_adapter(store, tmp_path / "a.safetensors")
    network = network_of(store)
    network.factors.load_state_dict({name: torch.from_numpy(f) for name, f in load_tensors(adapter, "").items()})
    with torch.no_grad():
        expected = network.logits(network(torch.tensor([], dtype=torch.long), torch.tensor([tokens])))[0]
    before = logits_of(store, "tiny", tokens, cache)
    kept = sorted(cache.iterdir())
    found = logits_of(store, "tiny", tokens, cache, lora=adapter)
    assert (found - expected).abs().max() < 1e-4 * (before - expected).abs().max()
    assert sorted(cache.iterdir()) == kept  # no cache of every adapter
    assert logits_of(store, "tiny", tokens, cache).equal(before)


def test_a_bare_name_is_that_of_a_shipped_adapter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lora-summaries").mkdir()  # whatever lies here
    assert located(Path("lora-summaries")) == shipped("lora-summaries.safetensors")
    for path in (Path("mine.safetensors"), Path("some/lora-summaries"), tmp_path / "lora-summaries"):
        assert located(path) == path
    with pytest.raises(ModelError, match=r"lora-none.safetensors: there is no such checkpoint"):
        lora_file(Path("lora-none"))


def test_an_adapter_that_is_replaced_in_use_is_noticed(store: ModelStore, tmp_path: Path) -> None:
    model = TorchLM(TorchLMConfig(model="tiny", lora=random_adapter(store, tmp_path / "a.safetensors")), store)
    model.identity("generate")
    random_adapter(store, tmp_path / "a.safetensors", alpha=2 * ALPHA)
    with pytest.raises(ModelError, match="was replaced while it was in use"):
        model.vocabulary()


def test_the_same_decisions_split_in_another_way_are_another_run(store: ModelStore, tmp_path: Path) -> None:
    path = tmp_path / "d.jsonl"
    lines = [
        chat(f"a {t} please", sets, f"{sets[0]}_1") for t in "xyzuvw" for sets in (("sofa", "clock"), ("bed", "door"))
    ]
    path.write_text("\n".join(lines))
    tutors = []
    for split in ("questions", "sets"):
        task = ChoosingTask(kind="select", decisions=(ChatDecisions(kind="chats", paths=(path,)),), split=split)
        config = LoraDistil(
            kind="lora", base="tiny", task=task, taught_by="", folds=2, judged=1, work=tmp_path, out=tmp_path / "o"
        )
        tutors.append(Tutor(config, Choosing(task), store, quiet))
    assert tutors[0]._folder != tutors[1]._folder


def test_a_model_with_an_adapter_is_another_model(store: ModelStore, tmp_path: Path) -> None:
    plain = TorchLM(TorchLMConfig(model="tiny"), store)
    some, other = (
        TorchLM(TorchLMConfig(model="tiny", lora=random_adapter(store, tmp_path / name, alpha=alpha)), store)
        for name, alpha in (("a.safetensors", ALPHA), ("b.safetensors", 2 * ALPHA))
    )
    assert len({model.identity("generate") for model in (plain, some, other)}) == 3
    alien = random_adapter(store, tmp_path / "c.safetensors", weights="0" * 64)
    for path, said in ((alien, "was trained on tiny"), (tmp_path / "none.safetensors", "no such checkpoint")):
        with pytest.raises(ModelError, match=said):
            TorchLM(TorchLMConfig(model="tiny", lora=path), store).identity("generate")
