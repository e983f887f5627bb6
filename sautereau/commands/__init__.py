"""The commands of the command line, which `sautereau` collects."""
