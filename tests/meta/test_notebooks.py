"""The notebooks run offline from top to bottom and reach the results that they state."""

import re
from pathlib import Path

import nbformat
from nbclient import NotebookClient

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"


def run(name: str) -> tuple[str, int]:
    """Run a notebook; return its output and the number of its pictures."""
    notebook = nbformat.read(TUTORIALS / name, as_version=4)  # type: ignore[no-untyped-call]
    assert not any(cell.get("outputs") for cell in notebook.cells)  # output would go stale
    NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = sum("image/png" in output.get("data", {}) for output in outputs)
    return "".join(output.get("text", "") for output in outputs), pictures


def number(pattern: str, output: str) -> float:
    found = re.search(pattern, output)
    assert found is not None, output
    return float(found.group(1))


def test_odometry() -> None:
    output, pictures = run("odometry.ipynb")
    by_ruler_m = number(r"track of 0\.245 m: ([\d.]+) m off", output)
    fitted_m = number(r"effective track 0\.\d+ m: ([\d.]+) m off", output)
    assert number(r"effective track (0\.\d+) m", output) > 0.3
    assert fitted_m < 0.1 < by_ruler_m
    assert number(r"with the lidar: ([\d.]+) m off", output) < 0.1
    assert pictures == 1


def test_slam_and_navigation() -> None:
    output, pictures = run("slam_navigation.ipynb")
    assert "at the goal (0.38, -0.45)" in output
    assert number(r"from the goal: ([\d.]+) m", output) < 0.2
    assert "contacts: 0" in output
    assert re.search(r"goal \(-1\.60, 0\.30\) is inside or too near", output)
    before_m2, after_m2 = (float(area) for area in re.findall(r"known: ([\d.]+) m2", output))
    assert after_m2 > before_m2
    assert pictures == 1
