"""A page as a reader meets it: its tags, its text, what would be loaded."""

from __future__ import annotations

from dataclasses import dataclass, field
from html.parser import HTMLParser

from wingfit.diagnosis.finding import Finding
from wingfit.report import html

VOID = frozenset({"meta", "br"})
LOADS = frozenset({"src", "href", "srcset", "data", "action", "poster", "xlink:href"})


@dataclass
class Page(HTMLParser):
    """Parsed strictly: every element that opens is closed in turn."""

    source: str
    tags: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.feed(self.source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(dict(attrs)) == len(attrs)
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.texts.append(data.replace("\u00a0", " "))

    @property
    def text(self) -> str:
        return "\n".join(self.texts)

    def count(self, tag: str, class_: str) -> int:
        """Elements of that name that have that class among theirs."""
        return sum(name == tag and class_ in (a.get("class") or "").split() for name, a in self.tags)

    def values(self, attribute: str) -> list[str]:
        return [a[attribute] or "" for _, a in self.tags if attribute in a]


def page(finding: Finding) -> Page:
    return Page(html(finding))
