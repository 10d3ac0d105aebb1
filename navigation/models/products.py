"""Products of small matrices, each sum in the order of its terms, and the responses that are made of them.

A product of matrices by BLAS may depend, in its last bits, on how many rows there are: one view alone would be scanned to other bytes
than among others. Here each number is summed by itself in one place of a register of the processor, term after term, whatever is
computed next to it. For such small matrices this is faster than BLAS.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from tussock.render.compile import compiled

TILE = 64  # filters that are stored together, and multiplied at once: what is computed on the way stays in the processor's cache
REGISTER = 32  # bytes of one; those of AVX-512 are larger, but gain little (measured on an AMD EPYC 9004: 97 to 88 Gflop/s)
COLUMNS = 2  # registers next to each other


def _sums(rows: int) -> Any:
    """A function `(left, row, right, column, sums, start)` for compiled code.

    It computes some rows of left (i, k) times some columns of right (k, j), from `row` and `column` on, as many as fill COLUMNS
    registers each, and stores the sums (i, ..) from column `start` on. All are arrays of one type without gaps.
    """

    @intrinsic
    def sums_of_products(typing, left, row, right, column, sums, start):
        if not left.layout == right.layout == sums.layout == "C":
            return None

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            number, index = context.get_data_type(left.dtype), ir.IntType(64)
            lanes = REGISTER // context.get_abi_sizeof(number)
            register = ir.VectorType(number, lanes)
            kind = {4: "f32", 8: "f64"}[context.get_abi_sizeof(number)]
            multiply_add = cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(register, [register] * 3), f"llvm.fmuladd.v{lanes}{kind}"
            )

            def array(type_: Any, value: Any, first_row: Any, first_column: Any) -> tuple[Any, Any]:
                """Address of a number of an array, and how many numbers one row has."""
                made = context.make_array(type_)(context, builder, value)
                step = cgutils.unpack_tuple(builder, made.shape)[1]
                return builder.gep(made.data, [builder.add(builder.mul(first_row, step), first_column)]), step

            def at(address: Any) -> Any:
                return builder.bitcast(address, register.as_pointer())

            zero = ir.Constant(index, 0)
            of_left, left_step = array(left, values[0], values[1], zero)
            of_right, right_step = array(right, values[2], zero, values[3])
            of_sums, sums_step = array(sums, values[4], values[1], values[5])
            totals = [[cgutils.alloca_once(builder, register) for _ in range(COLUMNS)] for _ in range(rows)]
            for total in sum(totals, []):
                builder.store(ir.Constant(register, [0.0] * lanes), total)
            with cgutils.for_range(builder, left_step) as term:
                factors = builder.gep(of_right, [builder.mul(term.index, right_step)])
                loaded = [builder.load(at(builder.gep(factors, [index(k * lanes)])), align=4) for k in range(COLUMNS)]
                for i in range(rows):
                    address = builder.gep(of_left, [builder.add(builder.mul(left_step, index(i)), term.index)])
                    repeated = _repeated(builder, builder.load(address), lanes)
                    for total, factor in zip(totals[i], loaded, strict=True):
                        builder.store(builder.call(multiply_add, [repeated, factor, builder.load(total)]), total)
            for i in range(rows):
                for k in range(COLUMNS):
                    address = builder.gep(of_sums, [builder.add(builder.mul(sums_step, index(i)), index(k * lanes))])
                    builder.store(builder.load(totals[i][k]), at(address), align=4)
            return context.get_dummy_value()

        return types.void(left, types.intp, right, types.intp, sums, types.intp), generate

    return sums_of_products


def _repeated(builder: Any, number: Any, lanes: int) -> Any:
    """A register filled with one number."""
    register, whole = ir.VectorType(number.type, lanes), ir.IntType(32)
    first = builder.insert_element(ir.Constant(register, ir.Undefined), number, whole(0))
    return builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(whole, lanes), [0] * lanes))


_two_rows, _four_rows = _sums(2), _sums(4)


@compiled
def _multiply(left, right, column, sums):
    """left (i, k) x right (k, j) as sums (i, TILE), of the columns from `column` on; i is even."""
    rows = left.shape[0]
    for start in range(0, TILE, COLUMNS * REGISTER // left.itemsize):
        for row in range(0, rows - rows % 4, 4):
            _four_rows(left, row, right, column + start, sums, start)
        if rows % 4:
            _two_rows(left, rows - 2, right, column + start, sums, start)


@compiled
def respond(rows, tiles, biases, even, odd, first, responses, begin, end):
    """Responses (n, w, m) of some filters to n views at all rotations.

    Args:
        rows: (f, 2 n, k) Of each view what gives the real parts of its products, then what gives the imaginary parts.
        tiles: (t, f, k, TILE) Filters.
        biases: (m,) Added to the responses.
        even: (i, f) Transform of real parts to what is even in the rotation, for rotations 0 to w // 2; i is even.
        odd: (i, f) The same of imaginary parts, to what is odd.
        first: The filter of `responses[..., 0]`.
        responses: (n, w, m) Stored here.
        begin: The first tile to multiply.
        end: The tile after the last one.
    """
    n, width, m = responses.shape
    products = np.empty((rows.shape[0], 2 * n, TILE), rows.dtype)
    by_frequency = products.reshape(rows.shape[0], 2 * n * TILE)
    evens, odds = np.empty((even.shape[0], TILE), rows.dtype), np.empty((odd.shape[0], TILE), rows.dtype)
    for tile in range(begin, end):
        for f in range(rows.shape[0]):
            _multiply(rows[f], tiles[tile, f], 0, products[f])
        start, stop = max(first - tile * TILE, 0), min(first + m - tile * TILE, TILE)
        left = tile * TILE + start - first
        right = left + stop - start
        bias = biases[left:right]
        for v in range(n):
            _multiply(even, by_frequency, 2 * v * TILE, evens)
            _multiply(odd, by_frequency, (2 * v + 1) * TILE, odds)
            for k in range(width // 2 + 1):
                a, b = evens[k, start:stop], odds[k, start:stop]
                positive, negative = responses[v, k, left:right], responses[v, -k, left:right]
                for j in range(stop - start):
                    middle = a[j] + bias[j]
                    negative[j] = middle - b[j]
                    positive[j] = middle + b[j]  # where both are the same rotation, b is 0
