"""Models of random weights, and stores around model folders that a test made."""

import hashlib
from pathlib import Path

import torch
import yaml

from erag.lm import efficientnet
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


def random_state(seed: int = 0) -> dict[str, torch.Tensor]:
    """A state dict of the real form with random weights."""
    torch.manual_seed(seed)
    state: dict[str, torch.Tensor] = {}

    def conv(name: str, norm: str, out: int, into: int, kernel: int) -> None:
        state[f"{name}.weight"] = torch.randn(out, into, kernel, kernel) / (into * kernel * kernel) ** 0.5
        state[f"{norm}.weight"], state[f"{norm}.bias"] = torch.rand(out) + 0.5, torch.randn(out) * 0.1
        state[f"{norm}.running_mean"], state[f"{norm}.running_var"] = torch.randn(out) * 0.1, torch.rand(out) + 0.5

    conv("_conv_stem", "_bn0", 32, 3, 3)
    before, block = 32, 0
    for count, kernel, _, expansion, channels in efficientnet._STAGES:
        for _ in range(count):
            wide, name = before * expansion, f"_blocks.{block}."
            if expansion > 1:
                conv(f"{name}_expand_conv", f"{name}_bn0", wide, before, 1)
            conv(f"{name}_depthwise_conv", f"{name}_bn1", wide, 1, kernel)
            conv(f"{name}_project_conv", f"{name}_bn2", channels, wide, 1)
            before, block = channels, block + 1
    conv("_conv_head", "_bn1", 1280, 320, 1)
    state["_fc.weight"], state["_fc.bias"] = torch.randn(1000, 1280) * 0.03, torch.zeros(1000)
    return state
