"""Stores around model folders that a test made."""

import hashlib
from pathlib import Path

import yaml

from erag.lm.weights import ModelStore


def store_of(root: Path, model: str, kind: str, files_format: str = "safetensors") -> ModelStore:
    """A store whose only model is the folder `root/files/model`, with a manifest of what is in it."""
    folder = root / "files" / model
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    manifest = {
        "id": model, "title": "made for a test", "kind": kind, "format": files_format, "roles": ["caption"],
        "licence": "none",
        "files": [
            {"path": path.relative_to(folder).as_posix(), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
            for path in files
        ],
    }  # fmt: skip
    (root / "manifests").mkdir(exist_ok=True)
    (root / "manifests" / f"{model}.yaml").write_text(yaml.safe_dump(manifest))
    return ModelStore(root / "manifests", root / "files")
