'''The page kit: what is said and shown of a result, once, as a page, as plain text and as JSON.

A wing has one `document.py` (or one for each of its results), with a function that takes the result
and returns a `Document`:

    def describe_coil(fit: CoilFit, *, title: str = "") -> Document:
        """What is said and shown of a coil."""
        return Document.judge(
            fit,
            schema="agonic/fit-coil@1",
            kind="Magnetic axis of a coil",
            name=fit.session.coil,
            title=title,
            method=f"{fit.reversals} current reversals",
            entries={"Constant": f"{with_sd(fit.constant, fit.constant_sd)} nT/A"},
            sections=[
                Section("Linearity", [tabulate(fit.levels, COLUMNS)]),
                Section("Residuals", [lambda: draw_residuals(fit)]),
            ],
            values={"coil": fit.session.coil, "n": fit.n, "constant_nT_A": fit.constant},
            styles=["alignment.css"],
        )

`document.to_html()` is the page, `to_text()` what a terminal shows, `to_record()` what the JSON
says. A command reads, fits, and ends with

    return finish(describe_coil(fit), out=out, report=report, as_json=as_json)

(`agonic.console.finish`), which saves the document's calibration to `out` unless it is refused,
writes the report in the form that its name asks for, says the result, and returns the exit status.
The public `…_page` function of a wing is `describe_coil(fit, title=title).to_html()`.

- `Document` puts together header, verdict with the next move, key figures, entries, sections,
  findings, notes, provenance, and the same in text: none of it is composed in a wing. In JSON
  verdict, status and findings are there already; `values` adds the rest, and overrides.
- A `Section` (in `section`, as is `Table`) has blocks: prose (`str`), entries (`dict`), a `Table`,
  a `Figure`, or a function without arguments that makes some, called only for a page. Without
  blocks it is left out. `printed=True` puts its prose, entries and tables in the text too.
- A `Figure` is panels of axes and marks, and a mark says what lies where, in which colour, and its
  words in the legend:

    figure("Residuals", columns.x, y, spread(columns, values), level("noise", [-sd, sd]))

- Several sensors in one result: a document for each in `sensors`. A plan or another thing without
  a verdict leaves `verdict` out; its `status` is the summary that comes first.
- A refused result shows no entries and no key figures; which sections and values it has, the wing
  says.

Modules, from what is used most: `document` (the above), `digits` (numbers as people read them),
`labels` (units, frames), `text` (signs of verdicts, wrapping, columns), `markup` (escaped HTML),
`axes`, `marks` and `figure` (what is drawn), `tables` (header, verdict, key figures, checks,
findings, provenance), `verdict` (its words), `page_file` (the file around a page).
The kit knows no wing: what is about one result only belongs to that wing.
'''
