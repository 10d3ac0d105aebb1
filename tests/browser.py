"""A page in a real browser, and what can be wrong with it there."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from jaxtyping import UInt8

WIDTHS = (390, 1400)  # of a telephone and of a desk, in pixels

PROBE = """<script>addEventListener("load", () => {
  const wide = [...document.querySelectorAll("body *")].filter(e => e.getBoundingClientRect().right > innerWidth + 1
    && !e.closest(".wide, pre, .table-wrapper, .toc-drawer")).map(e => e.tagName + "." + e.className);
  const broken = [...document.images].filter(i => !i.complete || i.naturalWidth == 0).length;
  const small = [...document.querySelectorAll("p, td, th, figcaption, pre")]
    .filter(e => parseFloat(getComputedStyle(e).fontSize) < 11).length;
  document.title = "PROBE" + JSON.stringify({width: innerWidth, wide, broken, small, images: document.images.length});
});</script>"""


def chromium() -> str:
    """The browser; without it, the test is skipped."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None and not os.environ.get("TUSSOCK_REQUIRE_GL"):
        pytest.skip("chromium is not installed (Debian: chromium)")
    assert browser is not None
    return browser


def screenshot_of(address: str, folder: Path, seconds: int) -> UInt8[np.ndarray, "h w 3"]:
    """What chromium shows of a page that draws with WebGL, these seconds after it was opened, by its clock. folder: to work in."""
    picture = folder / "page.png"
    subprocess.run(
        [chromium(), "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--no-first-run", "--disable-background-networking", f"--user-data-dir={folder / 'profile'}", "--window-size=1400,900",
         f"--virtual-time-budget={1000 * seconds}", f"--screenshot={picture}", address],
        capture_output=True, timeout=240, check=True,
    )  # fmt: skip
    return cv2.imread(str(picture))


def in_browser(page: Path, width: int, folder: Path) -> dict[str, Any]:
    """Show a page in chromium, `width` pixels wide: how many pictures it has, how many are broken, what is wider than the page, how
    many texts are too small to read. folder: an empty one to work in. Fails where the page writes to the console.
    """
    browser = chromium()
    probed = folder / "probed.html"
    probed.write_text(page.read_text(encoding="utf-8").replace("</body>", PROBE + "</body>"), encoding="utf-8")
    frame = folder / "frame.html"  # a frame is as narrow as it is told to be; a window is not
    frame.write_text(f"""<iframe src="probed.html" style="width:{width}px;height:800px;border:0"></iframe>
<script>const copy = () => {{ document.title = document.querySelector("iframe").contentDocument.title; }};
addEventListener("load", () => setInterval(copy, 50));</script>""")
    done = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", f"--user-data-dir={folder / 'profile'}", "--enable-logging=stderr",
         "--allow-file-access-from-files", "--window-size=1600,900", "--virtual-time-budget=8000", "--dump-dom", f"file://{frame}"],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    found = re.search(r"<title>PROBE(.*?)</title>", done.stdout)
    assert found, done.stderr[-2000:]
    assert "CONSOLE" not in done.stderr
    return json.loads(found.group(1).replace("&quot;", '"').replace("&amp;", "&"))
