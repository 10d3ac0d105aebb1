"""Compiled loops of the mushroom body: which Kenyon cells have the largest drive."""

import numpy as np

from tussock.render.compile import compiled

CELLS = 32  # in a group, whose largest drive is found first
COLUMNS = 64  # projections at once: what is computed of them then stays in the processor's cache


@compiled
def largest_drives(projections, wiring, cells):
    """Store the cells (n, count) with the largest sum of inputs at each of n projections, the largest first.

    Of cells that tie, the first ones. The `count` largest are at least as large as the limit that as many groups of cells reach. This
    leaves few cells to look at one by one.

    Args:
        projections: (neurons, n)
        wiring: (cells, inputs) Neurons whose projections a cell sums, in this order.
        cells: (n, count) Stored here.
    """
    n, count = cells.shape
    groups = -(-len(wiring) // CELLS)
    drives = np.empty((len(wiring), COLUMNS), projections.dtype)
    maxima = np.empty((groups, COLUMNS), projections.dtype)
    values = np.empty(count, projections.dtype)
    for start in range(0, n, COLUMNS):
        some = np.ascontiguousarray(projections[:, start : start + COLUMNS])
        width = some.shape[1]
        _drive(some, wiring, drives, maxima)
        for j in range(width):
            limit = -np.inf
            if groups >= count:
                _insert_all(maxima, j, 0, groups, limit, values, cells[start + j], 0)
                limit = values[count - 1]
            found = 0
            for group in range(groups):
                if maxima[group, j] >= limit:
                    first = group * CELLS
                    found = _insert_all(
                        drives, j, first, min(first + CELLS, len(wiring)), limit, values, cells[start + j], found
                    )


@compiled
def _drive(projections, wiring, drives, maxima):
    """Store the sums of the inputs of all cells, and the largest of each group."""
    n, inputs = projections.shape[1], wiring.shape[1]
    several = inputs - inputs % 5
    for cell in range(len(wiring)):
        drive, largest, wired = drives[cell, :n], maxima[cell // CELLS, :n], wiring[cell]
        for j in range(n):
            drive[j] = 0
        for i in range(0, several, 5):  # five at once, as it takes longest to store a sum and to load it again
            a, b, c = projections[wired[i]], projections[wired[i + 1]], projections[wired[i + 2]]
            d, e = projections[wired[i + 3]], projections[wired[i + 4]]
            for j in range(n):
                drive[j] = drive[j] + a[j] + b[j] + c[j] + d[j] + e[j]
        for i in range(several, inputs):
            a = projections[wired[i]]
            for j in range(n):
                drive[j] += a[j]
        if cell % CELLS == 0:
            for j in range(n):
                largest[j] = drive[j]
        for j in range(n):
            largest[j] = drive[j] if drive[j] > largest[j] else largest[j]


@compiled
def _insert_all(drives, column, first, last, limit, values, cells, found):
    """Enter rows `first` to `last` of a column of drives that reach a limit into the largest `values`, in order, and `cells`.

    Returns:
        How many values there are then, of which `found` were there before.
    """
    for row in range(first, last):
        value = drives[row, column]
        if value < limit or (found == len(values) and value <= values[found - 1]):
            continue
        found = min(found + 1, len(values))
        place = found - 1
        while place > 0 and values[place - 1] < value:
            values[place], cells[place] = values[place - 1], cells[place - 1]
            place -= 1
        values[place], cells[place] = value, row
    return found
