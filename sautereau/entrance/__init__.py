"""The Python entrance: what `import sautereau as st` offers, and the command line prints.

The classes show the results of the packages below. They compute nothing themselves.
"""
