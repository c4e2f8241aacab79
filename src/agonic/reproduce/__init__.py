"""The four documents that agonic began with, made again by its own commands.

`documents.toml` is the table: each equation, figure, table and claim, what the document says of it,
the command that makes it here, where in the command's JSON our number is, and the document's own
limit. `documents` reads it and puts a user's data in the place of the simulated, `run` executes its
commands in a folder and takes the numbers out of what they say, `report` is the page, text and JSON
of what came out, `command` is `agonic reproduce`. The page in the documentation and the tests are
made by the same functions.
"""
