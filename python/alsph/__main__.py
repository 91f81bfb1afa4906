"""The command line as `python -m alsph`."""

from alsph.cli import main

if __name__ == "__main__":
    main()
