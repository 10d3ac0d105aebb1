"""The command line: python -m tussock."""

from tussock.navigation.cli.main import main

if __name__ == "__main__":
    main()
