"""`python -m bimnav.cli`."""

from __future__ import annotations

import sys

from bimnav.cli import main

sys.exit(main())
