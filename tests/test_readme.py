"""The commands and examples of the documentation work as they stand; quickly in a small world, and slowly as they are written."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from commands import process, tussock

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = sorted(set((ROOT / "examples").glob("*.py")) - {ROOT / "examples" / "04_camera.py"})  # see test_robot.py
PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    *(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")),
]
SMALL_WORLD = "tiny field_width=6 field_depth=6"  # has the pose that README looks from


def commands() -> list[list[str]]:
    """The arguments of README's commands, in their order, without those that open a window (see test_recording.py) or need a download."""
    lines = [shlex.split(line)[1:] for line in re.findall(r"^    (tussock .+)$", README, flags=re.MULTILINE)]
    return [arguments for arguments in lines if arguments[0] != "play" and "bob_robotics" not in " ".join(arguments)]


def block(language: str) -> str:
    """The only block of code in README in some language."""
    (text,) = re.findall(rf"```{language}\n(.+?)```", README, flags=re.DOTALL)
    return text


@pytest.mark.slow
def test_the_commands_of_readme_work_in_a_small_world(capfd, tmp_path, cluster, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("sweep.toml").write_text(block("toml").replace("to = 4", "to = 0"))
    more = {"sweep": ["--scheduler", cluster], "compare": ["--size", "40x10"], "study": ["--size", "72x15"]}
    assert len(commands()) >= 5
    for arguments in commands():
        small = [SMALL_WORLD if each == "tussock-field" else each for each in arguments]
        code, _, err = tussock(capfd, *small, *more.get(arguments[0], []))
        assert code == 0, (arguments, err)
    assert Path("run", "recording.rrd").is_file()


@pytest.mark.slow
def test_the_commands_of_readme_work(tmp_path):
    (tmp_path / "sweep.toml").write_text(block("toml"))
    for arguments in commands():
        done = process(*arguments, cwd=tmp_path)
        assert done.returncode == 0, (arguments, done.stderr)
    assert (tmp_path / "run" / "recording.rrd").is_file()


@pytest.mark.parametrize("world", ["tiny", pytest.param("tussock-field", marks=pytest.mark.slow)])
def test_the_python_example_of_readme_works(tmp_path, world):
    example = block("python").replace("tussock-field", world)
    done = subprocess.run([sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith("arrived")


@pytest.mark.parametrize("page", PAGES)
def test_the_links_of_a_page_lead_to_files(page):
    for target in re.findall(r"\]\(([^)#]+)\)", (ROOT / page).read_text(encoding="utf-8")):
        if not target.startswith("http"):
            assert ((ROOT / page).parent / target).exists(), (page, target)


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_the_examples_work(tmp_path, example):
    done = subprocess.run([sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    if "three_routes" in example.name:
        assert done.stdout.count("arrived") == 3
        assert len(set(re.findall(r"([\d,]+) bytes", done.stdout))) == 1  # its memory does not grow
