"""`python -m erag`."""

from erag.cli.main import main

if __name__ == "__main__":
    main()
