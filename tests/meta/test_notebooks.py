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
    refusal = re.search(r"goal \(-1\.60, 0\.30\) is inside or too near .+", output)
    assert refusal is not None
    page = TUTORIALS.parent / "notebooks" / "slam_navigation.md"
    assert refusal[0] in page.read_text(), "render it again"
    before_m2, after_m2 = (float(area) for area in re.findall(r"known: ([\d.]+) m2", output))
    assert after_m2 > before_m2
    assert pictures == 1


def test_the_solutions_of_the_exercises_pass_their_tests() -> None:
    output, _ = run("exercises.ipynb")
    assert [f"exercise {number}" in output for number in range(1, 6)] == [True] * 5
    notebook = nbformat.read(TUTORIALS / "exercises.ipynb", as_version=4)  # type: ignore[no-untyped-call]
    solutions = [cell for cell in notebook.cells if "solution" in cell["metadata"].get("tags", [])]
    assert len(solutions) == 5, "nbconvert removes these for the students"


def test_without_the_solutions_each_exercise_has_the_head_of_its_function() -> None:
    notebook = nbformat.read(TUTORIALS / "exercises.ipynb", as_version=4)  # type: ignore[no-untyped-call]
    heads: dict[bool, set[str]] = {True: set(), False: set()}
    for cell in notebook.cells:
        is_solution = "solution" in cell["metadata"].get("tags", [])
        heads[is_solution].update(re.findall(r"^def (\w+)\(", cell["source"], re.MULTILINE))
    assert heads[True] == {"odometry", "pi_gains", "build_map", "shortest_path", "localize"}
    assert heads[True] <= heads[False]


def test_a_live_picture_follows_the_robot() -> None:
    cells = [
        "from thumper import Robot\nrobot = Robot('sim://').__enter__()\nrobot.show()",
        "first = robot.pose\nprint(robot.forward(0.5))",
        "robot.__exit__(None, None, None)",
    ]
    notebook = nbformat.v4.new_notebook()  # type: ignore[no-untyped-call]
    notebook.cells = [nbformat.v4.new_code_cell(cell) for cell in cells]  # type: ignore[no-untyped-call]
    client = NotebookClient(notebook, timeout=120, kernel_name="python3")
    pictures: list[str] = []

    def keep(cell: object, cell_index: int, execute_reply: object) -> None:
        pictures.append(notebook.cells[0]["outputs"][-1]["data"]["image/png"])

    client.on_cell_executed = keep
    client.execute()
    assert pictures[0] != pictures[1], "the picture of the first cell shows the drive of the second"
    assert "reached: drove 0.5" in notebook.cells[1]["outputs"][0]["text"]
