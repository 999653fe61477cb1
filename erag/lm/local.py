"""What the models on this machine have in common: weights of the store, what tells results apart, images one by one."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Generic, Protocol, TypeVar

from erag.core.errors import ModelError
from erag.lm.images import Picture, load_all
from erag.lm.ledger import Ledger
from erag.lm.roles import Caption, ImagePath, RoleName
from erag.lm.weights import ModelStore

CONVERTED = "images converted as they were read"


class CallSized(Protocol):
    """A configuration that says how many items are recorded together in one transaction."""

    @property
    def call_size(self) -> int: ...


Config = TypeVar("Config", bound=CallSized)


class LocalModel(ABC, Generic[Config]):
    """A `Model` over weights of the store."""

    roles: frozenset[RoleName]

    def __init__(self, config: Config, store: ModelStore, ledger: Ledger | None = None) -> None:
        self._config, self._store, self._ledger = config, store, ledger or Ledger()

    @abstractmethod
    def _stated(self) -> Mapping[str, Any]:
        """What makes results comparable: weights, rules, parameters; plain values."""

    @abstractmethod
    def _runtime(self) -> Mapping[str, Any]:
        """What else determines results to the last bit: precision, versions of libraries, the size of batches."""

    def identity(self, role: RoleName) -> str:
        del role
        return json.dumps(self._stated(), sort_keys=True)

    def fingerprint(self, role: RoleName) -> str:
        del role
        return json.dumps({**self._stated(), **self._runtime()}, sort_keys=True)

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._config.call_size


class ImageCaptioner(LocalModel[Config]):
    """The caption role, each image computed on its own: no caption depends on the others of a call."""

    roles: frozenset[RoleName] = frozenset({"caption"})

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        """One caption an image, same order; weights are verified and loaded at the first one.

        Raises BadImages naming every image that cannot be used, before anything is loaded; BadModelOutput for an image
        of which the model says nothing.
        """
        return [self._caption(p, path) for p, path in zip(self._pictures(images), images, strict=True)]

    @abstractmethod
    def _caption(self, picture: Picture, path: ImagePath) -> Caption:
        """The caption of a decoded image; `path` is for errors."""

    def _pictures(self, images: Sequence[ImagePath]) -> list[Picture]:
        pictures = load_all(images)
        if converted := sum(bool(p.notes) for p in pictures):
            self._ledger.events[CONVERTED] += converted
        return pictures


def versions(names: Sequence[str], extra: str) -> dict[str, str]:
    """The versions of the libraries a model rests on. Raises ModelError when one is not installed."""
    try:
        return {name: version(name) for name in names}
    except PackageNotFoundError as error:
        raise ModelError(f"the package {error.name} is not installed", repair=f"pip install 'erag[{extra}]'") from error
