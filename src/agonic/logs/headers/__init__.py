"""What the headers of a table say of its columns."""
