"""The file: records, chunks, checksums; what a recording is made of and read from."""
