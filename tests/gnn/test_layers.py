"""Layers by numpy, on the plain path and on the fast one, and their gradients."""

import numpy as np
import pytest
import torch

from swarm_mj.gnn.layers import FEW_ROWS, Layer, affine, compose, cut, side_by_side, split

ROWS = [3, FEW_ROWS - 1, FEW_ROWS, 1000]


def some_layer(num_inputs, num_outputs, seed=0):
    rng = np.random.default_rng(seed)
    weight = rng.standard_normal((num_outputs, num_inputs), dtype=np.float32)
    bias = rng.standard_normal(num_outputs, dtype=np.float32)
    return Layer(torch.from_numpy(weight), torch.from_numpy(bias))


def some_rows(num_rows, num_columns):
    rng = np.random.default_rng(1)
    return torch.from_numpy(rng.standard_normal((num_rows, num_columns), dtype=np.float32))


@pytest.mark.parametrize("has_relu", [False, True])
@pytest.mark.parametrize("num_rows", ROWS)
def test_a_layer_is_a_product_a_bias_and_a_relu(num_rows, has_relu):
    layer, x = some_layer(7, 5), some_rows(num_rows, 7)
    expected = x.numpy() @ layer.weight.numpy().T + layer.bias.numpy()
    expected = np.maximum(expected, 0) if has_relu else expected
    for grad in (torch.enable_grad, torch.no_grad, torch.inference_mode):
        with grad():
            np.testing.assert_allclose(affine(x, layer, has_relu=has_relu), expected, atol=1e-5)


@pytest.mark.parametrize("has_relu", [False, True])
@pytest.mark.parametrize("num_rows", ROWS)
def test_the_gradient_of_a_layer(num_rows, has_relu):
    """Of the sum of g * y with given g, written out; a ReLU lets g pass where y is above 0."""
    layer, x, g = some_layer(7, 5), some_rows(num_rows, 7), some_rows(num_rows, 5)
    inputs = [x.requires_grad_(), *(its.requires_grad_() for its in layer)]
    y = affine(x, layer, has_relu=has_relu)
    found = torch.autograd.grad((g * y).sum(), inputs)
    passed = (g * (y > 0) if has_relu else g).double().numpy()
    of_x = passed @ layer.weight.detach().double().numpy()
    of_weight = passed.T @ x.detach().double().numpy()
    for gradient, expected in zip(found, [of_x, of_weight, passed.sum(axis=0)], strict=True):
        np.testing.assert_allclose(gradient, expected, rtol=1e-4, atol=1e-4)


def test_the_gradient_reaches_a_layer_whose_input_is_given():
    layer, x = some_layer(7, 5), some_rows(1000, 7)
    layer.weight.requires_grad_()
    affine(x, layer).sum().backward()
    np.testing.assert_allclose(layer.weight.grad[0], x.sum(dim=0), rtol=1e-3, atol=1e-4)


def test_there_is_no_second_gradient():
    layer, x = some_layer(7, 5), some_rows(1000, 7)
    layer.weight.requires_grad_()
    loss = affine(x, layer, has_relu=True).square().sum()
    (first,) = torch.autograd.grad(loss, layer.weight, create_graph=True)
    with pytest.raises(RuntimeError, match="twice"):
        first.sum().backward()


def test_composed_layers_do_what_they_do_one_after_the_other():
    after, before, x = some_layer(4, 3, seed=2), some_layer(6, 4, seed=3), some_rows(5, 6)
    composed = compose(after, before)
    torch.testing.assert_close(affine(x, composed), affine(affine(x, before), after))
    assert compose(after, None) is after


def test_layers_side_by_side_are_split_again():
    layers = [some_layer(4, 3, seed=seed) for seed in range(3)]
    for found, layer in zip(split(side_by_side(layers), 3), layers, strict=True):
        torch.testing.assert_close(found, layer)


def test_a_perceptron_is_cut_behind_its_first_layer_and_before_its_last():
    a, b, c = (some_layer(2, 2, seed=seed) for seed in range(3))
    assert cut([a, b, c]) == (a, [b], c)
    assert cut([a, b]) == (a, [], b)
    assert cut([a]) == (a, [], None)
