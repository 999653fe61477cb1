"""Which data sets there are: every module of this package that has a `NAME` and a `load`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from pathlib import Path

import erag.evaluate.datasets as package
from erag.core.errors import ConfigError
from erag.evaluate.dataset import Dataset, Loader


def loaders() -> Mapping[str, Loader]:
    """The loaders by name, in the order of the names. To add one, add its module beside this one."""
    modules = [
        importlib.import_module(f"{package.__name__}.{found.name}") for found in pkgutil.iter_modules(package.__path__)
    ]
    found = {str(m.NAME): m.load for m in modules if hasattr(m, "NAME")}
    return dict(sorted(found.items()))


def load_dataset(name: str, root: Path | None = None, queries: Path | None = None) -> Dataset:
    """The data set `name` from its folder `root`, with the questions of `queries` where it brings none of its own.

    `sample` is in the package and needs neither. Raises ConfigError for an unknown name, InputError for files that are
    missing or cannot be read.
    """
    known = loaders()
    if name not in known:
        raise ConfigError(f"no data set {name!r}", where="data set", allowed=", ".join(known))
    if root is None and name != "sample":
        raise ConfigError(f"the data set {name!r} needs its folder", where="data set", allowed="root: FOLDER")
    return known[name](root or Path(), queries)
