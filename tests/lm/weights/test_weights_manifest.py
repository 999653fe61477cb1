"""Manifests: the shipped ones say what they should, and bad ones are refused by file and field."""

from pathlib import Path

import pytest
import yaml

from erag.core.errors import ConfigError
from erag.lm.weights.manifest import MAX_MANIFEST_BYTES, Manifest, load_manifest, load_manifests

MODELS = Path(__file__).parents[3] / "models"
SHIPPED = {
    "smollm2-135m": "b179c9523d0e6a0f98a330c7562b682750a6f8c8c15e5bc70ea373728110db53",
    "minilm-l6": "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db",
    "qwen2.5-coder-1.5b": "cc324af070c2ecbfd324a30884d2f951a7ff756aba85cb811a6ec436933bb046",
    "qwen2.5-coder-0.5b": "1d9614638d18024d0fbb36575a15f1302a3adf044df10345688ec4f6e1c4ff32",
    "gemma3-270m": "a5fd3b62230aa5ec60212297dc9d20eaa70578ac519e00d93a17e44c087a6818",
    "efficientnet-lite0": "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db",
}
GOOD = {
    "id": "m",
    "title": "M",
    "kind": "gguf",
    "format": "gguf",
    "roles": ["generate"],
    "licence": "MIT",
    "files": [{"path": "m.gguf", "sha256": "0" * 64, "bytes": 1}],
    "sources": [],
}
WHEEL = {"kind": "wheel", "package": "p", "version": "1", "member": "p/m.gguf"}
PARTS = {"kind": "wheel_parts", "package": "p{n}", "version": "1", "parts": 2}
TWO_FILES = [{"path": "a", "sha256": "0" * 64}, {"path": "b", "sha256": "1" * 64}]


def write(path: Path, **changes: object) -> Path:
    path.write_text(yaml.safe_dump({**GOOD, **changes}), encoding="utf-8")
    return path


def test_the_shipped_manifests_name_the_known_weights() -> None:
    manifests = load_manifests([MODELS])
    largest = {key: max(m.files, key=lambda f: f.bytes or 0).sha256 for key, m in manifests.items()}
    assert largest == SHIPPED
    assert all(m.bytes and m.sources and m.licence and m.ram_mb for m in manifests.values())


def test_every_shipped_manifest_begins_with_the_command_that_uses_it() -> None:
    for path in sorted(MODELS.glob("*.yaml")):
        assert path.read_text(encoding="utf-8").startswith(f"# erag models pull {path.stem}\n")
        assert load_manifest(path).id == path.stem


def test_the_tiny_preset_is_one_embedder_and_one_language_model() -> None:
    tiny = [m.id for m in load_manifests([MODELS]).values() if "tiny" in m.presets]
    assert tiny == ["minilm-l6", "smollm2-135m"]


def test_the_cards_mention_every_model() -> None:
    cards = (MODELS / "README.md").read_text(encoding="utf-8")
    assert all(f"`{model}`" in cards for model in SHIPPED)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"colour": "red"}, "colour"),
        ({"id": "../m"}, "id"),
        ({"id": "quarantine"}, "taken by the store"),
        ({"id": "m.partial"}, "taken by the store"),
        ({"roles": ["fly"]}, "roles"),
        ({"files": []}, "files"),
        ({"files": [{"path": "m", "sha256": "abc"}]}, "files.0.sha256"),
        ({"files": [{"path": "../m", "sha256": "0" * 64}]}, "files.0.path"),
        ({"files": [{"path": "/m", "sha256": "0" * 64}]}, "files.0.path"),
        ({"files": [{"path": "a//b", "sha256": "0" * 64}]}, "files.0.path"),
        ({"files": [{"path": ".locks/m", "sha256": "0" * 64}]}, "files.0.path"),
        ({"files": [{"path": "m/", "sha256": "0" * 64}]}, "ends neither"),
        ({"files": TWO_FILES[:1] * 2}, "same path"),
        ({"sources": [{**WHEEL, "package": "--index-url=x"}]}, "package"),
        ({"sources": [{**WHEEL, "package": "p q"}]}, "package"),
        ({"sources": [{**WHEEL, "version": "1 --pre"}]}, "version"),
        ({"sources": [{**WHEEL, "version": 0.1}]}, "version"),
        ({"sources": [{**WHEEL, "member": "../m.gguf"}]}, "member"),
        ({"sources": [{**WHEEL, "kind": "shell"}]}, "sources.0"),
        ({"sources": [PARTS], "files": TWO_FILES}, "wheel_parts gives one file"),
        ({"sources": [{**PARTS, "package": "p"}]}, "package"),
        ({"sources": [WHEEL], "files": TWO_FILES}, "ends with '/'"),
        ({"sources": [{"kind": "hub", "repo": "a/b", "revision": "main"}]}, "names its file"),
        ({"sources": [{"kind": "hub", "repo": "-a/b", "revision": "main", "file": "m"}]}, "repo"),
    ],
)
def test_a_bad_manifest_is_refused_by_file_and_field(tmp_path: Path, changes: dict[str, object], said: str) -> None:
    path = write(tmp_path / "bad.yaml", **changes)
    with pytest.raises(ConfigError) as refused:
        load_manifest(path)
    assert str(path) in refused.value.line()
    assert said in refused.value.line()


def test_yaml_cannot_run_anything(tmp_path: Path) -> None:
    path, trace = tmp_path / "evil.yaml", tmp_path / "trace"
    path.write_text(f"!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{trace}']]")
    with pytest.raises(ConfigError, match="not YAML"):
        load_manifest(path)
    assert not trace.exists()


@pytest.mark.parametrize("content", [b"", b"just text", b"[1, 2]", b"a: [", b"\xff\xfe\x00"])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "m.yaml").write_bytes(content)
    with pytest.raises(ConfigError, match=r"m\.yaml"):
        load_manifests([tmp_path])


def test_a_huge_file_is_not_parsed(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_bytes(b"#" * (MAX_MANIFEST_BYTES + 1))
    with pytest.raises(ConfigError, match="too large"):
        load_manifests([tmp_path])


def test_the_manifest_in_the_documentation_is_a_good_one(tmp_path: Path) -> None:
    page = (MODELS.parent / "docs" / "models.md").read_text(encoding="utf-8")
    example = page.split("```yaml\n")[1].split("```")[0]
    (tmp_path / "m.yaml").write_text(example, encoding="utf-8")
    assert load_manifest(tmp_path / "m.yaml").sources == ()


def test_an_id_belongs_to_one_manifest(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    first, second = write(tmp_path / "m.yaml"), write(tmp_path / "own" / "mine.yaml")
    with pytest.raises(ConfigError) as refused:
        load_manifests([tmp_path, tmp_path / "own"])
    assert str(first) in refused.value.line()
    assert str(second) in refused.value.line()


def test_the_fingerprint_is_that_of_the_weights_alone() -> None:
    one = Manifest.model_validate(GOOD)
    assert one.fingerprint == "0" * 64
    two = Manifest.model_validate({**GOOD, "files": TWO_FILES})
    turned = Manifest.model_validate({**GOOD, "title": "N", "files": TWO_FILES[::-1]})
    other = Manifest.model_validate({**GOOD, "files": [TWO_FILES[0], {"path": "b", "sha256": "2" * 64}]})
    assert two.fingerprint == turned.fingerprint != other.fingerprint
    assert len(two.fingerprint) == 64
