"""Write the manifest of a model folder or file that is on this machine: python scripts/write_manifest.py --help."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import yaml

from erag.core.errors import EragError, InputError
from erag.lm.weights.digest import sha256_of
from erag.lm.weights.manifest import Manifest
from erag.lm.weights.store import user_folder


def main() -> None:
    """Hash the files, check the manifest and write it to where `erag models import` looks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path, help="a model file, or the folder of a folder model")
    parser.add_argument("--id", required=True, help="small letters, digits, . _ -")
    parser.add_argument("--kind", required=True, choices=("sentence", "gguf", "state_dict", "blip", "clip", "vlm"))
    parser.add_argument("--licence", required=True)
    parser.add_argument("--role", action="append", default=[], help="repeat for several; default: caption")
    parser.add_argument("--out", type=Path, default=user_folder() / "manifests", help="folder of manifests")
    arguments = parser.parse_args()
    try:
        path = write(arguments)
    except EragError as error:
        sys.exit(error.line())
    print(f"{path}\nnow: erag models import {arguments.source} --name {arguments.id}")


def write(arguments: argparse.Namespace) -> Path:
    """The manifest's file. Raises InputError where there is nothing to hash."""
    source: Path = arguments.source
    files = [source] if source.is_file() else sorted(path for path in source.rglob("*") if path.is_file())
    if not files:
        raise InputError("no file is there", where=str(source))
    root = source.parent if source.is_file() else source
    gguf = any(path.suffix == ".gguf" for path in files)
    raw = {
        "id": arguments.id, "title": source.name, "kind": arguments.kind,
        "format": "gguf" if gguf else "pth" if arguments.kind == "state_dict" else "safetensors",
        "roles": arguments.role or ["caption"], "licence": arguments.licence,
        "files": [
            {"path": path.relative_to(root).as_posix(), "sha256": sha256_of(path), "bytes": path.stat().st_size}
            for path in files
        ],
    }  # fmt: skip
    manifest = Manifest.model_validate(raw)
    out: Path = arguments.out / f"{manifest.id}.yaml"
    if out.exists():
        raise InputError("a manifest of this id is already there", where=str(out), repair="another --id, or remove it")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(yaml.safe_dump(raw, sort_keys=False, allow_unicode=True), encoding="utf-8")
    return out


if __name__ == "__main__":
    main()
