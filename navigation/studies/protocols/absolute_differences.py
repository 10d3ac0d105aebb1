"""A compiled loop: the least sum of absolute differences between rotated images and others."""

from tussock.render.compile import compiled


@compiled
def least_differences(views, snapshots, differences, which):
    """Store, for each image and each rotation of it, the least difference from any snapshot, and the first snapshot that has it.

    Whole numbers, so the result is exact.

    Args:
        views: (n, h, 2 w) int16 Images, each twice side by side.
        snapshots: (m, h, w) int16
        differences: (n, w) int32 Stored here: column c is of the image moved left by c columns.
        which: (n, w) int32 Stored here.
    """
    m, h, w = snapshots.shape
    for v in range(len(views)):
        differences[v] = 2**31 - 1
        for s in range(m):
            for c in range(w):
                total = 0
                for i in range(h):
                    row, other = views[v, i], snapshots[s, i]
                    for j in range(w):
                        total += abs(row[c + j] - other[j])
                if total < differences[v, c]:
                    differences[v, c] = total
                    which[v, c] = s
