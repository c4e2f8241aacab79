"""How lines of text are laid out, and the numbers in them; `csv_text` is the reader."""
