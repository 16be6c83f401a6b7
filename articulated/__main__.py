"""`python -m articulated`, for where the command is not on the path."""

import sys

from articulated.cli import main

sys.exit(main())
