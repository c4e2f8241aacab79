"""`Document`: what is said and shown of a result, once, for a page, plain text and JSON."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple, Self

from agonic.calibration.base import Calibration
from agonic.health import Finding, Judged, sentences, sort_findings
from agonic.health.finding import NOT_READ
from agonic.report import tables, text
from agonic.report.digits import typeset
from agonic.report.markup import Markup, data_script, element, markup
from agonic.report.page_file import assemble_page, read_static
from agonic.report.section import Section
from agonic.report.verdict import MEANINGS, moves, sentence
from agonic.samples import Samples

ALWAYS_SAID = (NOT_READ, "prior")  # notes that the brief text has too
_LABEL_WIDTH = 8  # characters, so that entries, "Note" and "Written" stand in one column


class Repeated(NamedTuple):
    """What is to be noted of several sensors: their names or files, the note, how each had it."""

    names: list[str]
    says: str
    remarks: list[str]


def list_repeated(sensors: Sequence[Document]) -> list[Repeated]:
    """Notes that several sensors have, whatever the file that each is about is called."""
    found: dict[str, Repeated] = {}
    for sensor in sensors:
        for remark in sensor.remarks:
            file, colon, says = remark.partition(": ")
            named = colon and " " not in file and "." in file
            key = says if named else remark
            one = found.setdefault(key, Repeated([], key, []))
            one.names.append(file if named else sensor.name)
            one.remarks.append(remark)
    return [one for one in found.values() if len(one.names) > 1]


def list_sentences(findings: Iterable[Finding]) -> list[dict[str, str]]:
    """Findings for programs, each with its sentence as a whole."""
    return [
        {name: getattr(one, name) for name in ("name", "severity", "sentence")} for one in findings
    ]


@dataclass(frozen=True, kw_only=True, eq=False)
class Document:
    """What is said and shown of one result.

    Attributes
    ----------
    schema : of its JSON. kind : what the page is: "Axis of a coil". name : what it is about.
    title : heading of the page; default: the name. method : how, and from how much, after the
        verdict in text. about : a line under the heading of the page.
    verdict, status : the result in a word and in sentences. Without a verdict the status is a
        summary: first in the text, under the heading of the page.
    findings : what was seen; None where nothing was looked for. move : what to do next; default:
        what helps against the gravest finding. remarks : notes for whoever uses it.
    key_figures : name, value, and what it is of. entries : label → text, in the text, and on the
        page under the heading `entries_title`, unless that is "". sections : the rest; those
        without blocks are left out.
    refused_numbers : whether key figures are shown on the page of a refused result too.
    details : entries of the text that are shown when all is asked for. next_step : last in the
        text, a command to type.
    values : what the JSON says beside verdict, status and findings, which it may override.
    sensors : a document for each sensor, where there are several.
    contents : whether the page has a table of contents. calibration, samples : whose provenance is
        shown.
    overview : lines of the text, for a width, that stand for all that the sensors say where the
        text is brief.
    styles, scripts : files of `static/`. data : JSON for the scripts, by its id in the page.
    command : what makes it anew, to which the page adds an interval that is picked on a strip.
    """

    schema: str = ""
    kind: str = ""
    name: str
    title: str = ""
    method: str = ""
    about: str = ""
    verdict: str = ""
    status: str = ""
    findings: Sequence[Finding] | None = None
    move: str | None = None
    remarks: Sequence[str] = ()
    key_figures: Sequence[tuple[str, str, str]] = ()
    entries: Mapping[str, str] | None = None
    entries_title: str = "What was found"
    sections: Sequence[Section] = ()
    refused_numbers: bool = False
    details: Mapping[str, str] | None = None
    next_step: str = ""
    values: Mapping[str, Any] | None = None
    sensors: Sequence[Document] = ()
    contents: bool = False
    calibration: Calibration | None = None
    samples: Samples | None = None
    styles: Sequence[str] = ()
    scripts: Sequence[str] = ()
    data: Mapping[str, Callable[[], Any]] | None = None
    overview: Callable[[int], Iterable[str]] | None = None
    command: str = ""

    @classmethod
    def judge(cls, result: Judged, **given: Any) -> Self:
        """The document of a result: its verdict, status and findings, and what else is `given`."""
        judged = {name: getattr(result, name) for name in ("verdict", "status", "findings")}
        return cls(**judged | given)

    @property
    def good(self) -> bool:
        """Nothing to object: by the verdict, or, without one, by those of all sensors."""
        return self.verdict == "good" or (not self.verdict and all(s.good for s in self.sensors))

    @property
    def _parts(self) -> list[Section]:
        return [section for section in self.sections if section.blocks]

    @property
    def _shows_numbers(self) -> bool:
        return self.refused_numbers or self.verdict != "refused"

    def to_html(self) -> str:
        """The page, which needs nothing else."""
        name = self.title or self.name
        about = self.about or ("" if self.verdict else self.status)
        under = [element("p", typeset(about), class_="kicker")] if about else []
        inside = [
            *self._opening(),
            *self._list_contents(),
            *self._middle("h2"),
            *(sensor._article(f"sensor-{k}") for k, sensor in enumerate(self.sensors, start=1)),
            *self._origin("h2"),
        ]
        body = markup(
            tables.header(self.kind, name, *under), element("main", *inside), *self._scripts()
        )
        return assemble_page(
            f"{self.kind}: {name}",
            body,
            style="".join(map(read_static, ("report.css", *self.styles))),
            script="".join(map(read_static, self.scripts)),
        )

    def to_text(self, width: int = text.WIDTH, *, brief: bool = False) -> str:
        """The result for people, on a terminal so many characters wide. One finding a line, the
        gravest first, with what helps against it; of a refused result no more than those. `brief`
        leaves out notes, details, tables, and what each of several sensors would say again."""
        lines = list(self._lines(width, brief))
        if self.next_step:
            lines += ["", text.wrap_command(self.next_step, width=width, label="Next      ")]
        return "\n".join(lines).removeprefix("\n")

    def to_record(self) -> dict[str, Any]:
        """The result for programs, without the name of the schema."""
        record: dict[str, Any] = {}
        if self.verdict:
            record["verdict"] = self.verdict
        if self.verdict and self.status:
            record["status"] = self.status
        if self.findings is not None:
            record["findings"] = [asdict(finding) for finding in self.findings]
        values = dict(self.values or {})
        record = {name: value for name, value in record.items() if name not in values} | values
        if self.sensors:
            record["sensors"] = [sensor.to_record() for sensor in self.sensors]
        return record

    @property
    def next_move(self) -> str:
        """What to do next."""
        if self.move is not None:
            return self.move
        return next(iter(moves(self.findings or ())), "")

    def _lines(self, width: int, brief: bool, said: Collection[str] = ()) -> Iterable[str]:
        """The text line by line, without the remarks `said` elsewhere."""
        if self.verdict:
            word = MEANINGS[self.verdict][0].lower()
            method = f" ({self.method})" if self.method else ""
            sign = f"{text.SIGNS[self.verdict]} "
            yield text.wrap(f"{self.name}: {word}{method}", width=width, indent="", label=sign)
        yield from self._say_findings(width, brief)
        if self.verdict != "refused":
            entries = {**(self.entries or {}), **((not brief and self.details) or {})}
            least = _LABEL_WIDTH if self.verdict else 0
            yield from text.wrap_entries(entries, width=width, least=least)
            for section in self._parts:
                if section.printed and not brief:
                    yield from section.to_text(width)
        for note in self.remarks:
            if note not in said:
                yield text.wrap(note, width=width, label="Note      ")
        if brief and self.overview is not None:
            yield from self.overview(width)
            return
        if brief and len(self.sensors) > 1:
            yield from (line for sensor in self.sensors for line in sensor._sum_up(width))
            return
        shared = list_repeated(self.sensors)
        for sensor in self.sensors:
            yield ""
            yield from sensor._lines(width, brief, {r for one in shared for r in one.remarks})
        if shared:
            yield ""
        for one in shared:
            names = f"{', '.join(one.names)}: {one.says}"
            yield text.wrap(names, width=width, indent="", label="Note      ")

    def _sum_up(self, width: int) -> Iterable[str]:
        """One of several sensors: its verdict, and its gravest objection or its standard error."""
        found, rest = self._split_status()
        grave = [says for one, says in found if one.severity != "note"]
        head = f"{self.name}: {self.verdict}, {MEANINGS[self.verdict][1]}"
        yield text.wrap(head, width=width, indent="", label=f"{text.SIGNS[self.verdict]} ")
        more = f" (and {len(grave) - 1} more)" if len(grave) > 1 else ""
        yield text.wrap(f"{grave[0]}{more}" if grave else rest.split(". ")[0], width=width)

    def _say_findings(self, width: int, brief: bool) -> Iterable[str]:
        """Each finding on a line of its own, and what else the status says."""
        indent = "  " if self.verdict else ""
        found, rest = self._split_status()
        for finding, says in found:
            if finding.severity != "note" or not brief or finding.name in ALWAYS_SAID:
                label = f"{tables.SEVERITIES[finding.severity][1]:<{_LABEL_WIDTH}}  "
                yield text.wrap(says, width=width, indent=indent, label=label)
        if rest:
            yield text.wrap(rest, width=width, indent=indent)

    def _split_status(self) -> tuple[list[tuple[Finding, str]], str]:
        """The findings that the status tells, the gravest first, each in its sentence; the rest."""
        rest, found = self.status, []
        for finding in sort_findings(self.findings or ()):
            says = sentences(finding.sentence)
            if says in rest:
                rest = rest.replace(says, "")
                found.append((finding, says))
        return found, " ".join(word for word in rest.split(" ") if word)

    def _opening(self) -> Iterable[Markup]:
        """Verdict and figures to look at first; of a refused result the verdict alone."""
        if self.verdict:
            found, rest = self._split_status()
            yield tables.verdict(
                self.verdict,
                typeset(rest),
                move=self.next_move,
                found=[
                    (tables.SEVERITIES[one.severity][0], self._bullet(one, says))
                    for one, says in found
                ],
            )
        if self.key_figures and self._shows_numbers:
            yield tables.key_figures(self.key_figures)

    def _bullet(self, finding: Finding, says: str) -> str:
        """A finding beside the verdict; its move is left to the line that says what to do next."""
        own = finding.move and finding.move == self.next_move
        return typeset(sentence(finding.what) if own else says)

    def _list_contents(self, within: str = "") -> Iterable[Markup]:
        """The parts of the page, or of a sensor within it, where contents are wanted."""
        if not self.contents:
            return
        named = enumerate(self._parts, start=1)
        parts = [(f"{within}part-{k}", one.title) for k, one in named if one.title]
        parts += [(f"{within}findings", "Findings")] if self.findings is not None else []
        articles = enumerate(self.sensors, start=1)
        yield tables.contents([*parts, *((f"sensor-{k}", one.name) for k, one in articles)])

    def _middle(self, level: str, within: str = "") -> Iterable[Markup]:
        if self.entries and self.entries_title and self._shows_numbers:
            yield Section(self.entries_title, [self.entries]).to_html(level)
        for k, section in enumerate(self._parts, start=1):
            yield section.to_html(level, f"{within}part-{k}" if self.contents else "")
        if self.findings is not None:
            found, at = tables.findings(self.findings), f"{within}findings"
            yield tables.part("Findings", found, level=level, anchor=at if self.contents else "")
        if self.remarks:
            notes = [element("p", typeset(sentence(note))) for note in self.remarks]
            yield tables.part("Notes", *notes, level=level)

    def _origin(self, level: str) -> Iterable[Markup]:
        if self.calibration is not None:
            made = tables.provenance(self.calibration, self.samples)
            yield tables.part("Provenance", made, level=level)

    def _article(self, anchor: str) -> Markup:
        """The document of one sensor within that of several."""
        head = element("h2", self.title or self.name, id=f"{anchor}-name")
        return element(
            "article",
            head,
            *self._opening(),
            *self._list_contents(f"{anchor}-"),
            *self._middle("h3", f"{anchor}-"),
            *self._origin("h3"),
            *self._scripts(),
            id=anchor,
            aria_labelledby=f"{anchor}-name",
            data_source=next(iter(self.data or {}), None),
            data_command=self.command or None,
        )

    def _scripts(self) -> list[Markup]:
        return [data_script(make(), id=name) for name, make in (self.data or {}).items()]
