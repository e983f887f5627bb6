"""The program `sautereau`, and `python -m sautereau`: the command line."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C ends it with 130, also while it is imported."""
    try:
        from sautereau.commands.app import main
    except KeyboardInterrupt:
        sys.exit(130)
    main()


if __name__ == "__main__":
    main()
