"""A Galil DMC-4020 as its serial line shows it; speaks the protocol on its own."""
