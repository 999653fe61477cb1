"""Fewer bits: vectors, encoders, fronts, and GGUF files that a store accepts."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs erag[train]")

from erag.core.errors import ModelError
from erag.lm.llamacpp.quantise import quantise, source_of, variant_id, variants_store
from erag.lm.weights import ModelStore
from erag.study.compact import Bits, Eighths, Rescored, kept, nearest
from erag.study.front import front, knee
from erag.study.quantconfig import EncoderStudy, GgufStudy, VectorStudy


def _unit(n: int, d: int, seed: int = 0) -> np.ndarray:
    rows = np.random.default_rng(seed).normal(size=(n, d)).astype(np.float32)
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def test_eight_bits_keep_scores_and_a_quarter_of_the_bytes() -> None:
    vectors, query = _unit(300, 96), _unit(1, 96, seed=1)[0]
    small = Eighths.of(vectors)
    assert np.abs(small.scores(query) - vectors @ query).max() < 0.005
    assert small.bytes == 300 * (96 + 4)
    assert np.allclose(small.scores(query, np.array([7, 3])), small.scores(query)[[7, 3]], atol=1e-6)


def test_bits_are_signs_and_rescoring_mends_them() -> None:
    vectors = _unit(2000, 100)
    bits, small = Bits.of(vectors), Eighths.of(vectors)
    assert bits.bytes == 2000 * 16  # 100 bits in two words
    query = vectors[5]
    agree = ((vectors > 0) == (query > 0)).mean(axis=1)
    assert np.allclose(bits.scores(query), 2 * agree - 1, atol=1e-6)
    queries, exact = _unit(40, 100, seed=2), []
    plain, mended = [], []
    for q in queries:
        truth = nearest(vectors @ q, 10)
        exact.append(truth)
        plain.append(len(np.intersect1d(nearest(bits.scores(q), 10), truth)))
        mended.append(len(np.intersect1d(Rescored(bits, small, 300).nearest(q, 10), truth)))
    assert np.mean(mended) > np.mean(plain) + 2
    assert (Rescored(bits, small, 2000).nearest(queries[0], 10) == nearest(small.scores(queries[0]), 10)).all()


def test_vectors_are_kept_in_every_form() -> None:
    vectors = _unit(50, 64)
    forms = {form: kept(vectors, form) for form in ("float32", "float16", "int8", "bits", "rescored")}
    assert [forms[f].bytes for f in ("float32", "float16", "bits")] == [50 * 256, 50 * 128, 50 * 8]
    assert all(form.nearest(vectors[7], 3)[0] == 7 for form in forms.values())


def test_the_nearest_are_in_order_and_ties_go_by_row() -> None:
    scores = np.array([0.5, 0.9, 0.5, 0.1, 0.5], np.float32)
    assert nearest(scores, 3).tolist() == [1, 0, 2]
    assert nearest(scores, 9).tolist() == [1, 0, 2, 4, 3]


def test_front_and_knee() -> None:
    points = {"a": (100.0, 5.0), "b": (200.0, 2.0), "c": (400.0, 1.8), "worse": (300.0, 3.0), "d": (800.0, 1.79)}
    assert front(points) == ["a", "b", "c", "d"]
    assert knee(points) == "b"
    assert knee({"small": (1.0, 2.0), "large": (2.0, 1.0)}) == "large"
    assert knee({"x": (10.0, 3.0), "y": (100.0, 2.0), "z": (1000.0, 1.0)}) == "z"  # a straight line does not bend
    with pytest.raises(ValueError):
        knee({})


@pytest.mark.weights
def test_encoders_in_fewer_bits_stay_close(weights: ModelStore) -> None:
    import torch

    from erag.lm.bert import BertEncoder
    from erag.lm.int8 import Int8Encoder
    from erag.lm.sentence import SentenceConfig, SentenceEmbedder

    folder, texts = (
        weights.path("minilm-l6"),
        ["a bench by the lake", "a red bus waits at the stop", "where can I sit?"],
    )
    whole = BertEncoder(folder, torch.float32).nbytes
    exact = SentenceEmbedder(SentenceConfig(dtype="float32"), weights).embed(texts, "query")
    for form, least in (("int8", 0.998), ("int8_products", 0.98)):
        embedder = SentenceEmbedder(SentenceConfig(dtype=form), weights)
        near = (embedder.embed(texts, "query") * exact).sum(axis=1)
        assert least < near.min() < 1
        assert f'"dtype": "{form}"' in embedder.fingerprint("embed")
        assert Int8Encoder(folder, form).nbytes < 0.7 * whole


@pytest.mark.weights
def test_studies_of_vectors_and_encoders_write_their_tables(weights: ModelStore, tmp_path: Path) -> None:
    from erag.study.encoderstudy import run as encoder
    from erag.study.vectorstudy import run as vectors

    found = vectors(VectorStudy(kind="vectors", out=tmp_path / "v", repeats=1), weights)
    each = {way.name: way.values["bytes each"] for way in found.ways}
    again = {way.name: way.values["ten nearest found again"].mean for way in found.ways}  # type: ignore[union-attr]
    assert again["float32"] == 1
    assert each["bits"] * 32 == each["float32"]
    assert again["bits"] < again["bits, then int8 of 100"]
    assert "| bits, then int8 of 20 |" in (tmp_path / "v" / "report.md").read_text()
    report = encoder(EncoderStudy(kind="encoder", out=tmp_path / "e"), weights)
    assert [way.name for way in report.ways] == ["float32", "bfloat16", "int8 weights", "int8 products"]
    assert report.ways[0].values["cosine to float32"] == pytest.approx(1, abs=1e-5)
    assert all(way.values["lowest"] > 0.98 for way in report.ways)
    assert "| int8 products |" in (tmp_path / "e" / "report.md").read_text()


@pytest.mark.weights
def test_a_quantised_file_is_a_model_of_a_store(smollm2: ModelStore, tmp_path: Path) -> None:
    pytest.importorskip("llama_cpp", reason="needs erag[llamacpp]")
    source = source_of(smollm2, "smollm2-135m")
    made = quantise(source, "q2_k", tmp_path, threads=2)
    store = variants_store(tmp_path)
    path = store.path(variant_id("smollm2-135m", "q2_k"))
    assert path.stat().st_size == made.bytes < source.path.stat().st_size
    assert path.read_bytes()[:4] == b"GGUF"
    assert "Quantised before" in made.note
    assert made.licence == source.manifest.licence
    before = path.stat().st_mtime_ns
    assert quantise(source, "q2_k", tmp_path, threads=2) == made
    assert path.stat().st_mtime_ns == before
    path.unlink()
    assert quantise(source, "q2_k", tmp_path, threads=2).fingerprint == made.fingerprint


@pytest.mark.weights
def test_a_study_measures_each_variant_once(smollm2: ModelStore, tmp_path: Path) -> None:
    pytest.importorskip("llama_cpp", reason="needs erag[llamacpp]")
    from erag.study.variants import run

    config = GgufStudy(kind="gguf", variants=("q8_0",), out=tmp_path, texts=3, choices=3, words=20, answer=4, threads=2)
    report = run(config, smollm2)
    assert [m.name for m in report.measured] == ["q8_0", "shipped"]
    assert report.difference(report.measured[1]).mean == 0
    assert not list(tmp_path.rglob("*.gguf")) + list((tmp_path / "manifests").iterdir())  # deleted once measured
    assert all(len(m.nats) == 3 and len(m.right) == 3 and m.loss > 0 and m.decode > 0 for m in report.measured)
    assert "The knee is" in (tmp_path / "report.md").read_text()
    assert (tmp_path / "pareto.png").read_bytes()[:4] == b"\x89PNG"
    times = {p: p.stat().st_mtime_ns for p in (tmp_path / "figures").iterdir()}
    assert run(config, smollm2).measured == report.measured
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "figures").iterdir()} == times


def test_what_is_no_gguf_is_refused_and_llamacpps_refusal_is_told(tmp_path: Path) -> None:
    (tmp_path / "m").mkdir()
    for name, kind in (("a", "gguf"), ("b", "sentence")):
        file = tmp_path / "f" / name / "x.gguf"
        file.parent.mkdir(parents=True)
        file.write_bytes(b"GGUF but nothing else")
        from erag.lm.weights.digest import sha256_of

        (tmp_path / "m" / f"{name}.yaml").write_text(
            f"id: {name}\ntitle: T\nkind: {kind}\nformat: gguf\nroles: [generate]\nlicence: none\n"
            f"files: [{{path: x.gguf, sha256: {sha256_of(file)}}}]\n"
        )
    store = ModelStore(tmp_path / "m", tmp_path / "f")
    with pytest.raises(ModelError, match="no GGUF model"):
        source_of(store, "b")
    with pytest.raises(ModelError, match="no q4_0 of a"):
        quantise(source_of(store, "a"), "q4_0", tmp_path / "out", threads=1)
    assert not list((tmp_path / "out").rglob("*.gguf")) + list((tmp_path / "out").rglob("*.yaml"))
