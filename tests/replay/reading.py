"""Reads components of a replay back as plain arrays."""

import numpy as np
from rerun.chunk import RrdReader


def entities(path):
    """The names of everything a replay has."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def _values(path, entity, component, is_static):
    """A component's rows in the one chunk that has them."""
    chunks = RrdReader(path).stream().filter(content=entity)
    batches = [chunk.to_record_batch() for chunk in chunks if chunk.is_static == is_static]
    (batch,) = (batch for batch in batches if component in batch.schema.names)
    return batch.column(component)


def column(path, entity, component):
    """A component that changes: rows as nested lists."""
    return _values(path, entity, component, False)


def static(path, entity, component):
    """A component that never changes."""
    return np.array(_values(path, entity, component, True).to_pylist()).ravel()


def rows(path, entity, component, *shape):
    """A component's values in all windows, in this shape."""
    values = column(path, entity, component)
    while hasattr(values, "flatten") and hasattr(values.type, "value_type"):
        values = values.flatten()
    return values.to_numpy(zero_copy_only=False).reshape(-1, *shape)


def counts(path, entity, component):
    """How many values a component has in each window."""
    return np.diff(column(path, entity, component).offsets.to_numpy())


def colours(path, entity, component, num):
    """RGB of `num` things in each window."""
    rgba = rows(path, entity, component)
    return np.stack([(rgba >> shift) & 255 for shift in (24, 16, 8)], axis=-1).reshape(-1, num, 3)
