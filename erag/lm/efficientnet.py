"""EfficientNet-Lite0 (Tan & Le 2019, without squeeze and excitation): images to features and ImageNet classes.

Batch normalisation is folded into the convolutions as the state dict is read. Padding is TensorFlow's "same", in which
the weights were trained.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erag.core.errors import ModelError
from erag.lm.images import Pixels

if TYPE_CHECKING:
    import torch

CLASSES, CHANNELS, SIDE = 1000, 1280, 224
MEAN, STD = 127.0, 128.0
_EPS = 1e-3
# (blocks, kernel, stride of the first, expansion, channels out)
_STAGES = (
    (1, 3, 1, 1, 16), (2, 3, 2, 6, 24), (2, 5, 2, 6, 40), (3, 3, 2, 6, 80), (3, 5, 1, 6, 112), (4, 5, 2, 6, 192),
    (1, 3, 1, 6, 320),
)  # fmt: skip
TAPS = {8: (40, 4), 16: (112, 10), 32: (320, 15)}  # stride of a feature map -> its channels, the block it comes from


@dataclass(frozen=True, slots=True)
class _Conv:
    """A convolution with its normalisation folded in."""

    weight: torch.Tensor
    bias: torch.Tensor
    stride: int
    depthwise: bool
    active: bool  # whether ReLU6 follows

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        import torch.nn.functional as nnf

        x = nnf.pad(x, self._padding(x.shape[2], x.shape[3]))
        groups = x.shape[1] if self.depthwise else 1
        x = nnf.conv2d(x, self.weight, self.bias, self.stride, groups=groups)
        return nnf.relu6(x, inplace=True) if self.active else x

    def _padding(self, height: int, width: int) -> tuple[int, int, int, int]:
        """TensorFlow's "same": (left, right, top, bottom), the odd one out at right and bottom."""
        kernel = self.weight.shape[-1]
        down = max((-(-height // self.stride) - 1) * self.stride + kernel - height, 0)
        across = max((-(-width // self.stride) - 1) * self.stride + kernel - width, 0)
        return across // 2, across - across // 2, down // 2, down - down // 2


@dataclass(frozen=True, slots=True)
class _Block:
    """An inverted residual: expand, depthwise, project; added to its input where the shapes agree."""

    convs: tuple[_Conv, ...]
    residual: bool

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        y = x
        for conv in self.convs:
            y = conv(y)
        return x + y if self.residual else y


class EfficientNetLite0:
    """Frozen weights. All methods are to be called in torch's inference mode."""

    def __init__(self, state: Mapping[str, torch.Tensor]) -> None:
        self._stem = _folded(state, "_conv_stem", "_bn0", 2, active=True)
        self._blocks = tuple(_blocks(state))
        self._head = _folded(state, "_conv_head", "_bn1", 1, active=True)
        self._classes = state["_fc.weight"], state["_fc.bias"]

    def maps(self, images: torch.Tensor, strides: Sequence[int]) -> list[torch.Tensor]:
        """Feature maps (b, c, h/s, w/s) at `strides` (of `TAPS`, ascending) for (b, 3, h, w) normalised images."""
        wanted = {TAPS[s][1] for s in strides}
        x, found = self._stem(images), []
        for i, block in enumerate(self._blocks[: max(wanted) + 1]):
            x = block(x)
            if i in wanted:
                found.append(x)
        return found

    def logits(self, images: torch.Tensor) -> torch.Tensor:
        """(b, 1000) ImageNet logits for (b, 3, h, w) normalised images."""
        import torch.nn.functional as nnf

        (last,) = self.maps(images, (32,))
        return nnf.linear(self._head(last).mean(dim=(2, 3)), *self._classes)


def load_network(path: Path) -> EfficientNetLite0:
    """The network with the weights of a state dict. Raises ModelError for a file that holds another network."""
    import pickle

    import torch

    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise ModelError(f"cannot be loaded: {error}", where=str(path), repair="erag models verify") from error
    try:
        return EfficientNetLite0(state)
    except (KeyError, TypeError, AttributeError, IndexError, RuntimeError) as error:
        what = f"is not EfficientNet-Lite0: {type(error).__name__} {error}"
        raise ModelError(what, where=str(path), allowed="the state dict of efficientnet-lite0") from error


def batch(pictures: Sequence[Pixels]) -> torch.Tensor:
    """(b, 3, h, w) float32 as the network wants them, from pictures (h, w, 3) of one size."""
    import torch

    stacked = torch.from_numpy(np.stack(pictures)).permute(0, 3, 1, 2)
    return ((stacked.float() - MEAN) / STD).contiguous(memory_format=torch.channels_last)


def _blocks(state: Mapping[str, torch.Tensor]) -> list[_Block]:
    blocks: list[_Block] = []
    before = 32
    for count, kernel, first, expansion, channels in _STAGES:
        for i in range(count):
            name, stride = f"_blocks.{len(blocks)}.", first if i == 0 else 1
            convs = [] if expansion == 1 else [_folded(state, f"{name}_expand_conv", f"{name}_bn0", 1, active=True)]
            deep = _folded(state, f"{name}_depthwise_conv", f"{name}_bn1", stride, active=True, depthwise=True)
            flat = _folded(state, f"{name}_project_conv", f"{name}_bn2", 1, active=False)
            _expect(name, deep.weight.shape, (before * expansion, 1, kernel, kernel))
            _expect(name, flat.weight.shape, (channels, before * expansion, 1, 1))
            blocks.append(_Block((*convs, deep, flat), residual=stride == 1 and before == channels))
            before = channels
    return blocks


def _expect(name: str, shape: Sequence[int], wanted: tuple[int, ...]) -> None:
    if tuple(shape) != wanted:
        raise KeyError(f"{name} has shape {tuple(shape)}, not {wanted}")


def _folded(
    state: Mapping[str, torch.Tensor], conv: str, norm: str, stride: int, *, active: bool, depthwise: bool = False
) -> _Conv:
    import torch

    scale = state[f"{norm}.weight"] / torch.sqrt(state[f"{norm}.running_var"] + _EPS)
    weight = (state[f"{conv}.weight"] * scale[:, None, None, None]).contiguous(memory_format=torch.channels_last)
    bias = state[f"{norm}.bias"] - state[f"{norm}.running_mean"] * scale
    return _Conv(weight, bias, stride, depthwise, active)
