"""The MCAP container: records, chunks, durable writing, search for intact records."""
