"""The captioning student's checkpoint: its weights, and the words they stand for as the header."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from erag.lm import checkpoints
from erag.lm.student_words import StudentWords

if TYPE_CHECKING:
    import torch

    from erag.lm.student_network import StudentNetwork

SHIPPED = "captioner.safetensors"
_HEADER = "student"
_REPAIR = "erag distil --config configs/distil/captioner.yaml"


def shipped() -> Path:
    """The student that comes with the project."""
    return checkpoints.shipped(SHIPPED)


def save(path: Path, words: StudentWords, state: Mapping[str, torch.Tensor]) -> None:
    """Write a checkpoint; the same weights and words give the same bytes."""
    checkpoints.save(path, _HEADER, words, state)


def read_words(path: Path) -> StudentWords:
    """The words of a checkpoint. Raises ModelError for a file that is missing or no student."""
    return checkpoints.read_header(path, _HEADER, StudentWords, _REPAIR, "student's checkpoint")


def load(path: Path) -> tuple[StudentWords, StudentNetwork]:
    """The words and the network of a checkpoint, ready to look. Raises ModelError for a file that is no student."""
    from erag.lm.student_network import StudentNetwork

    words = read_words(path)
    network = StudentNetwork(words)
    checkpoints.load_into(path, network, _REPAIR)
    return words, network
