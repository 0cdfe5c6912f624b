"""Rows of different lengths in one array."""
import numpy as np


class Ragged:
    """`ragged[i]` is the i-th message's array, a view into `values`; `offsets` says where each begins."""

    def __init__(self, values, offsets):
        self.values = values
        self.offsets = offsets

    def __len__(self):
        return len(self.offsets) - 1

    def __getitem__(self, index):
        if not -len(self) <= index < len(self):
            raise IndexError(f"row {index} of {len(self)}")
        index %= len(self)
        return self.values[self.offsets[index]:self.offsets[index + 1]]

    @property
    def lengths(self):
        return np.diff(self.offsets)

    def stack(self):
        """As one array with a row for each message, where all have one length; ValueError otherwise."""
        lengths = self.lengths
        if len(lengths) and (lengths != lengths[0]).any():
            raise ValueError(f"rows of {lengths.min()} to {lengths.max()} elements make no array")
        width = int(lengths[0]) if len(lengths) else 0
        return self.values.reshape(len(self), width, *self.values.shape[1:])

    def __repr__(self):
        return f"Ragged({len(self)} rows, {len(self.values)} elements of {self.values.dtype})"


def assemble(count, pieces):
    """One Ragged of `count` rows from pieces (rows, array of shape rows x length x ...)."""
    lengths = np.zeros(count, np.int64)
    for rows, values in pieces:
        lengths[rows] = values.shape[1]
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    first = pieces[0][1]
    out = np.empty((int(offsets[-1]), *first.shape[2:]), first.dtype)
    for rows, values in pieces:
        width = values.shape[1]
        if width == 0:
            continue
        if len(rows) > width:  # whichever of the two is fewer is looped over by Python
            for k in range(width):
                out[offsets[rows] + k] = values[:, k]
        else:
            for row, value in zip(rows, values):
                out[offsets[row]:offsets[row] + width] = value
    return Ragged(out, offsets)
