"""The MCAP container: records, chunks, durable writing, salvage."""
