"""A column of matrices for rerun, whose own `Tensor.columns` takes no batches in 0.41.

The Arrow type must be rerun's to the letter, child nullability included, or the viewer shows
nothing; so it is read off a `Tensor` that rerun itself serialised.
"""

import numpy as np
import pyarrow as pa
import rerun as rr
from jaxtyping import Float16


class _ArrowBatch:
    """A ready Arrow array as rerun's ComponentBatchLike."""

    def __init__(self, array: pa.Array, component_type: str | None) -> None:
        self._array = array
        self._type = component_type

    def as_arrow_array(self) -> pa.Array:
        """The array."""
        return self._array

    def component_type(self) -> str | None:
        """Rerun's name of the component."""
        return self._type


def tensor_column(
    matrices: Float16[np.ndarray, "T R C"], names: tuple[str, str]
) -> list[rr.ComponentColumn]:
    """One matrix per time step.

    Args:
        matrices: The matrices.
        names: What rows and columns are.

    Returns:
        The column, for `send_columns`.
    """
    num_steps, num_rows, num_columns = matrices.shape
    batch = rr.Tensor(matrices[0], dim_names=names).as_component_batches()[0]
    descriptor, kind = batch.component_descriptor(), batch.as_arrow_array().type
    union = kind.field("buffer").type
    # A dense union: the half-float child holds every value, the others are empty.
    children = [pa.array([], type=union.field(i).type) for i in range(union.num_fields)]
    half = next(i for i in range(union.num_fields) if union.field(i).name == "F16")
    children[half] = _lists(
        union.field(half).type, num_rows * num_columns, pa.array(matrices.reshape(-1))
    )
    buffers = [
        None,
        pa.py_buffer(np.full(num_steps, union.type_codes[half], np.int8)),
        pa.py_buffer(np.arange(num_steps, dtype=np.int32)),
    ]
    shape = np.tile([num_rows, num_columns], num_steps).astype(np.uint64)
    fields = [
        _lists(kind.field("shape").type, 2, pa.array(shape)),
        _lists(kind.field("names").type, 2, pa.array(list(names) * num_steps)),
        pa.Array.from_buffers(union, num_steps, buffers, children=children),
    ]
    column = pa.Array.from_buffers(kind, num_steps, [None], children=fields)
    return [rr.ComponentColumn(descriptor, _ArrowBatch(column, descriptor.component_type))]


def _lists(kind: pa.DataType, length: int, values: pa.Array) -> pa.Array:
    """`values` cut into lists of one length."""
    offsets = pa.array(np.arange(0, len(values) + 1, length, dtype=np.int32))
    return pa.ListArray.from_arrays(offsets, values, type=kind)
