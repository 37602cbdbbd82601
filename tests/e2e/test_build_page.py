"""The commands of the page "Build the real robot" work on the emulated board with its boot loader."""

from pathlib import Path

from tests.e2e.build_page import Walk, follow, steps

ROOT = Path(__file__).parents[2]


def test_a_robot_is_flashed_checked_and_driven_as_the_page_says(tmp_path: Path) -> None:
    walk = Walk(ROOT, tmp_path)
    follow(walk, with_setup=False)
    assert len(walk.took_s) == 6


def test_steps_are_the_commands_and_files_of_a_page() -> None:
    page = "1. A\n    ```console\n    $ one\n    output\n    ```\n```sh\ntwo\nthree\n```\n```toml\n[a]\n```\n"
    assert steps(page) == ["one", "two", "three", "[a]\n"]
