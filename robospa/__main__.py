"""`python -m robospa` is the command `robospa`."""

from robospa.harness.cli.main import main

if __name__ == "__main__":
    main()
