"""The generated header, codec and protocol page match messages.toml; `--check` finds a stale one."""

from pathlib import Path

from tests.meta.freshness import check

REPO = Path(__file__).parents[2]
GENERATE = REPO / "firmware/protocol/generate.py"


def test_generated_files_are_fresh() -> None:
    result = check(GENERATE)
    assert result.returncode == 0, result.stdout + result.stderr


def test_check_finds_a_changed_schema(tmp_path: Path) -> None:
    """In a copy of the tree with a changed schema, `--check` fails, names the files and writes nothing."""
    names = ("firmware/core/messages.hpp", "host/thumper/board/messages.py", "docs/reference/protocol.md")
    sources = [path.relative_to(REPO).as_posix() for path in GENERATE.parent.iterdir() if path.is_file()]
    for name in (*names, *sources):
        target = tmp_path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes((REPO / name).read_bytes())
    schema = tmp_path / "firmware/protocol/messages.toml"
    schema.write_text(schema.read_text().replace("id = 0x84", "id = 0x85"))

    result = check(tmp_path / "firmware/protocol/generate.py")

    assert result.returncode == 1
    for name in names:
        assert f"stale: {name}" in result.stdout
        assert (tmp_path / name).read_bytes() == (REPO / name).read_bytes()
