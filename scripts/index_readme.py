"""Rewrite the README for a package index, where relative links lead nowhere. Pure, for hatch_readme.py."""

import re

DARK = re.compile(r'<source [^>]*srcset="[^"]*">|</?picture>')  # an index has one theme
IMAGE = re.compile(r'<img src="(?P<path>[^":]+)"(?P<rest>[^>]*)>')
LINK = re.compile(r"(?P<image>!?)\[(?P<text>[^\]]*)\]\((?!https?:)(?P<path>[^)\s]+)\)")


def absolute(markdown: str, base: str) -> str:
    """Return the text with links below `base`, in which `{kind}` becomes blob or raw.

    An empty base removes images and links, but not the text of links. Links to headings are always removed,
    because an index has no anchors.
    """

    def replaced(match: re.Match[str]) -> str:
        image, text, path = match["image"], match["text"], match["path"]
        if path.startswith("#") or not base:
            return "" if image else text
        return f"{image}[{text}]({base.format(kind='raw' if image else 'blob')}/{path})"

    def replaced_image(match: re.Match[str]) -> str:
        return f'<img src="{base.format(kind="raw")}/{match["path"]}"{match["rest"]}>' if base else ""

    return IMAGE.sub(replaced_image, LINK.sub(replaced, DARK.sub("", markdown)))
