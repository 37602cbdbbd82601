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
    by_physics, by_regression, *fitted = (
        int(found) for found in re.findall(r"time constant (\d+)(?:\.\d)? ", text)
    )
    assert by_physics == 75
    assert by_regression > 120, "the lab shows that counting biases it"
    assert len(fitted) == 6  # both wheels, and four models of the left one
    assert all(abs(tau_ms - 79) <= 4 for tau_ms in fitted)
    assert re.findall(r"largest pole radius [\d.]+, (\w+)", text) == [*3 * ["stable"], "unstable"]
    assert float(re.findall(r"phase margin \d+ deg, Ms ([\d.]+)", text)[0]) <= 1.6
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 5
