"""What systems answered in any experiment of a work folder: the same question of the same memory is asked once."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from erag.experiment.predictions import Appender, Prediction, read_records


class Answered:
    """Answers by their fingerprint, which is of all that determines them but the code."""

    def __init__(self, path: Path) -> None:
        self._known: dict[str, Prediction] = {}
        for prediction in read_records(path, Prediction):
            self._note(prediction)
        self._file = Appender(path)

    def get(self, fingerprint: str, first: bool) -> Prediction | None:
        """The answer; where the `first` mode of a question is wanted only one whose seconds are those of a first."""
        known = self._known.get(fingerprint)
        return known if known is not None and (known.first or not first) else None

    def add(self, prediction: Prediction) -> None:
        """Keep an answer; it is on disk when this returns. Errors are not kept: they may pass."""
        if prediction.error is None:
            self._file.add(prediction)
            self._note(prediction)

    def _note(self, prediction: Prediction) -> None:
        before = self._known.get(prediction.fingerprint)
        if before is None or prediction.first or not before.first:
            self._known[prediction.fingerprint] = prediction

    def __enter__(self) -> Answered:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
