"""Workbooks of spreadsheets: Excel and OpenDocument; `workbook` is the reader."""
