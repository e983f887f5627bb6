"""The Python entrance: what `import sautereau as st` offers, and the command line prints.

Each class holds results of the packages below and shows them; it computes nothing itself.
"""
