"""`python -m tensctl` is the command `tensctl`, for where its script is not on the path."""

import sys

from tensctl.cli import main

if __name__ == "__main__":
    sys.exit(main())
