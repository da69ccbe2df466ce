"""`python -m emaphm.cli`."""

import sys

from emaphm.cli import main

sys.exit(main())
