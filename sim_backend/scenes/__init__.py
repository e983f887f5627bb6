"""The scenes that come with the stand-in, as TOML files."""
