"""Recordings: `recording` writes them, `reading` reads them, `recovery` repairs them."""
