"""Campaigns: a folder of thousands of recordings as one table, and the touch of its plectra."""
