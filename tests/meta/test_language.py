"""The texts use the field's terms (CONTRIBUTING.md): no house words in pages, comments, messages or help."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/**/*.md")
CODE = ("host", "hil", "tuning", "firmware", "benchmarks", "scripts", "tests")

COUNTED = (
    "times|counts|messages|points|scans|rows|lines|steps|turns|bytes|frames|packets|commands|pulses|beams|samples|cycles|"
    "questions|pixels|wheels|motors|beats|observations|hits|cores|once|twice|one|ms|mb"
)
UNIT = (
    "second|minute|hour|turn|revolution|scan|cycle|drive|row|line|side|core|message|frame|run|particle|cell"
)
TERMS = {
    r"told": "reported, given",
    r"(?<!can\s)(?<!cannot\s)tells?(?! you| apart)": "reports, shows, says",
    r"lea(?:ves?|ving) with": "exits with",
    r"at (?:others' )?service": "running",
    r"anew": "again",
    rf"(?:\d+|{COUNTED}) an? (?:{UNIT})(?! has| is)": "per",
    r"the clock on the wall": "real time",
    r"bit by bit": "bit for bit",
    r"gives? up where": "aborts, stops",
    r"(?:of|on) its own that": "(rewrite the sentence)",
    r"(?:do|does|did) not check": "fails the CRC, is invalid",
    r"believe[sd]?": "estimates, trusts",
    r"by hand": "manually",
    r"(?<!other\s)(?:a|the) hand(?! on)": "the operator",
    r"(?:is|are|was|be|being) said": "is reported",
    r"mend(?:s|ed|ing)?": "fix, repair",
    r"cure[sd]?": "fix",
    r"st(?:and|ands|ood) still": "stops, is stationary",
    r"(?:robot|it|wheels?) st(?:ands|ood)": "stops, is (at)",
    r"pric(?:e|es|ed|ing)": "cost",
    r"look(?:s|ed|ing)? round": "rotate in place, scan",
    r"looks? along": "faces along",
    r"(?<!convex\s)hulls?": "footprint",
    r"errands?": "board job",
    r"patience": "recovery policy",
    r"prospects": "reachability",
    r"bearings": "motion watchdog",
    r"senses": "sensor inputs",
    r"(?:its|robot's|loop's|runtime's) products": "publisher",
    r"desk": "request handler",
    r"inbox": "request queue",
    r"rivals?": "alternative poses",
    r"laid scan": "scan likelihood",
    r"(?:compiled?|plot(?:ted)?|done) apart": "in a subprocess",
    r"(?:a|the|each|every|one|per|next|last|this|first|two|of) beats?": "cycle",
    r"(?:an|the last|the newest|wheel|drive|speed|each|every) orders?(?! of| in)": "command",
    r"borders? of the known": "frontier",
    r"go(?:es|ne|ing)? on (?:with|mapping|where)": "continue",
    r"near enough, in": "tolerance",
    r"shall": "must, will",
    r"stray(?:s|ed)": "leaves the path",
}
HOUSE_WORDS = re.compile(rf"\b(?:{'|'.join(f'({words})' for words in TERMS)})\b".replace(" ", r"\s+"))
CODE_SPAN = re.compile(r"```.*?```|`[^`\n]*`|\{[^{}\n]*\}", re.DOTALL)
STRING = r""""(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'"""
TEXTS = {
    ".md": re.compile(r".+", re.DOTALL),
    ".py": re.compile(rf'"""(?:\\.|[^\\])*?"""|{STRING}|#[^\n]*', re.DOTALL),
    ".js": re.compile(rf"/\*.*?\*/|//[^\n]*|{STRING}|`[^`]*`", re.DOTALL),
    ".cpp": re.compile(rf"/\*.*?\*/|//[^\n]*|{STRING}", re.DOTALL),
}
TEXTS[".hpp"] = TEXTS[".cpp"]


def house_words(path: Path) -> Iterator[str]:
    """Yield `file:line: 'phrase'; use TERM` for each house word."""
    source = path.read_text(encoding="utf-8")
    for text in TEXTS[path.suffix].finditer(source):
        if " " not in text[0]:
            continue  # a name, not prose
        plain = CODE_SPAN.sub(lambda span: "`" * len(span[0]), text[0].lower())
        for found in HOUSE_WORDS.finditer(plain):
            phrase, term = " ".join(found[0].split()), [*TERMS.values()][(found.lastindex or 1) - 1]
            line = source.count("\n", 0, text.start() + found.start()) + 1
            yield f"{path.relative_to(ROOT)}:{line}: {phrase!r}; use: {term}"


def files() -> Iterator[Path]:
    """Yield the pages and sources, without vendored and built files."""
    for pattern in (
        *PAGES,
        *(f"{folder}/**/*.{suffix}" for folder in CODE for suffix in ("py", "js", "[hc]pp")),
    ):
        for path in sorted(ROOT.glob(pattern)):
            if (
                path != Path(__file__)
                and not {"build", "node_modules"} & set(path.relative_to(ROOT).parts)
                and ".min." not in path.name
            ):
                yield path


def test_texts_use_the_terms_of_the_field() -> None:
    wrong = [line for path in files() for line in house_words(path)]
    assert not wrong, "\n".join(wrong)


def test_house_words_are_found_in_prose_alone() -> None:
    assert [found[0] for found in HOUSE_WORDS.finditer("who is told; 10 times a second; untold")] == [
        "told",
        "times a second",
    ]
    assert not HOUSE_WORDS.search(CODE_SPAN.sub("", "the field `fault_cure` and `cure`"))
