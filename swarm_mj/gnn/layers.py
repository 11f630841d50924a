"""Linear layers by themselves: composed where two meet, and on the CPU computed by oneDNN."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

FEW_ROWS = 256  # below it, plain PyTorch starts faster than oneDNN


class Layer(NamedTuple):
    """x -> x W' + b, as in `torch.nn.Linear`."""

    weight: Float[Tensor, "Out In"]
    bias: Float[Tensor, "Out"]


def layers_of(perceptron: nn.ModuleList) -> list[Layer]:
    """The numbers of a perceptron's layers, first to last."""
    linears = (linear for linear in perceptron if isinstance(linear, nn.Linear))
    return [Layer(linear.weight, linear.bias) for linear in linears]


def cut(layers: list[Layer]) -> tuple[Layer, list[Layer], Layer | None]:
    """The first layer, those between, and the last, or None where the first is the last."""
    first, *others = layers
    return first, others[:-1], others[-1] if others else None


def compose(after: Layer, before: Layer | None) -> Layer:
    """One layer that does what two do, one after the other, with nothing between them.

    Args:
        after: The second.
        before: The first; None leaves the second alone.

    Returns:
        x -> after(before(x)).
    """
    if before is None:
        return after
    return Layer(after.weight @ before.weight, torch.addmv(after.bias, after.weight, before.bias))


def side_by_side(layers: Sequence[Layer]) -> Layer:
    """One layer whose outputs are those of several, one after the other."""
    return Layer(torch.cat([w for w, _ in layers]), torch.cat([b for _, b in layers]))


def split(layer: Layer, width: int) -> list[Layer]:
    """The layers of `width` outputs each that lie side by side in one."""
    parts = zip(layer.weight.split(width), layer.bias.split(width), strict=True)
    return [Layer(weight, bias) for weight, bias in parts]


def affine(
    x: Float[Tensor, "n In"], layer: Layer, *, has_relu: bool = False
) -> Float[Tensor, "n Out"]:
    """Applies a layer, and a ReLU after it if asked for.

    Many rows of float32 on a CPU go to oneDNN: it uses the widest instructions of every processor,
    while MKL, which PyTorch takes otherwise, halves them on those that are not Intel's.

    Args:
        x: One row per node or edge.
        layer: The layer.
        has_relu: Whether a ReLU follows.

    Returns:
        A new array.
    """
    if not _suits_onednn(x):
        y = torch.nn.functional.linear(x, *layer)
        return y.relu_() if has_relu else y
    if torch.is_grad_enabled():
        return _Affine.apply(x, *layer, has_relu)
    return _onednn(x, *layer, has_relu=has_relu)


def _suits_onednn(x: Tensor) -> bool:
    return (
        x.dtype == torch.float32
        and x.device.type == "cpu"
        and len(x) >= FEW_ROWS
        and torch.backends.mkldnn.is_available()
        and hasattr(torch.ops.mkldnn, "_linear_pointwise")
    )


def _onednn(x: Tensor, weight: Tensor, bias: Tensor | None, *, has_relu: bool = False) -> Tensor:
    """The operator that PyTorch's compiler puts in the place of a linear layer."""
    activation = "relu" if has_relu else "none"
    return torch.ops.mkldnn._linear_pointwise(x, weight, bias, activation, [], "")


class _Affine(torch.autograd.Function):
    """`affine` by oneDNN with its gradient, which the operator alone lacks."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor, has_relu: bool) -> Tensor:  # noqa: ANN401 - PyTorch's
        y = _onednn(x, weight, bias, has_relu=has_relu)
        ctx.save_for_backward(x, weight, y if has_relu else None)
        return y

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401 - PyTorch's
        return _gradients(ctx, *grads)


@once_differentiable
def _gradients(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401 - PyTorch's
    """Of the rows, the weight, the bias, and of whether a ReLU follows: none."""
    x, weight, y = ctx.saved_tensors
    if y is not None:
        grad = torch.ops.aten.threshold_backward(grad, y, 0)
    grad_x = _onednn(grad, weight.T, None) if ctx.needs_input_grad[0] else None
    return grad_x, _onednn(grad.T, x.T, None), grad.sum(0), None
