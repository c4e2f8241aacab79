"""Workbooks as Excel and LibreOffice write them, by hand: of lists of cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr
from zipfile import ZIP_DEFLATED, ZipFile

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
STYLES = (
    f'{HEAD}<styleSheet xmlns="{MAIN}"><numFmts count="1"><numFmt numFmtId="164" '
    'formatCode="yyyy\\-mm\\-dd\\ hh:mm:ss.000"/></numFmts><cellStyleXfs count="1"><xf '
    'numFmtId="22"/></cellStyleXfs><cellXfs count="4"><xf numFmtId="0"/><xf numFmtId="164"/><xf '
    'numFmtId="21"/><xf numFmtId="14"/></cellXfs></styleSheet>'
)
GENERAL, MOMENT, TIME_OF_DAY, DATE = range(4)
"""The styles of cells; a cell with one is the pair of its number and it."""

Sheets = Mapping[str, Sequence[Sequence[object]]]


def _letters(column: int) -> str:
    return ("" if column < 26 else _letters(column // 26 - 1)) + chr(65 + column % 26)


def write_xlsx(path: Path, sheets: Sheets, *, date1904: bool = False) -> Path:
    """Texts are shared, as Excel has it; `None` is an empty cell that is not stored."""
    texts: list[str] = []
    parts = {}
    for number, rows in enumerate(sheets.values(), start=1):
        lines = []
        for at, row in enumerate(rows, start=1):
            cells = []
            for column, cell in enumerate(row):
                place = f'r="{_letters(column)}{at}"'
                if isinstance(cell, str):
                    texts.append(cell)
                    cells.append(f'<c {place} t="s"><v>{len(texts) - 1}</v></c>')
                elif isinstance(cell, tuple):
                    cells.append(f'<c {place} s="{cell[1]}"><v>{float(cell[0])!r}</v></c>')
                elif cell is not None:
                    cells.append(f"<c {place}><v>{cell!r}</v></c>")
            lines.append(f'<row r="{at}">{"".join(cells)}</row>')
        parts[f"xl/worksheets/sheet{number}.xml"] = (
            f'{HEAD}<worksheet xmlns="{MAIN}"><sheetData>{"".join(lines)}</sheetData></worksheet>'
        )
    named = "".join(
        f'<sheet name={quoteattr(name)} sheetId="{k}" r:id="rId{k}"/>'
        for k, name in enumerate(sheets, start=1)
    )
    related = "".join(
        f'<Relationship Id="rId{k}" Type="{OFFICE}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        for k in range(1, len(sheets) + 1)
    )
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", f"{HEAD}<Types/>")
        root = f'<Relationship Id="r" Type="{OFFICE}/officeDocument" Target="xl/workbook.xml"/>'
        archive.writestr(
            "_rels/.rels", f'{HEAD}<Relationships xmlns="{PACKAGE}">{root}</Relationships>'
        )
        archive.writestr(
            "xl/workbook.xml",
            f'{HEAD}<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><workbookPr '
            f'date1904="{int(date1904)}"/><sheets>{named}</sheets></workbook>',
        )
        archive.writestr(
            "xl/_rels/workbook.xml.rels",
            f'{HEAD}<Relationships xmlns="{PACKAGE}">{related}</Relationships>',
        )
        archive.writestr("xl/styles.xml", STYLES)
        shared = "".join(f'<si><t xml:space="preserve">{escape(text)}</t></si>' for text in texts)
        archive.writestr("xl/sharedStrings.xml", f'{HEAD}<sst xmlns="{MAIN}">{shared}</sst>')
        for name, content in parts.items():
            archive.writestr(name, content)
    return path


def write_ods(path: Path, sheets: Sheets) -> Path:
    """Texts, numbers, and spans of time as `PT…` texts; the rest of a sheet is one repeated row."""
    tables = []
    for name, rows in sheets.items():
        lines = []
        for row in rows:
            cells = []
            for cell in row:
                if isinstance(cell, str) and cell.startswith("PT"):
                    given = f'office:value-type="time" office:time-value="{cell}"'
                    cells.append(f"<table:table-cell {given}/>")
                elif isinstance(cell, str):
                    cells.append(
                        '<table:table-cell office:value-type="string"><text:p>'
                        f"{escape(cell)}</text:p></table:table-cell>"
                    )
                else:
                    given = f'office:value-type="float" office:value="{cell!r}"'
                    cells.append(f"<table:table-cell {given}><text:p>~</text:p></table:table-cell>")
            lines.append(f"<table:table-row>{''.join(cells)}</table:table-row>")
        empty = (
            '<table:table-row table:number-rows-repeated="1048000"><table:table-cell '
            'table:number-columns-repeated="16384"/></table:table-row>'
        )
        inside = "".join(lines)
        tables.append(f"<table:table table:name={quoteattr(name)}>{inside}{empty}</table:table>")
    urn = "urn:oasis:names:tc:opendocument:xmlns"
    content = (
        f'{HEAD}<office:document-content xmlns:office="{urn}:office:1.0" '
        f'xmlns:table="{urn}:table:1.0" xmlns:text="{urn}:text:1.0"><office:body>'
        f"<office:spreadsheet>{''.join(tables)}"
        "</office:spreadsheet></office:body></office:document-content>"
    )
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet", 0)
        archive.writestr("content.xml", content)
        kind = 'manifest:media-type="application/vnd.oasis.opendocument.spreadsheet"'
        archive.writestr(
            "META-INF/manifest.xml",
            f'{HEAD}<manifest:manifest xmlns:manifest="{urn}:manifest:1.0"><manifest:file-entry '
            f'manifest:full-path="/" {kind}/></manifest:manifest>',
        )
    return path
