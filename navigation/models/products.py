"""Compiled loops: products of small matrices, the responses of filters that are made of them, and what becomes of these.

A product of matrices by BLAS may depend, in its last bits, on how many rows there are: one view alone would be scanned to other bytes
than among others. Here each number is summed by itself in one place of a register of the processor, term after term, whatever is
computed next to it. For such small matrices this is faster than BLAS.
"""

from itertools import chain
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from tussock.render.compile import compiled

FILTERS = 4096  # that are stored together: this limits what is copied when others are added
TILE = 64  # filters that are multiplied at once: what is computed on the way stays in the processor's cache
PANEL = 16  # of these that are stored together: they are read from memory in one go
# Bytes of a register of the processor. Those of AVX-512 are larger, but gain little (on an AMD EPYC 9004, 97 to 88 Gflop/s), and where
# there are none, such code is slower (48 to 80).
REGISTER = 32
MAX = 2**31 - 1  # the greatest whole number of 32 bits


def _sums(rows: int) -> Any:
    """A function `(left, row, right, column, sums, start)` for compiled code.

    It computes some rows of left (i, k) times PANEL columns of right (k, j), from `row` and `column` on, and stores the sums (i, ..)
    from column `start` on. All are arrays of one type without gaps.
    """

    @intrinsic
    def sums_of_products(typing, left, row, right, column, sums, start):
        arrays = left, right, sums
        if not all(each.layout == "C" and each.ndim == 2 and each.dtype == left.dtype for each in arrays):
            return None  # numba then says that no function takes these

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            number, index = context.get_data_type(left.dtype), ir.IntType(64)
            lanes = REGISTER // context.get_abi_sizeof(number)
            register, registers = ir.VectorType(number, lanes), PANEL // lanes
            kind = {4: "f32", 8: "f64"}[context.get_abi_sizeof(number)]
            multiply_add = cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(register, [register] * 3), f"llvm.fmuladd.v{lanes}{kind}"
            )

            def at(address: Any) -> Any:
                return builder.bitcast(address, register.as_pointer())

            zero = ir.Constant(index, 0)
            of_left, left_step = _address(context, builder, left, values[0], values[1], zero)
            of_right, right_step = _address(context, builder, right, values[2], zero, values[3])
            of_sums, sums_step = _address(context, builder, sums, values[4], values[1], values[5])
            totals = [[cgutils.alloca_once(builder, register) for _ in range(registers)] for _ in range(rows)]
            for total in chain(*totals):
                builder.store(ir.Constant(register, [0.0] * lanes), total)
            with cgutils.for_range(builder, left_step) as term:
                factors = builder.gep(of_right, [builder.mul(term.index, right_step)])
                loaded = [builder.load(at(builder.gep(factors, [index(k * lanes)])), align=4) for k in range(registers)]
                for i in range(rows):
                    address = builder.gep(of_left, [builder.add(builder.mul(left_step, index(i)), term.index)])
                    repeated = _repeated(builder, builder.load(address), lanes)
                    for total, factor in zip(totals[i], loaded, strict=True):
                        builder.store(builder.call(multiply_add, [repeated, factor, builder.load(total)]), total)
            for i in range(rows):
                for k in range(registers):
                    address = builder.gep(of_sums, [builder.add(builder.mul(sums_step, index(i)), index(k * lanes))])
                    builder.store(builder.load(totals[i][k]), at(address), align=4)
            return context.get_dummy_value()

        return types.void(left, types.intp, right, types.intp, sums, types.intp), generate

    return sums_of_products


def _address(context: Any, builder: Any, array: Any, value: Any, row: Any, column: Any) -> tuple[Any, Any]:
    """Address of a number of an array (i, j), and how many numbers a row has."""
    made = context.make_array(array)(context, builder, value)
    step = cgutils.unpack_tuple(builder, made.shape)[1]
    return builder.gep(made.data, [builder.add(builder.mul(row, step), column)]), step


def _repeated(builder: Any, number: Any, lanes: int) -> Any:
    """A register filled with one number."""
    register, whole = ir.VectorType(number.type, lanes), ir.IntType(32)
    first = builder.insert_element(ir.Constant(register, ir.Undefined), number, whole(0))
    return builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(whole, lanes), [0] * lanes))


_two_rows, _four_rows = _sums(2), _sums(4)


@compiled
def _multiply(left, right, column, sums, at):
    """left (i, k) x PANEL columns of right (k, j), from `column` on, stored from column `at` of sums on; i is even."""
    rows = left.shape[0]
    for row in range(0, rows - rows % 4, 4):
        _four_rows(left, row, right, column, sums, at)
    if rows % 4:
        _two_rows(left, rows - 2, right, column, sums, at)


