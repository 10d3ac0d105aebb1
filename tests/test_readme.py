"""What the documentation tells people to type works as it stands."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
TUSSOCK = str(Path(sys.executable).with_name("tussock"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("readme")


def test_the_commands(folder):
    commands = re.findall(r"^    (tussock .+)$", README, flags=re.MULTILINE)
    assert len(commands) >= 5
    (sweep,) = re.findall(r"```toml\n(.+?)```", README, flags=re.DOTALL)
    (folder / "sweep.toml").write_text(sweep)
    for command in commands:
        words = shlex.split(command)[1:]
        if words[0] == "play":
            continue  # a window; tests/test_recording.py draws one without a display
        done = subprocess.run([TUSSOCK, *words], cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, (command, done.stderr)
    assert (folder / "run" / "recording.rrd").is_file()


def test_the_python_example(folder):
    (example,) = re.findall(r"```python\n(.+?)```", README, flags=re.DOTALL)
    done = subprocess.run([sys.executable, "-c", example], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith("arrived")


@pytest.mark.parametrize(
    "page",
    ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", *(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md"))],
)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", (ROOT / page).read_text()):
        if not target.startswith("http"):
            assert ((ROOT / page).parent / target).exists(), (page, target)


def test_the_examples_run(folder):
    for example in sorted((ROOT / "examples").glob("*.py")):
        done = subprocess.run([sys.executable, str(example)], cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, (example, done.stderr)
        if "three_routes" in example.name:
            assert done.stdout.count("arrived") == 3
            assert len(set(re.findall(r"([\d,]+) bytes", done.stdout))) == 1
