"""What a file is by its first bytes, whatever its name says: for a refusal that tells what was given instead."""

import re
import struct

WORLD = "it is a world ({}); give it as --world"
CONTENTS = (
    (b"version https://git-lfs", "it is a pointer of Git LFS, not the file itself; fetch it with: git lfs pull"),
    (b"glTF", WORLD.format("GLB")),
    (b"ply\n", WORLD.format("PLY")),
    (b"ply\r", WORLD.format("PLY")),
    (b"\x89HDF", "it is an HDF5 file (MATLAB's -v7.3); save it with -v7, or as CSV"),
    (b"\x89PNG", "it is an image (PNG)"),
    (b"\xff\xd8\xff", "it is an image (JPEG)"),
    (b"GIF8", "it is an image (GIF)"),
    (b"II*\0", "it is an image (TIFF)"),
    (b"MM\0*", "it is an image (TIFF)"),
    (b"BM", "it is an image (BMP)"),
    (b"%PDF", "it is a PDF"),
    (b"\xd0\xcf\x11\xe0", "it is a spreadsheet (.xls); save it as CSV"),
    (b"PK\x03\x04", "it is a ZIP archive, as spreadsheets are (.xlsx, .ods); save it as CSV"),
    (b"\x1f\x8b", "it is compressed (gzip); unpack it"),
    (b"SQLite format 3\0", "it is a database (SQLite, as ROS 2 bags are); export its poses as CSV"),
    (b"#ROSBAG", "it is a ROS bag; export its poses as CSV"),
)
OBJ_LINE = re.compile(rb"(mtllib|usemtl|o|g|s|vn|vt|vp)\s|v(\s+[-+.\deE]+){3,}\s*$|f(\s+-?\d+[\d/-]*){3,}\s*$")


def described(data: bytes) -> str | None:
    """What a file is that is no table of numbers, as a sentence; None where it is not known to be something else.

    Args:
        data: The whole file, or its beginning.
    """
    for start, sentence in CONTENTS:
        if data.startswith(start) and (start != b"BM" or b"\0" in data[:14]):
            return sentence
    if data.startswith(b"RIFF") and data[8:12] in (b"WEBP", b"AVI "):
        return f"it is {'an image (WebP)' if data[8:12] == b'WEBP' else 'a video (AVI)'}"
    if data[4:8] == b"ftyp":
        return "it is a video (MP4)"
    if len(data) >= 84 and len(data) == 84 + 50 * struct.unpack_from("<I", data, 80)[0]:
        return WORLD.format("STL")
    head = data[:4000].lstrip()
    if head.startswith(b"solid") and b"facet" in head:
        return WORLD.format("STL")
    if head.startswith(b"{"):
        return WORLD.format("glTF") if b'"asset"' in data[:100_000] else "it is JSON; save the points as CSV"
    lines = [line.strip() for line in head.splitlines()[:40]]
    lines = [line for line in lines if line and not line.startswith(b"#")]
    if len(lines) > 1 and all(OBJ_LINE.match(line) for line in lines[:-1]):  # the last one may be cut
        return WORLD.format("OBJ")
    return None
