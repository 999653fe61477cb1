"""Memories without weights, and their pages."""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from report_worlds import MakeMemory, MakePage, Rows

from erag.data.contract import QueryLine
from erag.lm.weights import default_store
from erag.pipeline.config import load_config
from erag.pipeline.query import Asker
from erag.pipeline.session import open_memory
from erag.report.asking import ask, text_lines
from erag.report.config import ReportConfig
from erag.report.memory import shown_of
from erag.report.page import Page, render


@pytest.fixture(scope="session")
def chromium() -> str:
    """The browser; tests that need it skip where there is none."""
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("no browser: chromium is not installed")
    return found


@pytest.fixture
def make_memory(tmp_path: Path, fake_config: Path) -> MakeMemory:
    """Builds a memory from rows of observations, in a folder that may hold their images."""

    def make(rows: Rows, frame: str = "metric", name: str = "world") -> Path:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        meta = {"format": "erag-observations", "version": 1, "name": name, "frame": frame}
        (folder / "meta.json").write_text(json.dumps(meta))
        (folder / "observations.jsonl").write_text("\n".join(json.dumps(row) for row in rows))
        memory = open_memory(tmp_path / f"{name}.erag", config=fake_config)
        memory.ingest(folder)
        memory.build()
        return memory.path

    return make


@pytest.fixture
def make_page(fake_config: Path) -> MakePage:
    """The page of a memory with the questions of texts or lines."""

    def make(path: Path, texts: Sequence[str] = (), lines: Sequence[QueryLine] = (), **options: Any) -> Page:
        asker = Asker(path, load_config(config=fake_config), default_store())
        asked = list(ask(asker, [*text_lines(texts), *lines], at=options.pop("at", None)))
        shown = shown_of(path, asker.corpus, asker.notes, "fake")
        return render(shown, asked, ReportConfig(seconds=False, **options))

    return make
