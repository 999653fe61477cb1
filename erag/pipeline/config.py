"""The configuration of ingest, build and query: presets, files, overrides; resolved before anything runs."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.aware.config import AwareConfig
from erag.core.errors import ConfigError
from erag.core.secrets import HIDDEN, secret_name, without_secrets
from erag.forest.config import ForestConfig
from erag.forest.summaries import SummaryConfig
from erag.generate.config import AnswerConfig
from erag.lm.config import BackendConfig
from erag.pipeline.captions import CaptionsConfig
from erag.retrieve.config import RetrieveConfig
from erag.topomap.config import MapConfig

MAX_CONFIG_BYTES = 1 << 20
MAX_DEPTH = 50


class PipelineConfig(BaseModel):
    """Everything that determines a memory and its answers."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    backend: BackendConfig = Field(default_factory=BackendConfig)
    captions: CaptionsConfig = Field(default_factory=CaptionsConfig)
    map: MapConfig = Field(default_factory=MapConfig)
    forest: ForestConfig = Field(default_factory=ForestConfig)
    summaries: SummaryConfig = Field(default_factory=SummaryConfig)
    retrieve: RetrieveConfig = Field(default_factory=RetrieveConfig)
    aware: AwareConfig = Field(default_factory=AwareConfig)
    answer: AnswerConfig = Field(default_factory=AnswerConfig)


def presets() -> dict[str, Path]:
    """The shipped presets by name."""
    return {path.stem: path for path in sorted((configs_dir() / "presets").glob("*.yaml"))}


def configs_dir() -> Path:
    """The shipped configurations: `configs/` of a checkout, or their copy in an installed package."""
    package = Path(str(files("erag")))
    checkout = package.parent / "configs"
    return checkout if (checkout / "presets").is_dir() else package / "_configs"


def load_config(preset: str = "tiny", config: Path | None = None, overrides: Sequence[str] = ()) -> PipelineConfig:
    """The configuration of a file, else of a preset, with `path=value` overrides. Raises ConfigError."""
    known = presets()
    if config is None and preset not in known:
        raise ConfigError(f"no preset {preset!r}", where="--preset", allowed=", ".join(known))
    path = config or known[preset]
    raw = read_yaml(path)
    for override in overrides:
        apply_override(raw, override)
    return validate(PipelineConfig, raw, str(path))


def read_yaml(path: Path) -> dict[str, Any]:
    """A YAML mapping, by the safe loader."""
    if path.exists() and not path.is_file():
        raise ConfigError("is not a regular file", where=str(path), allowed="a YAML file")
    try:
        text = path.read_text(encoding="utf-8")
        if len(text) > MAX_CONFIG_BYTES:
            raise ConfigError(f"{len(text)} characters", where=str(path), allowed=f"at most {MAX_CONFIG_BYTES}")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot be read: {error}", where=str(path)) from error
    raw = parse_yaml(text, str(path))
    if raw is None:
        return {}
    if not isinstance(raw, dict):
        raise ConfigError("not a mapping", where=str(path), allowed="key: value")
    return raw


def parse_yaml(text: str, where: str) -> Any:
    """A YAML value by the safe loader, without aliases. Raises ConfigError for what is none."""
    try:
        depth = 0
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            if isinstance(event, yaml.AliasEvent):
                raise ConfigError("has an alias (*name)", where=where, allowed="values written out")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise ConfigError(f"nested more than {MAX_DEPTH} deep", where=where)
        return yaml.safe_load(text)
    except (
        yaml.YAMLError,
        ValueError,
        AttributeError,
        KeyError,
        IndexError,
    ) as error:  # PyYAML lets its parsers' through
        raise ConfigError(f"not YAML: {error}", where=where) from error


def apply_override(raw: dict[str, Any], override: str) -> None:
    """Set `a.b=value` in place; the value is read as YAML. Another `kind` starts its section anew."""
    path, equals, value = override.partition("=")
    keys = path.split(".")
    if not equals or not all(keys):
        raise ConfigError(f"{without_secrets(path)!r}", where="--set", allowed="path=value, such as forest.alpha=0.5")
    at: Any = raw
    for key in keys[:-1]:
        at = at.setdefault(key, {})
        if not isinstance(at, dict):
            raise ConfigError(f"{path!r}: {key!r} holds a value, not a section", where="--set")
    loaded = parse_yaml(value, f"--set {path}")
    if keys[-1] == "kind" and at.get("kind") != loaded:
        at.clear()
    at[keys[-1]] = loaded


Model = TypeVar("Model", bound=BaseModel)


def _shown(value: object) -> str:
    return reprlib.repr(without_secrets(value))


def validate(model: type[Model], raw: object, where: str) -> Model:
    """`raw` as a configuration model; the first fault becomes one line with its path and what is allowed."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        loc, given, said, others = _first_fault(error, raw)
        at = ".".join(str(part) for part in loc)
        more = f" (and {others} more)" if others else ""
        shown = HIDDEN if secret_name(str(loc[-1] if loc else "")) else _shown(given)
        raise ConfigError(f"{at} = {shown}: {said}{more}", where=where) from None


def _first_fault(error: ValidationError, raw: object) -> tuple[tuple[int | str, ...], object, str, int]:
    """Where the first fault is, the value there, what is said of it, and how many other faults there are.

    Of a value that may be one of several things pydantic says for each why it is not that one: these are one fault.
    """
    faults = error.errors(include_url=False)
    first = faults[0]
    loc, whole = first["loc"], raw
    for part in loc[:-1]:
        whole = whole[part] if isinstance(whole, dict) and part in whole else None
    if first["type"] == "missing" or whole is None or whole is not first["input"]:
        return loc, first["input"], first["msg"], len(faults) - 1
    same = [f for f in faults if f["loc"][:-1] == loc[:-1]]
    return loc[:-1], first["input"], ", or: ".join(f["msg"] for f in same), len(faults) - len(same)