@compiled
def _of_tile(rows, tile, columns, inverse, products):
    """Products (2 n, f, TILE) of the first filters of a tile with n views: of each view the real parts, then the imaginary parts.

    In the order of `inverse`: frequencies of even numbers come first.
    """
    flat = products.reshape(len(products), products.shape[1] * TILE)
    of_even, of_odd = inverse[0].shape[2], inverse[1].shape[2]
    for f in range(len(rows)):
        place = f if of_odd == 0 else f // 2 + f % 2 * of_even
        for column in range(0, columns, PANEL):
            _multiply(rows[f], tile[f, column // PANEL], 0, flat, place * TILE + column)


@compiled
def _turned(real, imaginary, columns, inverse, parts, responses):
    """Responses (w, TILE) to all rotations of a view, from its products (f, TILE).

    r[k] = even[k] + odd[k] and r[-k] = even[k] - odd[k]: what is even in the rotation comes from the real parts, what is odd from the
    imaginary parts. After half a turn, what comes from frequencies of odd numbers has the other sign. So the inverse transform is
    computed for a quarter of the rotations (or for half of them, where their number is odd, see `inverse_transform`).
    """
    width, of_even = len(responses), inverse[0].shape[2]
    for part in range(2):
        products = imaginary if part else real
        for column in range(0, columns, PANEL):
            _multiply(inverse[0][part], products[:of_even], column, parts[2 * part], column)
            _multiply(inverse[1][part], products[of_even:], column, parts[2 * part + 1], column)
    for k in range(width // 4 + 1 if width % 2 == 0 else width // 2 + 1):
        a, b, c, d = parts[0, k], parts[1, k], parts[2, k], parts[3, k]
        # Where two of these are the same rotation, they are the same but for rounding.
        left, right = responses[k], responses[-k]
        for j in range(columns):
            right[j] = (a[j] + b[j]) - (c[j] + d[j])
            left[j] = (a[j] + b[j]) + (c[j] + d[j])
        if width % 2 == 0:
            left, right = responses[width // 2 + k - width], responses[width // 2 - k]
            for j in range(columns):
                right[j] = (a[j] - b[j]) - (c[j] - d[j])
                left[j] = (a[j] - b[j]) + (c[j] - d[j])


@compiled
def _scratch(rows, inverse, width):
    """Arrays for what is computed on the way."""
    frequencies, count, _ = rows.shape
    products = np.empty((count, frequencies, TILE), rows.dtype)
    parts = np.empty((4, inverse[0].shape[1], TILE), rows.dtype)
    return products, parts, np.empty((width, TILE), rows.dtype)


@compiled(fastmath={"reassoc"})
def dot_products(rows, weights, products):
    """Store the products (n, m) of rows (n, k) with weights (m, k), each summed by itself."""
    for j in range(len(weights)):
        for i in range(len(rows)):
            row, weight, total = rows[i], weights[j], np.float32(0)
            for k in range(len(row)):
                total += row[k] * weight[k]
            products[i, j] = total


# In all of these, of n views and of the filters `first` to `first` + m of some tiles:
#   rows (f, 2 n, k): of each view what gives the real parts of its products, then what gives the imaginary parts
#   inverse: as `inverse_transform`
#   tiles: filters as in `Tiles`; those in tiles `begin` to `end` are used
#   biases (m,): added to the responses


@compiled
def respond(rows, inverse, tiles, biases, first, begin, end, responses):
    """Store the responses (n, w, m)."""
    products, parts, turned = _scratch(rows, inverse, responses.shape[1])
    for tile in range(begin, end):
        column = tile * TILE - first
        start, stop = max(0, -column), min(TILE, len(biases) - column)
        _of_tile(rows, tiles[tile], stop, inverse, products)
        bias = biases[column + start : column + stop]
        for v in range(len(responses)):
            _turned(products[2 * v], products[2 * v + 1], stop, inverse, parts, turned)
            for k in range(len(turned)):
                found, stored = turned[k, start:stop], responses[v, k, column + start : column + stop]
                for j in range(len(bias)):
                    stored[j] = found[j] + bias[j]


@compiled
def nearest(rows, inverse, tiles, biases, first, begin, end, tolerance, least, index, doubtful):
    """Where a response is below `least` (n, w), change it to the least response, and `index` (n, w) to its filter, from 0 to m - 1.

    `doubtful` (n, w) becomes true where another response is within `tolerance` (n,) of the least one.

    All are float32. Their order is that of their bits as whole numbers, but for those below 0, whose bits are inverted here. The
    compiler compares several whole numbers at once, and floats one by one.
    """
    products, parts, turned = _scratch(rows, inverse, least.shape[1])
    bits = turned.view(np.int32)
    for tile in range(begin, end):
        column = tile * TILE - first
        start, stop = max(0, -column), min(TILE, len(biases) - column)
        _of_tile(rows, tiles[tile], stop, inverse, products)
        bias = biases[column + start : column + stop]
        for v in range(len(least)):
            _turned(products[2 * v], products[2 * v + 1], stop, inverse, parts, turned)
            for k in range(len(turned)):
                responses, ordered, low = turned[k, start:stop], bits[k, start:stop], np.int32(MAX)
                for j in range(len(bias)):
                    responses[j] += bias[j]
                for j in range(len(bias)):
                    low = min(low, ordered[j] ^ (ordered[j] >> 31 & MAX))
                low ^= low >> 31 & MAX
                lowest = np.int32(low).view(np.float32)
                if not lowest <= least[v, k] + tolerance[v]:
                    continue
                within, count = lowest + tolerance[v], np.int32(0)
                for j in range(len(bias)):
                    count += responses[j] <= within
                doubtful[v, k] = count > 1 or lowest >= least[v, k] - tolerance[v]
                if lowest < least[v, k]:
                    j = 0
                    while ordered[j] != low:
                        j += 1
                    least[v, k], index[v, k] = lowest, column + start + j


@compiled(fastmath={"reassoc"})
def absolute(rows, inverse, tiles, biases, first, begin, end, sums):
    """Store the sums (t, n, w) of the absolute responses of each tile."""
    products, parts, turned = _scratch(rows, inverse, sums.shape[2])
    for tile in range(begin, end):
        column = tile * TILE - first
        start, stop = max(0, -column), min(TILE, len(biases) - column)
        _of_tile(rows, tiles[tile], stop, inverse, products)
        bias = biases[column + start : column + stop]
        for v in range(sums.shape[1]):
            _turned(products[2 * v], products[2 * v + 1], stop, inverse, parts, turned)
            for k in range(len(turned)):
                responses, total = turned[k, start:stop], np.float32(0)
                for j in range(len(bias)):
                    total += abs(responses[j] + bias[j])
                sums[tile, v, k] = total
