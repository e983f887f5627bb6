"""`python -m sautereau`: the command line."""

from sautereau.commands.app import main

if __name__ == "__main__":
    main()
