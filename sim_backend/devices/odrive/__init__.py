"""An ODrive 3.6 with firmware 0.5.6, as its ASCII line shows it."""
