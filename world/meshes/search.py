"""Finds the files that a mesh needs, such as textures and material files, however their names are written.

Names in mesh files come from other machines: with backslashes, in another case, with %20 for a space, or as absolute paths.
"""

import io
import re
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from PIL import Image

from ..file_kinds import is_lfs_pointer

REMOTE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")  # at least two letters, unlike the drive of a Windows path


class Neighbours:
    """The files next to a mesh, as trimesh asks for them (a resolver of trimesh).

    Attributes:
        missing: What is not found or cannot be used, by the name in the mesh file, each with the reason.
        texts: Contents that are given in place of a file's, by the name that trimesh asks for.
    """

    def __init__(self, mesh: Path):
        """mesh: the file that names the others."""
        self.folder = mesh.parent
        self.missing: dict[str, str] = {}
        self.texts: dict[str, bytes] = {}

    def get(self, name: str) -> bytes:
        """The content of a file. Raises FileNotFoundError."""
        if name in self.texts:
            return self.texts[name]
        path = self.find(name)
        if path is None:
            raise FileNotFoundError(name)
        return path.read_bytes()

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def find(self, name: str) -> Path | None:
        """The path of a file as a mesh names it, or None.

        It is looked for as it is written, with %20 and its like decoded, and with backslashes as slashes; each also in another case.
        Of an absolute path, the last folders and the name are looked for next to the mesh, then the path itself.
        """
        name = name.strip().strip("\"'")
        if name.lower().startswith("file://"):
            name = name[7:]
        if REMOTE.match(name) or not name or "\0" in name:
            return None
        for written in dict.fromkeys((name, unquote(name), name.replace("\\", "/"), unquote(name.replace("\\", "/")))):
            if (path := self._find_as_written(written)) is not None:
                return path
        return None

    def check_image(self, name: str, content: bytes | None = None) -> bool:
        """Whether an image can be used; otherwise it is entered as missing.

        Args:
            name: The image as the mesh names it.
            content: Its content where it is in the mesh file; otherwise the file of that name is read.
        """
        if content is None:
            path = self.find(name)
            if path is None:
                remote = " (addresses are not followed)" if REMOTE.match(name) else ""
                self.missing[name] = f"is not found next to the file{remote}"
                return False
            content = path.read_bytes()
        if is_lfs_pointer(content):
            self.missing[name] = "is a pointer of Git LFS (run: git lfs pull)"
        else:
            try:
                with Image.open(io.BytesIO(content)) as image:
                    image.load()
            except Exception:  # Pillow's readers of images raise errors of any class
                self.missing[name] = "cannot be read as an image (export it as PNG or JPEG)"
        return name not in self.missing

    def _find_as_written(self, name: str) -> Path | None:
        windows = PureWindowsPath(name)
        absolute = name.startswith("/") or bool(windows.drive) or bool(windows.root)
        if not absolute:
            return _existing(self.folder, Path(name).parts)
        parts = windows.parts[1:]
        for start in range(len(parts)):
            if (path := _existing(self.folder, parts[start:])) is not None:
                return path
        return _existing(Path("/"), Path(name).parts[1:]) if name.startswith("/") else None


def _existing(folder: Path, parts: tuple[str, ...]) -> Path | None:
    """The file below a folder with these names of folders and of the file, in any case; None where there is none."""
    try:
        if (path := folder.joinpath(*parts)).is_file():
            return path
        for part in parts:
            exact = folder / part
            if part not in ("..", ".") and not exact.exists():
                same = sorted(each for each in folder.iterdir() if each.name.casefold() == part.casefold())
                if not same:
                    return None
                exact = same[0]
            folder = exact
        return folder if folder.is_file() else None
    except (OSError, ValueError):  # a name that is too long, a folder that may not be read
        return None
