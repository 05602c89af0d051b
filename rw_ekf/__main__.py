"""`python -m rw_ekf`."""

import sys

from rw_ekf.cli import main

sys.exit(main())
