"""The tutorial runs from top to bottom, offline, with the stated results."""

import re
from pathlib import Path

import nbformat
from nbclient import NotebookClient

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorials" / "tuning.ipynb"


def test_the_tutorial_runs_and_tunes() -> None:
    notebook = nbformat.read(TUTORIAL, as_version=4)  # type: ignore[no-untyped-call]
    assert not any(
        cell.get("outputs") for cell in notebook.cells
    )  # stored without outputs: none can be stale
    NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    text = "".join(output.get("text", "") for output in outputs)
    deviations = [float(found) for found in re.findall(r"std ([\d.]+) rad/s", text)]
    assert len(deviations) == 2
    assert all(deviation < 0.13 for deviation in deviations)
    assert "kp=11.6" in text
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
