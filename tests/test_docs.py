"""The Python of the documentation runs as it is printed. README.md and docs/benchmark.md have tests of their own."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize("page", ["failures", "environment", "eyes", pytest.param("models", marks=pytest.mark.slow)])
def test_the_snippets_of_a_page_run(page, tmp_path):
    snippets = re.findall(r"```python\n(.+?)```", (DOCS / f"{page}.md").read_text(), flags=re.DOTALL)
    done = subprocess.run([sys.executable, "-c", "\n".join(snippets)], cwd=tmp_path, capture_output=True, text=True)
    assert snippets
    assert done.returncode == 0, done.stderr
