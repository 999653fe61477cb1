"""The matrix products, packed and plain, against the formulas they stand for."""

import pytest
import torch

from erag.core.errors import ModelError
from erag.lm.torchlm.kernels import Kernels, choose_kernels, linear, product, wide


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("kernels", ["packed", "plain"])
@pytest.mark.parametrize("biased", [True, False])
@pytest.mark.parametrize("rows", [1, 5, 100])
def test_products(kernels: Kernels, dtype: torch.dtype, biased: bool, rows: int) -> None:
    torch.manual_seed(0)
    weight, x, other = (
        torch.randn(24, 40).to(dtype),
        torch.randn(2, rows, 40).to(dtype),
        torch.randn(2, rows, 24).to(dtype),
    )
    bias = torch.randn(24).to(dtype) if biased else None
    exact = torch.nn.functional.linear(x.double(), weight.double(), None if bias is None else bias.double())
    ours = linear(weight, bias, kernels)
    near = {"rtol": 1e-4, "atol": 1e-4} if dtype == torch.float32 else {"rtol": 0.02, "atol": 0.2}
    with torch.inference_mode():
        torch.testing.assert_close(ours(x).double(), exact, **near)
        torch.testing.assert_close(ours.silu(x).double(), torch.nn.functional.silu(exact), **near)
        torch.testing.assert_close(ours.plus(x, other).double(), exact + other, **near)
        torch.testing.assert_close(ours.times(x, other).double(), exact * other, **near)
        plain = torch.nn.functional.linear(x[0].double(), weight.double())
        torch.testing.assert_close(product(x[0], weight, kernels).double(), plain, **near)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("kernels", ["int8", "int8_products"])
def test_products_in_eight_bits_are_near(kernels: Kernels, dtype: torch.dtype) -> None:
    torch.manual_seed(0)
    weight, bias, x = torch.randn(64, 96).to(dtype), torch.randn(64).to(dtype), torch.randn(2, 24, 96).to(dtype)
    exact = torch.nn.functional.linear(x.double(), weight.double(), bias.double())
    found = linear(weight, bias, kernels)(x)
    assert found.dtype == dtype
    assert (found.double() - exact).abs().max() < 0.04 * exact.abs().max()
    assert wide(kernels) == choose_kernels("auto")


def test_kernels_that_do_not_exist_are_told() -> None:
    with pytest.raises(ModelError, match="kernels=plain"):
        linear(torch.ones(2, 2, dtype=torch.float64), None, "packed")


def test_auto_is_packed_where_pytorch_brings_onednn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    assert choose_kernels("auto") == "packed"
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    assert choose_kernels("auto") == "plain"
    assert choose_kernels("packed") == "packed"
