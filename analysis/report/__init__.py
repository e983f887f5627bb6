"""Report of a session: one HTML page that needs only a browser."""
