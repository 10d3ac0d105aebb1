"""The notebooks of the documentation run as they stand, in a kernel of their own, and can be handed out without their solutions."""

import re
import time
from pathlib import Path

import jupytext
import nbclient
import nbformat
import pytest

NOTEBOOKS = Path(__file__).parents[1] / "docs" / "notebooks"
LONGEST = 900  # seconds: what a practical of two hours can spare for computing
NAMES = ["practical", "own_data", "own_model_and_navigator"]


def test_every_notebook_is_listed():
    assert sorted(path.stem for path in NOTEBOOKS.glob("*.py")) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_has_a_title_a_kernel_and_valid_cells(name):
    notebook = jupytext.read(NOTEBOOKS / f"{name}.py")
    nbformat.validate(notebook)
    assert notebook.cells[0].source.startswith("# ")
    assert notebook.metadata["kernelspec"]["name"] == "python3"


def test_each_exercise_of_the_practical_has_a_hint_a_cell_and_a_solution():
    text = (NOTEBOOKS / "practical.py").read_text(encoding="utf-8")
    exercises, solutions = text.split("# ## Solutions")
    numbers = re.findall(r"^# ### Exercise (\d):", exercises, flags=re.MULTILINE)
    assert numbers == ["1", "2", "3", "4", "5"]
    assert re.findall(r"^# ### Solution (\d):", solutions, flags=re.MULTILINE) == numbers
    assert re.findall(r"^# Exercise (\d): your code", exercises, flags=re.MULTILINE) == numbers
    assert exercises.count("<summary>Hint</summary>") == len(numbers)


@pytest.mark.slow
@pytest.mark.timeout(LONGEST + 60)
@pytest.mark.filterwarnings("default::RuntimeWarning")  # of the kernel's sockets
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_runs(name, tmp_path, capsys):
    notebook = jupytext.reads(jupytext.writes(jupytext.read(NOTEBOOKS / f"{name}.py"), fmt="ipynb"), fmt="ipynb")
    client = nbclient.NotebookClient(
        notebook, timeout=LONGEST, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )
    began = time.monotonic()
    client.execute()  # raises where a cell does
    with capsys.disabled():
        print(f"\n{name}: {time.monotonic() - began:.0f} s")
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 4
    assert "<matplotlib" not in "".join(output.get("data", {}).get("text/plain", "") for output in outputs)
    if name == "practical":
        assert re.fullmatch(r"Processor time of all cores together: \d+ s\n", outputs[-1]["text"])
