"""Workbooks (.xlsx), by openpyxl: the active sheet as a text table, which others interpret."""

from datetime import date, datetime, time, timedelta
from typing import Any

import numpy as np
import openpyxl

from sautereau.daq.convert.readers import Found, refuse


def read(path: str, most: int) -> Found:
    """Return the UTF-8 bytes of the active sheet, a line for each row, its cells parted by tabs."""
    book: Any = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
    sheet, lines, count = book.active, [], 0
    sheet.reset_dimensions()  # rows beyond those that the file states are data as well
    for row in sheet.iter_rows(values_only=True):
        count += max(1, len(row))
        refuse(count, most // 10)  # a cell takes about 100 bytes
        lines.append("\t".join(map(_text, row)).rstrip("\t"))
    width = max((line.count("\t") for line in lines), default=0)
    # Empty cells at the end of a row; a title stays alone in its line.
    padded = (line + "\t" * (width - line.count("\t")) * ("\t" in line) for line in lines)
    rows = np.frombuffer("\n".join([*padded, ""]).encode(), np.uint8)
    others = f", one of {len(book.sheetnames)}" if len(book.sheetnames) > 1 else ""
    return {"rows": rows}, {"rows": {"unit": f"sheet {sheet.title!r}{others}"}}, None


def _text(cell: Any) -> str:
    if cell is None or isinstance(cell, bool):
        return ""
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, datetime):
        return cell.isoformat(" ")
    if isinstance(cell, (date, time)):
        return cell.isoformat()
    return " ".join(str(cell).split())
