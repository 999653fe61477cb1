"""A GGUF language model in PyTorch: batched generation, JSON of a schema, and likelihoods."""

from erag.lm.torchlm.model import TorchLM, TorchLMConfig

__all__ = ["TorchLM", "TorchLMConfig"]
